r"""One pair of eigenvalues, followed from operator to operator without the others.

On the invariant subspace that two modes span the operator A is a 2 x 2 block
:math:`B = (U^T V)^{-1} U^T A V`, with orthonormal bases V, U of the right and of the left subspace. Both are
smooth where the two eigenvectors become parallel, and so are half the trace and the discriminant

.. math:: D = (\lambda_1 - \lambda_2)^2 = (B_{11} - B_{22})^2 + 4 B_{12} B_{21} .

**Continuation.** The bases of a neighbouring operator are improved by inverse iteration,
:math:`V \leftarrow (A - \sigma)^{-1} V`, :math:`U \leftarrow (A - \sigma)^{-T} U`, with one factorisation for
all steps. The error falls by :math:`|\lambda - \sigma| / |\lambda_3 - \sigma|` a step, :math:`\lambda_3` the
closest of the others. The shift stands off the pair by the size of B - mean: nearer to a coalescence the
inverse would be dominated by the one common eigenvector and the second direction would drown in rounding.
The result counts only if the residuals :math:`A V - V (V^T A V)`, and those on the left, are at the level of
rounding: then V and U belong to an operator that differs from A by no more, and as both are used D is in
error by their product over the distance of the other modes. It must also be the same plane; an iteration that
went to other modes is rejected.

**Large operators.** There a factorisation costs as much as a hundred solutions, and the one from which a pair was found
is good for its neighbours, too, if P, what it is of, is A - sigma but for a small part of the distance of the other
modes: the iteration

.. math:: V \leftarrow V - P^{-1} (A V - V (V^T A V))

is inverse iteration where P is :math:`A - \sigma`, and ends at an invariant subspace of A whatever P is (residual
inverse iteration, Neumaier, SIAM J. Numer. Anal. 22, 914 (1985)). So factors need not be accurate either, and are
computed without pivoting.

A third eigenvalue may be closer to that shift than the pair, or hardly farther. Then shifts on the other side and
nearer by are tried. A complex pair is found, too, by its eigenvectors with its own eigenvalue as the shift: the closest
of the others is no nearer than the real axis.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import SuperLU

from .packing import Floats
from .sparse_lu import symmetric_lu
from .spectrum import Complexes

STEPS = 40
"""Inverse iterations before a continuation is given up: a solve costs a hundredth of a decomposition."""

STEPS_ON = 12
"""The same with the factors of a neighbour: four solutions a step, against the hundred of a factorisation."""

PACE = 5
"""Steps by which the pace of an iteration is judged: it slows down while the farther modes go, and then keeps it."""

OFFSETS = (1.0, -1.0, 0.1, -0.1)
"""Distances of the shift from the mean of a pair that are tried in turn, in units of its spread: a third eigenvalue may
be closer than the spread, and a tenth of it costs the second direction no more than a digit."""

RESIDUAL = 100.0
"""Residuals of accepted bases, in units of u |A|_F; LAPACK's own are of some 10."""

DENSE = 600
"""Operators up to this size are factorised as dense matrices, which is faster there than a sparse factorisation."""


@dataclass(frozen=True, eq=False)
class Block:
    """The 2 x 2 block of a pair.

    Attributes
    ----------
    mean : float
        Half the trace, 1 / time^2.
    discriminant : float
        D = (lambda_1 - lambda_2)^2, 1 / time^4.
    overlap : float
        The smaller |y^H x| of the unit left and right vectors.
    spread : float
        Frobenius norm of B - mean, 1 / time^2.
    entries : ndarray, shape (2, 2)
        B itself, 1 / time^2.
    right, left : ndarray, shape (n, 2)
        Orthonormal bases V and U.
    inverse : SparseInverse or None
        With which they were found, in a large operator; it may serve for a neighbour as well.
    """

    mean: float
    discriminant: float
    overlap: float
    spread: float
    entries: Floats
    right: Floats
    left: Floats
    inverse: "SparseInverse | None" = field(default=None, repr=False)

    @classmethod
    def of(cls, matrix: csr_array, right: Floats, left: Floats, inverse: "SparseInverse | None" = None) -> "Block":
        """The block of an operator on orthonormal bases of a right and a left invariant subspace."""
        metric = left.T @ right
        b = np.linalg.solve(metric, left.T @ (matrix @ right))
        mean = 0.5 * (b[0, 0] + b[1, 1])
        return cls(
            mean=float(mean),
            discriminant=float((b[0, 0] - b[1, 1]) ** 2 + 4 * b[0, 1] * b[1, 0]),
            overlap=_overlap(b, metric),
            spread=float(np.linalg.norm(b - mean * np.eye(2))),
            entries=b,
            right=right,
            left=left,
            inverse=inverse,
        )

    def slope(self, change: csr_array) -> float:
        """First-order change of the discriminant with a change of the operator, 1 / time^4."""
        b = self.entries
        db = np.linalg.solve(self.left.T @ self.right, self.left.T @ (change @ self.right))
        # The subspaces turn in first order, which changes invariants of the block in second order only.
        return float(2 * (b[0, 0] - b[1, 1]) * (db[0, 0] - db[1, 1]) + 4 * (db[0, 1] * b[1, 0] + b[0, 1] * db[1, 0]))

    def same_plane(self, other: "Block") -> bool:
        """Whether both planes are the same rather than not: all principal angles below 60 degrees."""
        right = np.linalg.svd(self.right.T @ other.right, compute_uv=False)
        left = np.linalg.svd(self.left.T @ other.left, compute_uv=False)
        return bool(min(right[-1], left[-1]) > 0.5)

    def closest(self, others: list["Block"]) -> "Block | None":
        """The one of them on the same plane; if there are several, that with the closest eigenvalues."""
        same = [other for other in others if self.same_plane(other)]
        return min(same, key=lambda other: abs(other.mean - self.mean), default=None)


def _overlap(b: Floats, metric: Floats) -> float:
    """The smaller |y^H x| from the eigenvectors z, w of the block: x = V z and y = U (U^T V)^-T w."""
    values, z = np.linalg.eig(b)
    if values[0] == values[1]:
        return 0.0
    w = np.linalg.inv(z).conj().T
    y = np.linalg.solve(metric.T, w)
    return float(np.min(1.0 / (np.linalg.norm(y, axis=0) * np.linalg.norm(z, axis=0))))


def continued(matrix: csr_array, block: Block) -> Block | None:
    """The block that a pair has become in a neighbouring operator.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array, shape (n, n)
        The operator, 1 / time^2.
    block : Block
        The pair in the neighbouring operator.

    Returns
    -------
    Block or None
        None if the iteration does not converge to this plane: other modes are too close, or the neighbour is
        too far.
    """
    ways: list[Callable[[], Block | None]] = [partial(_by_real_shift, matrix, block, share) for share in OFFSETS]
    if block.discriminant < 0:
        ways.insert(1, partial(_by_complex_shift, matrix, block))
    if block.inverse is not None:
        ways.insert(0, partial(_improved, matrix, block, block.inverse, STEPS_ON))
    for way in ways:
        found = way()
        if found is not None and found.same_plane(block):
            return found
    return None


def _by_real_shift(matrix: csr_array, block: Block, share: float) -> Block | None:
    """Inverse iteration of both planes, good through a coalescence; the shift is off by a share of the spread."""
    v, u = block.right, block.left
    mean = float(np.sum(u * (matrix @ v @ np.linalg.inv(u.T @ v)))) / 2
    shift = mean + share * max(block.spread, 1e3 * np.finfo(np.float64).eps * abs(block.mean))
    inverse = _inverse(matrix, shift)
    return None if inverse is None else _improved(matrix, block, inverse, STEPS)


def _improved(matrix: csr_array, block: Block, inverse: "Inverse", most: int) -> Block | None:
    """Both planes iterated until they are invariant."""
    v, u, transposed = block.right, block.left, matrix.T
    progress = _Progress(matrix, most)
    while progress.promising:
        v = np.linalg.qr(inverse.step(matrix, v, False))[0]
        u = np.linalg.qr(inverse.step(transposed, u, True))[0]
        if progress.converged(v, u):
            return Block.of(matrix, v, u, inverse if isinstance(inverse, SparseInverse) else None)
    return None


def _by_complex_shift(matrix: csr_array, block: Block) -> Block | None:
    """Inverse iteration of the eigenvectors of a complex pair, whatever real eigenvalue is close to it."""
    near = Block.of(matrix, block.right, block.left)
    if near.discriminant >= 0:
        return None
    inverse = _inverse(matrix, complex(near.mean, 0.5 * np.sqrt(-near.discriminant)))
    if inverse is None:
        return None
    metric = near.left.T @ near.right
    x = near.right @ _upper(near.entries)
    y = near.left @ _upper(np.linalg.solve(metric.T, (metric @ near.entries).T))  # A^T y = lambda y
    progress = _Progress(matrix, STEPS)
    while progress.promising:
        x, y = (each / np.linalg.norm(each) for each in (inverse.solve(x, False), inverse.solve(y, True)))
        v, u = (np.linalg.qr(np.column_stack([each.real, each.imag]))[0] for each in (x, y))
        if progress.converged(v, u):
            return Block.of(matrix, v, u)
    return None


def _upper(entries: Floats) -> Complexes:
    """The eigenvector of a 2 x 2 matrix whose eigenvalue has the positive imaginary part."""
    values, vectors = np.linalg.eig(entries)
    return np.asarray(vectors[:, np.argmax(values.imag)])


class _Progress:
    """The residuals of inverse iteration, down to rounding."""

    def __init__(self, matrix: csr_array, most: int) -> None:
        self.matrix, self.transposed, self.most = matrix, matrix.T, most
        self.level = RESIDUAL * 0.5 * np.finfo(np.float64).eps * float(np.linalg.norm(matrix.data))
        self.residuals: list[float] = []

    def converged(self, right: Floats, left: Floats) -> bool:
        """Whether both planes are invariant."""
        self.residuals.append(max(_residual(self.matrix, right), _residual(self.transposed, left)))
        return self.residuals[-1] < self.level

    @property
    def promising(self) -> bool:
        """Whether rounding may be reached within so many steps, at the pace of the last `PACE`."""
        left = self.most - len(self.residuals)
        if len(self.residuals) <= min(2 * PACE, self.most // 2):
            return True
        last, before = self.residuals[-1], self.residuals[-1 - PACE]
        return left > 0 and last * (last / before) ** (left / PACE) < self.level


def _residual(matrix: csr_array, basis: Floats) -> float:
    return float(np.linalg.norm(_image_beyond(matrix, basis)))


def _image_beyond(matrix: csr_array, basis: Floats) -> Floats:
    """A V - V (V^T A V)."""
    image = matrix @ basis
    return np.asarray(image - basis @ (basis.T @ image))


class Inverse(Protocol):
    """The inverse of A - sigma, or of its like."""

    def solve(self, vectors: Any, transposed: bool) -> Any:
        """Its product with vectors, or that of its transpose."""

    def step(self, matrix: csr_array, basis: Floats, transposed: bool) -> Floats:
        """A step of inverse iteration for an operator, or for the transpose that is handed over."""


@dataclass(frozen=True, eq=False)
class DenseInverse:
    """By LAPACK, accurate."""

    factors: tuple[Floats, Floats]

    def solve(self, vectors: Any, transposed: bool) -> Any:
        return lu_solve(self.factors, vectors, trans=int(transposed), check_finite=False)

    def step(self, matrix: csr_array, basis: Floats, transposed: bool) -> Floats:
        return np.asarray(self.solve(basis, transposed))


@dataclass(frozen=True, eq=False)
class SparseInverse:
    """By SuperLU without pivoting: of another operator, or inaccurate, which residuals make up for."""

    factors: SuperLU

    def solve(self, vectors: Any, transposed: bool) -> Any:
        return self.factors.solve(np.ascontiguousarray(vectors), trans="T" if transposed else "N")

    def step(self, matrix: csr_array, basis: Floats, transposed: bool) -> Floats:
        return basis - np.asarray(self.solve(_image_beyond(matrix, basis), transposed))


def _inverse(matrix: csr_array, shift: complex) -> Inverse | None:
    """That of A - shift; None if it is singular."""
    size = matrix.shape[0]
    shifted = csc_array(matrix - shift * eye_array(size))
    if size > DENSE:
        try:
            return SparseInverse(symmetric_lu(shifted))
        except RuntimeError:
            return None
    factors = lu_factor(shifted.toarray(), check_finite=False)
    return DenseInverse(factors) if np.all(np.diag(factors[0])) else None
