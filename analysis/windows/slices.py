"""The slices of a spectrum, shared by threads and by processes that search together.

The eigenvectors of slices take most of the time, and one slice needs nothing of another. So each rank finds the
eigenvectors of its own slices, a run of neighbouring ones, by :mod:`~faultgouge.analysis.factors.lanczos`, and hands
the pairs that may turn complex to the other ranks. All ranks count eigenvalues together, and do the rest alike and in
step. No rank has the vectors of another, and the result is that of one process to the bit.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import chain, pairwise
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import csc_array

from ..arrays import Floats
from ..errors import FaultgougeError
from ..factors.inertia import count_places, places_of_numbers
from ..factors.lanczos import Border, Factorization, Slice, SlicedSpectrum, SliceSizes, compare_slices, factor_shifted

Mine = TypeVar("Mine")


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Ranks:
    """This process among those that search together; one by itself by default.

    Attributes
    ----------
    rank, size : int
        Number of this process, and how many there are.
    gather : callable
        Anything that pickles -> the list of what all ranks have given, by rank, on each of them.
    workers : int
        Threads of this process.
    """

    rank: int = 0
    size: int = 1
    gather: Callable[[Any], list[Any]] = lambda mine: [mine]
    workers: int = field(default_factory=cores)

    def part(self, count: int) -> slice:
        """Range of neighbouring items that this rank has."""
        return slice(self.rank * count // self.size, (self.rank + 1) * count // self.size)

    def together(self, work: Callable[[], Mine]) -> list[Mine]:
        """The results of the work of all ranks, by rank.

        Raises
        ------
        FaultgougeError
            The first one that a rank has met, on all ranks; at once one of those that end all ranks (`one_rank`).
        """
        try:
            mine: Mine | FaultgougeError = work()
        except FaultgougeError as error:
            if error.one_rank:
                raise
            mine = error
        everyone = self.gather(mine)
        for met in everyone:
            if isinstance(met, FaultgougeError):
                raise met
        return everyone


ALONE = Ranks()
"""One process."""


@dataclass(frozen=True)
class Limits(SliceSizes):
    """Sizes and tolerances of the search of large packings; the defaults are meant for packings."""

    all_windows: int = 300
    """Disks up to which all windows are sought, from all eigenvalues: half a second for a decomposition, which grows
    with the cube of the number. Beyond, the first window is sought in slices of the spectrum."""
    one_basis: int = 1000
    """Coordinates up to which the basis is one dense decomposition: less than a second. Beyond, it comes in
    slices."""
    count_spacing: int = 240
    """Eigenvalues between two places at which they are counted; shifts are interpolated in between."""
    margin: int = 30
    """Further modes of a slice on either side, coupled to its own in all orders. What is farther away changes levels by
    less than (coupling / spacing)^2 / 30 of their spacing."""
    mixing: float = 0.1
    """Typical symmetric coupling within a slice, in level spacings, up to which its basis serves at other loads."""
    reach: float = 0.1
    """Share of an increment by which slices are extrapolated, so that a motion that a slice has grow a little late is
    found in time. Announced onsets are trusted to twice that."""
    window: float = 1e-3
    """Narrowest windows of slices that are looked for, in increments: the slices' own error is larger."""
    excess: float = 0.2
    """Number added to the antisymmetric couplings of a slice, in units of mixing^2 times the spacing of its levels."""
    parts: int = 4
    """Parts of a doubtful increment: four cost little more than two while a basis passes by."""
    depth: int = 2
    """How often parts are divided again; the finest are a sixteenth."""
    largest_basis: float = 3e8
    """Numbers of a basis that is kept from increment to increment, 2.4 GB."""


LIMITS = Limits()
"""The defaults."""


def slices(
    matrix: csc_array,
    margin: int,
    limits: Limits = LIMITS,
    factorise: Callable[[csc_array, float], Factorization] = factor_shifted,
    ranks: Ranks = ALONE,
) -> Iterator[Slice]:
    """Eigenvalues and eigenvectors of a symmetric matrix, slice by slice in the order of the spectrum.

    Parameters
    ----------
    matrix : scipy.sparse.csc_array, shape (E, E)
        Symmetric.
    margin : int
        Further modes wanted on either side of a slice.
    limits, factorise
        Sizes, and how to factorise S - shift.
    ranks : Ranks
        Who shares the slices; those of this rank are found. Its threads are also the slices at the most that are under
        way beyond the one that is asked for. All ranks must come to the end of their slices.

    Raises
    ------
    SliceError
        If eigenvalues do not converge, or neighbouring slices disagree.
    """
    from threadpoolctl import threadpool_limits  # nothing else needs it

    spectrum, size = SlicedSpectrum(matrix, limits, factorise), matrix.shape[0]
    mine: list[Border] = []
    failure: FaultgougeError | None = None
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(ranks.workers) as pool:

        def count_below(places: Floats) -> list[int]:
            own = places[ranks.part(len(places))]
            return [each for one in ranks.together(lambda: list(pool.map(spectrum.below, own))) for each in one]

        places, numbers = count_places(spectrum.matrix, count_below, (0, size), limits.count_spacing)
        pieces = max(1, round(size / limits.slice_size))
        ends = np.arange(pieces + 1) * size // pieces
        borders = places_of_numbers(places, numbers, ends)
        middles = 0.5 * (borders[:-1] + borders[1:])
        wanted = [(float(at), (int(a), int(b))) for at, (a, b) in zip(middles, pairwise(ends), strict=True)]
        waiting: deque[Future[Slice]] = deque()

        def next_slice() -> Slice:
            part = waiting.popleft().result()
            mine.append(part.border)
            compare_slices(*mine[-2:])
            return part

        try:
            for shift, own in wanted[ranks.part(len(wanted))]:
                waiting.append(pool.submit(spectrum.slice_about, shift, own, margin))
                if len(waiting) > ranks.workers:
                    yield next_slice()
            while waiting:
                yield next_slice()
        except FaultgougeError as error:
            failure = error

    def borders_found() -> list[Border]:
        if failure is not None:
            raise failure
        return mine

    compare_slices(*sorted(chain(*ranks.together(borders_found))))
