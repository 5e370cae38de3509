r"""The eigenvectors of a large sparse symmetric matrix, all of them, a slice of the spectrum after the other.

The dense decomposition of E coordinates takes some :math:`10 E^3` operations and :math:`16 E^2` bytes: hours and 15 GB
for 10,000 disks. Spectrum slicing (Parlett, *The Symmetric Eigenvalue Problem*, 1980, ch. 3; Grimes, Lewis and Simon,
SIAM J. Matrix Anal. Appl. 15, 228 (1994)) cuts the spectrum of S into slices, each about a shift :math:`\sigma`. In the
block Krylov space of :math:`(S - \sigma)^{-1}` the eigenvalues close to the shift come first. One sparse factorisation
serves the slice, and slices know nothing of each other, so that threads share them. The cost grows little faster than
:math:`E^2`. ARPACK solves for one vector at a time; blocks halve the time of solutions and of products.

**That none is missing** is known from *Sylvester's law of inertia*: in :math:`S - \sigma = L D L^T` the negative pivots
are as many as there are eigenvalues below :math:`\sigma`. So every eigenvalue of a slice has its number in the whole
spectrum. Two slices that meet must give the same eigenvalue the same number.

Several ranks count together (:mod:`~faultgouge.analysis.windows.slices.ranks`). Each then finds a run of neighbouring
slices that no other search has found or taken (:mod:`~faultgouge.analysis.windows.slices.store`).
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from itertools import chain, pairwise

import numpy as np
from scipy.linalg import eigh, qr
from scipy.sparse import csc_array, csr_array
from threadpoolctl import threadpool_limits

from ...arrays import Floats, Indices
from ...errors import FaultgougeError
from ...factors.inertia import Factorization, Solve, count_places, factor_shifted, places_of_numbers
from ...factors.sparse_lu import minimum_degree
from ..limits import LIMITS, Limits
from .ranks import ALONE, Ranks
from .store import NEW_PASS, Border, Shift, Slice, SlicePass, Take


class SliceError(FaultgougeError):
    """A part of a spectrum was not found: one sentence."""


def slices(
    matrix: csc_array,
    margin: int,
    modes: tuple[int, int] | None = None,
    limits: Limits = LIMITS,
    factorise: Callable[[csc_array, float], Factorization] | None = None,
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
        Sizes, and how to factorise S - shift if not by :func:`factor_shifted`.
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
    spectrum = _Spectrum(matrix, limits, factorise or partial(factor_shifted, mumps=ranks.workers == 1), ranks)
    mine: list[Border] = []
    failure: FaultgougeError | None = None
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(ranks.workers) as pool:
        shifts = stored.shifts or spectrum.shifts(pool, *(modes or (0, matrix.shape[0])))
        if ranks.rank == 0 and not stored.shifts:
            stored.keep_shifts(shifts)
        found = {each.modes for each in stored.borders}
        wanted = [each for each in shifts if each[1] not in found]
        own = wanted[ranks.part(len(wanted))]
        try:
            with stored.lock_slices() as take:
                for part in _in_turn(pool, ranks.workers, spectrum, own, margin, take):
                    mine.append(part.border)
                    _compare_slices(*mine[-2:])
                    yield part
        except FaultgougeError as error:
            failure = error

    def borders() -> list[Border]:
        if failure is not None:
            raise failure
        return mine

    _compare_slices(*sorted(chain(stored.borders, *ranks.together(borders))))


def _in_turn(
    pool: ThreadPoolExecutor, workers: int, spectrum: "_Spectrum", shifts: Sequence[Shift], margin: int, take: Take
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


def _compare_slices(*borders: Border) -> None:
    """Raise an error if a slice gives its first eigenvalue another number than the slice just before it."""
    for before, after in pairwise(borders):
        if after.modes[0] == before.modes[1] and not abs(after.first - before.beyond) <= 0.01 * after.spacing:
            raise SliceError(
                f"the eigenvalue of number {after.modes[0]} is {before.beyond:.10g} from one shift and "
                f"{after.first:.10g} from the next: one is missing in between"
            )


class _Spectrum:
    """A symmetric matrix in an order that keeps its factors sparse."""

    def __init__(
        self, matrix: csc_array, limits: Limits, factorise: Callable[[csc_array, float], Factorization], ranks: Ranks
    ) -> None:
        self.limits, self.factorise, self.ranks = limits, factorise, ranks
        self.order: Indices = np.argsort(minimum_degree(matrix))
        self.given, self.matrix = csr_array(matrix), csc_array(matrix[self.order][:, self.order])
        self.spare: list[Floats] = []  # memory for bases: fresh memory takes longer than a pass over it

    def below(self, shift: float) -> int:
        """Number of eigenvalues below the shift."""
        return self.factorise(self.matrix, shift)[1]

    def count_below(self, pool: ThreadPoolExecutor, shifts: Floats) -> list[int]:
        """Numbers of eigenvalues below some shifts; all ranks have the counts of all."""
        mine = shifts[self.ranks.part(len(shifts))]
        return [each for one in self.ranks.together(lambda: list(pool.map(self.below, mine))) for each in one]

    def shifts(self, pool: ThreadPoolExecutor, first: int, stop: int) -> list[Shift]:
        """The shifts of all slices from eigenvalue number `first` on, and before eigenvalue number `stop`."""
        places, numbers = count_places(
            self.matrix, partial(self.count_below, pool), (first, stop), self.limits.count_spacing
        )
        pieces = max(1, round((stop - first) / self.limits.slice_size))
        ends = first + np.arange(pieces + 1) * (stop - first) // pieces
        borders = places_of_numbers(places, numbers, ends)
        middles = 0.5 * (borders[:-1] + borders[1:])
        return [(float(middle), (int(a), int(b))) for middle, (a, b) in zip(middles, pairwise(ends), strict=True)]

    def slice_about(self, shift: float, own: tuple[int, int], margin: int) -> Slice:
        """The eigenvalues of these numbers, which are about the shift, by block Lanczos."""
        solve, below = self.factorise(self.matrix, shift)
        size, block = self.matrix.shape[0], self.limits.block
        basis = self.spare.pop() if self.spare else np.empty((min(self.limits.last_look * block, size), size))
        krylov = _Krylov(solve, basis, self.limits)
        krylov.extend(self.limits.first_look)
        while True:
            inverse, vectors, residuals = krylov.ritz()
            # by increasing eigenvalue: those below the shift have negative inverses
            order = np.concatenate([np.flatnonzero(inverse < 0)[::-1], np.flatnonzero(inverse > 0)[::-1]])
            values = shift + 1 / inverse[order]
            first = below - np.count_nonzero(inverse < 0)
            # one more at either end, for the comparison with the neighbours
            ends = max(own[0] - 1, 0) - first, min(own[1] + 1, size) - first
            if ends[0] >= 0 and ends[1] <= len(values):
                inner = slice(*ends)
                spacing = np.ptp(values[inner]) / (ends[1] - ends[0])
                if np.all(
                    residuals[order[inner]] <= self.limits.vector_residual * spacing * inverse[order[inner]] ** 2
                ):
                    break
            krylov.extend(self.limits.looks)
        kept = slice(max(0, own[0] - first - margin), min(len(values), own[1] - first + margin))
        start = own[0] - first - kept.start
        chosen, found = vectors[:, order[kept]], np.empty((size, kept.stop - kept.start))
        for rows in self.limits.chunks(size):
            found[self.order[rows]] = basis[: len(inverse), rows].T @ chosen
        self.spare.append(basis)
        part = Slice(
            first=first + kept.start,
            values=values[kept],
            vectors=found,
            own=slice(start, start + own[1] - own[0]),
        )
        self.compare(part)
        return part

    def compare(self, part: Slice) -> None:
        """Raise an error if inaccurate factors gave the slice other eigenvalues than the matrix has.

        The Krylov space knows the factors alone; the Rayleigh quotients are of the matrix itself.
        """
        values, vectors = part.values[part.own], np.ascontiguousarray(part.vectors[:, part.own])
        quotients = np.zeros(len(values))
        for rows in self.limits.chunks(len(vectors)):
            quotients += np.einsum("ij,ij->j", vectors[rows], self.given[rows] @ vectors)
        worst = int(np.argmax(np.abs(quotients - values)))
        if abs(quotients[worst] - values[worst]) > self.limits.vector_residual * part.border.spacing:
            number = part.first + part.own.start + worst
            raise SliceError(
                f"the eigenvalue of number {number} is {values[worst]:.10g} from the factors and "
                f"{quotients[worst]:.10g} from the matrix: the factors are inaccurate; take other loads"
            )


class _Krylov:
    """An orthonormal basis Q of the block Krylov space of an operator, and the operator in it, H = Q^T A Q.

    A new block is made orthogonal to the last blocks at once, and to all others later, together with the next block:
    the basis is then read from memory half as often. The part of a block along the others by then, the part that has
    strayed, is known when it is taken away. If a shift is next to an eigenvalue, blocks may stray too far. Such blocks
    are made anew, and from then on fewer at a time (semiorthogonality: Simon, Linear Algebra Appl. 61, 101 (1984)).

    The vectors are rows: products of many vectors with a few then take a third of the time.
    """

    def __init__(self, operator: Solve, basis: Floats, limits: Limits) -> None:
        self.operator, self.basis, self.limits, block = operator, basis, limits, limits.block
        most, size = basis.shape
        self.projection = np.zeros((most, most))
        start = np.random.default_rng(0).standard_normal((block, size))
        self.basis[:block] = qr(start.T, mode="economic")[0].T
        self.next = np.zeros((block, block))
        self.used = self.firm = block  # vectors, and those of them that are orthogonal to all others
        # blocks that are made orthogonal at a time; 0: each is orthogonal to all before it at once
        self.together = limits.blocks_together

    def extend(self, blocks: int) -> None:
        """So many blocks more, each orthogonal to all before it."""
        wanted = self.used + blocks * self.limits.block
        while self.firm < wanted:
            self._step()
            if self.used == wanted or self.used >= self.firm + self.together * self.limits.block:
                self._settle()

    def _step(self) -> None:
        """One block more, orthogonal to the last ones."""
        block, used = self.limits.block, self.used
        if used + block > len(self.basis):
            raise SliceError(f"a Krylov space of {used} vectors does not hold the eigenvalues about its shift")
        last, near = slice(used - block, used), slice(max(0, self.firm - 2 * block) if self.together else 0, used)
        image = np.ascontiguousarray(self.operator(self.basis[last].T).T)
        inside = image @ self.basis[near].T
        image -= inside @ self.basis[near]
        self.projection[last, near] = inside
        self.projection[near, last] = inside.T
        vectors, self.next = qr(image.T, mode="economic", overwrite_a=True)
        self.basis[used : used + block] = vectors.T
        self.used += block

    def _settle(self) -> None:
        """Make the last blocks orthogonal to the blocks before them, or give the last blocks up."""
        firm, fresh = self.firm, self.basis[self.firm : self.used]
        products = fresh @ self.basis[: self.used].T
        strayed, among = products[:, :firm], products[:, firm:] - np.eye(len(fresh))
        far, limit = np.linalg.norm(strayed, axis=1).max(), self.limits.stray_limit
        if self.together and (far > limit or np.abs(among).max() > limit**2):
            self.used, self.together = firm, self.together - 1
        else:
            fresh -= strayed @ self.basis[:firm]
            self.firm = self.used

    def ritz(self) -> tuple[Floats, Floats, Floats]:
        """Eigenvalues and eigenvectors of H, and the residuals of these as vectors of A."""
        block = self.limits.block
        used = self.used - block  # the last block has no image yet
        values, vectors = eigh(self.projection[:used, :used], check_finite=False)
        return values, vectors, np.linalg.norm(self.next @ vectors[used - block :], axis=0)
