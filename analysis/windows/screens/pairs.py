r"""Which pairs of modes may meet between two loads: quasi-degenerate perturbation theory.

In an eigenbasis of the symmetric part of A at one load (:mod:`~faultgouge.analysis.windows.slices.eigenbasis`) the
operator :math:`H(F) = X^T A(F) X` is nearly diagonal at the loads about it. The second-order effective operator of a
few modes i, j, from which the couplings to all other modes k are transformed away, is that of Schrieffer and Wolff
(Phys. Rev. 149, 491 (1966); Bravyi, DiVincenzo and Loss, Ann. Phys. 326, 2793 (2011)), also known as Van Vleck's or
Löwdin's:

.. math::

    B_{ij} = H_{ij} + \tfrac12 \sum_{k} H_{ik} H_{kj}
             \left(\frac1{H_{ii} - H_{kk}} + \frac1{H_{jj} - H_{kk}}\right) .

**Two modes.** The 2 x 2 block of modes i and j has the discriminant :math:`(B_{ii} - B_{jj})^2 + 4 (s^2 - w^2)`, s the
symmetric and w the antisymmetric part of its off-diagonal elements. Its third order is bounded term by term, whatever
the signs, by

.. math::

    R_{ij} = \sum_{k \ne i, j} \frac{|H_{ik}|}{|H_{ii} - H_{kk}|} S_{kj} , \qquad
    S_{kj} = \sum_l \frac{|H_{kl}|}{|H_{kk} - H_{ll}|} |H_{lj}| .

So the discriminant is positive up to this order, and the two modes do not meet, if

.. math::

    |B_{ii} - B_{jj}| - R_{ii} - R_{jj} > 2 \sqrt{(|w| + R_{ij})^2 - (|s| - R_{ij})^2} ,

without the last square where :math:`|s| < R_{ij}`, and without the root of a negative number. No denominator is taken
smaller than twice the coupling: a pair with a smaller distance does not pass its own test. Between the loads, H and B
are taken to stay within `Limits.slack` of the straight line.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ...arrays import Floats, Indices
from ..between import Few, ModesOfLoads
from ..edges import DoubtError
from ..limits import LIMITS, Limits
from ..slices.eigenbasis import Basis, Levels
from ..space import Space
from ..system import System
from ..system_modes import SystemModes


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
    # A coarse test of all pairs, in which the second order is a bound as well; then the sharp test of pairs that fail.
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


class PairScreen:
    """The modes that may meet along a ramp, in clusters, from one basis for as many increments as it serves."""

    def __init__(self, limits: Limits = LIMITS) -> None:
        self.limits = limits
        self._of_clusters = replace(limits, residual_factor=limits.cluster_residual)
        self._base: csr_array | None = None
        self._basis: Basis | None = None
        self._named = 0  # modes, when the basis was new
        self._seen: tuple[csr_array, Levels] | None = None
        self._reached: dict[tuple[int, ...], Space] = {}

    def __call__(self, here: System, there: System, growing: Sequence[Space], depth: int) -> Few | ModesOfLoads | None:
        """The modes of all clusters at both loads; None if they are more than `Limits.few_modes`, or not isolated.

        A DoubtError is raised in place of None where a part of the increment may show the first pair sooner.
        """
        clusters = self._clusters(here.stiffness, there.stiffness)
        if clusters is not None and not clusters:
            return Few([], 0)
        ends = [self._at_both(cluster, here, there) for cluster in clusters or []]
        if ends and None not in ends:
            below, above = zip(*ends, strict=True)
            return SystemModes.of_spaces(here, below), SystemModes.of_spaces(there, above)
        if not growing and depth < self.limits.change_divisions:
            raise DoubtError
        return None

    def _at_both(self, cluster: tuple[int, ...], here: System, there: System) -> tuple[Space, Space] | None:
        """The subspace of a cluster at both loads."""
        assert self._basis is not None
        below = self._reached.get(cluster)
        if below is None or below.system is not here:
            vectors = self._basis.lift(list(cluster))
            below = Space(here, vectors, vectors).at(here, self._of_clusters)
        above = None if below is None else below.at(there, self._of_clusters)
        if below is None or above is None:
            return None
        self._reached[cluster] = above
        return below, above

    def _clusters(self, here: csr_array, there: csr_array) -> list[tuple[int, ...]] | None:
        """Modes of the basis that may meet, by clusters; None if they are too many, or if the coordinates change.

        The basis is renewed where it names more than it did when it was new.
        """
        found = None if self._basis is None else self._look(self._basis, here, there)
        if self._base is not here and (found is None or sum(map(len, found)) > self._named):
            self._base, self._basis, self._seen, self._reached = here, Basis.of(here, self.limits), None, {}
            found = self._look(self._basis, here, there)
            self._named = sum(map(len, found or []))
        return found

    def _look(self, basis: Basis, here: csr_array, there: csr_array) -> list[tuple[int, ...]] | None:
        if not (basis.covers(here) and basis.covers(there)):
            return None
        matrix, before = self._seen or (here, basis.levels(here))
        if matrix is not here:
            before = basis.change(before, here - matrix)
        after = basis.change(before, there - here)
        self._seen = there, after
        clusters = clusters_of(may_meet(before, after, self.limits.slack))
        few = sum(map(len, clusters)) <= self.limits.few_modes
        isolated = all(isolation(after.diagonal, list(each)) < self.limits.isolation for each in clusters)
        return clusters if few and isolated else None


def isolation(levels: Floats, cluster: list[int]) -> float:
    """Half the width of a cluster of levels over the distance of its middle from the nearest level outside."""
    inside = levels[cluster]
    middle, half = 0.5 * (inside.max() + inside.min()), 0.5 * np.ptp(inside)
    return float(half / np.abs(np.delete(levels, cluster) - middle).min(initial=np.inf))


def clusters_of(pairs: Indices) -> list[tuple[int, ...]]:
    """The modes that are connected by pairs, shape (P, 2)."""
    named, places = np.unique(pairs, return_inverse=True)
    i, j = places.reshape(-1, 2).T
    links = csr_array((np.ones(len(i)), (i, j)), shape=(len(named),) * 2)
    count, label = connected_components(links, directed=False)
    return [tuple(named[label == k].tolist()) for k in range(count)]
