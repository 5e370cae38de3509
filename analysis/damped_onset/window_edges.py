"""Windows of growing motion and their edges: a root of Re s, or a jump of the equilibrium."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..onset.window_edges import GrowthWindow, LostPairError, sign_change
from .modes import DampedMode

STEADY = 1e-9
"""|Im s| below this share of the largest |s| counts as zero."""

Kind = Literal["hopf", "steady", "contact change", "start"]


@dataclass(frozen=True)
class Crossing:
    """Where a mode begins to grow, or ends to."""

    fx: float
    error: float
    frequency: float
    kind: Kind


@dataclass(frozen=True, kw_only=True)
class DampedWindow(GrowthWindow):
    """An interval of loads on which Re s of one motion is positive; other attributes are those of `GrowthWindow`.

    Attributes
    ----------
    frequency : float
        Im s at the onset, radian / time.
    kind : {"hopf", "steady", "contact change", "start"}
        Re s that goes through zero with Im s or without; a jump of the equilibrium; or nothing, as the motion grows at
        the smallest load.
    """

    frequency: float
    kind: Kind

    def in_time(self, unit: float) -> "DampedWindow":
        """The same of pencils of s / unit."""
        return replace(self, frequency=unit * self.frequency)

    def as_dict(self) -> dict[str, Any]:
        """The keys of the JSON contract: besides those of all windows, frequency."""
        return super().as_dict() | {"frequency": self.frequency}


def solve_edge(mode: Callable[[float], DampedMode], below: float, above: float) -> Crossing:
    """The root of Re s, or a bracket where Re s jumps."""
    change = sign_change(lambda fx: mode(fx).rate.real, below, above)
    if change.smooth:
        near = mode(change.loads[len(change.loads) // 2])
        steady = near.rate.imag <= STEADY * float(np.sqrt(np.abs(near.pencil.stiffness).max()))
        error = change.error + near.pencil.balance
        return Crossing(change.fx, error, near.rate.imag, "steady" if steady else "hopf")
    left, right = (mode(fx) for fx in change.loads)
    across = left.at(right.pencil)
    if across is None or (across.rate.real > 0) != (right.rate.real > 0):
        raise LostPairError  # the equilibrium does not jump there: it is the mode that has become another one
    return Crossing(change.fx, change.error, right.rate.imag, "contact change")


def window_of(onset: Crossing, end: Crossing | None) -> DampedWindow:
    """The window from one edge to another, or to none."""
    return DampedWindow(
        fx_onset=onset.fx,
        fx_end=None if end is None else end.fx,
        frequency=onset.frequency,
        error=onset.error,
        kind=onset.kind,
    )
