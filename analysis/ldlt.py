r"""Factors :math:`L D L^T` of a sparse symmetric matrix, solved with for several right sides at a time.

SuperLU's own solution calls BLAS for every few columns, which have some fifty entries each: most of its time goes into
the calls. The library of `ldlt.cpp`, built with the plugin, goes once through the entries for six right sides, and
through L alone: U is :math:`D L^T`. With 29,000 coordinates it takes half of the time.
"""

import ctypes
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU

from .packing import Floats, Indices

Integers = NDArray[np.int32]


@cache
def library() -> ctypes.CDLL | None:
    """The compiled library; None where it has not been built."""
    try:
        found = ctypes.CDLL(str(files("faultgouge") / "lib" / "ldlt.so"))
    except OSError:
        return None
    integer, array = ctypes.c_int32, ctypes.c_void_p
    found.solve_ldlt.argtypes = [integer, array, array, array, array, integer, array]
    found.solve_ldlt.restype = None
    return found


@dataclass(frozen=True, eq=False)
class SymmetricFactors:
    """Factors of a symmetric matrix of `n` rows, made without pivoting.

    Attributes
    ----------
    library : ctypes.CDLL
        That of `ldlt.cpp`.
    place : ndarray of int, shape (n,), or slice
        Places of the rows in the order of elimination; all of them where they are in that order.
    start, row, value : ndarray of int32, int32 and float, shape (n + 1,), (entries,) and (entries,)
        L without its diagonal, in compressed columns.
    pivot : ndarray, shape (n,)
        The diagonal of D.
    """

    library: ctypes.CDLL
    place: Indices | slice
    start: Integers
    row: Integers
    value: Floats
    pivot: Floats

    @classmethod
    def of(cls, lu: SuperLU, library: ctypes.CDLL) -> "SymmetricFactors":
        """Those of a symmetric matrix that SuperLU has factored with its diagonal entries as pivots (`perm_r` is
        `perm_c`)."""
        lower, size = lu.L, lu.shape[0]
        below = np.ones(lower.nnz, dtype=bool)
        below[lower.indptr[:-1]] = False  # the diagonal comes first in its column
        start = (lower.indptr - np.arange(size + 1)).astype(np.int32)
        row = lower.indices[below].astype(np.int32, copy=False)
        ordered = np.array_equal(lu.perm_c, np.arange(size))
        return cls(library, slice(None) if ordered else lu.perm_c, start, row, lower.data[below], lu.U.diagonal())

    def solve(self, right: Any, trans: str = "N") -> Any:
        """The solution of A x = b, shape (n,) or (n, k); `trans` makes no difference."""
        x = np.empty((len(self.pivot), right.size // len(self.pivot)))
        x[self.place] = np.reshape(right, x.shape)
        parts = (self.start, self.row, self.value, self.pivot)
        self.library.solve_ldlt(len(x), *(part.ctypes.data for part in parts), x.shape[1], x.ctypes.data)
        return x[self.place].reshape(right.shape)

    @property
    def negative(self) -> int:
        """Negative pivots, as many as A has negative eigenvalues: Sylvester's law of inertia."""
        return int(np.count_nonzero(self.pivot < 0))
