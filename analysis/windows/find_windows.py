"""The windows of a family of systems, or of matrices, that depend on one number: the load."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from ..arrays import Matrix
from ..counted import counted
from ..progress import report_progress
from .edges import Window
from .quiet import Quiet
from .search import Look, Search, SystemOfLoad
from .states import Motions
from .system import System

FEW_COORDINATES = 60
"""Coordinates up to which all motions take as long as to know which may grow."""

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
    decompose: Callable[[System], Motions] = Motions.of,
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
    known : callable, optional
        Called after each increment with all windows so far, and with the load up to which these are complete.
    decompose : callable, optional
        System -> all of its motions.

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
    found = windows_up_to(system, forces, narrowest=narrowest, look=look, first=first, decompose=decompose)
    for fx, windows in found:
        known(windows, fx)
    return windows


def windows_up_to(
    system: SystemOfLoad,
    forces: ArrayLike,
    *,
    narrowest: float | None = None,
    look: Look = lambda below, above: (),
    first: bool = False,
    decompose: Callable[[System], Motions] = Motions.of,
) -> Iterator[tuple[float, tuple[Window, ...]]]:
    """Yield each load but the smallest, with all windows up to this load; the windows are those of `find_windows`."""
    loads = check_increasing(forces)
    last = float(loads[-1])
    # the pair of a narrower window would grow more slowly than any run can show
    narrowest = 1e-7 * float(np.abs(loads).max()) if narrowest is None else narrowest
    start = system(float(loads[0]))
    few = Quiet(decompose) if start.dissipative and len(start.active) > FEW_COORDINATES else None
    for fx, windows in Search(system, narrowest, few, first, decompose).along(loads, look):
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


def check_increasing(forces: ArrayLike) -> NDArray[np.float64]:
    """Loads as an array; ValueError if they are not at least two finite, increasing numbers."""
    loads = np.array(forces, dtype=np.float64)
    if loads.ndim != 1 or len(loads) < 2 or not np.all(np.isfinite(loads)) or np.any(np.diff(loads) <= 0):
        raise ValueError("The loads of a ramp must be at least two finite, increasing numbers.")
    return loads
