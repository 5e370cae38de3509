"""The search for the onset along a ramp, and for windows: with dissipation or without, all windows or the first."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from ..arrays import Floats, Matrix
from ..counted import counted
from ..errors import NoEquilibriumError, TurningPointError
from ..has_configuration import HasConfiguration
from ..motion.buckling import negative_eigenvalues
from ..motion.spectrum import Spectrum, spectrum
from ..progress import report_progress, show_progress
from .motions import System, force_bearing
from .onset import Edge, Increments, NoGrowthError, Onset, OnsetError, Window
from .quiet import Quiet
from .search import Look, Search, SystemOfLoad
from .slices import ALONE, LIMITS, Limits, Ranks

LAPACK_COORDINATES = 5000
"""Coordinates up to which all eigenvalues at the first load are asked for: half a minute, and as their cube."""

FEW_COORDINATES = 60
"""Coordinates up to which all motions take as long as to know which may grow."""


def check_increasing(forces: ArrayLike) -> Floats:
    """Loads as an array; ValueError if they are not at least two finite, increasing numbers."""
    loads = np.array(forces, dtype=np.float64)
    if loads.ndim != 1 or len(loads) < 2 or not np.all(np.isfinite(loads)) or np.any(np.diff(loads) <= 0):
        raise ValueError("The loads of a ramp must be at least two finite, increasing numbers.")
    return loads


def find_windows(
    system: SystemOfLoad,
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    look: Look = lambda below, above: (),
    first: bool = False,
) -> tuple[Window, ...]:
    """Find all windows of a one-parameter family of systems.

    Parameters
    ----------
    system : callable
        fx -> System, in coordinates that do not depend on the load.
    forces : array_like, shape (S,)
        The increasing loads.
    narrowest : float, optional
        Windows narrower than this are not looked for, force; by default 1e-7 of the largest load.
    look : callable, optional
        Two neighbouring loads -> further loads between them at which to look; these may have no equilibrium.
    first : bool
        Go no farther than the increment in which the first window begins.

    Returns
    -------
    tuple of Window
        By increasing onset; may be empty.

    Raises
    ------
    ValueError
        If the loads are not at least two increasing numbers.
    """
    loads, windows = check_increasing(forces), ()  # type: Floats, tuple[Window, ...]
    # the pair of a narrower window would grow more slowly than any run can show
    narrowest = 1e-7 * float(np.abs(loads).max()) if narrowest is None else narrowest
    start = system(float(loads[0]))
    few = Quiet() if start.damping is not None and len(start.active) > FEW_COORDINATES else None
    for fx, windows in Search(system, narrowest, few, first).along(loads, look):
        says = f"motion that grows up to F_x = {fx:.6g} of {loads[-1]:.6g}"
        if windows:
            says += f"; {counted(len(windows), 'window')} so far, the first from {windows[0].fx_onset:.8g}"
        report_progress(says)
    return windows


def complex_windows(
    operator: Callable[[float], Matrix], forces: ArrayLike, *, narrowest: float | None = None
) -> tuple[Window, ...]:
    """Find all windows of complex eigenvalues of a one-parameter family of matrices.

    Parameters
    ----------
    operator : callable
        fx -> ndarray or sparse array, shape (n, n), in coordinates that do not depend on fx. Zero rows are left out.
    forces : array_like, shape (S,)
        The increasing loads.
    narrowest : float, optional
        Windows narrower than this are not looked for, force; by default 1e-7 of the largest load.

    Returns
    -------
    tuple of Window
        By increasing onset; may be empty.

    Raises
    ------
    ValueError
        If the loads are not at least two increasing numbers.
    """
    return find_windows(lambda fx: System(fx, csr_array(operator(fx))), forces, narrowest=narrowest)


def takes_all_modes(packing: HasConfiguration, limits: Limits = LIMITS) -> bool:
    """Whether a packing is small enough for all of its modes to be searched, and for all windows to be found."""
    return packing.coordinates <= 3 * limits.all_windows


def find_onset(
    equilibrium: Callable[[float], HasConfiguration],
    forces: ArrayLike,
    *,
    dissipation: bool = False,
    first: bool = False,
    ranks: Ranks = ALONE,
    folder: Path | None = None,
    limits: Limits = LIMITS,
) -> Onset:
    """Find the windows of growing motion between the smallest and the largest load.

    Without dissipation these are windows of complex eigenvalues. In a packing of up to `Limits.all_windows` disks all
    windows are found, unless only the first is asked for; in a larger packing only the first is found. The search ends
    with the branch of equilibria: a negative eigenvalue at one of the given loads shows a static instability before
    this load.

    Parameters
    ----------
    equilibrium : callable
        fx -> Packing or Configuration in equilibrium. The search calls it with the given loads in increasing order;
        between the calls for two loads a and b it asks for loads between a and b, in any order. At a load in between
        `equilibrium` may raise a NoEquilibriumError, and the search leaves this load out. All other errors reach the
        caller.
    forces : array_like, shape (S,)
        The increasing loads of the ramp, force per top disk.
    dissipation : bool
        Whether the packing's own dashpots and drag count. The onset without dissipation is then also found:
        `Onset.undamped`.
    first : bool
        Seek only the first window. No equilibrium beyond the increment in which it begins is then asked for. The end of
        the window is None if it lies beyond this increment.
    ranks : Ranks, optional
        The processes that search a large packing together. Each makes the same call, and gets the same equilibria.
    folder : Path, optional
        Folder in which a search stores its results, slice by slice, if its bases are too large for memory. A search of
        the same loads and operators continues from there, to the bit. All ranks write to the folder.

    Returns
    -------
    Onset

    Raises
    ------
    OnsetError
        If no motion grows at any load; with dissipation a NoGrowthError, which has the onset without dissipation.
    TurningPointError
        If an eigenvalue is negative before any is complex.
    SliceError
        Of a large packing, if a part of the spectrum is not found.
    OutputError, DamagedSliceError
        If a file in the folder cannot be written, or read.
    ValueError
        If the loads are not at least two increasing numbers, or if the packing has no dissipation although
        `dissipation` is set.
    """
    loads = check_increasing(forces)
    start = equilibrium(float(loads[0]))
    if dissipation and not start.damped:
        raise ValueError("The packing has no dissipation: call find_onset without dissipation=True.")
    takes_all, ends = takes_all_modes(start, limits), list[float]()

    def windows_of(system: SystemOfLoad, look: Look = lambda below, above: ()) -> tuple[tuple[Window, ...], Increments]:
        """The windows of a family of systems, and increments in doubt."""
        if takes_all:
            windows = find_windows(system, loads, look=look, first=first)
            return windows[:1] if first else windows, ()
        from .sliced_search import SlicedSearch  # with libraries that nothing else needs

        window, doubtful = SlicedSearch(system, ranks, folder, limits).first_window(loads)
        return (window,) if window else (), doubtful

    def at(fx: float) -> HasConfiguration:
        return start if fx == loads[0] else equilibrium(fx)

    def undamped(fx: float) -> System:
        """The branch of stable equilibria: it ends where one at a given load has a negative eigenvalue."""
        packing = at(fx)
        if fx in loads[1:] and len(negative_eigenvalues(force_bearing(packing))):
            ends.append(fx)
            raise TurningPointError(
                f"no pair of eigenvalues becomes complex before F_x = {fx:.10g}, where one is negative: the branch "
                "of stable equilibria ends before, at a turning point, and the packing leaves it without oscillation"
            )
        return System.of(packing)

    def undamped_onset() -> Onset:
        windows, doubtful = (), ()  # type: tuple[Window, ...], Increments
        negative, opened = negative_eigenvalues(force_bearing(start)), None
        at_start = _unstable_at_start(start, bool(len(negative)))
        if len(negative):
            ends.append(start.fx)
            opened = float(negative[0])
        elif at_start is not None:
            opened = max(at_start.pairs, key=lambda each: each.growth_rate).eigenvalue.real
        if opened is None or (takes_all and not first and not len(negative)):
            try:
                windows, doubtful = windows_of(undamped)
            except NoEquilibriumError:  # beyond the first increment, which the search asks for in any case
                if opened is None:
                    raise
        if opened is not None and not windows:
            windows = (Window(Edge(start.fx, 0.0, opened, "start"), None),)
        if not windows:
            raise OnsetError.of_search(float(loads[-1]), doubtful)
        complete = takes_all and not first and not len(negative)
        return Onset(windows, complete, doubtful, at_start, min(ends, default=None))

    def inside(below: float, above: float) -> list[float]:
        """Onsets and middles of undamped windows between two loads: growth without dissipation is largest there."""
        if beside is None or above <= beside.fx_c:
            return []
        windows = beside.windows
        if not beside.complete:  # only the first is known
            with suppress(NoEquilibriumError):
                windows = find_windows(lambda fx: System.of(at(fx)), [below, above])
        ends = [(each.fx_onset, each.fx_end) for each in windows if each.fx_end is not None]
        middles = [0.5 * (max(begin, below) + end) for begin, end in ends if below < end < above]
        return [each.fx_onset for each in windows if below < each.fx_onset < above] + middles

    if not dissipation:
        return undamped_onset()
    beside: Onset | None = None
    with suppress(OnsetError, NoEquilibriumError), show_progress(what="without dissipation, "):
        beside = undamped_onset()
    with show_progress(what="with dissipation, "):
        windows, doubtful = windows_of(lambda fx: System.of(at(fx), True), inside)
    if not windows:
        finding = f"No motion grows up to F_x = {loads[-1]:.10g}"
        raise NoGrowthError(finding, "raise the largest load", undamped=beside)
    return Onset(windows, takes_all and not first, doubtful, undamped=beside)


def _unstable_at_start(start: HasConfiguration, buckles: bool) -> Spectrum | None:
    """The spectrum of a packing that is unstable at the smallest load; None of others, and of large packings.

    Of a symmetric operator, as without tangential forces, nothing is computed unless it buckles: it is its transpose
    but for the rounding of sums over contacts.
    """
    matrix = System.of(start).stiffness
    symmetric = abs(matrix - matrix.T).max() <= 1e-14 * abs(matrix).max()
    if start.coordinates > LAPACK_COORDINATES or (symmetric and not buckles):
        return None
    found = spectrum(force_bearing(start))
    return found if len(found.unstable) else None
