r"""The operator in a fixed basis in which it is nearly diagonal: where to look for pairs that meet.

With the eigenvectors X of the symmetric part of A at one load, :math:`H(F) = X^T A(F) X` is nearly diagonal at the
loads about it: the antisymmetric part is small, and the modes turn little. X is computed once and serves for as long as
the couplings are small against the spacing of the levels.

**Meetings.** Which of all pairs can meet between two loads? Modes i and j have a 2 x 2 block, to second order in the
couplings to all other modes k

.. math::

    B_{ij} = H_{ij} + \tfrac12 \sum_{k \ne i, j} H_{ik} H_{kj}
             \left(\frac1{H_{ii} - H_{kk}} + \frac1{H_{jj} - H_{kk}}\right) ,

up to a third order that is bounded term by term, whatever the signs, by

.. math::

    R_{ij} = \sum_{k \ne i, j} \frac{|H_{ik}|}{|H_{ii} - H_{kk}|} S_{kj} , \qquad
    S_{kj} = \sum_l \frac{|H_{kl}|}{|H_{kk} - H_{ll}|} |H_{lj}| .

With the symmetric part s and the antisymmetric part w of its off-diagonal elements the discriminant is
:math:`(B_{ii} - B_{jj})^2 + 4 (s^2 - w^2)`. It is positive, and the two do not meet, if

.. math::

    |B_{ii} - B_{jj}| - R_{ii} - R_{jj} > 2 \sqrt{(|w| + R_{ij})^2 - (|s| - R_{ij})^2} ,

without the last square where :math:`|s| < R_{ij}`, and without the root where it is of a negative number. Denominators
are taken no smaller than twice the coupling: where they would be, that pair does not pass the test itself. Between the
loads, H and B are taken to stay within `SLACK` of the straight line. On most increments every pair passes, and nothing
needs to be decomposed.

**Clusters.** Which pair of thousands will meet first? A cluster of neighbours, a diagonal block of H with the
contributions of all other modes in second order, as B above, has the eigenvalues of A up to the third order of the
typical coupling over the distance of the modes outside. Clusters say where to look; what is found there has yet to be
confirmed with A itself.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_array

from .packing import Floats, Indices

CORE, MARGIN = 20, 20
"""Modes of a cluster that are its own, and further ones on either side that are coupled to these in all orders."""

SMALL = 2000
"""Coordinates up to which memory is no matter: 32 E^2 bytes are 128 MB."""

CHUNK = 512
"""Columns that are projected at a time, for memory."""

MIXING = 0.1
"""Typical coupling within clusters, in level spacings, up to which a projection is used: with the modes outside at
least MARGIN spacings away, (MIXING / MARGIN)^2 = 2.5e-5 of the coupling is what the second order leaves out."""


SLACK = 0.25
"""How far levels and couplings may leave the straight line between two loads, in units of their change: twice as far as
those whose slope doubles over the increment."""


FEW = 3
"""Pairs that are examined one by one; where more are named a new basis, or a decomposition, costs no more."""


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


def meetings(here: Levels, there: Levels) -> Indices:
    """The pairs of modes that may meet, or be complex, at two loads or between them.

    Parameters
    ----------
    here, there : Levels
        At the two loads, in one basis.

    Returns
    -------
    ndarray of int, shape (P, 2)
        Pairs of modes of the projection that do not pass the test.
    """
    largest = np.maximum(np.abs(here.coupling), np.abs(there.coupling))
    largest += SLACK * np.abs(there.coupling - here.coupling)
    largest = np.maximum(largest, largest.T)
    before, after = (np.subtract.outer(each.diagonal, each.diagonal) for each in (here, there))
    distance = np.minimum(np.abs(before), np.abs(after)).astype(np.float32)
    distance[np.signbit(before) != np.signbit(after)] = 0.0
    scale = np.maximum(distance, 2 * largest)
    ratio = np.divide(largest, scale, out=np.zeros_like(scale), where=scale > 0)
    second = ratio @ largest
    second = np.maximum(second, second.T)
    slack = SLACK * np.abs(there.diagonal - here.diagonal).astype(np.float32)
    # A coarse test of all, in which the second order is a bound as well, and the sharp one of those that fail.
    shift = np.diag(second) + slack
    pairs = np.nonzero(np.triu(distance <= 2 * (largest + second) + np.add.outer(shift, shift), 1))
    i, j = pairs
    (d, s, w), (d_there, s_there, w_there) = (_second_order(each, pairs, scale) for each in (here, there))
    aside_i, aside_j = _others(ratio[i], pairs), _others(ratio[j], pairs)
    third = np.sum(np.maximum(aside_i * second[j], aside_j * second[i]), axis=1)
    levels = np.sum(aside_i * second[i] + aside_j * second[j], axis=1) + slack[i] + slack[j]
    antisymmetric = np.maximum(np.abs(w), np.abs(w_there)) + SLACK * np.abs(w_there - w) + third
    symmetric = np.minimum(np.abs(s), np.abs(s_there)) - SLACK * np.abs(s_there - s) - third
    symmetric = np.where(s * s_there > 0, np.maximum(symmetric, 0.0), 0.0)
    apart = np.where(d * d_there > 0, np.minimum(np.abs(d), np.abs(d_there)), 0.0) - levels
    near = apart <= 2 * np.sqrt(np.maximum(antisymmetric**2 - symmetric**2, 0.0))
    return np.column_stack(pairs)[near]


def _second_order(levels: Levels, pairs: tuple[Indices, Indices], scale: NDArray[np.float32]) -> tuple[Floats, ...]:
    """B_ii - B_jj and the symmetric and the antisymmetric part of B_ij, for each pair."""
    i, j = pairs
    h, diagonal = levels.coupling, levels.diagonal
    weight_i, weight_j = (
        _others(np.sign(diagonal[k][:, None] - diagonal) / np.where(scale[k] > 0, scale[k], np.inf), pairs)
        for k in pairs
    )
    mean = 0.5 * (weight_i + weight_j)
    ii, jj = np.sum(h[i] * h[:, i].T * weight_i, axis=1), np.sum(h[j] * h[:, j].T * weight_j, axis=1)
    ij = h[i, j] + np.sum(h[i] * h[:, j].T * mean, axis=1)
    ji = h[j, i] + np.sum(h[j] * h[:, i].T * mean, axis=1)
    return diagonal[i] - diagonal[j] + ii - jj, 0.5 * (ij + ji), 0.5 * (ij - ji)


def _others(rows: Floats, pairs: tuple[Indices, Indices]) -> Floats:
    """Rows, one for each pair, without the elements of the pair itself."""
    place = np.arange(len(rows))
    for column in pairs:
        rows[place, column] = 0.0
    return rows


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
        # Divide and conquer is the faster one, but needs twice the memory of MRRR, which matters where E is large.
        driver = "evd" if len(active) <= SMALL else "evr"
        values, basis = eigh(dense, driver=driver, overwrite_a=True, check_finite=False)
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
        levels = self._levels(inner)
        clusters = []
        for cluster in self.clusters:
            part = self.basis[:, cluster.modes]
            diagonal = levels.diagonal[cluster.modes]
            # Modes of the margin may lie close to modes outside: what these do is right for the core.
            core = np.sort(diagonal[cluster.core[0] : cluster.core[1] + 1])
            distance = np.clip(diagonal, core[0], core[-1])[:, None] - levels.diagonal
            weight = np.divide(1.0, distance, out=np.zeros_like(distance), where=distance != 0)
            weight[:, cluster.modes] = 0.0
            rows, columns = levels.coupling[cluster.modes], levels.coupling[:, cluster.modes]
            second = 0.5 * ((rows * weight) @ columns + rows @ (columns * weight.T))
            clusters.append(part.T @ (inner @ part) + second)
        return clusters

    def covers(self, matrix: csr_array) -> bool:
        """Whether an operator acts on the same coordinates."""
        return np.array_equal(np.flatnonzero(np.diff(matrix.indptr)), self.active)

    def levels(self, matrix: csr_array) -> Levels:
        """X^T A X of an operator on the same coordinates."""
        return self._levels(matrix[self.active][:, self.active])

    def _levels(self, inner: csr_array) -> Levels:
        count = len(self.values)
        basis = self.basis.astype(np.float32)
        coupling = np.empty((count, count), dtype=np.float32)
        diagonal = np.empty(count)
        for start in range(0, count, CHUNK):
            part = self.basis[:, start : start + CHUNK]
            image = inner @ part - part * self.values[start : start + CHUNK]
            diagonal[start : start + CHUNK] = np.sum(part * image, axis=0)
            coupling[:, start : start + CHUNK] = basis.T @ image.astype(np.float32)
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

    def fits(self, matrix: csr_array, blocks: list[Floats]) -> bool:
        """Whether the projection is good enough for an operator with these cluster blocks."""
        if not self.covers(matrix):
            return False
        mixing = []
        for cluster, block in zip(self.clusters, blocks, strict=True):
            levels = self.values[cluster.modes]
            off_diagonal = block - np.diag(np.diag(block))
            width = max(levels[-1] - levels[0], np.finfo(np.float64).tiny)
            mixing.append(np.linalg.norm(off_diagonal) / width)
        # |off-diagonal|_F over the width of the cluster is the typical coupling over the spacing.
        return bool(np.median(mixing) < MIXING)


class Outlook:
    """Meetings along a ramp, from one projection for as many increments as it serves."""

    def __init__(self) -> None:
        self._base: csr_array | None = None
        self._projection: Projection | None = None
        self._seen: tuple[csr_array, Levels] | None = None

    def meetings(self, here: csr_array, there: csr_array) -> list[Floats] | None:
        """Orthonormal bases, shape (n, 2), of the pairs that may meet between two neighbouring loads.

        None if they are more than `FEW`, or if the coordinates change.
        """
        found = None if self._projection is None else self._look(self._projection, here, there)
        if (found is None or len(found) > 0) and self._base is not here:
            self._base, self._projection, self._seen = here, Projection.of(here), None
            found = self._look(self._projection, here, there)
        return found

    def _look(self, projection: Projection, here: csr_array, there: csr_array) -> list[Floats] | None:
        if not (projection.covers(here) and projection.covers(there)):
            return None
        before = self._seen[1] if self._seen and self._seen[0] is here else projection.levels(here)
        after = projection.levels(there)
        self._seen = there, after
        pairs = meetings(before, after)
        return [projection.plane(pair) for pair in pairs] if len(pairs) <= FEW else None
