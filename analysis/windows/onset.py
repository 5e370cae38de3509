"""The windows of loads on which a motion grows, and the onset along a ramp, as results."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ..counted import counted
from ..errors import FaultgougeError
from ..motion.spectrum import Spectrum
from ..packing.packing import Packing
from ..table_display import TableDisplay
from ..uncertain_digits import with_uncertainty

Kind = Literal["coalescence", "hopf", "steady", "contact change", "start"]

Increments = tuple[tuple[float, float], ...]
"""From load to load."""


@dataclass(frozen=True)
class Edge:
    """A load at which a motion begins or ceases to grow.

    Attributes
    ----------
    fx : float
        The load, force per top disk.
    error : float
        Uncertainty of the load: of a root twice the scatter over the slope, of a jump half of its bracket; plus the
        `load_error` of the equilibria. 0 at a "start".
    eigenvalue : float or complex
        Without dissipation the double eigenvalue (the real part of the pair if it does not coalesce there),
        1 / time^2; with it s, complex, 1 / time.
    kind : {"coalescence", "hopf", "steady", "contact change", "start"}
        Two real eigenvalues that meet; Re s that goes through zero, with Im s or without; a jump of the equilibrium; or
        nothing, as the motion grows at the smallest load.
    """

    fx: float
    error: float
    eigenvalue: float | complex
    kind: Kind


@dataclass(frozen=True)
class Window:
    """An interval of loads on which one motion grows.

    Attributes
    ----------
    onset : Edge
        Where the motion begins to grow.
    end : Edge or None
        Where the motion ceases to grow; None if it grows at the largest load that was looked at.
    path_error : float or None
        Part of the onset's error that comes from the increments of the path of equilibria, force. None until the path
        has been taken once more, with other increments.
    """

    onset: Edge
    end: Edge | None
    path_error: float | None = None

    @property
    def fx_onset(self) -> float:
        """Load at which the motion begins to grow, force per top disk."""
        return self.onset.fx

    @property
    def fx_end(self) -> float | None:
        """Load at which the motion ceases to grow."""
        return None if self.end is None else self.end.fx

    @property
    def error(self) -> float:
        """Uncertainty of fx_onset: from rounding and, where known, from the path."""
        return self.onset.error + (self.path_error or 0.0)

    @property
    def kind(self) -> Kind:
        """Kind of the edge at which the window begins."""
        return self.onset.kind

    @property
    def dissipative(self) -> bool:
        """Whether the motion has dissipation."""
        return isinstance(self.onset.eigenvalue, complex)

    @property
    def eigenvalue(self) -> float:
        """The double eigenvalue at the onset, 1 / time^2; with dissipation Re(-s^2)."""
        value = self.onset.eigenvalue
        return -((value**2).real) if isinstance(value, complex) else value

    @property
    def frequency(self) -> float:
        """Im s at the onset, radian / time; without dissipation the root of the eigenvalue."""
        value = self.onset.eigenvalue
        return value.imag if isinstance(value, complex) else float(np.sqrt(max(0.0, value)))

    def as_dict(self) -> dict[str, Any]:
        """For JSON: fx_onset, fx_end, error, error_of_path, kind, and lambda, or frequency with dissipation."""
        known = {"fx_onset": self.fx_onset, "fx_end": self.fx_end, "error": self.error}
        own = {"frequency": self.frequency} if self.dissipative else {"lambda": self.eigenvalue}
        return known | {"error_of_path": self.path_error, "kind": self.kind} | own


class OnsetError(FaultgougeError):
    """No complex pair appears on the given loads.

    Parameters
    ----------
    finding : str
        What was sought, up to which load, and not found.
    larger : str, optional
        How the user gets larger loads, as advice.
    finer : bool
        Whether smaller increments may show an onset, too.
    undamped : Onset or None
        Of a search with dissipation, the onset without it on the same loads.
    """

    def __init__(self, finding: str, larger: str = "", finer: bool = False, undamped: "Onset | None" = None) -> None:
        super().__init__(finding, larger, finer, undamped)
        self.finding, self.larger, self.finer, self.undamped = finding, larger, finer, undamped

    def __str__(self) -> str:
        advice = ", or ".join(each for each in ("take smaller increments" * self.finer, self.larger) if each)
        return f"{self.finding}: {advice}." if advice else self.finding

    @classmethod
    def of_search(cls, last: float, doubtful: Increments) -> "OnsetError":
        """The error of a search up to the last load."""
        if not doubtful:
            return cls(f"No pair of eigenvalues is complex up to F_x = {last:.10g}", "raise the largest load")
        between = "between {:.10g} and {:.10g}".format(*doubtful[0])
        none = f"No pair of eigenvalues was found to become complex up to F_x = {last:.10g}"
        return cls(f"{none}, but one was expected {between}", "raise the largest load", finer=True)


class NoGrowthError(OnsetError):
    """No motion grows on the given loads in spite of the dissipation."""


@dataclass(frozen=True)
class Onset(TableDisplay):
    """The windows of growing motion along a ramp.

    Attributes
    ----------
    windows : tuple of Window
        By increasing onset; at least one.
    complete : bool
        Whether `windows` has all windows up to the largest load, or to the end of the branch of equilibria; else
        `windows` has the first window.
    doubtful : tuple of (float, float)
        Of a large packing, increments before the onset in which a pair was expected and not found: take smaller ones.
    at_start : Spectrum or None
        The eigenvalues of a packing that is unstable at the smallest load already; None if it is stable there, or too
        large for all of its eigenvalues to be counted.
    ends : float or None
        Load before which the branch of equilibria ends, as an eigenvalue is negative at this load; None if the search
        met no such load.
    undamped : Onset or None
        Of a search with dissipation, the onset without dissipation; None if the same loads have no such onset.
    mu : float
        Friction coefficient of a scene's onset; nan of others.
    equilibria : tuple of Equilibrium
        Of a scene's onset, the equilibria of the ramp, by increasing F_x.
    between : dict
        Of a scene's onset, further equilibria that were asked for, packing by F_x.
    flows_beyond : float or None
        Of a scene's onset, the last F_x with an equilibrium, if the packing flows before the end of the ramp.
    """

    windows: tuple[Window, ...]
    complete: bool = True
    doubtful: Increments = ()
    at_start: Spectrum | None = None
    ends: float | None = None
    undamped: "Onset | None" = None
    mu: float = np.nan
    equilibria: tuple[Any, ...] = ()
    between: dict[float, Packing] = field(default_factory=dict)
    flows_beyond: float | None = None

    @property
    def fx_c(self) -> float:
        """F_x^c, the first onset, force per top disk."""
        return self.windows[0].fx_onset

    @property
    def error(self) -> float:
        """Uncertainty of fx_c."""
        return self.windows[0].error

    def describe(self) -> str:
        """F_x^c with its error, in words; or that, and why, the packing is unstable at the smallest load."""
        first, found = self.windows[0], self.at_start
        if first.kind != "start" or first.dissipative:
            return f"F_x^c = {with_uncertainty(self.fx_c, self.error)}"
        if found is None:
            pair = f"a pair of eigenvalues is complex about {first.eigenvalue:.6g}"
            known = f"an eigenvalue is {first.eigenvalue:.6g}" if first.eigenvalue < 0 else pair
        else:
            counts = [(len(found.pairs), "complex pair"), (len(found.negative), "negative eigenvalue")]
            known = " and ".join(counted(count, what) for count, what in counts if count)
            known += f"; in the fastest motion D grows as exp({found.growth_rate():.6g} t)"
        shear = "before any shear is added" if self.fx_c == 0 else "the smallest load"
        return f"unstable at F_x = {self.fx_c:g}, {shear}: {known}"

    __str__ = describe

    def __repr__(self) -> str:
        known = len(self.windows) if self.complete else "not counted, as the search ended with the first"
        return f"<Onset: {self}, windows: {known}>"

    def _rows(self) -> dict[str, str]:
        rows = {}
        for each in self.windows:
            end = "the end" if each.fx_end is None else f"{each.fx_end:.8g}"
            what = f"frequency = {each.frequency:.6g}" if each.dissipative else f"lambda = {each.eigenvalue:.6g}"
            rows[f"from {with_uncertainty(each.fx_onset, each.error)}"] = f"to {end}, {what}, {each.kind}"
        return rows

    def as_dict(self) -> dict[str, Any]:
        """For JSON: fx_c, error, error_of_path, windows, doubtful, and more with dissipation or without."""
        undamped, start, first = self.undamped, self.at_start, self.windows[0]
        known: dict[str, Any] = {
            "fx_c": self.fx_c, "error": self.error, "error_of_path": first.path_error,
            "windows": [window.as_dict() for window in self.windows], "doubtful": list(map(list, self.doubtful)),
        }  # fmt: skip
        if first.dissipative:
            by_itself = None if undamped is None else {"fx_c": undamped.fx_c, "error": undamped.error}
            return known | {"undamped": by_itself, "flows_beyond": self.flows_beyond}
        unstable = None if start is None else {
            "pairs": len(start.pairs), "negative": len(start.negative), "growth_rate": start.growth_rate()
        }  # fmt: skip
        known |= {"complete": self.complete, "modes": None, "unstable_at_start": unstable, "branch_ends": self.ends}
        return known
