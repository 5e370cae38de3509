"""Windows of growing motion and their edges: a root of Re s, or a jump of the equilibrium."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..onset.window_edges import LostPairError, sign_change
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


@dataclass(frozen=True)
class DampedWindow:
    """An interval of loads on which one motion grows.

    Attributes
    ----------
    fx_onset : float
        Load at which Re s becomes positive, force per top disk.
    fx_end : float or None
        Load at which it is negative again; None if it grows at the largest load.
    frequency : float
        Im s at the onset, radian / time.
    error : float
        Uncertainty of fx_onset: twice the scatter of Re s over its slope, or the bracket, and what the residual of the
        equilibria amounts to, as of :class:`~faultgouge.analysis.Window`.
    kind : {"hopf", "steady", "contact change", "start"}
        What begins the window: Re s that goes through zero with Im s or without, a jump of the equilibrium, or nothing:
        the motion grows at the smallest load.
    path_error : float or None
        As of :class:`~faultgouge.analysis.Window`.
    """

    fx_onset: float
    fx_end: float | None
    frequency: float
    error: float
    kind: Kind
    path_error: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """The keys of the JSON contract."""
        names = ("fx_onset", "fx_end", "frequency", "error", "kind")
        return {name: getattr(self, name) for name in names} | {"error_of_path": self.path_error}


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
    return DampedWindow(onset.fx, None if end is None else end.fx, onset.frequency, onset.error, onset.kind)
