"""The first window of a large packing, in slices of the spectrum."""

from pathlib import Path

from ...arrays import Floats
from ..edges import Increments, SystemOfLoad, Window
from ..limits import LIMITS, Limits
from ..system import System, unit_of
from .clusters import SliceSearch
from .growth import SlicedGrowth
from .pairs import SlicedPairs
from .ranks import ALONE, Ranks


def first_window(
    system: SystemOfLoad,
    loads: Floats,
    modes: tuple[int, int] | None = None,
    ranks: Ranks = ALONE,
    folder: Path | None = None,
    limits: Limits = LIMITS,
) -> tuple[Window | None, Increments]:
    """The first window of a family of large systems, if there is one, and increments before it that are in doubt.

    On increments in doubt clusters announce a motion that the system was not seen to have. With strong dashpots, of
    more than `Limits.axis_coordinates` coordinates, they are all loads before the window, where clusters may have
    missed one. The window's end is None where its motion grows at the next load.

    Parameters
    ----------
    system : callable
        fx -> System.
    loads : ndarray, shape (S,)
        The increasing loads of the ramp. Of loads beyond the one above the onset see `SliceSearch.along`.
    modes, ranks, folder, limits
        As of :func:`~faultgouge.analysis.find_onset`.

    Raises
    ------
    NoEquilibriumError
        If a load has none before a motion is seen to grow.
    LostPairError, SliceError, UncoveredAxisError
        If a motion cannot be followed, a part of the spectrum is not found, or motions cannot be told from each other.
    """
    start = system(float(loads[0]))
    unit = unit_of(start)

    def in_units(fx: float) -> System:
        return (start if fx == start.fx else system(fx)).in_units_of(unit)

    kind: type[SliceSearch] = SlicedGrowth if start.dissipative else SlicedPairs
    first, doubtful = kind(in_units, modes, ranks, folder, limits).first_window(loads)
    return None if first is None else first.in_units_of(unit), doubtful
