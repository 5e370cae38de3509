r"""In which order the disks are eliminated from :math:`K \Delta q = F`.

A fill-reducing order of the matrix itself sees single entries, and those that happen to vanish, as on a crystal, spoil
it: the coordinates of one disk then no longer count as one. So the order is found on the graph of disks and contacts,
by minimum degree, and the coordinates of a disk stay together, which also gives the factorisation dense blocks.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array

from ..analysis.sparse_lu import symmetric_lu

Indices = NDArray[np.int64]


def elimination_order(i: Indices, j: Indices, disks: int, coordinates: Indices) -> Indices:
    """A fill-reducing order of coordinates.

    Parameters
    ----------
    i, j : ndarray of int, shape (P,)
        The pairs of disks whose coordinates are coupled.
    disks : int
        N.
    coordinates : ndarray of int, shape (E,)
        Which of the 3N coordinates (x.., y.., R theta..) are unknown.

    Returns
    -------
    ndarray of int, shape (E,)
        A permutation of range(E).
    """
    every = np.arange(disks)
    ones = np.ones(len(i))
    degree = np.bincount(i, minlength=disks) + np.bincount(j, minlength=disks)
    # diagonally dominant, so that SuperLU, which orders only what it factors, has nothing to pivot
    graph = coo_array(
        (np.concatenate([-ones, -ones, degree + 1.0]), (np.concatenate([i, j, every]), np.concatenate([j, i, every]))),
        shape=(disks, disks),
    )
    factors = symmetric_lu(csc_array(graph))
    axis, disk = np.divmod(coordinates, disks)
    return np.lexsort((axis, factors.perm_c[disk]))
