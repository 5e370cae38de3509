"""An eigenbasis of the symmetric part of the operator, all of it at once or a slice of the spectrum after the other.

In the eigenvectors X of the symmetric part of A at one load, H(F) = X^T A(F) X is nearly diagonal at the loads about
it: the antisymmetric part is small, and the modes turn little. X is computed once and serves as long as the couplings
are small against the spacing of the levels.

Perturbation theory (:mod:`~faultgouge.analysis.onset.screening`) asks for a mode and its neighbours in the spectrum
alone. So a large operator has a basis for each slice of its spectrum (:mod:`~faultgouge.analysis.onset.slicing`), with
a margin on either side, and never one of all modes. A *cluster* of neighbouring modes, with all others in second order,
has the eigenvalues of A up to the third order of the typical coupling over the distance of the modes outside.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csc_array, csr_array

from ..packing import Floats, Indices
from .limits import LIMITS, Limits
from .ranks import Ranks


@dataclass(frozen=True, eq=False)
class Cluster:
    """Neighbouring modes of a basis.

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
class Levels:
    """An operator in an eigenbasis.

    Attributes
    ----------
    diagonal : ndarray, shape (E,)
        H_ii, 1 / time^2.
    coupling : ndarray of float32, shape (E, E)
        H_ij, with a zero diagonal: single precision is plenty for what is compared with distances of levels.
    """

    diagonal: Floats
    coupling: NDArray[np.float32]

    def block(self, cluster: Cluster) -> Floats:
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
class Basis:
    """Eigenvectors of the symmetric part of an operator, all or neighbouring ones.

    Attributes
    ----------
    size : int
        Coordinates of the operator.
    active : ndarray of int, shape (E,)
        Those whose rows are not zero.
    values : ndarray, shape (M,)
        Eigenvalues of the symmetric part, increasing; 1 / time^2.
    vectors : ndarray, shape (E, M)
        Orthonormal eigenvectors in columns.
    own : slice
        The modes that belong to this basis, and to that of no other slice; the rest are margins.
    limits : Limits
    """

    size: int
    active: Indices = field(repr=False)
    values: Floats = field(repr=False)
    vectors: Floats = field(repr=False)
    own: slice
    limits: Limits = field(default=LIMITS, repr=False)

    @classmethod
    def of(cls, matrix: csr_array, limits: Limits = LIMITS) -> "Basis":
        """All modes, by LAPACK: the one expensive step, some 10 E^3 operations."""
        active = np.flatnonzero(np.diff(matrix.indptr))
        dense = matrix[active][:, active].toarray()
        dense += dense.T.copy()
        dense *= 0.5
        values, vectors = eigh(dense, driver="evd", overwrite_a=True, check_finite=False)
        return cls(matrix.shape[0], active, values, vectors, slice(0, len(values)), limits)

    @classmethod
    def slices(cls, matrix: csr_array, modes: tuple[int, int], limits: Limits, ranks: Ranks) -> "Iterator[Basis]":
        """This rank's bases; the own modes of those of all ranks are those of these numbers.

        A small operator has one, which the first rank makes.

        Parameters
        ----------
        matrix : scipy.sparse.csr_array, shape (n, n)
            The operator, 1 / time^2.
        modes : tuple of (int, int)
            Numbers of the first mode that is wanted and of the first that is not, the lowest being 0.
        limits : Limits
        ranks : Ranks
            Who shares the slices. All of them must come to the end of their bases.
        """
        active = np.flatnonzero(np.diff(matrix.indptr))
        if len(active) <= limits.one_basis:
            if ranks.rank == 0:
                yield replace(cls.of(matrix, limits), own=slice(*modes))
            return
        from .slicing import slices  # with libraries that nothing else needs

        inner = matrix[active][:, active]
        symmetric, margin = csc_array(0.5 * (inner + inner.T)), limits.margin + limits.beyond
        for part in slices(symmetric, margin, modes, limits, ranks=ranks):
            yield cls(matrix.shape[0], active, part.values, part.vectors, part.own, limits)

    @property
    def clusters(self) -> list[Cluster]:
        """Overlapping clusters whose cores cover all modes of its own."""
        core, margin, found = self.limits.core, self.limits.margin, []
        for first in range(self.own.start, self.own.stop, core):
            start, stop = max(0, first - margin), min(len(self.values), first + core + margin)
            found.append(Cluster(slice(start, stop), (first - start, min(first + core, self.own.stop) - 1 - start)))
        return found

    def covers(self, matrix: csr_array) -> bool:
        """Whether an operator acts on the same coordinates."""
        return np.array_equal(np.flatnonzero(np.diff(matrix.indptr)), self.active)

    def levels(self, matrix: csr_array) -> Levels:
        """X^T A X of an operator on the same coordinates."""
        inner, count, chunk = matrix[self.active][:, self.active], len(self.values), self.limits.chunk
        coupling = np.empty((count, count), dtype=np.float32)
        diagonal = np.empty(count)
        for start in range(0, count, chunk):
            columns = slice(start, start + chunk)
            image = inner @ self.vectors[:, columns] - self.vectors[:, columns] * self.values[columns]
            diagonal[columns] = np.sum(self.vectors[:, columns] * image, axis=0)
            coupling[:, columns] = self._rough.T @ image.astype(np.float32)
        np.fill_diagonal(coupling, 0.0)
        return Levels(self.values + diagonal, coupling)

    def change(self, levels: Levels, change: csr_array) -> Levels:
        """Levels of an operator that differs a little from one whose levels are known, in single precision."""
        inner = change[self.active][:, self.active].astype(np.float32)
        coupling = self._rough.T @ (inner @ self._rough)
        diagonal = levels.diagonal + np.diag(coupling)
        np.fill_diagonal(coupling, 0.0)
        coupling += levels.coupling
        return Levels(diagonal, coupling)

    @cached_property
    def _rough(self) -> NDArray[np.float32]:
        """The vectors in single precision."""
        return self.vectors.astype(np.float32)

    def mixing(self, levels: Levels) -> list[float]:
        """The typical coupling over the spacing in each cluster: |off-diagonal|_F over the cluster's width."""
        found = []
        for cluster in self.clusters:
            block = levels.block(cluster)
            width = max(np.ptp(self.values[cluster.modes]), np.finfo(np.float64).tiny)
            found.append(float(np.linalg.norm(block - np.diag(np.diag(block))) / width))
        return found

    def lifted(self, modes: slice | Indices, vectors: Floats | None = None) -> Floats:
        """Modes of the basis, or combinations of them in columns, as vectors in the coordinates of the operator."""
        full = np.zeros((self.size, 2))
        full[self.active] = self.vectors[:, modes] if vectors is None else self.vectors[:, modes] @ vectors
        return full
