"""An eigenbasis of the symmetric part of the operator, all of it at once or a slice of the spectrum after the other.

In the eigenvectors X of the symmetric part of A at one load, H(F) = X^T A(F) X is nearly diagonal at the loads about
it. X is computed once and serves as long as the couplings are small against the spacing of the levels. A large operator
has a basis for each slice of its spectrum (:mod:`~faultgouge.analysis.windows.slices.lanczos`), with a margin on either
side, and never one of all modes. A *cluster* of neighbouring modes, with all others in second order, has the
eigenvalues of A up to the third order of the typical coupling over the distance of the modes outside.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csc_array, csr_array

from ...arrays import Floats, Indices
from ...factors.lanczos import Slice
from ...motion.eigenvalues import active_coordinates
from ..limits import LIMITS, Limits
from .ranks import Ranks
from .store import NEW_PASS, SlicePass


@dataclass(frozen=True, eq=False)
class ModeCluster:
    """Neighbouring modes of a basis, margins included; no other cluster owns the first to the last mode of its core.

    `modes` are counted within the basis, `core` within the cluster.
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
    """An operator in an eigenbasis: H_ii, shape (E,), and H_ij, shape (E, E), with a zero diagonal; 1 / time^2.

    Couplings are compared with distances of levels: single precision is plenty.
    """

    diagonal: Floats
    coupling: NDArray[np.float32]

    def block(self, cluster: ModeCluster) -> Floats:
        """The operator in a cluster, with the second order of the modes outside; 1 / time^2."""
        diagonal = self.diagonal[cluster.modes]
        # Modes of the margin may lie close to modes outside, whose effect is right for the core.
        core = np.sort(diagonal[cluster.core[0] : cluster.core[1] + 1])
        distance = np.clip(diagonal, core[0], core[-1])[:, None] - self.diagonal
        weight = np.divide(1.0, distance, out=np.zeros_like(distance), where=distance != 0)
        weight[:, cluster.modes] = 0.0
        rows, columns = self.coupling[cluster.modes], self.coupling[:, cluster.modes]
        second = 0.5 * ((rows * weight) @ columns + rows @ (columns * weight.T))
        return np.diag(diagonal) + self.coupling[cluster.modes, cluster.modes] + second

    def beyond(self, there: "Levels", share: float) -> "Levels":
        """The levels at a share, which may exceed 1, of the straight line to others."""
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
class Basis(Slice):
    """Eigenvectors of the symmetric part of an operator, 1 / time^2, with `size` coordinates: a slice, or all of them.

    `active`, shape (E,), are the coordinates whose rows are not zero.
    """

    size: int
    active: Indices = field(repr=False)
    limits: Limits = field(default=LIMITS, repr=False)

    @classmethod
    def of(cls, matrix: csr_array, limits: Limits = LIMITS) -> "Basis":
        """The basis of all modes, by LAPACK: the only expensive step, some 10 E^3 operations."""
        active = active_coordinates(matrix)
        dense = matrix[active][:, active].toarray()
        dense += dense.T.copy()
        dense *= 0.5
        values, vectors = eigh(dense, driver="evd", overwrite_a=True, check_finite=False)
        return cls(0, values, vectors, slice(0, len(values)), matrix.shape[0], active, limits)

    @property
    def clusters(self) -> list[ModeCluster]:
        """Overlapping clusters whose cores cover all modes of its own."""
        core, margin, found = self.limits.core, self.limits.margin, []
        for first in range(self.own.start, self.own.stop, core):
            start, stop = max(0, first - margin), min(len(self.values), first + core + margin)
            found.append(ModeCluster(slice(start, stop), (first - start, min(first + core, self.own.stop) - 1 - start)))
        return found

    def covers(self, matrix: csr_array) -> bool:
        """Whether an operator acts on the same coordinates."""
        return np.array_equal(active_coordinates(matrix), self.active)

    def levels(self, matrix: csr_array) -> Levels:
        """X^T A X of an operator on the same coordinates."""
        inner, count = matrix[self.active][:, self.active], len(self.values)
        coupling, diagonal = np.zeros((count, count), dtype=np.float32), np.zeros(count)
        for rows in self.limits.chunks(len(self.active)):
            image = inner[rows] @ self.vectors - self.vectors[rows] * self.values
            diagonal += np.einsum("ij,ij->j", self.vectors[rows], image)
            coupling += self._rough[rows].T @ image.astype(np.float32)
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
        """The typical coupling over the spacing in each cluster, of the symmetric part: a new basis has none."""
        symmetric = 0.5 * (levels.coupling + levels.coupling.T)
        blocks = ((symmetric[each.modes, each.modes], self.values[each.modes]) for each in self.clusters)
        return [width_and_mixing(block, values)[1] for block, values in blocks]

    def lift(self, modes: slice | Indices | list[int], vectors: Floats | None = None) -> Floats:
        """Modes of the basis, or combinations of them in columns, as vectors in the coordinates of the operator."""
        inner = self.vectors[:, modes] if vectors is None else self.vectors[:, modes] @ vectors
        full = np.zeros((self.size, inner.shape[1]))
        full[self.active] = inner
        return full


def width_and_mixing(block: Floats, levels: Floats) -> tuple[float, float]:
    """Width of the levels of a cluster, 1 / time^2, and |off-diagonal|_F over that, the typical coupling."""
    width = max(float(np.ptp(levels)), np.finfo(np.float64).tiny)
    return width, float(np.linalg.norm(block - np.diag(np.diag(block)))) / width


class Bases:
    """The bases of this rank along the ramp; with enough memory they are kept as long as they serve.

    `modes` are the numbers of the first mode that is looked at and of the first that is not, None for all. The ranks
    share the slices; all of them must come to the end of their bases.
    """

    def __init__(self, modes: tuple[int, int] | None, ranks: Ranks, limits: Limits = LIMITS) -> None:
        self.modes, self.ranks, self.limits = modes, ranks, limits
        self._kept: list[Basis] = []

    def narrow(self, modes: tuple[int, int]) -> None:
        """Look at these modes from here on; the same on all ranks."""
        if self.modes is None or not self.modes[0] <= modes[0] < modes[1] <= self.modes[1]:
            self._kept = []
        self._kept = [
            each for each in self._kept if each.border.modes[0] < modes[1] and each.border.modes[1] > modes[0]
        ]
        self.modes = modes

    def range(self, matrix: csr_array) -> tuple[int, int]:
        """Numbers of the first mode that is looked at and of the first that is not; ValueError if there are none."""
        count = len(active_coordinates(matrix))
        first, stop = self.modes or (0, count)
        if not 0 <= first < min(stop, count):
            raise ValueError(f"modes {first}:{stop} is no part of the {count} modes of this packing, 0:{count}")
        return first, min(stop, count)

    def keeps(self, matrix: csr_array) -> bool:
        """Whether there is memory for the bases of all modes that are looked at."""
        first, stop = self.range(matrix)
        limits = self.limits
        margins = 2 * (limits.margin + limits.modes_beyond) * max(1, round((stop - first) / limits.slice_size))
        return (stop - first + margins) * matrix.shape[0] <= limits.largest_basis

    def at(self, matrix: csr_array, stored: SlicePass = NEW_PASS) -> Iterable[tuple[Basis, Levels]]:
        """The bases and the operator in them; bases of an earlier load as long as the bases of all ranks serve.

        If bases are not kept in memory, the slices that are stored already are left out.
        """
        serving = self._usable_bases(matrix)
        if serving is not None:
            return serving
        bases: Iterable[Basis] = self._make_bases(matrix, stored)
        if self.keeps(matrix):
            self._kept = []  # its memory is free before that for the next ones is taken
            bases = self._kept = list(bases)
        return ((basis, basis.levels(matrix)) for basis in bases)

    def _usable_bases(self, matrix: csr_array) -> list[tuple[Basis, Levels]] | None:
        """The stored bases, and the operator in them; None if the bases of some rank do not serve."""
        covering = all(basis.covers(matrix) for basis in self._kept)
        kept = [(basis, basis.levels(matrix)) for basis in self._kept if covering]
        mine = [each for basis, levels in kept for each in basis.mixing(levels)] if covering else [np.inf]
        mixing = [each for one in self.ranks.together(lambda: mine) for each in one]
        return kept if mixing and max(mixing) < np.inf and np.median(mixing) < self.limits.mixing else None

    def _make_bases(self, matrix: csr_array, stored: SlicePass) -> Iterator[Basis]:
        """The bases of slices of the spectrum; a small operator has one, which the first rank makes."""
        limits, active = self.limits, active_coordinates(matrix)
        if len(active) <= limits.one_basis:
            if self.ranks.rank == 0 and not stored.found:
                yield replace(Basis.of(matrix, limits), own=slice(*self.range(matrix)))
            return
        from .slices import slices  # with libraries that nothing else needs

        inner = matrix[active][:, active]
        symmetric, margin = csc_array(0.5 * (inner + inner.T)), limits.margin + limits.modes_beyond
        for part in slices(symmetric, margin, self.range(matrix), limits, ranks=self.ranks, stored=stored):
            yield Basis(part.first, part.values, part.vectors, part.own, matrix.shape[0], active, limits)
