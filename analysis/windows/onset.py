"""The onset along a ramp, as a result: its windows, its error, and both in words."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..counted import counted
from ..errors import FaultgougeError
from ..motion.spectrum import Spectrum
from ..packing.packing import Packing
from ..table_display import TableDisplay
from ..uncertain_digits import with_uncertainty
from .edges import Increments, Window

RAISE_LOAD = "raise the largest load"


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
    """

    def __init__(self, finding: str, larger: str = "", finer: bool = False) -> None:
        super().__init__(finding, larger, finer)
        self.finding, self.larger, self.finer = finding, larger, finer

    def __str__(self) -> str:
        advice = ", or ".join(
            (["take smaller increments"] if self.finer else []) + ([self.larger] if self.larger else [])
        )
        return f"{self.finding}: {advice}." if advice else self.finding

    @classmethod
    def among(cls, modes: tuple[int, int] | None, last: float, doubtful: Increments) -> "OnsetError":
        """The error of a search among some modes, or all, up to the last load."""
        which = "" if modes is None else f" among the modes {modes[0]}:{modes[1]}"
        if not doubtful:
            return cls(f"No pair of eigenvalues{which} is complex up to F_x = {last:.10g}", RAISE_LOAD)
        below, above = doubtful[0]
        return cls(
            f"No pair of eigenvalues{which} was found to become complex up to F_x = {last:.10g}, but one was expected "
            f"between {below:.10g} and {above:.10g}",
            RAISE_LOAD,
            finer=True,
        )


class NoGrowthError(OnsetError):
    """No motion grows on the given loads in spite of the dissipation.

    Parameters
    ----------
    finding, larger, finer
        As of :class:`OnsetError`.
    undamped : Onset or None
        The onset without dissipation on the same loads.
    """

    def __init__(self, finding: str, larger: str = "", finer: bool = False, undamped: "Onset | None" = None) -> None:
        super().__init__(finding, larger, finer)
        self.undamped = undamped


def windows_rows(windows: Sequence[Window]) -> dict[str, str]:
    """Windows of complex eigenvalues in words: where each begins, and what it is."""
    rows = {}
    for each in windows:
        end = "the end" if each.fx_end is None else f"{each.fx_end:.8g}"
        begin = f"from {with_uncertainty(each.fx_onset, each.error)}"
        what = f"frequency = {each.frequency:.6g}" if each.dissipative else f"lambda = {each.eigenvalue:.6g}"
        rows[begin] = f"to {end}, {what}, {each.kind}"
    return rows


def instability_in_words(found: Spectrum) -> str:
    """How many complex pairs and negative eigenvalues a spectrum has, and how fast D grows."""
    counts = [(len(found.pairs), "complex pair"), (len(found.negative), "negative eigenvalue")]
    parts = [counted(count, what) for count, what in counts if count]
    return f"{' and '.join(parts)}; in the fastest motion D grows as exp({found.growth_rate():.6g} t)"


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
    modes : tuple of (int, int) or None
        Modes among which the onset was sought; None for all.
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
    modes: tuple[int, int] | None = None
    at_start: Spectrum | None = None
    ends: float | None = None
    undamped: "Onset | None" = None
    mu: float = np.nan
    equilibria: tuple[Any, ...] = ()
    between: dict[float, Packing] = field(default_factory=dict)
    flows_beyond: float | None = None

    def __repr__(self) -> str:
        parts = [self.describe(), f"windows: {self.window_count}"]
        if self.equilibria:
            reached = counted(len(self.equilibria), "equilibrium", "equilibria")
            parts = [f"mu = {self.mu:g}", *parts, f"{reached} up to F_x = {self.equilibria[-1].fx:g}"]
        return f"<Onset: {', '.join(parts)}>"

    def __str__(self) -> str:
        return self.describe()

    def describe(self) -> str:
        """F_x^c with its error, in words; or that, and why, the packing is unstable at the smallest load."""
        first = self.windows[0]
        if first.kind != "start" or first.dissipative:
            return f"F_x^c = {with_uncertainty(self.fx_c, self.error)}"
        negative = f"an eigenvalue is {first.eigenvalue:.6g}"
        known = negative if first.eigenvalue < 0 else f"a pair of eigenvalues is complex about {first.eigenvalue:.6g}"
        shear = "before any shear is added" if self.fx_c == 0 else "the smallest load"
        known = known if self.at_start is None else instability_in_words(self.at_start)
        return f"unstable at F_x = {self.fx_c:g}, {shear}: {known}"

    def _rows(self) -> dict[str, str]:
        return windows_rows(self.windows)

    @property
    def window_count(self) -> str:
        """The number of windows in words, as far as they were counted."""
        return str(len(self.windows)) if self.complete else "not counted, as the search ended with the first"

    @property
    def fx_c(self) -> float:
        """F_x^c, the first onset, force per top disk."""
        return self.windows[0].fx_onset

    @property
    def error(self) -> float:
        """Uncertainty of fx_c."""
        return self.windows[0].error

    def as_dict(self) -> dict[str, Any]:
        """For JSON: fx_c, error, error_of_path, windows, doubtful, and more with dissipation or without."""
        undamped, start = self.undamped, self.at_start
        known: dict[str, Any] = {
            "fx_c": self.fx_c,
            "error": self.error,
            "error_of_path": self.windows[0].path_error,
            "windows": [window.as_dict() for window in self.windows],
        }
        if self.windows[0].dissipative:
            return known | {
                "undamped": None if undamped is None else {"fx_c": undamped.fx_c, "error": undamped.error},
                "doubtful": [list(increment) for increment in self.doubtful],
                "flows_beyond": self.flows_beyond,
            }
        return known | {
            "complete": self.complete,
            "doubtful": [list(increment) for increment in self.doubtful],
            "modes": None if self.modes is None else list(self.modes),
            "unstable_at_start": None
            if start is None
            else {"pairs": len(start.pairs), "negative": len(start.negative), "growth_rate": start.growth_rate()},
            "branch_ends": self.ends,
        }
