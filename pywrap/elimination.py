r"""In which order the disks are eliminated from :math:`K \Delta q = F`.

A fill-reducing order of the matrix itself sees single entries, and those that happen to vanish, as on a crystal, spoil
it: the coordinates of one disk then no longer count as one. So the order is found on the graph of disks and contacts,
by minimum degree, and the coordinates of a disk stay together, which also gives the factorisation dense blocks.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from ..analysis import Packing

Indices = NDArray[np.int64]


def elimination_order(packing: Packing, coordinates: Indices) -> Indices:
    """A fill-reducing order of coordinates.

    Parameters
    ----------
    packing : Packing
        Whose contacts couple the disks.
    coordinates : ndarray of int, shape (E,)
        Which of the 3N coordinates (x.., y.., R theta..) are unknown.

    Returns
    -------
    ndarray of int, shape (E,)
        A permutation of range(E).
    """
    n, pair = len(packing), ~packing.contacts.floor
    i, j, every = packing.contacts.i[pair], packing.contacts.j[pair], np.arange(n)
    ones = np.ones(len(i))
    degree = np.bincount(i, minlength=n) + np.bincount(j, minlength=n)
    # diagonally dominant, so that SuperLU, which orders only what it factors, has nothing to pivot
    graph = coo_array(
        (np.concatenate([-ones, -ones, degree + 1.0]), (np.concatenate([i, j, every]), np.concatenate([j, i, every]))),
        shape=(n, n),
    )
    factors = splu(csc_array(graph), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    axis, disk = np.divmod(coordinates, n)
    return np.lexsort((axis, factors.perm_c[disk]))
