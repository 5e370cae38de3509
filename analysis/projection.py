r"""The operator in a fixed basis in which it is nearly diagonal: it tells where to look for pairs that meet.

With the eigenvectors X of the symmetric part of A at one load, :math:`H(F) = X^T A(F) X` is nearly diagonal at the
loads about it: the antisymmetric part is small, and the modes turn little. X is computed once and serves for as long as
the couplings are small against the spacing of the levels.

**Clusters.** Which pair of thousands will meet first? A cluster of neighbours, a diagonal block of H with the
contributions of all other modes k in second order,

.. math::

    H_{ij} + \tfrac12 \sum_k H_{ik} H_{kj} \left(\frac1{H_{ii} - H_{kk}} + \frac1{H_{jj} - H_{kk}}\right) ,

has the eigenvalues of A up to the third order of the typical coupling over the distance of the modes outside. Clusters
say where to look; what is found there has yet to be confirmed with A itself.

**Parts.** Neighbours are all that a cluster needs. A large operator is projected onto one slice of its spectrum after
the other (:mod:`~faultgouge.analysis.slices`), with a margin on either side, and never onto all.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csc_array, csr_array

from .packing import Floats, Indices

CORE, MARGIN = 20, 20
"""Modes of a cluster that are its own, and further ones on either side that are coupled to these in all orders."""

BEYOND = 10
"""Modes of a part on either side beyond those of its clusters. They count in second order, as those of `MARGIN` do in
all orders. What is farther away changes levels by less than (coupling / spacing)^2 / 30 of their spacing."""

SMALL = 1000
"""Coordinates up to which all modes are one part, from a dense decomposition: less than a second there."""

CHUNK = 512
"""Columns that are projected at a time, for memory."""

MIXING = 0.1
"""Typical coupling within clusters, in level spacings, up to which a projection is used: with the modes outside at
least MARGIN spacings away, (MIXING / MARGIN)^2 = 2.5e-5 of the coupling is what the second order leaves out."""


@dataclass(frozen=True, eq=False)
class Levels:
    """An operator in the basis of a projection.

    Attributes
    ----------
    diagonal : ndarray, shape (E,)
        H_ii, 1 / time^2.
    coupling : ndarray of float32, shape (E, E)
        H_ij, with a zero diagonal: single precision is plenty for what is compared with distances of levels.
    """

    diagonal: Floats
    coupling: NDArray[np.float32]

    def block(self, cluster: "Cluster") -> Floats:
        """The operator in a cluster, with the second order of the modes outside; 1 / time^2."""
        diagonal = self.diagonal[cluster.modes]
        # Modes of the margin may lie close to modes outside: what these do is right for the core.
        core = np.sort(diagonal[cluster.core[0] : cluster.core[1] + 1])
        distance = np.clip(diagonal, core[0], core[-1])[:, None] - self.diagonal
        weight = np.divide(1.0, distance, out=np.zeros_like(distance), where=distance != 0)
        weight[:, cluster.modes] = 0.0
        rows, columns = self.coupling[cluster.modes], self.coupling[:, cluster.modes]
        second = 0.5 * ((rows * weight) @ columns + rows @ (columns * weight.T))
        return np.diag(diagonal) + self.coupling[cluster.modes, cluster.modes] + second

    def beyond(self, there: "Levels", share: float) -> "Levels":
        """The levels at a share of the way to others and on, beyond 1, along a straight line."""
        return Levels(
            (1 - share) * self.diagonal + share * there.diagonal,
            np.float32(1 - share) * self.coupling + np.float32(share) * there.coupling,
        )

    @cached_property
    def largest(self) -> NDArray[np.float32]:
        """The larger of |H_ij| and |H_ji|, shape (E, E)."""
        magnitude = np.abs(self.coupling)
        return np.maximum(magnitude, magnitude.T)

    @cached_property
    def distance(self) -> NDArray[np.float32]:
        """H_ii - H_jj, shape (E, E); rounded after it is taken."""
        return np.subtract.outer(self.diagonal, self.diagonal).astype(np.float32)


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
    """Eigenvectors of the symmetric part of an operator, all or neighbouring ones, as a basis for its neighbours.

    Attributes
    ----------
    size : int
        Coordinates of the operator.
    active : ndarray of int, shape (E,)
        Those whose rows are not zero.
    values : ndarray, shape (M,)
        Eigenvalues of the symmetric part, increasing; 1 / time^2.
    basis : ndarray, shape (E, M)
        Orthonormal eigenvectors in columns.
    own : slice
        The modes that belong to this projection, and to no other part; the rest are margins.
    """

    size: int
    active: Indices
    values: Floats
    basis: Floats
    own: slice

    @classmethod
    def of(cls, matrix: csr_array) -> "Projection":
        """The dense eigenproblem of the symmetric part: the one expensive step, some 10 E^3 operations."""
        active = np.flatnonzero(np.diff(matrix.indptr))
        dense = matrix[active][:, active].toarray()
        dense += dense.T.copy()
        dense *= 0.5
        values, basis = eigh(dense, driver="evd", overwrite_a=True, check_finite=False)
        return cls(matrix.shape[0], active, values, basis, slice(0, len(values)))

    @classmethod
    def parts(cls, matrix: csr_array, workers: int, modes: tuple[int, int]) -> "Iterator[Projection]":
        """Projections whose own modes are, together, these of the symmetric part.

        Parameters
        ----------
        matrix : scipy.sparse.csr_array, shape (n, n)
            The operator, 1 / time^2.
        workers : int
            Threads.
        modes : tuple of (int, int)
            Numbers of the first mode that is wanted and of the first that is not, the lowest being 0.
        """
        active = np.flatnonzero(np.diff(matrix.indptr))
        if len(active) <= SMALL:
            yield replace(cls.of(matrix), own=slice(*modes))
            return
        from .slices import slices  # with libraries that nothing else needs

        inner = matrix[active][:, active]
        for part in slices(csc_array(0.5 * (inner + inner.T)), MARGIN + BEYOND, workers, modes):
            yield cls(matrix.shape[0], active, part.values, part.vectors, part.own)

    @staticmethod
    def width(modes: int) -> int:
        """Modes of the parts that share so many among them, margins included."""
        from .slices import OWN

        return modes + 2 * (MARGIN + BEYOND) * max(1, round(modes / OWN))

    @property
    def clusters(self) -> list[Cluster]:
        """Overlapping clusters whose cores cover all modes of its own."""
        count = len(self.values)
        found = []
        for first in range(self.own.start, self.own.stop, CORE):
            start, stop = max(0, first - MARGIN), min(count, first + CORE + MARGIN)
            found.append(Cluster(slice(start, stop), (first - start, min(first + CORE, self.own.stop) - 1 - start)))
        return found

    def blocks(self, levels: Levels) -> list[Floats]:
        """Every cluster of an operator; 1 / time^2."""
        return [levels.block(cluster) for cluster in self.clusters]

    def covers(self, matrix: csr_array) -> bool:
        """Whether an operator acts on the same coordinates."""
        return np.array_equal(np.flatnonzero(np.diff(matrix.indptr)), self.active)

    def levels(self, matrix: csr_array) -> Levels:
        """X^T A X of an operator on the same coordinates."""
        return self._levels(matrix[self.active][:, self.active])

    @cached_property
    def rough_basis(self) -> NDArray[np.float32]:
        """The basis in single precision, shape (E, E)."""
        return self.basis.astype(np.float32)

    def change(self, levels: Levels, change: csr_array) -> Levels:
        """Levels of an operator that differs a little from one whose levels are known, in single precision."""
        inner = change[self.active][:, self.active].astype(np.float32)
        coupling = self.rough_basis.T @ (inner @ self.rough_basis)
        diagonal = levels.diagonal + np.diag(coupling)
        np.fill_diagonal(coupling, 0.0)
        coupling += levels.coupling
        return Levels(diagonal, coupling)

    def _levels(self, inner: csr_array) -> Levels:
        count = len(self.values)
        coupling = np.empty((count, count), dtype=np.float32)
        diagonal = np.empty(count)
        for start in range(0, count, CHUNK):
            part = self.basis[:, start : start + CHUNK]
            image = inner @ part - part * self.values[start : start + CHUNK]
            diagonal[start : start + CHUNK] = np.sum(part * image, axis=0)
            coupling[:, start : start + CHUNK] = self.rough_basis.T @ image.astype(np.float32)
        np.fill_diagonal(coupling, 0.0)
        return Levels(self.values + diagonal, coupling)

    def plane(self, pair: Indices) -> Floats:
        """Two modes in the coordinates of the operator, shape (size, 2)."""
        full = np.zeros((self.size, 2))
        full[self.active] = self.basis[:, pair]
        return full

    def lifted(self, cluster: Cluster, vectors: Floats) -> Floats:
        """Vectors in the coordinates of a cluster as vectors in those of the operator, shape (size, k)."""
        full = np.zeros((self.size, vectors.shape[1]))
        full[self.active] = self.basis[:, cluster.modes] @ vectors
        return full

    def mixing(self, blocks: list[Floats]) -> list[float]:
        """The typical coupling over the spacing in each cluster: |off-diagonal|_F over the cluster's width."""
        found = []
        for cluster, block in zip(self.clusters, blocks, strict=True):
            levels = self.values[cluster.modes]
            off_diagonal = block - np.diag(np.diag(block))
            width = max(levels[-1] - levels[0], np.finfo(np.float64).tiny)
            found.append(float(np.linalg.norm(off_diagonal) / width))
        return found
