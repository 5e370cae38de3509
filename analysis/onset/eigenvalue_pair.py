r"""A pair of eigenvalues: how it is followed from load to load without the others, and what it may do in between.

**The pair.** On the invariant subspace of two modes the operator A is a 2 x 2 block :math:`B = (U^T V)^{-1} U^T A V`,
with orthonormal bases V, U of the right and of the left subspace. V, U, half the trace and the *discriminant*

.. math:: D = (\lambda_1 - \lambda_2)^2 = (B_{11} - B_{22})^2 + 4 B_{12} B_{21}

are smooth functions of the load where the two eigenvectors become parallel, at an exceptional point (Kato,
*Perturbation Theory for Linear Operators*, 1966, II.1). D > 0 is a pair of real eigenvalues, D < 0 a complex pair.

**Continuation.** The bases of a neighbouring operator are improved by inverse iteration,
:math:`V \leftarrow (A - \sigma)^{-1} V`, :math:`U \leftarrow (A - \sigma)^{-T} U`, with one factorisation for all
steps. The error falls by :math:`|\lambda - \sigma| / |\lambda_3 - \sigma|` a step, :math:`\lambda_3` the closest of the
other eigenvalues. The shift stands off the pair by a tenth of B - mean, or the common eigenvector would dominate the
inverse close to a coalescence. If a third eigenvalue is closer to that shift, others are tried. A complex pair is also
found by its eigenvectors, with its own eigenvalue as the shift: no other eigenvalue is nearer than the real axis.

**Acceptance.** The residuals :math:`A V - V (V^T A V)`, and those on the left, must be at the level of rounding: the
error of D is their product over the distance of the other modes. The planes must also be those of the pair.

**Large operators.** There a factorisation costs as much as a hundred solutions. The factors P of a neighbour serve as
well in *residual inverse iteration* (Neumaier, SIAM J. Numer. Anal. 22, 914 (1985)),

.. math:: V \leftarrow V - P^{-1} (A V - V (V^T A V)) ,

which ends at an invariant subspace of A whatever P is. So sparse factors need no pivoting.

**Between two loads** a window narrower than the increment may hide. With A' the difference of both operators,
:math:`D' = 2 (\lambda_1 - \lambda_2)(\lambda_1' - \lambda_2')` is known at either end from :math:`\lambda' = y^H A' x /
y^H x`. A cubic goes through both values and slopes, and a parabola through either slope and both values. The lowest
point of the cubic, less the disagreement of the three, is a bound. Where the bound is negative a window may hide.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse import csc_array, csr_array, eye_array

from ..factors.sparse_lu import SingularMatrixError, symmetric_lu
from ..motion.eigenvalues import Complexes, exceeds_rounding, unit_rounding
from ..packing.packing import Floats
from .limits import LIMITS, Limits

Planes = tuple[Floats, Floats]

FAR = 2.0
"""Distance of a load from the nearer of two others up to which planes are extrapolated, in units of the distance of
these two from each other."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two modes of the operator A, shape (n, n), 1 / time^2, at the load fx.

    Attributes
    ----------
    right, left : ndarray, shape (n, 2)
        Orthonormal bases V and U of the invariant planes.
    inverse : Inverse or None
        Sparse factors with which the planes were found; they may serve for a neighbour as well.
    """

    fx: float
    matrix: csr_array = field(repr=False)
    right: Floats = field(repr=False)
    left: Floats = field(repr=False)
    inverse: "Inverse | None" = field(default=None, repr=False)

    def block(self, matrix: csr_array) -> Floats:
        """(U^T V)^-1 U^T A V of any matrix on the planes of this pair, shape (2, 2)."""
        return np.asarray(np.linalg.solve(self.left.T @ self.right, self.left.T @ (matrix @ self.right)))

    @cached_property
    def entries(self) -> Floats:
        """The block B, shape (2, 2), 1 / time^2."""
        return self.block(self.matrix)

    @cached_property
    def mean(self) -> float:
        """Half the trace, 1 / time^2."""
        return float(0.5 * np.trace(self.entries))

    @cached_property
    def discriminant(self) -> float:
        """D = (lambda_1 - lambda_2)^2, 1 / time^4."""
        b = self.entries
        return float((b[0, 0] - b[1, 1]) ** 2 + 4 * b[0, 1] * b[1, 0])

    @property
    def traceless(self) -> Floats:
        """B - mean, shape (2, 2), 1 / time^2."""
        return self.entries - self.mean * np.eye(2)

    @cached_property
    def spread(self) -> float:
        """Frobenius norm of B - mean, 1 / time^2."""
        return float(np.linalg.norm(self.traceless))

    @cached_property
    def overlap(self) -> float:
        """The smaller |y^H x| of unit left and right eigenvectors; zero at an exceptional point."""
        values, z = np.linalg.eig(self.entries)
        if values[0] == values[1]:
            return 0.0
        # x = V z and y = U (U^T V)^-T w, of the eigenvectors z, w of the block
        y = np.linalg.solve(self.right.T @ self.left, np.linalg.inv(z).conj().T)
        return float(np.min(1.0 / (np.linalg.norm(y, axis=0) * np.linalg.norm(z, axis=0))))

    @property
    def definite(self) -> bool:
        """Whether the pair is real, or complex, by more than rounding."""
        split = complex(self.mean, 0.5 * np.sqrt(abs(self.discriminant)))
        return exceeds_rounding(split, self.overlap, unit_rounding(self.matrix.data))

    def slope(self, change: csr_array) -> float:
        """First-order change of the discriminant with a change of the operator, 1 / time^4."""
        b, db = self.entries, self.block(change)
        # The planes turn in first order, which changes invariants of the block in second order only.
        return float(2 * (b[0, 0] - b[1, 1]) * (db[0, 0] - db[1, 1]) + 4 * (db[0, 1] * b[1, 0] + b[0, 1] * db[1, 0]))

    def extrapolate(self, other: "Pair", fx: float) -> "Pair | None":
        """A guess of the pair at the load fx, force: planes on the line through those at two loads; None beyond FAR."""
        share = (fx - self.fx) / (other.fx - self.fx)
        if abs(share) > FAR:
            return None
        ends = (self.right, other.right), (self.left, other.left)
        right, left = (np.linalg.qr(a + share * (b @ np.linalg.inv(a.T @ b) - a))[0] for a, b in ends)
        return replace(self, right=right, left=left)

    def same_planes(self, other: "Pair") -> bool:
        """Whether both pairs have the same planes rather than not: all principal angles below 60 degrees."""
        right = np.linalg.svd(self.right.T @ other.right, compute_uv=False)
        left = np.linalg.svd(self.left.T @ other.left, compute_uv=False)
        return bool(min(right[-1], left[-1]) > 0.5)

    def closest(self, others: "Iterable[Pair]") -> "Pair | None":
        """The pair with the closest eigenvalues among the others with the same planes."""
        same = [other for other in others if self.same_planes(other)]
        return min(same, key=lambda other: abs(other.mean - self.mean), default=None)


@dataclass(frozen=True, eq=False)
class Inverse:
    """The inverse of A - sigma, or of a matrix like it: `solve` is (vectors, transposed) -> its product with vectors.

    Sparse factors are not exact, being without pivoting or of another operator: residuals make up for that.
    """

    solve: Callable[[Any, bool], Any]
    exact: bool

    def step(self, matrix: csr_array, basis: Floats, transposed: bool) -> Floats:
        """One step of (residual) inverse iteration for an operator, or for the transpose that is handed over."""
        if self.exact:
            return np.asarray(self.solve(basis, transposed))
        return basis - np.asarray(self.solve(_residual_of_plane(matrix, basis), transposed))


def inverse_of(matrix: csr_array, shift: complex, limits: Limits = LIMITS) -> Inverse | None:
    """The inverse of A - shift; None if that is singular."""
    shifted = csc_array(matrix - shift * eye_array(matrix.shape[0]))
    if matrix.shape[0] > limits.dense_factors:
        try:
            sparse = symmetric_lu(shifted)
        except SingularMatrixError:
            return None
        return Inverse(lambda b, turned: sparse.solve(np.ascontiguousarray(b), trans="T" if turned else "N"), False)
    dense = lu_factor(shifted.toarray(), check_finite=False)
    if not np.all(np.diag(dense[0])):
        return None
    return Inverse(lambda b, turned: lu_solve(dense, b, trans=int(turned), check_finite=False), True)


def continue_pair(pair: Pair, fx: float, matrix: csr_array, limits: Limits = LIMITS) -> Pair | None:
    """Continue a pair, or a guess of one, to a neighbouring operator; None if no iteration converges."""
    for planes, inverse, most in _iterations(pair, replace(pair, fx=fx, matrix=matrix), limits):
        found = _invariant(matrix, planes, most, limits)
        if found is not None:
            image = Pair(fx, matrix, *found, inverse)
            if image.same_planes(pair):
                return image
    return None


def _iterations(pair: Pair, guess: Pair, limits: Limits) -> Iterator[tuple[Iterator[Planes], Inverse | None, int]]:
    """Ways to the planes, cheapest first: the iteration, its factors where they may serve again, its longest length."""
    if pair.inverse is not None:
        yield _planes(guess, pair.inverse), pair.inverse, limits.steps_on
    scale = max(pair.spread, 1e3 * np.finfo(np.float64).eps * abs(pair.mean))
    for turn, offset in enumerate(limits.offsets):
        inverse = inverse_of(guess.matrix, guess.mean + offset * scale, limits)
        if inverse is not None:
            yield _planes(guess, inverse), None if inverse.exact else inverse, limits.steps
        if turn == 0 and pair.discriminant < 0 and guess.discriminant < 0:
            eigenvalue = complex(guess.mean, 0.5 * np.sqrt(-guess.discriminant))
            inverse = inverse_of(guess.matrix, eigenvalue, limits)
            if inverse is not None:
                yield _complex_planes(guess, inverse), None, limits.steps


def _planes(guess: Pair, inverse: Inverse) -> Iterator[Planes]:
    """Inverse iteration of both planes, good through a coalescence."""
    v, u, transposed = guess.right, guess.left, guess.matrix.T
    while True:
        v = np.linalg.qr(inverse.step(guess.matrix, v, False))[0]
        u = np.linalg.qr(inverse.step(transposed, u, True))[0]
        yield v, u


def _complex_planes(guess: Pair, inverse: Inverse) -> Iterator[Planes]:
    """Inverse iteration of the eigenvectors of a complex pair, whatever real eigenvalue is close to it."""
    metric = guess.left.T @ guess.right
    x = guess.right @ _upper(guess.entries)
    y = guess.left @ _upper(np.linalg.solve(metric.T, (metric @ guess.entries).T))  # A^T y = lambda y
    while True:
        x, y = (each / np.linalg.norm(each) for each in (inverse.solve(x, False), inverse.solve(y, True)))
        v, u = (np.linalg.qr(np.column_stack([each.real, each.imag]))[0] for each in (x, y))
        yield v, u


def _upper(entries: Floats) -> Complexes:
    """The eigenvector of a 2 x 2 matrix whose eigenvalue has the positive imaginary part."""
    values, vectors = np.linalg.eig(entries)
    return np.asarray(vectors[:, np.argmax(values.imag)])


def _invariant(matrix: csr_array, planes: Iterator[Planes], most: int, limits: Limits) -> Planes | None:
    """The first planes whose residuals are rounding; None once the pace says that there will be none in time."""
    level = limits.residual * unit_rounding(matrix.data)
    transposed, residuals = matrix.T, []
    for v, u in planes:
        residuals.append(
            max(float(np.linalg.norm(_residual_of_plane(*each))) for each in ((matrix, v), (transposed, u)))
        )
        if residuals[-1] < level:
            return v, u
        left = most - len(residuals)
        if len(residuals) > min(2 * limits.pace, most // 2):
            gain = residuals[-1] / residuals[-1 - limits.pace]
            if left <= 0 or not residuals[-1] * gain ** (left / limits.pace) < level:
                return None
    return None


def _residual_of_plane(matrix: csr_array, basis: Floats) -> Floats:
    """A V - V (V^T A V)."""
    image = matrix @ basis
    return np.asarray(image - basis @ (basis.T @ image))


def deepest_dip(d0: Floats, s0: Floats, d1: Floats, s1: Floats, bend: float) -> tuple[Floats, Floats]:
    """The widest stretch of 0 < t < 1 on which functions known at both ends may be negative.

    d0, s0 and d1, s1, each of shape (P,), are values, positive, and slopes at t = 0 and at t = 1; `bend` is that of
    `Limits`. Returned are the largest possible width in t, zero where a function surely stays positive, and where it is
    deepest.
    """
    # Parabolas d0 + s0 t + f t^2 and d1 - s1 r + g r^2, r = 1 - t; cubic d0 + s0 t + h t^2 + k t^3.
    f, g = d1 - d0 - s0, d0 - d1 + s1
    h, k = 3 * (d1 - d0) - 2 * s0 - s1, 2 * (d0 - d1) + s0 + s1
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(h * h - 3 * k * s0, 0.0))
        t = np.array([-s0 / (2 * f), 1 - s1 / (2 * g), (root - h) / (3 * k)])
        t = np.clip(np.nan_to_num(t, nan=0.5), 0.0, 1.0)
        r = 1 - t
        cubic = d0 + t * (s0 + t * (h + t * k))
        spread = np.maximum(np.abs(d0 + t * (s0 + t * f) - cubic), np.abs(d1 - r * (s1 - r * g) - cubic))
        lowest = cubic - spread - bend * np.minimum(d0, d1) * (4 * t * r)
        deepest = np.argmin(lowest, axis=0), np.arange(len(d0))
        depth = np.maximum(-lowest[deepest], 0.0)
        width = np.where(depth > 0, 2 * np.sqrt(depth / np.maximum(np.abs(f), np.abs(g))), 0.0)
    return np.minimum(width, 1.0), t[deepest]


def dip_between(here: Pair, there: Pair, limits: Limits = LIMITS) -> tuple[float, float]:
    """Where the discriminant of a pair may change its sign and back between two loads with the same sign of it.

    Returned are the width of the widest stretch with the other sign that is possible, force, zero if there is surely
    none, and the load at which D is closest to zero, or deepest beyond.
    """
    sign, change, increment = np.sign(here.discriminant), there.matrix - here.matrix, there.fx - here.fx
    ends = ((pair.discriminant, pair.slope(change)) for pair in (here, there))
    d0, s0, d1, s1 = (sign * np.array([number]) for end in ends for number in end)
    width, at = deepest_dip(d0, s0, d1, s1, limits.bend)
    return float(width[0]) * increment, here.fx + float(at[0]) * increment
