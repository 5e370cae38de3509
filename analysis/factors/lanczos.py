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
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
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
    """The eigenvalues at the border of a slice, on which neighbours must agree: numbers in the whole spectrum of its
    first eigenvalue and of the first one beyond; these eigenvalues, nan beyond the end; and the mean distance of its
    eigenvalues and of the next ones on either side."""

    modes: tuple[int, int]
    first: float
    beyond: float
    spacing: float

    @property
    def size(self) -> int:
        """Number of modes in the slice."""
        return self.modes[1] - self.modes[0]


@dataclass(frozen=True, eq=False)
class Slice:
    """A run of neighbouring eigenvalues.

    `values` (M,) increase: those of a margin, of which the outer ones are not converged, the slice's `own` ones, and
    those of another margin; `vectors` (E, M) has their orthonormal eigenvectors. `first` is the number of the first of
    `values` in the whole spectrum.
    """

    first: int
    values: Floats = field(repr=False)
    vectors: Floats = field(repr=False)
    own: slice

    @property
    def border(self) -> Border:
        """The border, on which its neighbours must agree."""
        values, own = self.values, self.own
        near = values[max(0, own.start - 1) : own.stop + 1]
        beyond = float(values[own.stop]) if own.stop < len(values) else float("nan")
        modes = self.first + own.start, self.first + own.stop
        return Border(modes, float(values[own.start]), beyond, float(np.ptp(near)) / len(near))


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
            two = f"{before.beyond:.10g} from one shift and {after.first:.10g} from the next"
            raise SliceError(f"the eigenvalue of number {after.modes[0]} is {two}: one is missing in between")


class SlicedSpectrum:
    """A symmetric matrix in an order that keeps its factors sparse, to be looked at in slices. `factorise` makes the
    factors of S - shift, its coordinates in the order of elimination."""

    def __init__(
        self,
        matrix: csc_array,
        sizes: SliceSizes = SliceSizes(),
        factorise: Callable[[csc_array, float], Factorization] = factor_shifted,
    ) -> None:
        self.sizes, self.factorise = sizes, factorise
        self.order: Indices = np.argsort(elimination_places(matrix))
        self.given, self.matrix = csr_array(matrix), csc_array(matrix[self.order][:, self.order])

    def below(self, shift: float) -> int:
        """Number of eigenvalues below the shift."""
        return self.factorise(self.matrix, shift)[1]

    def walk(self, first: int, stop: int, low: float, shift: float, margin: int) -> Iterator[tuple[Slice, Solve]]:
        """Slices from the eigenvalue of number `first` to the one before `stop`, each about a shift next to the last,
        and what solves (S - shift) x = b with their factors. `low` is a place below the first eigenvalue, `shift` a
        guess of the first shift, `margin` as of `slice_about`. The factors of each slice count what is below its shift,
        so that no other counts are needed. A SliceError if eigenvalues do not converge, or neighbouring slices
        disagree."""
        most, before, high, again = self.sizes.slice_size, None, np.inf, False
        while first < stop:
            solve, below = self.factorise(self.matrix, shift)
            ahead = below - first
            # factors take a small part of the time of a slice: a shift that is far off is moved
            if ahead > most and shift - low > 1e-9 * abs(shift):
                high, shift = shift, low + (shift - low) * max(0.5 * most / ahead, 0.1)
                continue
            if ahead <= 0 or (ahead < most // 4 and below + ahead < stop and np.isinf(high)):
                step = shift - low
                low, shift = (shift, shift) if ahead <= 0 else (low, shift)
                shift = 0.5 * (shift + high) if np.isfinite(high) else shift + step * min(most / max(ahead, 1), 2.0)
                continue
            part = self.slice_about(shift, (first, min(stop, 2 * below - first)), margin, (solve, below))
            try:
                compare_slices(*([] if before is None else [before]), part.border)
            except SliceError:
                if again:
                    raise
                shift, again = low + 0.8 * (shift - low), True
                continue
            again = False
            yield part, partial(self._in_order, solve)
            first, before, low, high = part.border.modes[1], part.border, float(part.values[part.own][-1]), np.inf
            shift = low + 0.5 * most * max(part.border.spacing, 1e-9 * abs(low))

    def _in_order(self, solve: Solve, right: Floats) -> Floats:
        found = np.empty_like(right)
        found[self.order] = solve(right[self.order])
        return found

    def slice_about(
        self, shift: float, own: tuple[int, int], margin: int, factors: Factorization | None = None
    ) -> Slice:
        """The eigenvalues of these numbers, which are about the shift, by block Lanczos, and a margin of further ones
        on either side. A SliceError if they do not converge, or the factors are inaccurate."""
        solve, below = factors or self.factorise(self.matrix, shift)
        size, block = self.matrix.shape[0], self.sizes.block
        start = np.random.default_rng(0).standard_normal((block, size))
        krylov = BlockKrylov(solve, start, self.sizes.last_look * block)
        krylov.extend(self.sizes.first_look * block)
        while True:
            inverse, vectors = eigh(0.5 * (krylov.square + krylov.square.T), check_finite=False)
            residuals = krylov.residuals(vectors)
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
            if krylov.full:
                raise SliceError(f"eigenvalues about {shift:.6g} are not in a Krylov space of {krylov.used} vectors")
            krylov.extend(krylov.used + self.sizes.looks * block)
        kept = slice(max(0, own[0] - first - margin), min(len(values), own[1] - first + margin))
        start = own[0] - first - kept.start
        chosen, found = vectors[:, order[kept]], np.empty((size, kept.stop - kept.start))
        for rows in self.sizes.chunks(size):
            found[self.order[rows]] = krylov.basis[: len(inverse), rows].T @ chosen
        part = Slice(first + kept.start, values[kept], found, slice(start, start + own[1] - own[0]))
        # the Krylov space knows the factors alone; the Rayleigh quotients are of the matrix itself
        values, vectors = part.values[part.own], np.ascontiguousarray(part.vectors[:, part.own])
        quotients = np.zeros(len(values))
        for rows in self.sizes.chunks(len(vectors)):
            quotients += np.einsum("ij,ij->j", vectors[rows], self.given[rows] @ vectors)
        worst = int(np.argmax(np.abs(quotients - values)))
        if abs(quotients[worst] - values[worst]) > self.sizes.vector_residual * part.border.spacing:
            two = f"{values[worst]:.10g} from the factors and {quotients[worst]:.10g} from the matrix"
            number = part.first + part.own.start + worst
            raise SliceError(f"eigenvalue {number} is {two}: the factors are inaccurate; take other loads")
        return part


DEPENDENT = 1e-10
"""Length of a new vector, beside the longest of its block, below which its direction is rounding."""

PASSES, SHORTENED = 3, 0.5
"""How often a block is made orthogonal to the whole space at the most, and the share of its length that has to be left
for this to have been the last time: rounding is then twice that of a unit vector at the most (Daniel, Gragg, Kaufman
and Stewart, Math. Comput. 30, 772 (1976))."""


class BlockKrylov:
    """An orthonormal basis Q of the block Krylov space of an operator F, from a first block, shape (b, n), up to `most`
    vectors, and H = Q^T F Q. A block is made orthogonal to all before it until that no longer shortens it much: once is
    not enough. Images by a nearly symmetric operator have most of what they share with the space in the last two
    blocks, which come first. The vectors are rows, so that the products of many with a few take half of the time."""

    def __init__(self, operator: Solve, start: Floats, most: int) -> None:
        self.operator, (self.block, size) = operator, start.shape
        self.most = min(most, size - size % self.block)
        self.basis = np.empty((self.most + self.block, size))
        self.projection = np.zeros((self.most + self.block, self.most))
        self.basis[: self.block] = qr(start.T, mode="economic")[0].T
        self.used = 0  # vectors that have an image

    @property
    def full(self) -> bool:
        """Whether no block is left."""
        return self.used + self.block > self.most

    def extend(self, wanted: int) -> None:
        """So many vectors at least, or all."""
        while self.used < max(wanted, 1) and not self.full:
            last, known = slice(self.used, self.used + self.block), self.used + self.block
            image = np.ascontiguousarray(self.operator(self.basis[last].T).T)
            self._leave_space(image, known)
            vectors, rest = qr(image.T, mode="economic", overwrite_a=True, check_finite=False)
            if np.abs(np.diag(rest)).min() < DEPENDENT * np.abs(np.diag(rest)).max(initial=1e-300):
                # a direction that rounding has chosen: any serves that is orthogonal to all before
                part = vectors.T @ self.basis[:known].T
                image = vectors.T - part @ self.basis[:known]
                vectors, turned = qr(image.T, mode="economic", overwrite_a=True, check_finite=False)
                self.projection[:known, last] += part.T @ rest
                rest = turned @ rest  # the others have changed their signs
            self.basis[known : known + self.block] = vectors.T
            self.projection[known : known + self.block, last] = rest
            self.used = known

    def _leave_space(self, image: Floats, known: int) -> None:
        """Make the images of the last block orthogonal to all vectors so far; H gets what they had of these."""
        images = slice(self.used, known)

        def leave(first: int) -> Floats:
            part = image @ self.basis[first:known].T
            np.subtract(image, part @ self.basis[first:known], out=image)
            self.projection[first:known, images] += part.T
            return np.asarray(np.linalg.norm(image, axis=1))

        length = leave(max(0, known - 2 * self.block))
        for _ in range(PASSES):
            before, length = length, leave(0)
            if np.all(length > SHORTENED * before):
                return

    @property
    def square(self) -> Floats:
        """H, shape (m, m)."""
        return self.projection[: self.used, : self.used]

    def residuals(self, vectors: NDArray) -> Floats:
        """Of vectors of H, as of the operator's."""
        rest = self.projection[self.used : self.used + self.block, self.used - self.block : self.used]
        return np.asarray(np.linalg.norm(rest @ vectors[self.used - self.block :], axis=0))
