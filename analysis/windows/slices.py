"""The slices of a spectrum, shared by threads and by ranks.

Several ranks count together (:mod:`~faultgouge.analysis.windows.ranks`). Each then finds a run of neighbouring
slices that no other search has found or taken (:mod:`~faultgouge.analysis.windows.store`), by
:mod:`~faultgouge.analysis.factors.lanczos`.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import chain, pairwise

import numpy as np
from scipy.sparse import csc_array
from threadpoolctl import threadpool_limits

from ..arrays import Floats
from ..errors import FaultgougeError
from ..factors.inertia import count_places, places_of_numbers
from ..factors.lanczos import Border, Factorization, Slice, SlicedSpectrum, compare_slices, factor_shifted
from .limits import LIMITS, Limits
from .ranks import ALONE, Ranks
from .store import NEW_PASS, Shift, SlicePass, Take


def slices(
    matrix: csc_array,
    margin: int,
    modes: tuple[int, int] | None = None,
    limits: Limits = LIMITS,
    factorise: Callable[[csc_array, float], Factorization] = factor_shifted,
    ranks: Ranks = ALONE,
    stored: SlicePass = NEW_PASS,
) -> Iterator[Slice]:
    """Eigenvalues and eigenvectors of a symmetric matrix, slice by slice in the order of the spectrum.

    Parameters
    ----------
    matrix : scipy.sparse.csc_array, shape (E, E)
        Symmetric.
    margin : int
        Further modes wanted on either side of a slice.
    modes : tuple of (int, int), optional
        Numbers of the first eigenvalue that is wanted and of the first that is not, the lowest being 0; all by default.
    limits, factorise
        Sizes, and how to factorise S - shift.
    ranks : Ranks
        Who shares the slices; those of this rank are found. Its threads are also the slices at the most that are under
        way beyond the one that is asked for. All ranks must come to the end of their slices.
    stored : SlicePass
        The slices in it are left out, and those that another search takes. The shifts are taken from it; if it has
        none, the first rank keeps them there.

    Raises
    ------
    SliceError
        If eigenvalues do not converge, or neighbouring slices disagree.
    """
    spectrum = SlicedSpectrum(matrix, limits, factorise)
    mine: list[Border] = []
    failure: FaultgougeError | None = None
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(ranks.workers) as pool:
        shifts = stored.shifts or _shifts(spectrum, pool, ranks, limits, modes or (0, matrix.shape[0]))
        if ranks.rank == 0 and not stored.shifts:
            stored.keep_shifts(shifts)
        found = {each.modes for each in stored.borders}
        wanted = [each for each in shifts if each[1] not in found]
        own = wanted[ranks.part(len(wanted))]
        try:
            with stored.lock_slices() as take:
                for part in _in_turn(pool, ranks.workers, spectrum, own, margin, take):
                    mine.append(part.border)
                    compare_slices(*mine[-2:])
                    yield part
        except FaultgougeError as error:
            failure = error

    def borders() -> list[Border]:
        if failure is not None:
            raise failure
        return mine

    compare_slices(*sorted(chain(stored.borders, *ranks.together(borders))))


def _in_turn(
    pool: ThreadPoolExecutor, workers: int, spectrum: SlicedSpectrum, shifts: Sequence[Shift], margin: int, take: Take
) -> Iterator[Slice]:
    """Slices in their order, those that could be taken."""
    waiting: deque[Future[Slice]] = deque()
    for shift, own in shifts:
        if take(own):
            waiting.append(pool.submit(spectrum.slice_about, shift, own, margin))
        if len(waiting) > workers:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def _shifts(
    spectrum: SlicedSpectrum, pool: ThreadPoolExecutor, ranks: Ranks, limits: Limits, modes: tuple[int, int]
) -> list[Shift]:
    """The shifts of all slices from one eigenvalue number on, and before another."""

    def count_below(shifts: Floats) -> list[int]:
        mine = shifts[ranks.part(len(shifts))]
        return [each for one in ranks.together(lambda: list(pool.map(spectrum.below, mine))) for each in one]

    first, stop = modes
    places, numbers = count_places(spectrum.matrix, count_below, modes, limits.count_spacing)
    pieces = max(1, round((stop - first) / limits.slice_size))
    ends = first + np.arange(pieces + 1) * (stop - first) // pieces
    borders = places_of_numbers(places, numbers, ends)
    middles = 0.5 * (borders[:-1] + borders[1:])
    return [(float(middle), (int(a), int(b))) for middle, (a, b) in zip(middles, pairwise(ends), strict=True)]
