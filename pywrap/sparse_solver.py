r"""Newton's matrix of a large packing: SuperLU, and GMRES between two factorisations.

To factor K of 100,000 disks takes as long as thirty evaluations of the forces. From one Newton iteration to the next K
changes a little everywhere, with the load, and much at a few contacts, which close or open. Neither needs new factors:
with those of a matrix nearby as preconditioner P, :math:`P^{-1} K` is the identity but for something small and for
something of low rank, and GMRES reduces the residual a hundredfold in some five iterations.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import LinearOperator, SuperLU, gmres

from ..analysis.sparse_lu import symmetric_lu
from .elimination import elimination_order

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

ACCURATE = 1e-2
"""Residual of the iterative solution, as a share of the force. Where contacts open or close a Newton iteration gains a
factor of five, where none does a thousand: a tenth of it is lost at the end, and half of the work saved before."""

LONGEST = 30
"""Iterations of GMRES that are worth while: a factorisation takes as long as fifty."""


@dataclass(frozen=True, eq=False)
class SparseFactors:
    """Factors of K.

    Attributes
    ----------
    coordinates : ndarray of int, shape (E,)
        Which of the 3N coordinates the matrix has, in the order of elimination.
    factors : SuperLU
        Of the matrix in this order.
    """

    coordinates: Indices
    factors: SuperLU

    def solve(self, force: Floats) -> Floats:
        """The solution on these coordinates, zero on the others, shape (3N,)."""
        step = np.zeros_like(force)
        step[self.coordinates] = self.factors.solve(force[self.coordinates])
        return step


class SparseSolver:
    """K, solved with the factors of a matrix nearby as long as these serve, and then with its own.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array, shape (3N, 3N)
        K; a coordinate without stiffness of its own is no unknown.
    i, j : ndarray of int, shape (P,)
        The pairs of disks that it couples.
    nearby : SparseSolver, optional
        That of a matrix nearby.
    """

    def __init__(self, matrix: csr_array, i: Indices, j: Indices, nearby: "SparseSolver | None" = None) -> None:
        self._stiffness = matrix.diagonal()
        self._active = np.flatnonzero(self._stiffness)
        self._matrix = matrix[self._active][:, self._active]
        self._pairs = i, j
        self._factors: SparseFactors | None = None if nearby is None else nearby._factors
        self._own = False

    def solve(self, force: Floats) -> Floats | None:
        """The solution of K dq = F, shape (3N,); None if K is singular."""
        if self._factors is not None and not self._own:
            step = self._iterated(self._factors, force)
            if step is not None:
                return step
        if not self._own:
            self._factors = None  # before the memory for others is taken
            self._factors, self._own = self._factored(), True
        step = None if self._factors is None else self._factors.solve(force)
        return step if step is not None and np.all(np.isfinite(step)) else None

    def _factored(self) -> SparseFactors | None:
        order = elimination_order(*self._pairs, len(self._stiffness) // 3, self._active)
        try:
            # nearly symmetric: pivots on the diagonal where good
            factors = symmetric_lu(csc_array(self._matrix[order][:, order]), ordered=True, pivoting=0.01)
        except RuntimeError:
            return None
        return SparseFactors(self._active[order], factors)

    def _iterated(self, nearby: SparseFactors, force: Floats) -> Floats | None:
        """The solution by GMRES; None if that takes too long."""
        active, shape = self._active, self._matrix.shape
        new = np.setdiff1d(active, nearby.coordinates)

        def preconditioned(residual: Floats) -> Floats:
            spread = np.zeros_like(force)
            spread[active] = residual
            step = nearby.solve(spread)
            step[new] = spread[new] / self._stiffness[new]
            return step[active]

        # from the right, so that its residual is a force
        operator = LinearOperator(shape, lambda residual: self._matrix @ preconditioned(residual), dtype=np.float64)
        found, failed = gmres(operator, force[active], rtol=ACCURATE, restart=LONGEST, maxiter=1)
        if failed:
            return None
        step = np.zeros_like(force)
        step[active] = preconditioned(found)
        return step
