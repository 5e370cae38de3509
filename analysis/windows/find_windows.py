"""The windows of a family of systems, or of matrices, that depend on one number: the load."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from ..arrays import Matrix
from ..counted import counted
from ..progress import report_progress
from .edges import SystemOfLoad, Window
from .limits import LIMITS, Limits
from .screens.growth import GrowthScreen
from .screens.pairs import PairScreen
from .search import Look, windows_along
from .system import System, unit_of

WindowsSoFar = Callable[[tuple[Window, ...], float], None]
"""Takes the windows so far, and the load up to which these are complete."""


def find_windows(
    system: SystemOfLoad,
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    look: Look = lambda below, above: (),
    first: bool = False,
    known: WindowsSoFar = lambda windows, fx: None,
    limits: Limits = LIMITS,
) -> tuple[Window, ...]:
    """Find all windows of a one-parameter family of systems.

    Parameters
    ----------
    system : callable
        fx -> System, in coordinates that do not depend on the load.
    forces : array_like, shape (S,)
        The increasing loads.
    narrowest : float, optional
        Windows narrower than this are not looked for, force; by default as in `Limits`.
    look : callable, optional
        Two neighbouring loads -> further loads between them at which to look; these may have no equilibrium.
    first : bool
        Go no farther than the increment in which the first window begins.
    known : callable, optional
        Called after each increment with all windows so far, and with the load up to which these are complete.

    Returns
    -------
    tuple of Window
        By increasing onset; may be empty.

    Raises
    ------
    ValueError
        If the loads are not at least two increasing numbers.
    """
    windows: tuple[Window, ...] = ()
    for fx, windows in windows_up_to(system, forces, narrowest=narrowest, look=look, first=first, limits=limits):
        known(windows, fx)
    return windows


def windows_up_to(
    system: SystemOfLoad,
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    look: Look = lambda below, above: (),
    first: bool = False,
    limits: Limits = LIMITS,
) -> Iterator[tuple[float, tuple[Window, ...]]]:
    """Yield each load but the smallest, with all windows up to this load; the windows are those of `find_windows`."""
    loads = check_increasing(forces)
    start = system(float(loads[0]))
    unit, last = unit_of(start), float(loads[-1])
    narrowest = limits.narrowest * float(np.abs(loads).max()) if narrowest is None else narrowest
    screen = GrowthScreen(limits) if start.dissipative else PairScreen(limits)

    def in_units(fx: float) -> System:
        return (start if fx == start.fx else system(fx)).in_units_of(unit)

    for fx, found in windows_along(in_units, loads, narrowest, screen, look=look, first=first, limits=limits):
        windows = tuple(window.in_units_of(unit) for window in found)
        so_far = (
            f"; {counted(len(windows), 'window')} so far, the first from {windows[0].fx_onset:.8g}" if windows else ""
        )
        report_progress(f"motion that grows up to F_x = {fx:.6g} of {last:.6g}{so_far}")
        yield fx, windows


def complex_windows(
    operator: Callable[[float], Matrix],
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    limits: Limits = LIMITS,
) -> tuple[Window, ...]:
    """Find all windows of complex eigenvalues of a one-parameter family of matrices.

    Parameters
    ----------
    operator : callable
        fx -> ndarray or sparse array, shape (n, n), in coordinates that do not depend on fx. Zero rows are left out.
    forces : array_like, shape (S,)
        The increasing loads.
    narrowest : float, optional
        Windows narrower than this are not looked for, force; by default as in `limits`.
    limits : Limits
        Sizes and tolerances of the search.

    Returns
    -------
    tuple of Window
        By increasing onset; may be empty.

    Raises
    ------
    ValueError
        If the loads are not at least two increasing numbers.
    """
    return find_windows(lambda fx: System(fx, csr_array(operator(fx))), forces, narrowest=narrowest, limits=limits)


def check_increasing(forces: ArrayLike) -> NDArray[np.float64]:
    """Loads as an array; ValueError if they are not at least two finite, increasing numbers."""
    loads = np.array(forces, dtype=np.float64)
    if loads.ndim != 1 or len(loads) < 2 or not np.all(np.isfinite(loads)) or np.any(np.diff(loads) <= 0):
        raise ValueError("The loads of a ramp must be at least two finite, increasing numbers.")
    return loads
