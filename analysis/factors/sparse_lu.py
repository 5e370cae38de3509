"""Sparse factors of large matrices with a symmetric pattern, such as K, or nearly so. All sparse factors are made here.

**Order.** METIS orders the graph of a matrix by nested dissection (Karypis and Kumar, SIAM J. Sci. Comput. 20, 359
(1998)). Of 72,000 coordinates of spheres that takes 0.2 s, where minimum degree takes 5 s and leaves a fifth more
entries. Rows of one pattern, such as those of a particle, are ordered as one, which gives the factors dense blocks.

**Factors.** :mod:`~faultgouge.analysis.factors.ldu` factors real matrices without pivoting. SuperLU, which SciPy has,
factors all others, and those that need pivots off the diagonal.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pymetis
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import SuperLU, splu

from ..errors import FaultgougeError
from ..packing.packing import Indices
from .ldu import CompiledFactors, library

DIAGONAL_PIVOT = 0.01
"""Share of the largest entry of its column that a diagonal entry must have to be the pivot of any matrix."""

INACCURATE = 1e-11
"""Relative residual of solutions without pivoting from which on pivots are chosen; usually it is some 1e-13."""


class SingularMatrixError(FaultgougeError):
    """A matrix has no factors: a pivot is zero."""


@dataclass(frozen=True, eq=False)
class Factors:
    """Factors of a matrix A.

    Attributes
    ----------
    made : CompiledFactors or scipy.sparse.linalg.SuperLU
        Of the rows in the order of elimination.
    order : ndarray of int, shape (n,), or None
        The rows in this order; None if A is given in it.
    """

    made: CompiledFactors | SuperLU
    order: Indices | None = None

    def solve(self, right: Any, trans: str = "N") -> Any:
        """The solution of A x = b, or with `trans` = "T" of A^T x = b, shape (n,) or (n, k)."""
        if self.order is None:
            return self.made.solve(right, trans)
        inside = self.made.solve(right[self.order], trans)
        found = np.empty_like(inside)
        found[self.order] = inside
        return found

    @property
    def negative(self) -> int:
        """Negative pivots of a symmetric A, as many as it has negative eigenvalues: Sylvester's law of inertia. Of
        factors without pivoting alone."""
        if isinstance(self.made, CompiledFactors):
            return self.made.negative
        return int(np.count_nonzero(self.made.U.diagonal() < 0))

    @property
    def entries(self) -> int:
        """Entries of both factors."""
        return self.made.entries if isinstance(self.made, CompiledFactors) else int(self.made.nnz)


def symmetric_lu(
    matrix: csc_array, *, ordered: bool = False, pivoting: float = 0.0, symmetric: bool = False
) -> Factors:
    """The factors of a matrix with a symmetric pattern.

    Parameters
    ----------
    matrix : scipy.sparse.csc_array, shape (n, n)
        Symmetric, or nearly so.
    ordered : bool
        Whether its coordinates are in the order of elimination already.
    pivoting : float
        Share of the largest entry of a column that its diagonal entry must have to be the pivot. With 0 it always is:
        the factors are then those of a symmetric matrix, L D L^T, and their accuracy is to be looked at.
    symmetric : bool
        Whether it is symmetric to the bit; real then.

    Raises
    ------
    SingularMatrixError
        If a pivot is zero.
    """
    order = None if ordered else np.argsort(elimination_places(matrix))
    inside = matrix if order is None else csc_array(matrix[order][:, order])
    compiled = library() if pivoting == 0 and np.isrealobj(matrix.data) else None
    # where a pivot is zero SuperLU takes another one
    made = None if compiled is None else CompiledFactors.of(inside, compiled, symmetric=symmetric)
    if made is not None:
        return Factors(made, order)
    try:
        # without joining small columns to supernodes the factors have three quarters of the entries
        options: dict[str, Any] = {"relax": 1, "options": {"SymmetricMode": True}}
        return Factors(splu(inside, permc_spec="NATURAL", diag_pivot_thresh=pivoting, **options), order)
    except RuntimeError as error:  # SuperLU's only word for it
        raise SingularMatrixError(f"The sparse factors of a matrix of {matrix.shape[0]} rows: {error}.") from error


def negative_pivots(matrix: csc_array, *, ordered: bool = False) -> int | None:
    """How many eigenvalues of a symmetric matrix are negative; None if one is zero, and factors do not tell."""
    try:
        return symmetric_lu(matrix, ordered=ordered, symmetric=True).negative
    except SingularMatrixError:
        return None


def general_lu(matrix: csc_array, *, ordered: bool = False) -> Factors:
    """The factors of any square matrix: without pivoting where the solutions are accurate, as they nearly always are.

    Otherwise, and for complex matrices, the pivot is the diagonal entry unless another one of its column is larger than
    a hundred of it, so that the order of elimination remains. Raises SingularMatrixError if a pivot is zero.
    """
    order = None if ordered else np.argsort(elimination_places(matrix))
    inside = matrix if order is None else csc_array(matrix[order][:, order])
    if np.isrealobj(matrix.data):
        right = np.random.default_rng(2).standard_normal(matrix.shape[0])
        try:
            factors = symmetric_lu(inside, ordered=True)
            found = factors.solve(right)
            size = np.abs(matrix.data).max(initial=0.0) * np.linalg.norm(found)
            if np.linalg.norm(inside @ found - right) <= INACCURATE * size:
                return Factors(factors.made, order)
        except SingularMatrixError:
            pass
    return Factors(symmetric_lu(inside, ordered=True, pivoting=DIAGONAL_PIVOT).made, order)


def elimination_places(matrix: csc_array) -> Indices:
    """Places of the rows of a matrix in an order of elimination of the pattern of A + A^T, shape (n,).

    >>> from scipy.sparse import csc_array
    >>> line = csc_array([[2.0, 1.0, 0.0], [1.0, 2.0, 1.0], [0.0, 1.0, 2.0]])
    >>> sorted(elimination_places(line).tolist())
    [0, 1, 2]
    """
    size = matrix.shape[0]
    pattern = csc_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    pattern = csr_array(pattern + pattern.T)  # METIS may not come to an end where it is not symmetric
    pattern.data[:] = 1.0
    # rows of one pattern have the same sum of random numbers
    _, group = np.unique(pattern @ np.random.default_rng(0).random(size), return_inverse=True)
    member = csr_array((np.ones(size), group, np.arange(size + 1)), shape=(size, int(group.max(initial=-1)) + 1))
    coupled = csr_array(member.T @ pattern @ member)
    coupled.setdiag(0)
    coupled.eliminate_zeros()
    if not coupled.nnz:
        return np.argsort(np.argsort(group, kind="stable"))
    starts, ends = (each.astype(np.int32) for each in (coupled.indptr, coupled.indices))
    place = np.argsort(np.asarray(pymetis.nested_dissection(pymetis.CSRAdjacency(starts, ends))[0]))
    places = np.empty(size, dtype=np.intp)
    places[np.argsort(place[group], kind="stable")] = np.arange(size)
    return places
