r"""Linear solvers for Newton's method with one interface: a band for small packings, sparse factors for large packings.

A packing is a few disks wide or high, and K couples neighbours only. With the disks in the order of reverse Cuthill and
McKee, and the coordinates of a disk together, all entries lie within a band: for 100 disks with 285 coordinates, within
44 places of the diagonal. LAPACK factors the band in a quarter of the time for the full matrix, and uses so little
memory that Python and LAMMPS stay in the processor's caches.

A fill-reducing order of the matrix itself depends on single entries. Entries that happen to vanish, as on a crystal,
spoil this order: the coordinates of one disk are then separated. The order of elimination is therefore found by minimum
degree on the graph of disks and contacts. The coordinates of a disk stay together, which also gives the factorisation
dense blocks.
"""

from contextlib import suppress
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgbtrf, dgbtrs
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from ..arrays import Floats, Indices
from ..packing.disk_operators import SIGNS
from .sparse_lu import Factors, SingularMatrixError, elimination_places, general_lu

Booleans = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Band:
    """Where the stiffnesses of contacts are in the band matrix of some coordinates: which of (x.., y.., R theta..) it
    has, E of them; the same in its order, and their disks; W, diagonals on either side; and the place of each number of
    each contact, shape (36 C,), E (3W + 1) for what is not in the matrix."""

    active: Booleans
    coordinates: Indices
    disks: Indices
    width: int
    places: Indices

    def matrix(self, terms: Floats) -> Floats:
        """The matrix as LAPACK wants it, with room for what pivots fill in, shape (3W + 1, E), of `contact_terms`."""
        shape = len(self.coordinates), 3 * self.width + 1
        values = (SIGNS[..., None] * terms).ravel()
        return np.bincount(self.places, values, shape[0] * shape[1] + 1)[:-1].reshape(shape).T


def band(i: Indices, j: Indices, active: Booleans) -> Band:
    """The band of a packing, of the partners of its contacts, -1 the floor, and the coordinates that the matrix has,
    shape (3N,)."""
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


class BandSolver:
    """K in a band, factored by LAPACK; the matrix of :meth:`Band.matrix` is overwritten."""

    def __init__(self, band: Band, matrix: Floats) -> None:
        self._coordinates, self._width = band.coordinates, band.width
        self._factors, self._pivots, self._singular = dgbtrf(matrix, band.width, band.width, overwrite_ab=True)

    def solve(self, force: Floats) -> Floats | None:
        """The solution of K dq = F, shape (3N,); None if K is singular."""
        if self._singular:
            return None
        solution, _ = dgbtrs(self._factors, self._width, self._width, force.take(self._coordinates), self._pivots)
        step = np.zeros(len(force))
        step[self._coordinates] = solution
        return step if np.isfinite(solution.sum()) else None


class SparseSolver:
    """K in sparse factors. A coordinate without stiffness of its own is no unknown; `i` and `j` are the pairs of disks
    that K couples."""

    def __init__(self, matrix: csr_array, i: Indices, j: Indices) -> None:
        active = np.flatnonzero(matrix.diagonal())
        self._coordinates = active[elimination_order(i, j, matrix.shape[0] // 3, active)]
        self._factors: Factors | None = None
        with suppress(SingularMatrixError):
            inside = csc_array(matrix[self._coordinates][:, self._coordinates])
            self._factors = general_lu(inside, ordered=True)

    def solve(self, force: Floats) -> Floats | None:
        """The solution of K dq = F, shape (3N,); None if K is singular."""
        if self._factors is None:
            return None
        step = np.zeros_like(force)
        step[self._coordinates] = self._factors.solve(force[self._coordinates])
        return step if np.all(np.isfinite(step)) else None


Solver: TypeAlias = BandSolver | SparseSolver
"""A matrix K on some of the 3N coordinates (x.., y.., R theta..), to be solved with many forces."""


def elimination_order(i: Indices, j: Indices, disks: int, coordinates: Indices) -> Indices:
    """A fill-reducing order of some of the 3N coordinates (x.., y.., R theta..), a permutation of range(E), where these
    pairs of disks are coupled."""
    every = np.arange(disks)
    graph = coo_array((np.ones(2 * len(i) + disks), (np.concatenate([i, j, every]), np.concatenate([j, i, every]))))
    place = elimination_places(csc_array(graph))
    axis, disk = np.divmod(coordinates, disks)
    return np.lexsort((axis, place[disk]))
