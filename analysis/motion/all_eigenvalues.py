r"""All eigenvalues of a large sparse non-symmetric operator, a slice of the spectrum after the other.

LAPACK needs time with the cube of the number n of coordinates, and :math:`n^2` numbers. Here the spectrum is cut into
slices by shifts on the real axis, and a block Arnoldi iteration with the inverse finds the eigenvalues in a disc about
each shift, with a few
hundred vectors. The time is a little more than the square of n.

**Shifts.** Every eigenvalue :math:`\lambda` of A has a real part between the lowest and the largest eigenvalue of the
symmetric part :math:`S = (A + A^T)/2` (Bendixson, Acta Math. 25, 359 (1902)). A is nearly symmetric, so that its
eigenvalues are as dense as those of S, which inertia counts. Discs overlap, and are as large as imaginary parts
demand.

**That all are found.** There is no law of inertia for A. But n eigenvalues are to be found, their sum is the trace of
A, and the sum of their squares the trace of :math:`A^2`. Two neighbouring discs must also find the same eigenvalues
where they overlap. Where one of these is violated, the slices that have the fewest eigenvalues beside what S has are
found again from other shifts, with larger blocks, one after the other. If this does not help there is an error.

**Islands.** Coordinates that are not coupled to all others, such as those of identical cells apart, have equal
eigenvalues, more than a block has vectors. Each island has slices of its own, or is small enough for
LAPACK.

**Discs.** In the block Krylov space of :math:`(A - \sigma)^{-1}` the eigenvalues :math:`\lambda` closest to
:math:`\sigma` come first: they are the largest :math:`\theta = 1/(\lambda - \sigma)` of the projection H. A residual r
of the inverse changes :math:`\lambda` by :math:`\kappa\, r / |\theta|^2` at the most to first order. `ShiftedDisc` has
all eigenvalues up to the first one that has not converged.

**Vectors.** The left vectors are the right ones of :math:`A^T`, from a second space with the same factors. Of two
eigenvalues that nearly coalesce the vectors are nearly parallel, and uncertain; the planes of both are not. So vectors
come from the invariant subspaces of many eigenvalues: with orthonormal bases V of the right one and U of the left one,
all that is wanted is in the small matrix :math:`B = (U^T V)^{-1} U^T A V`, whose error is the product of the errors of
V and U (Stewart and Sun, *Matrix Perturbation Theory*, 1990, ch. V).
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, schur
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.csgraph import connected_components

from ..arrays import Complexes, Floats
from ..errors import FaultgougeError
from ..factors.inertia import count_places, places_of_numbers
from ..factors.lanczos import BlockKrylov, factor_shifted
from ..factors.sparse_lu import Factors, elimination_places, general_lu
from ..progress import report_progress
from .modes import Modes

ROOM = 1.06
"""Vectors of the next space, in units of those that would have been enough for the last one."""


class SpectrumError(FaultgougeError):
    """Eigenvalues were not found: one sentence."""


class Krylov(BlockKrylov):
    """A space with vectors and subspaces of single eigenvalues."""

    def vector(self, wanted: complex) -> Complexes:
        """The vector of the space that belongs to one eigenvalue of H, by inverse iteration."""
        shifted = self.square - wanted * (1 + np.finfo(float).eps) * np.eye(self.used)
        found = np.ones(self.used, complex)
        for _ in range(2):
            found = np.linalg.solve(shifted, found)
            found /= np.linalg.norm(found)
        return np.asarray(self.basis[: self.used].T @ found)

    def subspace(self, wanted: Complexes) -> Floats:
        """An orthonormal basis of the invariant subspace of some eigenvalues of H, closed under conjugation."""
        from scipy.optimize import linear_sum_assignment

        every = np.linalg.eigvals(self.square)
        distance = np.abs(wanted[:, None] - every)
        chosen = every[linear_sum_assignment(distance)[1]]
        others = np.setdiff1d(every, chosen)

        def is_chosen(real: float, imaginary: float) -> bool:
            value = complex(real, imaginary)
            return bool(np.abs(chosen - value).min() < np.abs(others - value).min(initial=np.inf))

        apart = f"{len(wanted)} eigenvalues are not set apart from {len(others)} others of one space"
        try:
            _, vectors, count = schur(self.square, output="real", sort=is_chosen, check_finite=False)
        except np.linalg.LinAlgError as error:  # rounding has moved one of a cluster
            raise SpectrumError(apart) from error
        if count != len(wanted):
            raise SpectrumError(apart)
        return np.asarray(self.basis[: self.used].T @ vectors[:, :count])


@dataclass(frozen=True)
class Reach:
    """What a disc has to hold.

    Attributes
    ----------
    low, high : float
        Real parts.
    beyond : float
        Radius, in units of the distance of the farther of these.
    accuracy : float
        Error of an eigenvalue at the most.
    most : int
        Vectors of a space at the most.
    """

    low: float
    high: float
    beyond: float
    accuracy: float
    most: int

    def radius(self, shift: float, values: Complexes) -> float:
        """Radius about a shift within which all eigenvalues with these real parts lie, given those that are known."""
        inside = values[(values.real >= self.low) & (values.real <= self.high)]
        height = 1.5 * float(np.abs(inside.imag).max(initial=0.0))
        return float(np.hypot(self.beyond * max(self.high - shift, shift - self.low), height))


@dataclass(frozen=True, eq=False)
class ShiftedDisc:
    """What is known about a shift.

    Attributes
    ----------
    shift : float
    radius : float
        All eigenvalues that are closer are known.
    values : ndarray of complex, shape (k,)
        These.
    overlap : ndarray, shape (k,)
        |y^H x|, as the space has it.
    krylov : Krylov
    """

    matrix: csc_array
    factors: Factors
    shift: float
    radius: float
    values: Complexes
    overlap: Floats
    krylov: Krylov

    @classmethod
    def about(
        cls, matrix: csc_array, shift: float, reach: Reach, block: int, first: int, seed: int = 0
    ) -> "ShiftedDisc":
        """The eigenvalues about a shift.

        Parameters
        ----------
        matrix : scipy.sparse.csc_array, shape (n, n)
            A, its coordinates in the order of elimination.
        shift : float
        reach : Reach
        block, first : int
            Vectors of a block, and vectors of the space before its eigenvalues are looked at.
        seed : int
            Of the first block.

        Raises
        ------
        SpectrumError
            If the largest space does not hold them.
        """
        factors = general_lu(csc_array(matrix - shift * eye_array(matrix.shape[0])), ordered=True)
        start = np.random.default_rng(seed)
        krylov = Krylov(factors.solve, start.standard_normal((block, matrix.shape[0])), reach.most)
        while True:
            krylov.extend(first)
            values, overlap, errors = ritz_values(krylov, shift)
            failed = np.flatnonzero(errors > reach.accuracy * overlap)
            count = int(failed[0]) if len(failed) else len(values)
            radius = abs(values[count - 1] - shift) if count else 0.0
            if radius >= reach.radius(shift, values[:count]) or (krylov.full and count == matrix.shape[0]):
                return cls(matrix, factors, shift, float(radius), values[:count], overlap[:count], krylov)
            if krylov.full:
                raise SpectrumError(
                    f"a space of {krylov.used} vectors about {shift:.6g} does not hold the eigenvalues from "
                    f"{reach.low:.6g} to {reach.high:.6g}"
                )
            # the radius grows as the space does
            first = int(krylov.used * min(1.5, max(1.05, reach.radius(shift, values[:count]) / max(radius, 1e-300))))

    def enough(self, reach: Reach) -> int:
        """Vectors that would have been enough for what a disc has to hold, and a few more, as looks cost more."""
        return int(ROOM * self.krylov.used * min(1.0, reach.radius(self.shift, self.values) / self.radius))

    def marked(self, chosen: NDArray[np.bool_], accuracy: float) -> Modes:
        """Some of the eigenvalues, closed under conjugation, with right and left vectors.

        Raises
        ------
        SpectrumError
            If the left vectors are not found.
        """
        wanted = self.values[chosen]
        theta = 1 / (wanted - self.shift)
        right = self.krylov.subspace(theta)
        mirror = self._left_space(right, wanted, accuracy)
        left = mirror.subspace(theta)
        both = left.T @ right
        small = np.linalg.solve(both, left.T @ (self.matrix @ right))
        values, y, x = eig(small, left=True, right=True)
        x, y = right @ x, left @ np.linalg.solve(both.T, y)
        return Modes(values, x / np.linalg.norm(x, axis=0), y / np.linalg.norm(y, axis=0))

    def _left_space(self, right: Floats, wanted: Complexes, accuracy: float) -> Krylov:
        """The space of the transposed inverse, until it has the eigenvalues that are wanted."""
        from scipy.optimize import linear_sum_assignment

        block = self.krylov.block
        # few left vectors are next to what the right space has
        start = right.T if right.shape[1] <= block else np.random.default_rng(1).standard_normal((block, len(right)))
        krylov = Krylov(lambda columns: self.factors.solve(columns, trans="T"), start, self.krylov.most)
        first = min(self.krylov.used, 6 * len(start)) if len(start) == len(wanted) else self.krylov.used * 3 // 4
        while True:
            krylov.extend(first)
            values, overlap, errors = ritz_values(krylov, self.shift)
            values = values[errors <= accuracy * overlap]
            if len(values) >= len(wanted):
                distance = np.abs(wanted[:, None] - values)
                near = distance[linear_sum_assignment(distance)]
                if near.max(initial=0.0) < np.sqrt(accuracy):
                    return krylov
            if krylov.full:
                raise SpectrumError(f"left vectors of eigenvalues about {self.shift:.6g} were not found")
            first = krylov.used * 5 // 4


def ritz_values(krylov: Krylov, shift: float) -> tuple[Complexes, Floats, Floats]:
    """Eigenvalues from a space of the inverse, the next to the shift first, their |y^H x|, and first-order errors."""
    theta, left, right = eig(krylov.square, left=True, right=True, check_finite=False)
    order = np.argsort(-np.abs(theta), kind="stable")
    theta, left, right = theta[order], left[:, order], right[:, order]
    overlap = np.abs(np.sum(left.conj() * right, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = krylov.residuals(right) / np.abs(theta) ** 2
        values = shift + 1 / theta
    return values, overlap, np.where(theta == 0, np.inf, errors)


@dataclass(frozen=True)
class SpectrumSizes:
    """Sizes and tolerances of slices, with their reasons."""

    own: int = 36
    """Eigenvalues of a slice. More cost more orthogonalisation, fewer cost more factors."""
    block: int = 4
    """Vectors that are solved for at a time, in the time of two by themselves. Larger blocks take more vectors."""
    beyond: float = 1.1
    """Radius of a disc in units of half its slice: what two neighbours both have."""
    accuracy: float = 1e-6
    """Error of an eigenvalue, in mean distances of eigenvalues, to first order; it enters as its square where vectors
    are nearly orthogonal."""
    oblique: float = 0.1
    """|y^H x| below which a real eigenvalue may belong to a pair that is about to coalesce: its error is large, and it
    is found again from the plane of both."""
    complete: float = 1e-3
    """Error of the trace, in mean distances of eigenvalues, as of all errors together."""
    largest: int = 15
    """Vectors of a space at the most, in units of `own`."""
    least: int = 540
    """Coordinates up to which LAPACK finds all: a space of the largest size would hold them, in no less time."""


SIZES = SpectrumSizes()


@dataclass(frozen=True, eq=False)
class AllEigenvalues:
    """All eigenvalues of a matrix, and vectors of those that matter.

    Attributes
    ----------
    values : ndarray of complex, shape (n,)
        Sorted by real part, then imaginary part.
    marked : Modes
        Those with a positive imaginary part, those that are real and negative, and real ones that are oblique.
    """

    values: Complexes
    marked: Modes


@dataclass(frozen=True, eq=False)
class SpectrumSlice:
    """Eigenvalues of a disc, those with vectors among them.

    Attributes
    ----------
    shift, radius : float
    values : ndarray of complex, shape (k,)
    vectors : Modes
    """

    shift: float
    radius: float
    values: Complexes
    vectors: Modes

    @classmethod
    def empty(cls, shift: float, size: int) -> "SpectrumSlice":
        """A slice of which nothing was found."""
        return cls(shift, 0.0, np.zeros(0, complex), Modes.none(size))

    def between(self, low: float, high: float) -> Complexes:
        """Eigenvalues with a real part in [low, high)."""
        return self.values[(self.values.real >= low) & (self.values.real < high)]


def all_eigenvalues(matrix: csr_array, sizes: SpectrumSizes = SIZES) -> AllEigenvalues:
    """All eigenvalues of a sparse matrix that is nearly symmetric.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array, shape (n, n)
        A, such as M^(-1/2) K M^(-1/2) of the coordinates that feel a force; its pattern is symmetric.
    sizes : SpectrumSizes
        Sizes and tolerances.

    Returns
    -------
    AllEigenvalues

    Raises
    ------
    SpectrumError
        If not all are found.
    """
    count, island = connected_components(matrix, directed=False)
    if count == 1:
        return _of_island(matrix, sizes)
    values, parts = [], []
    for places in np.split(np.argsort(island, kind="stable"), np.cumsum(np.bincount(island))[:-1]):
        found = _of_island(csr_array(matrix[places][:, places]), sizes)
        values.append(found.values)
        parts.append(found.marked.placed(places, matrix.shape[0]))
    every = np.concatenate(values)
    return AllEigenvalues(every[np.lexsort((every.imag, every.real))], Modes.joined(parts))


def _of_island(matrix: csr_array, sizes: SpectrumSizes) -> AllEigenvalues:
    """Of coordinates that are all coupled: in slices, or by LAPACK if they are few."""
    if matrix.shape[0] > sizes.least:
        return _of_slices(matrix, sizes)
    values, left, right = eig(matrix.toarray(), left=True, right=True)
    marked = (values.imag > 0) | ((values.imag == 0) & (values.real < 0))
    marked |= (values.imag == 0) & (np.abs(np.sum(left.conj() * right, axis=0)) < sizes.oblique)
    order = np.lexsort((values.imag, values.real))
    return AllEigenvalues(values[order], Modes(values[marked], right[:, marked], left[:, marked]))


def _of_slices(matrix: csr_array, sizes: SpectrumSizes) -> AllEigenvalues:
    """Of many coordinates."""
    spectrum = _SlicedSpectrum.of(matrix, sizes)
    slices = []
    first = 3 * sizes.own
    for k in range(len(spectrum.borders) - 1):
        report_progress(f"slice {k + 1} of {len(spectrum.borders) - 1} of the spectrum")
        try:
            found, first = spectrum.slice(k, first)
        except SpectrumError:
            found = SpectrumSlice.empty(float(spectrum.borders[k : k + 2].mean()), matrix.shape[0])
        slices.append(found)
    for block in (2, 4, 8):
        if spectrum.what_is_wrong(slices):
            spectrum.mend(slices, block * sizes.block, first)
    if wrong := spectrum.what_is_wrong(slices):
        raise SpectrumError(f"All eigenvalues of {matrix.shape[0]} coordinates: {wrong}.")
    return spectrum.joined(slices)


@dataclass(frozen=True, eq=False)
class _SlicedSpectrum:
    """A matrix in an order that keeps its factors sparse, and the borders of its slices."""

    matrix: csc_array
    order: NDArray[np.int64]
    borders: Floats
    numbers: NDArray[np.int64]
    spacing: float
    sizes: SpectrumSizes

    @classmethod
    def of(cls, matrix: csr_array, sizes: SpectrumSizes) -> "_SlicedSpectrum":
        size = matrix.shape[0]
        symmetric = csc_array(0.5 * (matrix + matrix.T))
        order = np.argsort(elimination_places(symmetric))
        symmetric, ordered = csc_array(symmetric[order][:, order]), csc_array(matrix[order][:, order])

        def count(shifts: Floats) -> list[int]:
            return [factor_shifted(symmetric, shift)[1] for shift in shifts]

        places, below = _tighten(*count_places(symmetric, count, (0, size), 2 * sizes.own), count)
        pieces = max(1, round(size / sizes.own))
        numbers = np.arange(pieces + 1) * size // pieces
        borders = places_of_numbers(places, below, numbers)
        return cls(ordered, order, borders, numbers, float(places[-1] - places[0]) / size, sizes)

    def slice(self, number: int, first: int, block: int | None = None) -> tuple[SpectrumSlice, int]:
        """The eigenvalues of a slice, found with `first` vectors at first, and how many of these it took."""
        low, high = self.borders[number : number + 2]
        sizes, again = self.sizes, block is not None
        most = sizes.largest * sizes.own if block is None else sizes.largest * max(sizes.own, block)
        accuracy = max(sizes.accuracy * self.spacing, 4 * np.finfo(float).eps * np.abs(self.borders).max())
        reach = Reach(low, high, sizes.beyond, accuracy, most)
        shift = float(low + (0.44 if again else 0.5) * (high - low))
        disc = ShiftedDisc.about(self.matrix, shift, reach, block or sizes.block, first, seed=block or 0)
        values, overlap = disc.values, disc.overlap
        chosen = (values.imag != 0) | (values.real < 0) | (overlap < sizes.oblique)
        # two that nearly coalesce are on the same side of the widest gap
        ends = [_widest_gap(sign * (values.real - shift), sign * (end - shift), disc.radius)
                for sign, end in ((-1, low), (1, high))]  # fmt: skip
        chosen &= (values.real > shift - ends[0]) & (values.real < shift + ends[1])
        # of a cluster all or none: rounding says which of its eigenvalues are negative
        chosen |= np.abs(values[:, None] - values[chosen]).min(axis=1, initial=np.inf) < sizes.complete * self.spacing
        if not chosen.any():
            return SpectrumSlice(shift, disc.radius, values, Modes.none(len(self.order))), disc.enough(reach)
        marked = disc.marked(chosen, accuracy)
        return SpectrumSlice(shift, disc.radius, np.concatenate([values[~chosen], marked.values]), marked), disc.enough(
            reach
        )

    def mend(self, slices: list[SpectrumSlice], block: int, first: int) -> None:
        """Find suspects again, with larger blocks from other shifts, until nothing is wrong.

        A slice that is found again stays as it was if fewer of all eigenvalues are found with the new one.
        """
        for k in self.suspects(slices):
            before, missing = slices[k], self.missing(slices)
            try:
                slices[k], _ = self.slice(k, first, block)
            except SpectrumError:
                continue
            if not self.what_is_wrong(slices):
                return
            if self.missing(slices) > missing:
                slices[k] = before

    def ends(self, slices: list[SpectrumSlice]) -> Floats:
        """Real parts up to which each slice has its own, as far as possible from all eigenvalues."""
        inner = []
        for one, other, border in zip(slices[:-1], slices[1:], self.borders[1:-1], strict=True):
            room = max(0.0, 0.5 * min(one.shift + one.radius - border, border - other.shift + other.radius))
            real = np.concatenate([one.values.real, other.values.real])
            near = np.sort(np.concatenate([real[np.abs(real - border) < room], [border - room, border + room]]))
            k = int(np.argmax(np.diff(near)))
            inner.append(0.5 * (near[k] + near[k + 1]))
        return np.array([-np.inf, *inner, np.inf])

    def values(self, slices: list[SpectrumSlice]) -> list[Complexes]:
        """Of each slice its own."""
        ends = self.ends(slices)
        return [part.between(*pair) for part, *pair in zip(slices, ends[:-1], ends[1:], strict=True)]

    def what_is_wrong(self, slices: list[SpectrumSlice]) -> str:
        """Why these are not all eigenvalues; an empty string if they are."""
        values, size = np.concatenate(self.values(slices)), self.matrix.shape[0]
        if len(values) != size:
            return f"{len(values)} were found"
        trace, square = self.matrix.diagonal().sum(), (self.matrix @ self.matrix).diagonal().sum()
        allowed, largest = self.sizes.complete * self.spacing, np.abs(values).max(initial=0.0)
        if abs(values.sum() - trace) > allowed:
            return f"their sum is off the trace by {abs(values.sum() - trace):.3g}"
        if abs((values**2).sum() - square) > 2 * allowed * largest:
            return f"the sum of their squares is off the trace of the square by {abs((values**2).sum() - square):.3g}"
        for one, other in pairwise(slices):
            if not _agree(one, other, np.sqrt(self.sizes.accuracy) * self.spacing):
                return f"the slices about {one.shift:.6g} and {other.shift:.6g} disagree"
        return ""

    def missing(self, slices: list[SpectrumSlice]) -> int:
        """How many eigenvalues are missing, or too many."""
        return abs(self.matrix.shape[0] - sum(len(own) for own in self.values(slices)))

    def suspects(self, slices: list[SpectrumSlice]) -> NDArray[np.int64]:
        """The slices, those first that have the fewest eigenvalues beside the symmetric part."""
        return np.argsort([len(own) for own in self.values(slices)] - np.diff(self.numbers), kind="stable")

    def joined(self, slices: list[SpectrumSlice]) -> AllEigenvalues:
        """All eigenvalues, and vectors in the given order of coordinates."""
        ends = self.ends(slices)
        values = np.concatenate(self.values(slices))
        parts: list[Modes] = []
        for part, low, high in zip(slices, ends[:-1], ends[1:], strict=True):
            known = part.vectors
            own = (known.values.real >= low) & (known.values.real < high) & (known.values.imag >= 0)
            parts.append(Modes(known.values[own], known.right[:, own], known.left[:, own]))
        marked = Modes.joined(parts).placed(self.order, len(self.order))
        return AllEigenvalues(values[np.lexsort((values.imag, values.real))], marked)


def _widest_gap(distance: Floats, near: float, far: float) -> float:
    """The middle of the widest gap between distances from a shift, in the outer half of two of them."""
    near += 0.5 * (far - near)  # what is nearer may be the slice's own
    inside = np.sort(np.concatenate([distance[(distance > near) & (distance < far)], [near, far]]))
    k = int(np.argmax(np.diff(inside)))
    return float(0.5 * (inside[k] + inside[k + 1]))


def _agree(one: SpectrumSlice, other: SpectrumSlice, close: float) -> bool:
    """Whether two slices have the same eigenvalues where both should have all."""
    for a, b in ((one, other), (other, one)):
        distance = np.abs(a.values - b.shift)
        both = a.values[(distance < 0.99 * b.radius) & (np.abs(a.values - a.shift) < 0.99 * a.radius)]
        if len(both) and (len(b.values) == 0 or np.abs(both[:, None] - b.values).min(axis=1).max() > close):
            return False
    return True


def _tighten(
    places: Floats, numbers: NDArray[np.int64], count: Callable[[Floats], list[int]]
) -> tuple[Floats, NDArray[np.int64]]:
    """The lowest and the highest place moved next to the first and to the last eigenvalue."""
    places = places.copy()
    for _ in range(8):
        middle = 0.5 * (places[[0, -2]] + places[[1, -1]])
        low, high = count(middle)
        if low == 0 and len(places) > 2:
            places[0] = middle[0]
        if high == numbers[-1] and len(places) > 2:
            places[-1] = middle[1]
    return places, numbers
