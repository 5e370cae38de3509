r"""Eigenvectors of a large sparse symmetric matrix, a slice of the spectrum after the other; and block Krylov spaces.

The dense decomposition of E coordinates takes some :math:`10 E^3` operations and :math:`16 E^2` bytes: hours and 15 GB
for 10,000 disks. Spectrum slicing (Parlett, *The Symmetric Eigenvalue Problem*, 1980, ch. 3; Grimes, Lewis and Simon,
SIAM J. Matrix Anal. Appl. 15, 228 (1994)) cuts the spectrum of S into slices, each about a shift :math:`\sigma`. In the
block Krylov space of :math:`(S - \sigma)^{-1}` the eigenvalues close to the shift come first. One sparse factorisation
serves the slice, and slices know nothing of each other. The cost grows little faster than :math:`E^2`. ARPACK solves
for one vector at a time; blocks halve the time of solutions and of products.

**That none is missing** is known from *Sylvester's law of inertia*: in :math:`S - \sigma = L D L^T` the negative pivots
are as many as there are eigenvalues below :math:`\sigma`. So every eigenvalue of a slice has its number in the whole
spectrum. Two slices that meet must give the same eigenvalue the same number.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh, qr
from scipy.sparse import csc_array, csr_array, eye_array

from ..arrays import Floats, Indices
from ..errors import FaultgougeError
from .sparse_lu import elimination_places, symmetric_lu

Solve = Callable[[Floats], Floats]
Factorization = tuple[Solve, int]


class SliceError(FaultgougeError):
    """A part of a spectrum was not found: one sentence."""


@dataclass(frozen=True)
class SliceSizes:
    """Sizes and tolerances of slices, with their reasons."""

    slice_size: int = 120
    """Eigenvalues of a slice. Fewer cost more factorisations, more cost more orthogonalisation."""
    block: int = 6
    """Vectors that are solved for at a time: 0.7 ms each at 30,000 coordinates, against 2.6 ms one by one. Larger
    blocks need more vectors for the same eigenvalues: 288 for a slice, with blocks of eight 304."""
    first_look: int = 48
    """Blocks of a Krylov space before its eigenvalues are looked at: enough for most slices."""
    looks: int = 6
    """Blocks between two looks. A look costs as much as two blocks of 30,000 coordinates, or as twenty of 3,000."""
    last_look: int = 200
    """Blocks at the most."""
    blocks_together: int = 2
    """Blocks that are made orthogonal to all before them at a time: three stray too far in most slices."""
    stray_limit: float = 3e-6
    """Part of a new vector along the basis, up to which the part is taken away afterwards; some 1e-7 at 29,000
    coordinates. Its square, 1e-11, then remains in lengths and angles of the basis."""
    vector_residual: float = 1e-2
    """Residual of the eigenvectors of a slice, in mean distances of eigenvalues, as of the inverse. It enters an
    eigenvalue as its square over the distance of modes outside: 4e-6 at the most was measured (29,000 coordinates).
    An eigenvalue may be off its Rayleigh quotient with S by as much."""
    chunk_rows: int = 1024
    """Rows of a basis that are multiplied at a time: the product stays in the cache."""

    def chunks(self, size: int) -> list[slice]:
        """The rows of a basis, so many at a time."""
        return [slice(first, first + self.chunk_rows) for first in range(0, size, self.chunk_rows)]


class Border(NamedTuple):
    """The eigenvalues at the border of a slice, on which neighbouring slices must agree.

    Attributes
    ----------
    modes : tuple of (int, int)
        Numbers in the whole spectrum of the slice's first eigenvalue and of the first one beyond.
    first, beyond : float
        These eigenvalues, 1 / time^2; nan beyond the end of the spectrum.
    spacing : float
        Mean distance of the slice's eigenvalues and of the next ones on either side, 1 / time^2.
    """

    modes: tuple[int, int]
    first: float
    beyond: float
    spacing: float

    @property
    def size(self) -> int:
        """Number of modes in the slice."""
        return self.modes[1] - self.modes[0]

    @classmethod
    def of(cls, number: int, values: Floats, own: slice) -> "Border":
        """The border of a slice, from increasing eigenvalues, the number of the first, and which are its own."""
        near = values[max(0, own.start - 1) : own.stop + 1]
        beyond = float(values[own.stop]) if own.stop < len(values) else float("nan")
        modes = number + own.start, number + own.stop
        return cls(modes, float(values[own.start]), beyond, float(np.ptp(near)) / len(near))


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
    """

    first: int
    values: Floats = field(repr=False)
    vectors: Floats = field(repr=False)
    own: slice

    @property
    def border(self) -> Border:
        """The border, on which its neighbours must agree."""
        return Border.of(self.first, self.values, self.own)


def factor_shifted(matrix: csc_array, shift: float) -> Factorization:
    """The inverse of S - shift, and how many eigenvalues of S are below the shift.

    The factors are made without pivoting, so that the signs of the pivots tell the inertia. What stability that costs
    is for the caller to look at. The coordinates of S are in the order of elimination.
    """
    shifted = csc_array(matrix - shift * eye_array(matrix.shape[0]))
    factors = symmetric_lu(shifted, ordered=True, symmetric=True)
    return factors.solve, factors.negative


def compare_slices(*borders: Border) -> None:
    """Raise a SliceError if a slice gives its first eigenvalue another number than the slice just before it."""
    for before, after in pairwise(borders):
        if after.modes[0] == before.modes[1] and not abs(after.first - before.beyond) <= 0.01 * after.spacing:
            raise SliceError(
                f"the eigenvalue of number {after.modes[0]} is {before.beyond:.10g} from one shift and "
                f"{after.first:.10g} from the next: one is missing in between"
            )


class SlicedSpectrum:
    """A symmetric matrix in an order that keeps its factors sparse, to be looked at in slices.

    Parameters
    ----------
    matrix : scipy.sparse.csc_array, shape (E, E)
        S, symmetric.
    sizes : SliceSizes
        Sizes and tolerances.
    factorise : callable
        How to factorise S - shift, its coordinates in the order of elimination.
    """

    def __init__(
        self,
        matrix: csc_array,
        sizes: SliceSizes = SliceSizes(),
        factorise: Callable[[csc_array, float], Factorization] = factor_shifted,
    ) -> None:
        self.sizes, self.factorise = sizes, factorise
        self.order: Indices = np.argsort(elimination_places(matrix))
        self.given, self.matrix = csr_array(matrix), csc_array(matrix[self.order][:, self.order])
        self.spare: list[Floats] = []  # memory for bases: fresh memory takes longer than a pass over it

    def below(self, shift: float) -> int:
        """Number of eigenvalues below the shift."""
        return self.factorise(self.matrix, shift)[1]

    def walk(self, first: int, stop: int, shift: float, margin: int) -> Iterator[Slice]:
        """Slices from the eigenvalue of number `first` to the one before `stop`, each about a shift next to the last.

        The factors of each slice count what is below its shift, so that no other counts are needed. `shift` is a guess
        of the first, beyond the eigenvalue of number `first`; `margin` as in `slice_about`.

        Raises
        ------
        SliceError
            If eigenvalues do not converge, or neighbouring slices disagree.
        """
        known, before = -float(abs(self.matrix).sum(axis=0).max()), None
        while first < stop:
            solve, below = self.factorise(self.matrix, shift)
            if not 0 < below - first <= self.sizes.slice_size:  # a bisection where the guess is far off
                step = (shift - known) * min(0.5 * self.sizes.slice_size / max(below - first, 1), 2.0)
                shift = known + step if before is not None or below > first else 0.5 * (shift + abs(shift)) + 1e-300
                continue
            own = first, min(stop, 2 * below - first)
            part = self.slice_about(shift, own, margin, (solve, below))
            if before is not None:
                compare_slices(before, part.border)
            yield part
            first, before, known = own[1], part.border, float(part.values[part.own][-1])
            shift = known + 0.5 * self.sizes.slice_size * max(part.border.spacing, 1e-12 * abs(known))

    def slice_about(
        self, shift: float, own: tuple[int, int], margin: int, factors: Factorization | None = None
    ) -> Slice:
        """The eigenvalues of these numbers, which are about the shift, by block Lanczos.

        `margin` are further modes wanted on either side; `factors` those of S - shift, where they are known.

        Raises
        ------
        SliceError
            If they do not converge, or the factors are inaccurate.
        """
        solve, below = factors or self.factorise(self.matrix, shift)
        size, block = self.matrix.shape[0], self.sizes.block
        basis = self.spare.pop() if self.spare else np.empty((min(self.sizes.last_look * block, size), size))
        krylov = BlockLanczos(solve, basis, self.sizes)
        krylov.extend(self.sizes.first_look)
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
                if np.all(residuals[order[inner]] <= self.sizes.vector_residual * spacing * inverse[order[inner]] ** 2):
                    break
            krylov.extend(self.sizes.looks)
        kept = slice(max(0, own[0] - first - margin), min(len(values), own[1] - first + margin))
        start = own[0] - first - kept.start
        chosen, found = vectors[:, order[kept]], np.empty((size, kept.stop - kept.start))
        for rows in self.sizes.chunks(size):
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
        for rows in self.sizes.chunks(len(vectors)):
            quotients += np.einsum("ij,ij->j", vectors[rows], self.given[rows] @ vectors)
        worst = int(np.argmax(np.abs(quotients - values)))
        if abs(quotients[worst] - values[worst]) > self.sizes.vector_residual * part.border.spacing:
            number = part.first + part.own.start + worst
            raise SliceError(
                f"the eigenvalue of number {number} is {values[worst]:.10g} from the factors and "
                f"{quotients[worst]:.10g} from the matrix: the factors are inaccurate; take other loads"
            )


class BlockLanczos:
    """An orthonormal basis Q of the block Krylov space of an operator, and the operator in it, H = Q^T A Q.

    A new block is made orthogonal to the last blocks at once, and to all others later, together with the next block:
    the basis is then read from memory half as often. The part of a block along the others by then, the part that has
    strayed, is known when it is taken away. If a shift is next to an eigenvalue, blocks may stray too far. Such blocks
    are made anew, and from then on fewer at a time (semiorthogonality: Simon, Linear Algebra Appl. 61, 101 (1984)).

    The vectors are rows: products of many vectors with a few then take a third of the time.
    """

    def __init__(self, operator: Solve, basis: Floats, sizes: SliceSizes) -> None:
        self.operator, self.basis, self.sizes, block = operator, basis, sizes, sizes.block
        most, size = basis.shape
        self.projection = np.zeros((most, most))
        start = np.random.default_rng(0).standard_normal((block, size))
        self.basis[:block] = qr(start.T, mode="economic")[0].T
        self.next = np.zeros((block, block))
        self.used = self.firm = block  # vectors, and those of them that are orthogonal to all others
        # blocks that are made orthogonal at a time; 0: each is orthogonal to all before it at once
        self.together = sizes.blocks_together

    def extend(self, blocks: int) -> None:
        """So many blocks more, each orthogonal to all before it."""
        wanted = self.used + blocks * self.sizes.block
        while self.firm < wanted:
            self._step()
            if self.used == wanted or self.used >= self.firm + self.together * self.sizes.block:
                self._settle()

    def _step(self) -> None:
        """One block more, orthogonal to the last ones."""
        block, used = self.sizes.block, self.used
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
        far, limit = np.linalg.norm(strayed, axis=1).max(), self.sizes.stray_limit
        if self.together and (far > limit or np.abs(among).max() > limit**2):
            self.used, self.together = firm, self.together - 1
        else:
            fresh -= strayed @ self.basis[:firm]
            self.firm = self.used

    def ritz(self) -> tuple[Floats, Floats, Floats]:
        """Eigenvalues and eigenvectors of H, and the residuals of these as vectors of A."""
        block = self.sizes.block
        used = self.used - block  # the last block has no image yet
        values, vectors = eigh(self.projection[:used, :used], check_finite=False)
        return values, vectors, np.linalg.norm(self.next @ vectors[used - block :], axis=0)
