r"""One pair of eigenvalues, found and followed from operator to operator without the others.

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

**Projection.** Which pair of thousands will meet first? With the eigenvectors X of the symmetric part of A at one
load, :math:`H(F) = X^T A(F) X` is nearly diagonal at the loads about it: the antisymmetric part is small and
modes mix with their neighbours only. A cluster of neighbours, a diagonal block of H with the contributions of all
other modes k in second order,

.. math::

    H_{ij} + \tfrac12 \sum_k H_{ik} H_{kj} \left(\frac1{H_{ii} - H_{kk}} + \frac1{H_{jj} - H_{kk}}\right) ,

has the eigenvalues of A up to the third order of the typical coupling h over the distance of the modes outside. X is
computed once and serves for as long as h is small against the spacing of the levels. Clusters say where to look;
what is found there has yet to be confirmed by continuation with A itself.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, lu_factor, lu_solve
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import splu

from .packing import Floats, Indices

STEPS = 40
"""Inverse iterations before a continuation is given up: a solve costs a hundredth of a decomposition."""

RESIDUAL = 100.0
"""Residuals of accepted bases, in units of u |A|_F; LAPACK's own are of some 10."""

DENSE = 600
"""Operators up to this size are factorised as dense matrices, which is faster there than a sparse factorisation."""


CORE, MARGIN = 20, 20
"""Modes of a cluster that are its own, and further ones on either side that are coupled to these in all orders."""

CHUNK = 512
"""Columns that are projected at a time, for memory."""

MIXING = 0.1
"""Typical coupling within clusters, in level spacings, up to which a projection is used: with the modes outside at
least MARGIN spacings away, (MIXING / MARGIN)^2 = 2.5e-5 of the coupling is what the second order leaves out."""


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
    right, left : ndarray, shape (n, 2)
        Orthonormal bases V and U.
    """

    mean: float
    discriminant: float
    overlap: float
    spread: float
    right: Floats
    left: Floats

    @classmethod
    def of(cls, matrix: csr_array, right: Floats, left: Floats) -> "Block":
        """The block of an operator on orthonormal bases of a right and a left invariant subspace."""
        metric = left.T @ right
        b = np.linalg.solve(metric, left.T @ (matrix @ right))
        mean = 0.5 * (b[0, 0] + b[1, 1])
        return cls(
            mean=float(mean),
            discriminant=float((b[0, 0] - b[1, 1]) ** 2 + 4 * b[0, 1] * b[1, 0]),
            overlap=_overlap(b, metric),
            spread=float(np.linalg.norm(b - mean * np.eye(2))),
            right=right,
            left=left,
        )

    def same_plane(self, other: "Block") -> bool:
        """Whether both planes are the same rather than not: all principal angles below 60 degrees."""
        right = np.linalg.svd(self.right.T @ other.right, compute_uv=False)
        left = np.linalg.svd(self.left.T @ other.left, compute_uv=False)
        return bool(min(right[-1], left[-1]) > 0.5)


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
    v, u = block.right, block.left
    shift = float(np.sum(u * (matrix @ v @ np.linalg.inv(u.T @ v)))) / 2 + max(
        block.spread, 1e3 * np.finfo(np.float64).eps * abs(block.mean)
    )
    solve = _shifted_solver(matrix, shift)
    if solve is None:
        return None
    level = RESIDUAL * 0.5 * np.finfo(np.float64).eps * float(np.linalg.norm(matrix.data))
    transposed = matrix.T
    for _ in range(STEPS):
        v, u = np.linalg.qr(solve(v, False))[0], np.linalg.qr(solve(u, True))[0]
        if max(_residual(matrix, v), _residual(transposed, u)) < level:
            found = Block.of(matrix, v, u)
            return found if found.same_plane(block) else None
    return None


def _residual(matrix: csr_array, basis: Floats) -> float:
    image = matrix @ basis
    return float(np.linalg.norm(image - basis @ (basis.T @ image)))


def _shifted_solver(matrix: csr_array, shift: float) -> Callable[[Floats, bool], Floats] | None:
    """(right-hand sides, transposed) -> solutions of A - shift; None if that is singular."""
    size = matrix.shape[0]
    shifted = csc_array(matrix - shift * eye_array(size))
    if size <= DENSE:
        factors = lu_factor(shifted.toarray(), check_finite=False)
        if not np.all(np.diag(factors[0])):
            return None
        return lambda b, transposed: lu_solve(factors, b, trans=int(transposed), check_finite=False)
    try:
        sparse = splu(shifted)
    except RuntimeError:
        return None
    return lambda b, transposed: sparse.solve(np.ascontiguousarray(b), trans="T" if transposed else "N")


@dataclass(frozen=True, eq=False)
class Cluster:
    """Neighbouring modes of a projection.

    Attributes
    ----------
    modes : slice
        Which modes, by increasing eigenvalue, margins included.
    core : tuple of int
        The first and the last mode, counted within the cluster, that no other cluster owns.
    """

    modes: slice
    core: tuple[int, int]

    def owns(self, vectors: Floats) -> bool:
        """Whether the plane of orthonormal vectors, in cluster coordinates, has its weight in the core."""
        weight = np.sum(vectors**2, axis=1)
        centre = float(weight @ np.arange(len(weight)) / weight.sum())
        # One mode more: planes differ a little from cluster to cluster, and twice is better than not at all.
        return self.core[0] - 1.0 <= centre <= self.core[1] + 1.0


@dataclass(frozen=True, eq=False)
class Projection:
    """The eigenvectors of the symmetric part of an operator, as a basis for its neighbours.

    Attributes
    ----------
    size : int
        Coordinates of the operator.
    active : ndarray of int, shape (E,)
        Those whose rows are not zero.
    values : ndarray, shape (E,)
        Eigenvalues of the symmetric part, increasing; 1 / time^2.
    basis : ndarray, shape (E, E)
        Orthonormal eigenvectors in columns.
    """

    size: int
    active: Indices
    values: Floats
    basis: Floats

    @classmethod
    def of(cls, matrix: csr_array) -> "Projection":
        """The dense eigenproblem of the symmetric part: the one expensive step, some 10 E^3 operations."""
        active = np.flatnonzero(np.diff(matrix.indptr))
        dense = matrix[active][:, active].toarray()
        dense += dense.T.copy()
        dense *= 0.5
        # MRRR needs half the memory of divide and conquer, 16 E^2 bytes.
        values, basis = eigh(dense, driver="evr", overwrite_a=True, check_finite=False)
        return cls(matrix.shape[0], active, values, basis)

    @property
    def clusters(self) -> list[Cluster]:
        """Overlapping clusters whose cores cover all modes."""
        count = len(self.values)
        found = []
        for first in range(0, count, CORE):
            start, stop = max(0, first - MARGIN), min(count, first + CORE + MARGIN)
            found.append(Cluster(slice(start, stop), (first - start, min(first + CORE, count) - 1 - start)))
        return found

    def onto(self, matrix: csr_array) -> list[Floats]:
        """Every cluster of an operator, with the second order of the modes outside; 1 / time^2."""
        inner = matrix[self.active][:, self.active]
        coupling, diagonal = self._couplings(inner)
        clusters = []
        for cluster in self.clusters:
            part = self.basis[:, cluster.modes]
            levels = diagonal[cluster.modes]
            # Modes of the margin may lie close to modes outside: what these do is right for the core.
            core = np.sort(levels[cluster.core[0] : cluster.core[1] + 1])
            distance = np.clip(levels, core[0], core[-1])[:, None] - diagonal
            weight = np.divide(1.0, distance, out=np.zeros_like(distance), where=distance != 0)
            weight[:, cluster.modes] = 0.0
            rows, columns = coupling[cluster.modes], coupling[:, cluster.modes]
            second = 0.5 * ((rows * weight) @ columns + rows @ (columns * weight.T))
            clusters.append(part.T @ (inner @ part) + second)
        return clusters

    def _couplings(self, inner: csr_array) -> tuple[NDArray[np.float32], Floats]:
        """X^T A X - Lambda in single precision, which is plenty for a correction, and the diagonal of X^T A X."""
        count = len(self.values)
        basis = self.basis.astype(np.float32)
        coupling = np.empty((count, count), dtype=np.float32)
        diagonal = np.empty(count)
        for start in range(0, count, CHUNK):
            part = self.basis[:, start : start + CHUNK]
            image = inner @ part - part * self.values[start : start + CHUNK]
            diagonal[start : start + CHUNK] = np.sum(part * image, axis=0)
            coupling[:, start : start + CHUNK] = basis.T @ image.astype(np.float32)
        return coupling, self.values + diagonal

    def lifted(self, cluster: Cluster, vectors: Floats) -> Floats:
        """Vectors in the coordinates of a cluster as vectors in those of the operator, shape (size, k)."""
        full = np.zeros((self.size, vectors.shape[1]))
        full[self.active] = self.basis[:, cluster.modes] @ vectors
        return full

    def fits(self, matrix: csr_array, blocks: list[Floats]) -> bool:
        """Whether the projection is good enough for an operator with these cluster blocks."""
        if not np.array_equal(np.flatnonzero(np.diff(matrix.indptr)), self.active):
            return False
        mixing = []
        for cluster, block in zip(self.clusters, blocks, strict=True):
            levels = self.values[cluster.modes]
            off_diagonal = block - np.diag(np.diag(block))
            width = max(levels[-1] - levels[0], np.finfo(np.float64).tiny)
            mixing.append(np.linalg.norm(off_diagonal) / width)
        # |off-diagonal|_F over the width of the cluster is the typical coupling over the spacing.
        return bool(np.median(mixing) < MIXING)
