"""Windows: intervals of the load on which a pair is complex."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..packing import Packing
from .edge import Edge, Kind


@dataclass(frozen=True)
class Window:
    """An interval of loads on which one pair of eigenvalues is complex.

    Attributes
    ----------
    fx_onset : float
        Load at which the pair becomes complex, force per top disk.
    fx_end : float or None
        Load at which it is real again; None if it is complex at the largest load that was looked at.
    eigenvalue : float
        The double eigenvalue at the onset (the real part of the pair if it does not coalesce there), 1 /
        time^2.
    error : float
        Uncertainty of fx_onset: twice the scatter of the discriminant over its slope for a coalescence, the bracket
        otherwise; and the `load_error` of the equilibria. How their path depends on the increments is not in it.
    end_error : float or None
        The same for fx_end.
    overlap : float
        Smallest |y^H x| met at the onset; at an exceptional point it is the root of the rounding error.
    kind : {"coalescence", "contact change", "start"}
        What begins the window: two real eigenvalues that meet; a jump of the equilibrium; or nothing, as the pair is
        complex at the smallest load.
    """

    fx_onset: float
    fx_end: float | None
    eigenvalue: float
    error: float
    end_error: float | None
    overlap: float
    kind: Kind

    @classmethod
    def between(cls, onset: Edge, end: Edge | None) -> "Window":
        """The window from one edge to another, or to none."""
        return cls(
            fx_onset=onset.fx,
            fx_end=None if end is None else end.fx,
            eigenvalue=onset.eigenvalue,
            error=onset.error,
            end_error=None if end is None else end.error,
            overlap=onset.overlap,
            kind=onset.kind,
        )

    def as_dict(self) -> dict[str, Any]:
        """The keys of the JSON contract: fx_onset, fx_end, lambda, error, kind."""
        return {
            "fx_onset": self.fx_onset,
            "fx_end": self.fx_end,
            "lambda": self.eigenvalue,
            "error": self.error,
            "kind": self.kind,
        }


def load_error(packing: Packing) -> float:
    """r / n^(1/2) of a residual r with n top disks, force: what is out of balance by r is exact at other loads."""
    return packing.residual / float(np.sqrt(max(1, packing.top.sum())))


def increasing(forces: ArrayLike) -> NDArray[np.float64]:
    """Loads as an array; ValueError if they are not at least two finite, increasing numbers."""
    loads = np.array(forces, dtype=np.float64)
    if loads.ndim != 1 or len(loads) < 2 or not np.all(np.isfinite(loads)) or np.any(np.diff(loads) <= 0):
        raise ValueError("The loads of a ramp must be at least two finite, increasing numbers.")
    return loads
