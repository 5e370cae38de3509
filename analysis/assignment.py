"""Partners with the largest sum of weights, without scipy.optimize, whose import takes longer than the assignment."""

from itertools import combinations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching

from .arrays import Floats, Indices

TIE = 1e-9
"""Share by which sums of two weights differ that rounding may have set apart, as those of a pair that has just met."""


def assign_columns(weight: Floats) -> Indices:
    """A column for each row, none twice, with the largest sum of weights.

    Of two rows that want the same column, and may have either, the first one has the first column.

    Parameters
    ----------
    weight : ndarray, shape (R, C)
        Finite numbers.

    Returns
    -------
    ndarray of int, shape (R,)
        -1 where columns are too few.
    """
    if not weight.size:
        return np.full(len(weight), -1)
    column = np.argmax(weight, axis=1)
    if len(np.unique(column)) == len(column):  # each row has its largest weight
        return column
    rivals = np.flatnonzero(np.bincount(column)[column] > 1)
    above_zero = weight - weight.min() + (np.ptp(weight) or 1.0)  # a zero would be no edge
    rows, columns = min_weight_full_bipartite_matching(csr_array(above_zero), maximize=True)
    column[:] = -1
    column[rows] = columns
    for i, j in combinations(rivals, 2):
        here, there = column[i], column[j]
        kept, exchanged = weight[i, here] + weight[j, there], weight[i, there] + weight[j, here]
        if here > there >= 0 and exchanged >= kept - TIE * abs(kept):
            column[[i, j]] = there, here
    return column
