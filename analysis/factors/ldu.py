r"""Factors L D U of a sparse matrix without pivoting, and solutions for many right sides.

L and :math:`U^T` have the same pattern, that of the factors of :math:`A + A^T`, and ones on their diagonals. Of a
symmetric matrix :math:`U = L^T`, so that factors take half of the time and of the memory. The library of `ldu.cpp` is
built with the plugin. A solution for four right sides takes a fifth of the time of SuperLU with 1,000 disks, and two
fifths with 1,000 spheres, whose factors leave the cache.

The method is multifrontal (Liu, SIAM Rev. 34, 82 (1992)). Neighbouring columns of one pattern, such as those of a disk,
are eliminated together in a small dense matrix, their front. The contribution of the front to other rows is added to
the front of the parent in the elimination tree.
"""

import ctypes
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from ..arrays import Floats

Integers = NDArray[np.int32]


@cache
def library() -> ctypes.CDLL | None:
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


@dataclass(frozen=True, eq=False)
class CompiledFactors:
    """Factors of a matrix of `n` rows.

    Attributes
    ----------
    library : ctypes.CDLL
        That of `ldu.cpp`.
    start, row : ndarray of int64 and int32, shape (n + 1,) and (entries,)
        The pattern of L without its diagonal, in compressed columns.
    lower, upper : ndarray, shape (entries,)
        The entries of L, and of the transpose of U; one array if the matrix is symmetric.
    pivot : ndarray, shape (n,)
        The diagonal of D.
    """

    library: ctypes.CDLL
    start: NDArray[np.int64]
    row: Integers
    lower: Floats
    upper: Floats
    pivot: Floats

    @classmethod
    def of(cls, matrix: csc_array, library: ctypes.CDLL, *, symmetric: bool) -> "CompiledFactors | None":
        """The factors of a real matrix in the order of elimination; None if a pivot is zero. `symmetric` says that the
        matrix is, to the bit.

        Raises
        ------
        MemoryError
            If there is none for the fronts.
        """
        transposed = matrix if symmetric else csc_array(matrix.T)
        pattern = _columns(matrix if symmetric else _entries(matrix) + _entries(transposed))
        size = matrix.shape[0]
        parent, below, start = np.empty(size, np.int32), np.empty(size, np.int64), np.zeros(size + 1, np.int64)
        library.elimination_tree(size, *_places(*pattern[:2], parent, below))
        np.cumsum(below, out=start[1:])
        lower = np.empty(start[-1])
        upper = lower if symmetric else np.empty(start[-1])
        factors = cls(library, start, np.empty(start[-1], np.int32), lower, upper, np.empty(size))
        given, turned = _columns(matrix), _columns(transposed)
        halves = [*_places(*given), *([None] * 3 if symmetric else _places(*turned))]
        made = library.factor_ldu(size, *halves, parent.ctypes.data, *factors._parts)
        if made < 0:
            raise MemoryError(f"the fronts of a matrix of {size} rows")
        return factors if made else None

    def solve(self, right: Any, trans: str = "N") -> Any:
        """The solution of A x = b, or with `trans` = "T" of A^T x = b, shape (n,) or (n, k)."""
        x = np.array(right, dtype=np.float64, order="C").reshape(len(self.pivot), -1)
        start, row, lower, upper, pivot = self._parts
        halves = (lower, upper) if trans == "N" else (upper, lower)
        self.library.solve_ldu(len(x), start, row, *halves, pivot, x.shape[1], x.ctypes.data)
        return x.reshape(np.shape(right))

    @property
    def entries(self) -> int:
        """Entries of both factors."""
        return 2 * len(self.lower) + len(self.pivot)

    @property
    def negative(self) -> int:
        """Negative pivots, as many as a symmetric A has negative eigenvalues: Sylvester's law of inertia."""
        return int(np.count_nonzero(self.pivot < 0))

    @property
    def _parts(self) -> list[int]:
        return _places(self.start, self.row, self.lower, self.upper, self.pivot)


def _columns(matrix: csc_array) -> tuple[NDArray[np.int64], Integers, Floats]:
    """Where the columns of a matrix begin, the rows of their entries, and these."""
    entries = np.ascontiguousarray(matrix.data, dtype=np.float64)
    return matrix.indptr.astype(np.int64), matrix.indices.astype(np.int32, copy=False), entries


def _entries(matrix: csc_array) -> csc_array:
    """A matrix with a one for each entry, zeros among them."""
    return csc_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)


def _places(*arrays: NDArray[Any]) -> list[int]:
    """Addresses of arrays in memory."""
    return [array.ctypes.data for array in arrays]
