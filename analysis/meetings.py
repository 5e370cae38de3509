r"""Which pairs of modes may meet between two loads, without any decomposition at either.

In the basis of a :mod:`~faultgouge.analysis.projection` the operator H is nearly diagonal at the loads about that of
the basis. Modes i and j have a 2 x 2 block, to second order in the couplings to all other modes k

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
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from .packing import Floats, Indices
from .projection import Levels, Projection

SLACK = 0.05
"""How far levels and couplings may leave the straight line between two loads, in units of their change. In packings of
100 disks and increments of 1e-3 it is 1.3e-3 in the median, and grows with the increment."""

FEW = 3
"""Pairs that are examined one by one; where more are named a new basis, or a decomposition, costs no more."""


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
    largest = np.maximum(here.largest, there.largest)
    distance = np.minimum(np.abs(here.distance), np.abs(there.distance))
    distance[here.distance * there.distance < 0] = 0.0
    scale = np.maximum(distance, 2 * largest)
    np.fill_diagonal(scale, np.inf)
    ratio = np.divide(largest, scale, out=np.zeros_like(scale), where=scale > 0)
    second = ratio @ largest
    second += second.T.copy()
    second *= 0.5
    slack = SLACK * np.abs(there.diagonal - here.diagonal).astype(np.float32)
    # A coarse test of all, in which the second order is a bound as well, and the sharp one of those that fail.
    shift = np.diag(second) + slack
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
        if self._seen is None:
            self._seen = here, projection.levels(here)
        elif self._seen[0] is not here:
            self._seen = here, projection.change(self._seen[1], here - self._seen[0])
        before = self._seen[1]
        after = projection.change(before, there - here)
        self._seen = there, after
        pairs = meetings(before, after)
        return [projection.plane(pair) for pair in pairs] if len(pairs) <= FEW else None
