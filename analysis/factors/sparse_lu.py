r"""All sparse factors: of large matrices with a symmetric pattern, such as K, or nearly so.

**Order.** METIS orders the graph of a matrix by nested dissection (Karypis and Kumar, SIAM J. Sci. Comput. 20, 359
(1998)). Of 72,000 coordinates of spheres that takes 0.2 s, where minimum degree takes 5 s and leaves a fifth more
entries. Rows of one pattern, such as those of a particle, are ordered as one, which gives the factors dense blocks.

**Factors.** The library of `ldu.cpp`, which is built with the plugin, factors real matrices as L D U without pivoting.
L and :math:`U^T` have the same pattern, that of the factors of :math:`A + A^T`, and ones on their diagonals. Of a
symmetric matrix :math:`U = L^T`, so that factors take half of the time and of the memory. A solution for four right
sides takes a fifth of the time of SuperLU with 1,000 disks, and two fifths with 1,000 spheres, whose factors leave the
cache. The method is multifrontal (Liu, SIAM Rev. 34, 82 (1992)): neighbouring columns of one pattern, such as those of
a disk, are eliminated together in a small dense matrix, their front; what the front adds to other rows goes to the
front of the parent in the elimination tree. SuperLU, which SciPy has, factors all other matrices, and those that need
pivots off the diagonal.
"""

import ctypes
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
import pymetis
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import SuperLU, splu

from ..arrays import Floats, Indices
from ..errors import FaultgougeError

DIAGONAL_PIVOT = 0.01
"""Share of the largest entry of its column that a diagonal entry must have to be the pivot of any matrix."""

INACCURATE = 1e-11
"""Relative residual of solutions without pivoting from which on pivots are chosen; usually it is some 1e-13."""


class SingularMatrixError(FaultgougeError):
    """A matrix has no factors: a pivot is zero."""


@cache
def _library() -> ctypes.CDLL | None:
    """The compiled library; None where it has not been built."""
    try:
        found = ctypes.CDLL(str(files("faultgouge") / "lib" / "ldu.so"))
    except OSError:
        return None
    integer, array = ctypes.c_int32, ctypes.c_void_p
    found.elimination_tree.argtypes = [integer, *[array] * 4]
    found.factor_ldu.argtypes = [integer, *[array] * 12]
    found.solve_ldu.argtypes = [integer, *[array] * 5, integer, array]
    found.elimination_tree.restype = found.solve_ldu.restype = None
    found.factor_ldu.restype = integer
    return found


def _places(*arrays: NDArray[Any]) -> list[int]:
    """Addresses of arrays in memory."""
    return [array.ctypes.data for array in arrays]


@dataclass(frozen=True, eq=False)
class CompiledFactors:
    """Factors of a matrix of `n` rows by the library of `ldu.cpp`: the pattern of L without its diagonal in compressed
    columns; the entries of L, and of the transpose of U, one array if the matrix is symmetric; the diagonal of D."""

    library: ctypes.CDLL
    start: NDArray[np.int64]
    row: NDArray[np.int32]
    lower: Floats
    upper: Floats
    pivot: Floats

    @classmethod
    def of(cls, matrix: csc_array, library: ctypes.CDLL, *, symmetric: bool) -> "CompiledFactors | None":
        """The factors of a real matrix in the order of elimination; None if a pivot is zero. `symmetric` says that the
        matrix is, to the bit. A MemoryError if there is none for the fronts."""

        def columns(each: csc_array) -> list[NDArray[Any]]:
            """Where the columns of a matrix begin, the rows of their entries, and these."""
            entries = np.ascontiguousarray(each.data, dtype=np.float64)
            return [each.indptr.astype(np.int64), each.indices.astype(np.int32, copy=False), entries]

        size, whole = matrix.shape[0], [matrix] if symmetric else [matrix, csc_array(matrix.T)]
        pattern = matrix if symmetric else sum(_ones(each) for each in whole)
        parent, below, start = np.empty(size, np.int32), np.empty(size, np.int64), np.zeros(size + 1, np.int64)
        begin, rows, _ = columns(pattern)
        library.elimination_tree(size, *_places(begin, rows, parent, below))
        np.cumsum(below, out=start[1:])
        lower = np.empty(start[-1])
        upper = lower if symmetric else np.empty(start[-1])
        row, pivot, halves = np.empty(start[-1], np.int32), np.empty(size), [columns(each) for each in whole]
        given = [place for half in halves for place in _places(*half)] + [None] * (3 * symmetric)
        made = library.factor_ldu(size, *given, *_places(parent, start, row, lower, upper, pivot))
        if made < 0:
            raise MemoryError(f"the fronts of a matrix of {size} rows")
        return cls(library, start, row, lower, upper, pivot) if made else None

    def solve(self, right: Any, trans: str = "N") -> Any:
        """The solution of A x = b, or with `trans` = "T" of A^T x = b, shape (n,) or (n, k)."""
        x = np.array(right, dtype=np.float64, order="C").reshape(len(self.pivot), -1)
        halves = (self.lower, self.upper) if trans == "N" else (self.upper, self.lower)
        parts = _places(self.start, self.row, *halves, self.pivot)
        self.library.solve_ldu(len(x), *parts, x.shape[1], x.ctypes.data)
        return x.reshape(np.shape(right))

    @property
    def nnz(self) -> int:
        """Entries of both factors."""
        return 2 * len(self.lower) + len(self.pivot)


@dataclass(frozen=True, eq=False)
class Factors:
    """Factors of a matrix A, of its rows in an order of elimination; without one A is given in it."""

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
        pivots = self.made.U.diagonal() if isinstance(self.made, SuperLU) else self.made.pivot
        return int(np.count_nonzero(pivots < 0))

    @property
    def entries(self) -> int:
        """Entries of both factors."""
        return int(self.made.nnz)


def symmetric_lu(
    matrix: csc_array, *, ordered: bool = False, pivoting: float = 0.0, symmetric: bool = False
) -> Factors:
    """The factors of a matrix with a symmetric pattern, whose coordinates may be `ordered` for elimination already.

    A diagonal entry is the pivot if it has at least the share `pivoting` of the largest entry of its column. With 0 it
    always is: the factors are then those of a symmetric matrix, L D L^T, and their accuracy is to be looked at. A
    `symmetric` matrix is real, and symmetric to the bit. Raises SingularMatrixError if a pivot is zero.
    """
    inside, order = _ordered(matrix, ordered)
    compiled = _library() if pivoting == 0 and np.isrealobj(matrix.data) else None
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


def _ordered(matrix: csc_array, ordered: bool) -> tuple[csc_array, Indices | None]:
    order = None if ordered else np.argsort(elimination_places(matrix))
    return (matrix if order is None else csc_array(matrix[order][:, order])), order


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
    inside, order = _ordered(matrix, ordered)
    if np.isrealobj(matrix.data):
        right = np.random.default_rng(2).standard_normal(matrix.shape[0])
        with suppress(SingularMatrixError):
            factors = symmetric_lu(inside, ordered=True)
            found = factors.solve(right)
            size = np.abs(matrix.data).max(initial=0.0) * np.linalg.norm(found)
            if np.linalg.norm(inside @ found - right) <= INACCURATE * size:
                return Factors(factors.made, order)
    return Factors(symmetric_lu(inside, ordered=True, pivoting=DIAGONAL_PIVOT).made, order)


def _ones(matrix: csc_array) -> csc_array:
    """A matrix with a one for each entry, zeros among them."""
    return csc_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)


def elimination_places(matrix: csc_array) -> Indices:
    """Places of the rows of a matrix in an order of elimination of the pattern of A + A^T, shape (n,).

    >>> from scipy.sparse import csc_array
    >>> line = csc_array([[2.0, 1.0, 0.0], [1.0, 2.0, 1.0], [0.0, 1.0, 2.0]])
    >>> sorted(elimination_places(line).tolist())
    [0, 1, 2]
    """
    size = matrix.shape[0]
    pattern = _ones(matrix)
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
