r"""Linear solvers for Newton's method with one interface: a band for small packings, sparse factors for large packings.

A packing is a few disks wide or high, and K couples neighbours only. With the disks in the order of reverse Cuthill and
McKee, and the coordinates of a disk together, all entries lie within a band: for 100 disks with 285 coordinates, within
44 places of the diagonal. LAPACK factors the band in a quarter of the time for the full matrix, and uses so little
memory that Python and LAMMPS stay in the processor's caches.

The factorisation of K for 100,000 disks takes as long as thirty evaluations of the forces; that of its symmetric part
takes as long as ten. From one Newton iteration to the next K changes a little everywhere, with the load, and much at a
few contacts, which close or open. Neither change needs new factors. With the factors of a nearby matrix, or of the
symmetric part, as preconditioner P, :math:`P^{-1} K` is the identity except for a small part and a part of low rank,
and GMRES reduces the residual a hundredfold in some five iterations. If GMRES fails to do so, K itself is factored.

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
from scipy.sparse.linalg import LinearOperator, gmres

from ..arrays import Floats, Indices
from ..packing.disk_operators import SIGNS
from .sparse_lu import Factors, SingularMatrixError, elimination_places, symmetric_lu

Booleans = NDArray[np.bool_]

RESIDUAL_SHARE = 1e-2
"""Residual of the iterative solution, as a share of the force. A Newton iteration gains a factor of five where contacts
open or close, and a thousand where none does. The residual costs a tenth of the last gain, and saves half of the work
before."""

GMRES_ITERATIONS = 30
"""Iterations of GMRES that are worth while: a factorisation takes as long as fifty."""


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
    """K, solved with the factors of a matrix nearby as long as these serve, and then with its own. A coordinate without
    stiffness of its own is no unknown; `i` and `j` are the pairs of disks that K couples. `own` is whether it has had
    to make factors of its own."""

    def __init__(self, matrix: csr_array, i: Indices, j: Indices, nearby: "SparseSolver | None" = None) -> None:
        self._stiffness, self._pairs, self.own = matrix.diagonal(), (i, j), False
        self._active = np.flatnonzero(self._stiffness)
        self._matrix = matrix[self._active][:, self._active]
        # factors, of which coordinates they are, and whether of K itself and not of its symmetric part
        self._made: tuple[Factors, Indices, bool] | None = None if nearby is None else nearby._made
        self._left = [False, True]  # of which matrix factors can still be made: K, its symmetric part

    def solve(self, force: Floats) -> Floats | None:
        """The solution of K dq = F, shape (3N,); None if K is singular."""
        while True:
            if self._made is not None:
                step = self._with_factors(force) if self.own and self._made[2] else self._iterated(force)
                if step is not None and np.all(np.isfinite(step)):
                    return step
            if not self._left:
                return None
            symmetric, self._made = self._left.pop(), None  # before the memory for others is taken
            order = elimination_order(*self._pairs, len(self._stiffness) // 3, self._active)
            matrix = 0.5 * (self._matrix + self._matrix.T) if symmetric else self._matrix
            inside, self.own = csc_array(matrix[order][:, order]), True
            with suppress(SingularMatrixError):
                # nearly symmetric: pivots of K itself on the diagonal where good
                pivoting = 0.0 if symmetric else 0.01
                factors = symmetric_lu(inside, ordered=True, symmetric=symmetric, pivoting=pivoting)
                self._made = factors, self._active[order], not symmetric

    def _with_factors(self, force: Floats) -> Floats:
        """The solution on the coordinates of the factors, zero on the others, shape (3N,)."""
        assert self._made is not None
        factors, coordinates, _ = self._made
        step = np.zeros_like(force)
        step[coordinates] = factors.solve(force[coordinates])
        return step

    def _iterated(self, force: Floats) -> Floats | None:
        """The solution by GMRES; None if that takes too long."""
        assert self._made is not None
        active, new = self._active, np.setdiff1d(self._active, self._made[1])

        def apply_preconditioner(residual: Floats) -> Floats:
            spread = np.zeros_like(force)
            spread[active] = residual
            step = self._with_factors(spread)
            step[new] = spread[new] / self._stiffness[new]
            return step[active]

        # from the right, so that its residual is a force
        shape, both = self._matrix.shape, lambda residual: self._matrix @ apply_preconditioner(residual)
        operator = LinearOperator(shape, both, dtype=np.float64)
        found, failed = gmres(operator, force[active], rtol=RESIDUAL_SHARE, restart=GMRES_ITERATIONS, maxiter=1)
        step = np.zeros_like(force)
        step[active] = apply_preconditioner(found)
        return None if failed else step


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
