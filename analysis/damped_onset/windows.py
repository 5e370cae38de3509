r"""The onset with dissipation: windows of loads on which some motion grows, solved for and not scanned.

With dashpots and drag the eigenvalues s of :math:`s^2 M + s C + K` lie to the left of the imaginary axis as long as
the packing is stable. It becomes unstable where one of them crosses the axis: at a Hopf point if Im s is not zero,
where Re s goes through zero along a straight line, at a steady one otherwise. No two eigenvalues meet there, and the
crossing is the simple root of a smooth function of the load. **Dashpots may destabilise**: the load of the crossing is
in general below the undamped onset, however weak the dashpots are (Ziegler, Ing.-Arch. 20, 49 (1952); Bottema, Indag.
Math. 18, 403 (1956); Kirillov and Verhulst, arXiv:0906.1650; :mod:`~faultgouge.analysis.damped_onset.weak`).

**Between two loads** every mode is known at both ends with its slope. A mode whose Re s has another sign at the other
end has an edge in between: the mode is followed to it by itself (:mod:`~faultgouge.analysis.damped_onset.modes`), and
solved for as the edges of complex pairs are (:func:`~faultgouge.analysis.onset.edge.sign_change`).

**Windows narrower than the increment** are where two modes nearly meet. What both may do in between is told from the
ends (:mod:`~faultgouge.analysis.damped_onset.step`). Where that has another number of growing modes than the ends, an
operator is computed at that load and both halves are examined again, until no window wider than a stated width can
hide. Undamped windows are looked into besides: between their edges the growth without dissipation is largest.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..errors import FaultgougeError, NoEquilibriumError
from ..onset.edge import LostPairError, sign_change, track
from ..onset.limits import LIMITS
from ..onset.walk import between, increasing, walk
from ..packing.packing import Packing
from .modes import DampedMode, DampedModes, Pencil
from .step import Step, excursion

STEADY = 1e-9
"""|Im s| below this share of the largest |s| counts as zero."""

Kind = Literal["hopf", "steady", "contact change", "start"]


class DampedOnsetError(FaultgougeError):
    """No motion grows on the given loads."""


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


def damped_windows(
    equilibrium: Callable[[float], Packing],
    forces: ArrayLike,
    *,
    look: Iterable[float] = (),
    first: bool = False,
    watch: Callable[[str], None] = lambda says: None,
) -> tuple[DampedWindow, ...]:
    """The windows of loads on which some motion of a packing with dashpots or drag grows.

    Parameters
    ----------
    equilibrium : callable
        fx -> Packing in equilibrium with its dashpots and drag, as in :func:`~faultgouge.analysis.find_onset`.
    forces : array_like, shape (S,)
        The increasing loads of the ramp, force per top disk.
    look : iterable of float, optional
        Further loads to be looked at, as those of undamped windows.
    first : bool
        Go no farther than the increment in which the first window begins.
    watch : callable, optional
        Told in words what is being looked at.

    Returns
    -------
    tuple of DampedWindow
        By increasing onset; may be empty. All modes of the packing are computed at every load: 2 s for 100 disks, eight
        times as much for 200.

    Raises
    ------
    ValueError
        If the loads are not at least two increasing numbers, or the packing has no dissipation.
    """
    loads = increasing(forces)
    start = equilibrium(float(loads[0]))
    if not start.law.damped and start.drag_time is None:
        raise ValueError("The packing has no dissipation: find_onset is what it needs.")
    return growing_windows(lambda fx: Pencil.of(equilibrium(fx)), loads, look, first, watch)


def growing_windows(
    pencil: Callable[[float], Pencil],
    forces: ArrayLike,
    look: Iterable[float] = (),
    first: bool = False,
    watch: Callable[[str], None] = lambda says: None,
) -> tuple[DampedWindow, ...]:
    """The same of a family of pencils s^2 + s G + A, in coordinates that do not depend on the load.

    Parameters
    ----------
    pencil : callable
        fx -> Pencil.
    forces, look, first, watch
        As of `damped_windows`.
    """
    loads = increasing(forces)
    narrowest = LIMITS.narrowest * float(np.abs(loads).max())
    here = DampedModes.of(pencil(float(loads[0])))
    oracle = Growing(pencil, narrowest, here)
    between = [float(fx) for fx in look if loads[0] < fx < loads[-1]]
    for load in np.unique(np.concatenate([loads[1:], between])):
        watch(f"damped modes at F_x = {load:.6g}")
        there = DampedModes.of(pencil(float(load)))
        walk(oracle, [here, there])
        here = there
        if first and (oracle.open or oracle.closed):
            break
    return oracle.windows()


Crossings = dict[tuple[int, int], Crossing]
"""Where modes, by their numbers at both ends of an increment, cross the axis."""


class Growing:
    """The oracle of growing motion; its places are all modes of a load, and it is sure of a step and its crossings."""

    finished = False

    def __init__(self, pencil: Callable[[float], Pencil], narrowest: float, start: DampedModes) -> None:
        self.pencil, self.narrowest = pencil, narrowest
        # by the index of the growing mode at the load reached so far
        self.open = {int(k): Crossing(start.fx, 0.0, float(start.rates[k].imag), "start") for k in start.growing}
        self.closed: list[DampedWindow] = []

    def windows(self) -> tuple[DampedWindow, ...]:
        """All windows by increasing onset."""
        still = [_window(edge, None) for edge in self.open.values()]
        return tuple(sorted(self.closed + still, key=lambda window: window.fx_onset))

    def candidates(self, places: Sequence[DampedModes], depth: int) -> Iterator[Step]:
        """The assignment of the modes over each increment."""
        return (Step.of(here, there) for here, there in pairwise(places))

    def confirm(
        self, step: Step, here: DampedModes, there: DampedModes, depth: int
    ) -> tuple[tuple[Step, Crossings] | None, list[DampedModes]]:
        """The crossings of a step, once nothing can hide in it any more."""
        middle = 0.5 * (here.fx + there.fx)
        divisible = there.fx - here.fx > self.narrowest
        look = None if not divisible else middle if step.lost else self.unclear(step)
        crossings: Crossings = {}
        for pair in [] if look is not None else step.edges:
            crossing = self.crossing(here.mode(pair[0]), there.mode(pair[1]))
            if crossing is not None:
                crossings[pair] = crossing
            elif divisible:
                look = middle
                break
        divide = [] if look is None else between(lambda fx: DampedModes.of(self.pencil(fx)), here.fx, look, there.fx)
        return (None if divide else (step, crossings)), divide

    def unclear(self, step: Step) -> float | None:
        """A load at which all modes have to be looked at, as a pair grows there or cannot be followed; else None."""
        for pair in step.suspects(self.narrowest):
            here = [step.here.mode(k) for k in pair]
            there = [step.there.mode(int(step.forward[k])) for k in pair]
            fx = self.inspected(here, there)
            if fx is not None:
                return fx
        return None

    def inspected(self, here: list[DampedMode], there: list[DampedMode]) -> float | None:
        """The same for one pair: it is followed to where the cubics see it grow, and from there to either side."""
        span = there[0].fx - here[0].fx
        slopes = [mode.change(there[0].pencil) for mode in here], [-mode.change(here[0].pencil) for mode in there]
        width, at = excursion([mode.rate for mode in here], slopes[0], [mode.rate for mode in there], slopes[1])
        if width * span <= self.narrowest:
            return None
        fx = here[0].fx + float(at) * span
        try:
            pencil = self.pencil(fx)
        except NoEquilibriumError:
            return fx
        found = [mode.at(pencil) for mode in (here if at < 0.5 else there)]
        modes = [mode for mode in found if mode is not None]
        if len(modes) < 2 or modes[0].same(modes[1]):
            return fx
        ends = [sorted(mode.growing for mode in each) for each in (here, there)]
        if sorted(mode.growing for mode in modes) not in ends:
            return fx
        return self.inspected(here, modes) or self.inspected(modes, there)

    def crossing(self, here: DampedMode, there: DampedMode) -> Crossing | None:
        """Where a mode crosses the axis between two loads; None if it cannot be followed or jumps."""

        def follow(nearest: list[DampedMode], fx: float) -> DampedMode:
            pencil = self.pencil(fx)
            for mode in nearest:
                found = mode.at(pencil)
                if found is not None:
                    return found
            raise LostPairError

        try:
            return _solved(track({here.fx: here, there.fx: there}, follow), here.fx, there.fx)
        except (LostPairError, NoEquilibriumError):
            return None

    def record(self, sure: tuple[Step, Crossings]) -> None:
        """Carry the windows over a step; what could not be solved for begins and ends halfway."""
        step, crossings = sure
        half = 0.5 * (step.there.fx - step.here.fx)
        growing_here, growing_there = set(step.here.growing.tolist()), set(step.there.growing.tolist())
        now: dict[int, Crossing] = {}
        for k in growing_here:
            image = int(step.forward[k])
            if image in growing_there:
                now[image] = self.open[k]
                continue
            halfway = Crossing(step.here.fx + half, half, float(step.here.rates[k].imag), "contact change")
            self.closed.append(_window(self.open[k], crossings.get((k, image), halfway)))
        for image in growing_there - set(now):
            halfway = Crossing(step.here.fx + half, half, float(step.there.rates[image].imag), "contact change")
            before = np.flatnonzero(step.forward == image)
            now[image] = crossings.get((int(before[0]), image), halfway) if len(before) else halfway
        self.open = now


def _solved(mode: Callable[[float], DampedMode], below: float, above: float) -> Crossing:
    """The root of Re s, or a bracket where Re s jumps."""
    change = sign_change(lambda fx: mode(fx).rate.real, below, above)
    if change.smooth:
        middle = mode(change.loads[2])
        steady = middle.rate.imag <= STEADY * float(np.sqrt(np.abs(middle.pencil.stiffness).max()))
        kind: Kind = "steady" if steady else "hopf"
        return Crossing(change.fx, change.error + middle.pencil.balance, middle.rate.imag, kind)
    left, right = (mode(fx) for fx in change.loads)
    across = left.at(right.pencil)
    if across is None or (across.rate.real > 0) != (right.rate.real > 0):
        raise LostPairError  # the equilibrium does not jump there: it is the mode that has become another one
    return Crossing(change.fx, change.error, right.rate.imag, "contact change")


def _window(onset: Crossing, end: Crossing | None) -> DampedWindow:
    return DampedWindow(onset.fx, None if end is None else end.fx, onset.frequency, onset.error, onset.kind)


def dissipative(packing: Packing, cn: float = 0.0, ct: float = 0.0, drag_time: float | None = None) -> Packing:
    """The same equilibrium with dashpots and drag: dissipation has no part in where a packing rests.

    Parameters
    ----------
    packing : Packing
        The equilibrium.
    cn, ct : float
        Dashpots of every contact, as of :class:`~faultgouge.analysis.MindlinLaw`.
    drag_time : float, optional
        tau of the drag, time; none by default.
    """
    return replace(packing, law=replace(packing.law, cn=cn, ct=ct), drag_time=drag_time)


def dissipating(
    equilibrium: Callable[[float], Packing], cn: float = 0.0, ct: float = 0.0, drag_time: float | None = None
) -> Callable[[float], Packing]:
    """`dissipative` of every equilibrium of a ramp."""
    return lambda fx: dissipative(equilibrium(fx), cn, ct, drag_time)
