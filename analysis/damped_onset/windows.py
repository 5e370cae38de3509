r"""The onset with dissipation: windows of loads on which some motion grows, solved for and not scanned.

With dashpots and drag the eigenvalues s of :math:`s^2 M + s C + K` lie to the left of the imaginary axis as long as
the packing is stable. It becomes unstable where one of them crosses the axis: at a Hopf point if Im s is not zero,
where Re s goes through zero along a straight line, at a steady one otherwise. No two eigenvalues meet there, and the
crossing is the simple root of a smooth function of the load. **Dashpots may destabilise**: the load of the crossing is
in general below the undamped onset, however weak the dashpots are (Ziegler, Ing.-Arch. 20, 49 (1952); Bottema, Indag.
Math. 18, 403 (1956); Kirillov and Verhulst, arXiv:0906.1650).

**Most increments** are done with the few modes that may grow (:mod:`~faultgouge.analysis.damped_onset.all_windows`).
Where these leave doubt, all modes tell.

**Between two loads** every mode is known at both ends with its slope. A mode whose Re s has another sign at the other
end has an edge in between: the mode is followed to it by itself (:mod:`~faultgouge.analysis.damped_onset.modes`), and
solved for as the edges of complex pairs are (:func:`~faultgouge.analysis.onset.window_edges.sign_change`).

**Windows narrower than the increment** are where two modes nearly meet. What both may do in between is told from the
ends (:mod:`~faultgouge.analysis.damped_onset.load_step`). Where that has another number of growing modes than the ends,
an operator is computed at that load and both halves are examined again, until no window wider than a stated width can
hide. Undamped windows are looked into besides: between their edges the growth without dissipation is largest.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..counted import counted
from ..errors import FaultgougeError, NoEquilibriumError
from ..onset.limits import LIMITS
from ..onset.march import check_increasing, march
from ..onset.window_edges import LostTrackError
from ..packing.packing import Floats, Packing
from ..progress import Watch, report_progress, show_progress
from .all_windows import AllGrowth
from .modes import Pencil, in_own_time
from .perturbation_screening import GrowthScreen
from .window_edges import DampedWindow

Known = Callable[[tuple[DampedWindow, ...], float], None]
"""Takes the windows so far, and the load up to which they are all."""

Look = Callable[[float, float], Iterable[float]]
"""Two neighbouring loads of a ramp -> further loads between them that are to be looked at."""


class DampedOnsetError(FaultgougeError):
    """No motion grows on the given loads."""


def damped_windows(
    equilibrium: Callable[[float], Packing],
    forces: ArrayLike,
    *,
    look: Iterable[float] = (),
    first: bool = False,
    watch: Watch | None = None,
    known: Known = lambda windows, fx: None,
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
    known : callable, optional
        Given all windows so far, and the load up to which they are all, after each increment.

    Returns
    -------
    tuple of DampedWindow
        By increasing onset; may be empty. All modes of the packing are computed where the few that may grow leave
        doubt: half a second for 100 disks, eight times as much for 200.

    Raises
    ------
    ValueError
        If the loads are not at least two increasing numbers, or the packing has no dissipation.
    """
    loads = check_increasing(forces)
    start = equilibrium(float(loads[0]))
    if not start.damped:
        raise ValueError("The packing has no dissipation: find_onset is what it needs.")
    further = [float(fx) for fx in look]

    def between(below: float, above: float) -> list[float]:
        return [fx for fx in further if below < fx < above]

    with show_progress(watch):
        return growing_windows(lambda fx: Pencil.of(equilibrium(fx)), loads, between, first, known)


def growing_windows(
    pencil: Callable[[float], Pencil],
    forces: ArrayLike,
    look: Look = lambda below, above: (),
    first: bool = False,
    known: Known = lambda windows, fx: None,
) -> tuple[DampedWindow, ...]:
    """The same of a family of pencils s^2 + s G + A, in coordinates that do not depend on the load.

    Parameters
    ----------
    pencil : callable
        fx -> Pencil.
    forces, first, known
        As of `damped_windows`.
    look : callable, optional
        Two neighbouring loads -> further loads between them that are to be looked at.
    """
    loads = check_increasing(forces)
    narrowest = LIMITS.narrowest * float(np.abs(loads).max())
    own, unit = in_own_time(pencil, float(loads[0]))

    def in_time(windows: tuple[DampedWindow, ...]) -> tuple[DampedWindow, ...]:
        return tuple(each.in_time(unit) for each in windows)

    def so_far(windows: tuple[DampedWindow, ...], fx: float) -> None:
        known(in_time(windows), fx)

    try:
        return in_time(march_along_ramp(AllGrowth(own, narrowest, GrowthScreen()), loads, look, first, so_far))
    except LostTrackError:
        return in_time(march_along_ramp(AllGrowth(own, narrowest, None), loads, look, first, so_far))


def march_along_ramp(
    oracle: AllGrowth,
    loads: Floats,
    look: Look = lambda below, above: (),
    first: bool = False,
    known: Known = lambda windows, fx: None,
) -> tuple[DampedWindow, ...]:
    """The windows that an oracle finds along a ramp; a load to be looked at besides may have no equilibrium."""
    here = oracle.at(float(loads[0]))
    windows: tuple[DampedWindow, ...] = ()
    for below, above in pairwise(loads.tolist()):
        for load in [*sorted(look(below, above)), above]:
            found = counted(len(windows), "window")
            so_far = f"; {found} so far, the first from {windows[0].fx_onset:.8g}" if windows else ""
            report_progress(f"motion that grows up to F_x = {load:.6g} of {loads[-1]:.6g}{so_far}")
            try:
                there = oracle.at(load)
            except NoEquilibriumError:
                if load == above:
                    raise
                continue
            march(oracle, [here, there])
            here, windows = there, oracle.windows()
            known(windows, here.fx)
            if first and windows:
                return windows
    return windows


def with_dissipation(packing: Packing, cn: float = 0.0, ct: float = 0.0, drag_time: float | None = None) -> Packing:
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


def without_dissipation(
    equilibrium: Callable[[float], Packing], cn: float = 0.0, ct: float = 0.0, drag_time: float | None = None
) -> Callable[[float], Packing]:
    """`with_dissipation` of every equilibrium of a ramp."""
    return lambda fx: with_dissipation(equilibrium(fx), cn, ct, drag_time)
