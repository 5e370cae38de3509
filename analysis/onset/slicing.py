r"""The eigenvectors of a large sparse symmetric matrix, all of them, a slice of the spectrum after the other.

The dense decomposition of E coordinates takes some :math:`10 E^3` operations and :math:`16 E^2` bytes: hours and 15 GB
for 10,000 disks. Spectrum slicing (Parlett, *The Symmetric Eigenvalue Problem*, 1980, ch. 3; Grimes, Lewis and Simon,
SIAM J. Matrix Anal. Appl. 15, 228 (1994)) cuts the spectrum of S into slices, each about a shift :math:`\sigma`. In the
block Krylov space of :math:`(S - \sigma)^{-1}` the eigenvalues close to the shift come first. One sparse factorisation
serves the slice, and slices know nothing of each other, so that threads share them. The cost grows little faster than
:math:`E^2`. ARPACK solves for one vector at a time; blocks halve the time of solutions and of products.

**That none is missing** is known from *Sylvester's law of inertia*: in :math:`S - \sigma = L D L^T` the negative pivots
are as many as there are eigenvalues below :math:`\sigma`. So every eigenvalue of a slice has its number in the whole
spectrum. Where two slices meet both must give the same eigenvalue the same number.

Several ranks count together, and each finds a run of neighbouring slices (:mod:`~faultgouge.analysis.onset.ranks`).
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.linalg import eigh, qr
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import eigsh
from threadpoolctl import threadpool_limits

from ..errors import FaultgougeError
from ..packing import Floats, Indices
from ..sparse_lu import minimum_degree, symmetric_lu
from .limits import LIMITS, Limits
from .ranks import ALONE, Ranks


class SliceError(FaultgougeError):
    """A part of a spectrum was not found: one sentence."""


@dataclass(frozen=True, eq=False)
class Slice:
    """A run of neighbouring eigenvalues.

    Attributes
    ----------
    first : int
        Number in the whole spectrum of the first of `values`.
    values : ndarray, shape (M,)
        Eigenvalues, increasing: first those of a margin, then the slice's own ones, then another margin. Those farther
        out in the margins are not converged.
    vectors : ndarray, shape (E, M)
        Orthonormal eigenvectors in columns.
    own : slice
        Which of the M belong to this slice and to no other.
    spacing : float
        Mean distance of these and of the next ones on either side.
    """

    first: int
    values: Floats
    vectors: Floats
    own: slice
    spacing: float


Solve = Callable[[Floats], Floats]
Factored = tuple[Solve, int]


def factored(matrix: csc_array, shift: float, mumps: bool = False) -> Factored:
    """The inverse of S - shift, and how many eigenvalues of S are below the shift: Sylvester's law of inertia.

    The factors are made without pivoting, so that the signs of the pivots tell the inertia. What stability that costs
    is looked at afterwards, by Rayleigh quotients. The coordinates of S are in the order of elimination. `mumps` says
    whether MUMPS may be used.
    """
    shifted = csc_array(matrix - shift * eye_array(matrix.shape[0]))
    factors = symmetric_lu(shifted, ordered=True, symmetric=True, mumps=mumps)
    return factors.solve, factors.negative


def slices(
    matrix: csc_array,
    margin: int,
    modes: tuple[int, int] | None = None,
    limits: Limits = LIMITS,
    factorise: Callable[[csc_array, float], Factored] | None = None,
    ranks: Ranks = ALONE,
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
        Sizes, and how to factorise S - shift if not by :func:`factored`.
    ranks : Ranks
        Who shares the slices; those of this rank are found. Its threads are also the slices at the most that are under
        way beyond the one that is asked for. All ranks must come to the end of their slices.

    Raises
    ------
    SliceError
        If eigenvalues do not converge, or neighbouring slices disagree.
    """
    spectrum = _Spectrum(matrix, limits, factorise or partial(factored, mumps=ranks.workers == 1), ranks)
    ends: list[Slice] = []
    failure: FaultgougeError | None = None
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(ranks.workers) as pool:
        shifts = spectrum.shifts(pool, *(modes or (0, matrix.shape[0])))
        try:
            for part in _in_turn(pool, ranks.workers, spectrum, shifts[ranks.part(len(shifts))], margin):
                ends = [*ends[:1], replace(part, vectors=np.empty((0, 0)))]
                yield part
        except FaultgougeError as error:
            failure = error

    def borders() -> list[Slice]:
        if failure is not None:
            raise failure
        return ends

    for before, after in pairwise([each for each in ranks.together(borders) if each]):
        _compare(before[-1], after[0])


Shift = tuple[float, tuple[int, int]]
"""A shift, and the numbers of the first eigenvalue that belongs to it and of the first that does not."""


def _in_turn(
    pool: ThreadPoolExecutor, workers: int, spectrum: "_Spectrum", shifts: Sequence[Shift], margin: int
) -> Iterator[Slice]:
    """Neighbouring slices in their order, each compared with the one before it."""
    waiting: deque[Future[Slice]] = deque()
    before: Slice | None = None
    for place in range(len(shifts) + workers):
        if place < len(shifts):
            waiting.append(pool.submit(spectrum.slice_about, *shifts[place], margin))
        if place >= workers and waiting:
            after = waiting.popleft().result()
            if before is not None:
                _compare(before, after)
            yield after
            before = after


def _compare(before: Slice, after: Slice) -> None:
    """Raise an error if the second slice gives its first eigenvalue another number than the slice before it."""
    number = after.first + after.own.start
    here, there = after.values[after.own.start], before.values[number - before.first]
    if abs(here - there) > 0.01 * after.spacing:
        raise SliceError(
            f"the eigenvalue of number {number} is {there:.10g} from one shift and {here:.10g} from the next: "
            "one is missing in between"
        )


class _Spectrum:
    """A symmetric matrix in an order that keeps its factors sparse."""

    def __init__(
        self, matrix: csc_array, limits: Limits, factorise: Callable[[csc_array, float], Factored], ranks: Ranks
    ) -> None:
        self.limits, self.factorise, self.ranks = limits, factorise, ranks
        size = matrix.shape[0]
        self.bound = float(abs(matrix).sum(axis=0).max())  # no eigenvalue is beyond
        order = minimum_degree(csc_array(matrix + 2 * self.bound * eye_array(size)))
        self.place: Indices = order
        self.matrix = csc_array(matrix[np.argsort(order)][:, np.argsort(order)])

    def below(self, shift: float) -> int:
        """How many eigenvalues are below the shift."""
        return self.factorise(self.matrix, shift)[1]

    def counted(self, pool: ThreadPoolExecutor, shifts: Floats) -> list[int]:
        """How many eigenvalues are below each of some shifts; all ranks know what each has counted."""
        mine = shifts[self.ranks.part(len(shifts))]
        return [each for one in self.ranks.together(lambda: list(pool.map(self.below, mine))) for each in one]

    def shifts(self, pool: ThreadPoolExecutor, first: int, stop: int) -> list[Shift]:
        """The shifts of all slices from the eigenvalue of number `first` on, and before that of number `stop`."""
        from scipy.interpolate import PchipInterpolator

        size = self.matrix.shape[0]
        start = np.random.default_rng(0).standard_normal(size)
        top = float(eigsh(self.matrix, k=1, which="LA", tol=1e-3, v0=start, return_eigenvectors=False)[0])
        places = np.array([-self.bound, -1e-9 * self.bound, 1.01 * top])
        numbers = np.array([0, *self.counted(pool, places[1:2]), size])
        while True:
            wanted = (numbers[1:] > first) & (numbers[:-1] < stop)
            wide = np.flatnonzero(wanted & (np.diff(numbers) > self.limits.coarse) & (np.diff(places) > 1e-6 * top))
            if len(wide) == 0:
                break
            between = places[wide] + 0.5 * (places[wide + 1] - places[wide])
            numbers = np.insert(numbers, wide + 1, self.counted(pool, between))
            places = np.insert(places, wide + 1, between)
        numbers, last = np.unique(numbers[::-1], return_index=True)
        pieces = max(1, round((stop - first) / self.limits.own))
        ends = first + np.arange(pieces + 1) * (stop - first) // pieces
        borders = PchipInterpolator(numbers, places[::-1][last])(ends)
        middles = 0.5 * (borders[:-1] + borders[1:])
        return [(float(middle), (int(a), int(b))) for middle, (a, b) in zip(middles, pairwise(ends), strict=True)]

    def slice_about(self, shift: float, own: tuple[int, int], margin: int) -> Slice:
        """The eigenvalues of these numbers, which are about the shift, by block Lanczos."""
        solve, below = self.factorise(self.matrix, shift)
        krylov = _Krylov(solve, self.matrix.shape[0], self.limits)
        krylov.extend(self.limits.first_look)
        while True:
            inverse, vectors, residuals = krylov.ritz()
            # by increasing eigenvalue: those below the shift have negative inverses
            order = np.concatenate([np.flatnonzero(inverse < 0)[::-1], np.flatnonzero(inverse > 0)[::-1]])
            values = shift + 1 / inverse[order]
            first = below - np.count_nonzero(inverse < 0)
            # one more at either end, for the comparison with the neighbours
            ends = max(own[0] - 1, 0) - first, min(own[1] + 1, len(self.place)) - first
            if ends[0] >= 0 and ends[1] <= len(values):
                inner = slice(*ends)
                spacing = np.ptp(values[inner]) / (ends[1] - ends[0])
                if np.all(residuals[order[inner]] <= self.limits.accurate * spacing * inverse[order[inner]] ** 2):
                    break
            krylov.extend(self.limits.looks)
        kept = slice(max(0, own[0] - first - margin), min(len(values), own[1] - first + margin))
        start = own[0] - first - kept.start
        found = krylov.basis[: len(inverse)].T @ vectors[:, order[kept]]
        part = Slice(
            first=first + kept.start,
            values=values[kept],
            vectors=found[self.place],
            own=slice(start, start + own[1] - own[0]),
            spacing=float(spacing),
        )
        self.compare(part, np.ascontiguousarray(found[:, part.own]))
        return part

    def compare(self, part: Slice, vectors: Floats) -> None:
        """Raise an error if a slice's own eigenvalues are not those of the matrix, but of inaccurate factors.

        The Krylov space knows the factors alone; the Rayleigh quotients are of the matrix itself.
        """
        values = part.values[part.own]
        quotients = np.einsum("ij,ij->j", vectors, self.matrix @ vectors)
        worst = int(np.argmax(np.abs(quotients - values)))
        if abs(quotients[worst] - values[worst]) > self.limits.accurate * part.spacing:
            number = part.first + part.own.start + worst
            raise SliceError(
                f"the eigenvalue of number {number} is {values[worst]:.10g} from the factors and "
                f"{quotients[worst]:.10g} from the matrix: the factors are inaccurate; take other loads"
            )


class _Krylov:
    """An orthonormal basis Q of the block Krylov space of an operator, and the operator in it, H = Q^T A Q.

    The vectors are rows: so the products of many with a few take a third of the time.
    """

    def __init__(self, operator: Solve, size: int, limits: Limits) -> None:
        self.operator, self.limits, block = operator, limits, limits.block
        most = min(limits.last_look * block, size)
        self.basis = np.empty((most, size))  # memory is taken as it is written to
        self.projection = np.zeros((most, most))
        start = np.random.default_rng(0).standard_normal((block, size))
        self.basis[:block] = qr(start.T, mode="economic")[0].T
        self.used, self.next, self.drifting = block, np.zeros((block, block)), False
        self.scratch = np.empty((block, size))

    def extend(self, blocks: int) -> None:
        """So many blocks more, each made orthogonal to all before it."""
        block = self.limits.block
        for _ in range(blocks):
            used = self.used
            if used + block > len(self.basis):
                raise SliceError(f"a Krylov space of {used} vectors does not hold the eigenvalues about its shift")
            known, last = self.basis[:used], slice(used - block, used)
            image = np.ascontiguousarray(self.operator(self.basis[last].T).T)
            inside = image @ known.T
            image -= np.matmul(inside, known, out=self.scratch)
            if self.drifting:
                image -= np.matmul(image @ known.T, known, out=self.scratch)
            self.projection[last, :used] = inside
            self.projection[:used, last] = inside.T
            vectors, self.next = qr(image.T, mode="economic", overwrite_a=True)
            self.basis[used : used + block] = vectors.T
            self.drifting = self.drifting or bool(np.abs(self.basis[:block] @ vectors).max() > self.limits.drift)
            self.used += block

    def ritz(self) -> tuple[Floats, Floats, Floats]:
        """Eigenvalues and eigenvectors of H, and the residuals of these as vectors of A."""
        block = self.limits.block
        used = self.used - block  # the last block has no image yet
        values, vectors = eigh(self.projection[:used, :used], check_finite=False)
        return values, vectors, np.linalg.norm(self.next @ vectors[used - block :], axis=0)
