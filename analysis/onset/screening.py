r"""Which pairs of modes may meet between two loads: quasi-degenerate perturbation theory.

In an eigenbasis of the symmetric part of A at one load (:mod:`~faultgouge.analysis.onset.basis`) the operator
:math:`H(F) = X^T A(F) X` is nearly diagonal at the loads about it. The second-order effective operator of a few modes
i, j, from which the couplings to all other modes k are transformed away, is that of Schrieffer and Wolff (Phys. Rev.
149, 491 (1966); Bravyi, DiVincenzo and Loss, Ann. Phys. 326, 2793 (2011)), also known as Van Vleck's or Löwdin's:

.. math::

    B_{ij} = H_{ij} + \tfrac12 \sum_{k} H_{ik} H_{kj}
             \left(\frac1{H_{ii} - H_{kk}} + \frac1{H_{jj} - H_{kk}}\right) .

**Two modes.** The 2 x 2 block of modes i and j has the discriminant :math:`(B_{ii} - B_{jj})^2 + 4 (s^2 - w^2)`, s the
symmetric and w the antisymmetric part of its off-diagonal elements. Its third order is bounded term by term, whatever
the signs, by

.. math::

    R_{ij} = \sum_{k \ne i, j} \frac{|H_{ik}|}{|H_{ii} - H_{kk}|} S_{kj} , \qquad
    S_{kj} = \sum_l \frac{|H_{kl}|}{|H_{kk} - H_{ll}|} |H_{lj}| .

So the discriminant is positive, and the two modes do not meet, if

.. math::

    |B_{ii} - B_{jj}| - R_{ii} - R_{jj} > 2 \sqrt{(|w| + R_{ij})^2 - (|s| - R_{ij})^2} ,

without the last square where :math:`|s| < R_{ij}`, and without the root where it is of a negative number. Denominators
are taken no smaller than twice the coupling: where they would be, that pair does not pass the test itself. Between the
loads, H and B are taken to stay within `Limits.slack` of the straight line.

**Clusters.** Which of thousands of modes meet first? A cluster of neighbouring modes, with all other modes in second
order as above, has the eigenvalues of A up to the third order of the typical coupling over the distance of the modes
outside. Clusters say where to look; what is found there has yet to be confirmed with A itself.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..packing import Floats, Indices


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


def may_meet(here: Levels, there: Levels, slack: float) -> Indices:
    """Pairs of modes, shape (P, 2), that may meet, or be complex, at two loads or between them.

    The levels at both loads are in one basis; `slack` is that of `Limits`.
    """
    largest = np.maximum(here.largest, there.largest)
    distance = np.minimum(np.abs(here.distance), np.abs(there.distance))
    distance[here.distance * there.distance < 0] = 0.0
    scale = np.maximum(distance, 2 * largest)
    np.fill_diagonal(scale, np.inf)
    ratio = np.divide(largest, scale, out=np.zeros_like(scale), where=scale > 0)
    second = ratio @ largest
    second += second.T.copy()
    second *= 0.5
    aside = slack * np.abs(there.diagonal - here.diagonal).astype(np.float32)
    # A coarse test of all, in which the second order is a bound as well, and the sharp one of those that fail.
    shift = np.diag(second) + aside
    reach = 2 * (largest + second) + shift
    reach += shift[:, None]
    i, j = np.nonzero(distance <= reach)
    pairs = i[i < j], j[i < j]
    if len(pairs[0]) == 0:
        return np.empty((0, 2), dtype=np.int64)
    i, j = pairs
    (d, s, w), (d_there, s_there, w_there) = (_second_order(each, pairs, scale) for each in (here, there))
    aside_i, aside_j = _others(ratio[i], pairs), _others(ratio[j], pairs)
    third = 0.5 * np.sum(aside_i * second[j] + aside_j * second[i], axis=1)
    levels = np.sum(aside_i * second[i] + aside_j * second[j], axis=1) + aside[i] + aside[j]
    antisymmetric = np.maximum(np.abs(w), np.abs(w_there)) + slack * np.abs(w_there - w) + third
    symmetric = np.minimum(np.abs(s), np.abs(s_there)) - slack * np.abs(s_there - s) - third
    symmetric = np.where(s * s_there > 0, np.maximum(symmetric, 0.0), 0.0)
    apart = np.where(d * d_there > 0, np.minimum(np.abs(d), np.abs(d_there)), 0.0) - levels
    near = apart <= 2 * np.sqrt(np.maximum(antisymmetric**2 - symmetric**2, 0.0))
    return np.column_stack(pairs)[near]


def _second_order(levels: Levels, pairs: tuple[Indices, Indices], scale: NDArray[np.float32]) -> tuple[Floats, ...]:
    """B_ii - B_jj and the symmetric and the antisymmetric part of B_ij, for each pair."""
    i, j = pairs
    h, diagonal = levels.coupling, levels.diagonal
    weight_i, weight_j = (
        _others(np.sign(levels.distance[k]) / np.where(scale[k] > 0, scale[k], np.inf), pairs) for k in pairs
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
