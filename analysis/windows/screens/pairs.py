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

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ...arrays import Floats, Indices
from ..between import Few
from ..edges import DoubtError
from ..limits import LIMITS, Limits
from ..slices.eigenbasis import Basis, Levels
from ..space import Space
from ..system import System


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
    """Pairs that may meet along a ramp, from one basis for as many increments as it serves."""

    def __init__(self, limits: Limits = LIMITS) -> None:
        self.limits = limits
        self._base: csr_array | None = None
        self._basis: Basis | None = None
        self._seen: tuple[csr_array, Levels] | None = None
        self._reached: list[Space] = []

    def __call__(self, here: System, there: System, growing: Sequence[Space], depth: int) -> Few | None:
        """The pairs at both loads; None if they are more than `Limits.few_pairs`, or one is a pair to within
        rounding."""
        planes = self._planes(here.stiffness, there.stiffness, len(growing))
        reached = [*growing, *(each for each in self._reached if each.system is here)]
        self._reached = []
        pairs: list[tuple[Space, Space]] = []
        for plane in planes or []:
            guess = Space(here, plane, plane)
            below = guess.closest(reached) or guess.at(here, self.limits)
            above = None if below is None else below.at(there, self.limits)
            if below is None or above is None or any(before.like(below) for before, _ in pairs):
                raise DoubtError
            if not (below.definite and above.definite):
                return None
            pairs.append((below, above))
        if planes is None:
            return None
        self._reached = [above for _, above in pairs]
        return Few(pairs, len(pairs))

    def _planes(self, here: csr_array, there: csr_array, complex_pairs: int) -> list[Floats] | None:
        """Orthonormal bases of the pairs, shape (n, 2); None if they are too many, or if the coordinates change.

        The basis is renewed where it names more pairs than those that are complex_pairs to be complex.
        """
        if complex_pairs > self.limits.few_pairs:
            return None
        found = None if self._basis is None else self._look(self._basis, here, there)
        if (found is None or len(found) > complex_pairs) and self._base is not here:
            self._base, self._basis, self._seen = here, Basis.of(here, self.limits), None
            found = self._look(self._basis, here, there)
        return found

    def _look(self, basis: Basis, here: csr_array, there: csr_array) -> list[Floats] | None:
        if not (basis.covers(here) and basis.covers(there)):
            return None
        matrix, before = self._seen or (here, basis.levels(here))
        if matrix is not here:
            before = basis.change(before, here - matrix)
        after = basis.change(before, there - here)
        self._seen = there, after
        pairs = may_meet(before, after, self.limits.slack)
        return [basis.lift(pair) for pair in pairs] if len(pairs) <= self.limits.few_pairs else None
