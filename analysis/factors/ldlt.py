r"""Factors :math:`L D L^T` of a sparse symmetric matrix without pivoting, and solutions for many right sides.

SuperLU makes :math:`L` and :math:`U` of any matrix. The library of `ldlt.cpp`, built with the plugin, uses the
symmetry: U is :math:`D L^T`. Factorisation and solution take two fifths of the time of SuperLU. The method is
multifrontal (Liu, SIAM Rev. 34, 82 (1992)). Neighbouring columns of one pattern, such as those of a disk, are
eliminated together in a small dense matrix, their front. The contribution of the front to other rows is added to the
front of the parent in the elimination tree.
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
        found = ctypes.CDLL(str(files("faultgouge") / "lib" / "ldlt.so"))
    except OSError:
        return None
    integer, array = ctypes.c_int32, ctypes.c_void_p
    found.elimination_tree.argtypes = [integer, *[array] * 4]
    found.factor_ldlt.argtypes = [integer, *[array] * 8]
    found.solve_ldlt.argtypes = [integer, *[array] * 4, integer, array]
    found.elimination_tree.restype = found.solve_ldlt.restype = None
    found.factor_ldlt.restype = integer
    return found


@dataclass(frozen=True, eq=False)
class SymmetricFactors:
    """Factors of a symmetric matrix of `n` rows.

    Attributes
    ----------
    library : ctypes.CDLL
        That of `ldlt.cpp`.
    start, row, value : ndarray of int64, int32 and float, shape (n + 1,), (entries,) and (entries,)
        L without its diagonal, in compressed columns.
    pivot : ndarray, shape (n,)
        The diagonal of D.
    """

    library: ctypes.CDLL
    start: NDArray[np.int64]
    row: Integers
    value: Floats
    pivot: Floats

    @classmethod
    def of(cls, matrix: csc_array, library: ctypes.CDLL) -> "SymmetricFactors | None":
        """The factors of a matrix that is symmetric to the bit, in the order of elimination; None if a pivot is zero.

        Raises
        ------
        MemoryError
            If there is none for the fronts.
        """
        size = matrix.shape[0]
        columns = matrix.indptr.astype(np.int64), matrix.indices.astype(np.int32, copy=False)
        parent, below, start = np.empty(size, np.int32), np.empty(size, np.int64), np.zeros(size + 1, np.int64)
        library.elimination_tree(size, *_places(*columns, parent, below))
        np.cumsum(below, out=start[1:])
        factors = cls(library, start, np.empty(start[-1], np.int32), np.empty(start[-1]), np.empty(size))
        entries = np.ascontiguousarray(matrix.data, dtype=np.float64)
        made = library.factor_ldlt(size, *_places(*columns, entries, parent), *factors._parts)
        if made < 0:
            raise MemoryError(f"the fronts of a matrix of {size} rows")
        return factors if made else None

    def solve(self, right: Any, trans: str = "N") -> Any:
        """The solution of A x = b, shape (n,) or (n, k); `trans` makes no difference."""
        x = np.array(right, dtype=np.float64, order="C").reshape(len(self.pivot), -1)
        self.library.solve_ldlt(len(x), *self._parts, x.shape[1], x.ctypes.data)
        return x.reshape(np.shape(right))

    @property
    def negative(self) -> int:
        """Negative pivots, as many as A has negative eigenvalues: Sylvester's law of inertia."""
        return int(np.count_nonzero(self.pivot < 0))

    @property
    def _parts(self) -> list[int]:
        return _places(self.start, self.row, self.value, self.pivot)


def _places(*arrays: NDArray[Any]) -> list[int]:
    """Addresses of arrays in memory."""
    return [array.ctypes.data for array in arrays]
