"""Newton's matrix of a small packing as a band about the diagonal.

A packing is a few disks wide or high, and K couples neighbours only. With the disks in the order of reverse Cuthill and
McKee, and the coordinates of a disk together, all entries lie within a band: of 100 disks with 285 coordinates, within
44 places of the diagonal. LAPACK factors the band in a quarter of the time that it takes for the full matrix, and what
it touches leaves Python and LAMMPS in the processor's caches.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from ..analysis.stiffness import SIGNS

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Booleans = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Band:
    """Where the stiffnesses of contacts are in the band matrix of some coordinates.

    Attributes
    ----------
    active : ndarray of bool, shape (3N,)
        The coordinates (x.., y.., R theta..) that the matrix has, E of them.
    coordinates : ndarray of int, shape (E,)
        The same in the order of the matrix.
    disks : ndarray of int, shape (E,)
        Whose they are.
    width : int
        W, diagonals on either side of the main one.
    places : ndarray of int, shape (36 C,)
        For each number of each contact, by partner of the row and of the column, and their coordinates; E (3W + 1) for
        what is not in the matrix.
    """

    active: Booleans
    coordinates: Indices
    disks: Indices
    width: int
    places: Indices

    def matrix(self, terms: Floats) -> Floats:
        """The matrix as LAPACK wants it, with room for what pivots fill in, shape (3W + 1, E).

        Parameters
        ----------
        terms : ndarray, shape (3, 3, C)
            The numbers of each contact, see :func:`~faultgouge.analysis.stiffness.contact_terms`.
        """
        shape = len(self.coordinates), 3 * self.width + 1
        values = (SIGNS[..., None] * terms).ravel()
        return np.bincount(self.places, values, shape[0] * shape[1] + 1)[:-1].reshape(shape).T


def band(i: Indices, j: Indices, active: Booleans) -> Band:
    """The band of a packing.

    Parameters
    ----------
    i, j : ndarray of int, shape (C,)
        Partners of the contacts; j = -1 is the floor.
    active : ndarray of bool, shape (3N,)
        The coordinates (x.., y.., R theta..) that the matrix has.
    """
    disks = len(active) // 3
    coordinates = (_order(i, j, disks)[:, None] + disks * np.arange(3)).ravel()
    coordinates = coordinates[active[coordinates]]
    size = len(coordinates)
    nowhere = 3 * size * size + size  # larger than any place, for any width
    number = np.full((3, disks + 1), nowhere)  # of coordinates in the matrix; those of the floor, -1, come last
    axis, disk = np.divmod(coordinates, disks)
    number[axis, disk] = np.arange(size)
    ends = number[:, [i, j]].transpose(1, 0, 2)
    rows, columns = ends[:, None, :, None], ends[None, :, None, :]
    inside = (rows < nowhere) & (columns < nowhere)
    width = int(np.abs(rows - columns).max(where=inside, initial=0))
    places = np.where(inside, rows + 3 * width * columns + 2 * width, size * (3 * width + 1))
    return Band(active, coordinates, disk, width, places.ravel())


def _order(i: Indices, j: Indices, disks: int) -> Indices:
    """The disks in an order in which neighbours have close numbers, shape (N,)."""
    pair = j >= 0
    ends = np.concatenate([i[pair], j[pair]]), np.concatenate([j[pair], i[pair]])
    graph = coo_array((np.ones(len(ends[0])), ends), shape=(disks, disks))
    return reverse_cuthill_mckee(csr_array(graph), symmetric_mode=True).astype(np.int64)
