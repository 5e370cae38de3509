"""Sparse factors of large matrices with a symmetric pattern, such as K, or nearly so. All sparse factors are made here.

**Real matrices** in an order of elimination are factored by :mod:`~faultgouge.analysis.factors.ldu`, without pivoting.

**SuperLU**, which SciPy has, factors all others, and finds orders of elimination of minimum degree on the pattern of
A + A^T. Pivots are taken from the diagonal. By default SuperLU joins small columns of the elimination tree to
supernodes and fills these with zeros. Without this, the factors of 300,000 coordinates have three quarters of the
entries, and take half of the time.

**MUMPS**, if python-mumps is installed (``pip install faultgouge[mumps]``), from `MUMPS_FROM` coordinates on. Nested
dissection gives its factors fewer entries, and pivots of two rows keep them accurate. MUMPS cannot run in several
threads at once, so that parallel threads do not use it.
"""

from dataclasses import dataclass
from functools import cache
from threading import RLock
from typing import Any, Protocol

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from ..errors import FaultgougeError
from ..packing.packing import Floats, Indices
from .ldu import CompiledFactors, library


class SingularMatrixError(FaultgougeError):
    """A matrix has no factors: a pivot is zero."""

    @classmethod
    def of(cls, matrix: csc_array, why: object) -> "SingularMatrixError":
        """The sentence about a matrix."""
        return cls(f"The sparse factors of a matrix of {matrix.shape[0]} rows: {why}.")


SYMMETRIC: dict[str, Any] = {"relax": 1, "options": {"SymmetricMode": True}}

DIAGONAL_PIVOT = 0.01
"""Share of the largest entry of its column that a diagonal entry must have to be the pivot of any matrix: MUMPS's
default, too."""

INACCURATE = 1e-11
"""Relative residual of solutions without pivoting from which on pivots are chosen; usually it is some 1e-13."""

MUMPS_FROM = 1_000_000
"""Coordinates from which on MUMPS is used: it takes as long there, and half of the memory."""


class Factors(Protocol):
    """Factors of a matrix A."""

    def solve(self, right: Any, trans: str = "N") -> Any:
        """The solution of A x = b, or with `trans` = "T" of A^T x = b, shape (n,) or (n, k)."""

    @property
    def negative(self) -> int:
        """Negative pivots of a symmetric A, as many as it has negative eigenvalues: Sylvester's law of inertia."""


@dataclass(frozen=True, eq=False)
class SuperLUFactors:
    """The factors of SuperLU."""

    lu: SuperLU

    def solve(self, right: Any, trans: str = "N") -> Any:
        """See :class:`Factors`."""
        return self.lu.solve(right, trans)

    @property
    def entries(self) -> int:
        """Entries of both factors."""
        return int(self.lu.nnz)

    @property
    def negative(self) -> int:
        """See :class:`Factors`; of factors without pivoting alone."""
        return int(np.count_nonzero(self.lu.U.diagonal() < 0))


def symmetric_lu(
    matrix: csc_array, *, ordered: bool = False, pivoting: float = 0.0, symmetric: bool = False, mumps: bool = True
) -> Factors:
    """The factors of a matrix with a symmetric pattern.

    Parameters
    ----------
    matrix : scipy.sparse.csc_array, shape (n, n)
        Symmetric, or nearly so.
    ordered : bool
        Whether its coordinates are in the order of elimination already; MUMPS orders by itself.
    pivoting : float
        Share of the largest entry of a column that its diagonal entry must have to be SuperLU's pivot. With 0 it always
        is: the factors are then those of a symmetric matrix, L D L^T, and their accuracy is to be looked at.
    symmetric : bool
        Whether it is symmetric to the bit; real then.
    mumps : bool
        Whether MUMPS may be used: not by several threads at a time, nor where the digits must not depend on it.

    Raises
    ------
    SingularMatrixError
        If a pivot is zero.
    """
    if mumps and matrix.shape[0] >= MUMPS_FROM and _mumps() is not None:
        return MumpsFactors(matrix, symmetric)
    return _without_mumps(matrix, ordered=ordered, pivoting=pivoting, symmetric=symmetric)


def _without_mumps(
    matrix: csc_array, *, ordered: bool, pivoting: float = 0.0, symmetric: bool = False
) -> "SuperLUFactors | CompiledFactors":
    compiled = library() if ordered and pivoting == 0 and np.isrealobj(matrix.data) else None
    # where a pivot is zero SuperLU takes another one
    factors = CompiledFactors.of(matrix, compiled, symmetric=symmetric) if compiled is not None else None
    return factors or SuperLUFactors(_superlu(matrix, "NATURAL" if ordered else "MMD_AT_PLUS_A", pivoting))


def general_lu(matrix: csc_array) -> SuperLUFactors:
    """The factors of any square matrix, with pivots from its columns.

    The pivot is the diagonal entry unless another one of its column is larger than a hundred of it: so the order of
    elimination, that of a symmetric pattern, remains. It takes half of the time of SuperLU's default, and gives the
    same digits. Raises SingularMatrixError if a pivot is zero.
    """
    return SuperLUFactors(_superlu(matrix, "MMD_AT_PLUS_A", DIAGONAL_PIVOT))


def accurate_lu(matrix: csc_array) -> "SuperLUFactors | CompiledFactors":
    """The factors of a real matrix in the order of elimination, without pivoting where the solutions are accurate.

    Raises SingularMatrixError if a pivot is zero.
    """
    right = np.random.default_rng(2).standard_normal(matrix.shape[0])
    try:
        factors = _without_mumps(matrix, ordered=True)
        found = factors.solve(right)
        size = np.abs(matrix.data).max() * np.linalg.norm(found)
        if np.linalg.norm(matrix @ found - right) <= INACCURATE * size:
            return factors
    except SingularMatrixError:
        pass
    return _without_mumps(matrix, ordered=True, pivoting=DIAGONAL_PIVOT)


@dataclass(frozen=True, eq=False)
class ReorderedFactors:
    """Factors of a real matrix, whose rows the order of elimination has moved.

    Attributes
    ----------
    factors : SuperLUFactors or CompiledFactors
    order : ndarray of int, shape (n,)
        The rows in the order of elimination.
    """

    factors: "SuperLUFactors | CompiledFactors"
    order: Indices

    @classmethod
    def of(cls, matrix: csc_array) -> "ReorderedFactors":
        """Factor a matrix that may be far from symmetric; see `accurate_lu`."""
        order = np.argsort(minimum_degree(csc_array(abs(matrix) + abs(matrix.T))))
        return cls(accurate_lu(csc_array(matrix[order][:, order])), order)

    @property
    def entries(self) -> int:
        """Entries of both factors."""
        return self.factors.entries

    def solve(self, right: Floats) -> Floats:
        """The solution of A x = b, shape (n,) or (n, k)."""
        found = np.empty(right.shape)
        found[self.order] = self.factors.solve(right[self.order])
        return found


def minimum_degree(matrix: csc_array) -> Indices:
    """Places of the rows of a matrix with a symmetric pattern in an order of elimination, shape (n,).

    Rows of one pattern, such as those of a particle, are ordered as one: SuperLU gives an order with the factors alone,
    and the particles' factors are smaller.
    """
    size = matrix.shape[0]
    pattern = csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    # rows of one pattern have the same sum of random numbers
    _, group = np.unique(pattern @ np.random.default_rng(0).random(size), return_inverse=True)
    member = csr_array((np.ones(size), group, np.arange(size + 1)), shape=(size, int(group.max(initial=-1)) + 1))
    coupled = csc_array(member.T @ pattern @ member)
    dominant = csc_array(coupled + diags_array(1.0 + coupled.sum(axis=0)))
    places = np.empty(size, dtype=np.intp)
    places[np.argsort(_superlu(dominant, "MMD_AT_PLUS_A", 0.0).perm_c[group], kind="stable")] = np.arange(size)
    return places


def _superlu(matrix: csc_array, order: str, pivoting: float) -> SuperLU:
    try:
        return splu(matrix, permc_spec=order, diag_pivot_thresh=pivoting, **SYMMETRIC)
    except RuntimeError as error:  # SuperLU's only word for it
        raise SingularMatrixError.of(matrix, error) from error


@cache
def _mumps() -> Any:
    """The module of python-mumps; None where it is not installed."""
    try:
        import mumps
    except ImportError:
        return None
    return mumps


_LOCK = RLock()
"""Lock on MUMPS, whose factors share variables: held while factors are made, used or freed."""


class MumpsFactors:
    """The factors of MUMPS, see :class:`Factors`.

    Parameters
    ----------
    matrix : scipy.sparse.csc_array, shape (n, n)
    symmetric : bool
        Whether half of the matrix says all of it.
    """

    SINGULAR = (-6, -10)
    """Errors of MUMPS for a matrix without factors: singular by its structure, and by its numbers."""

    def __init__(self, matrix: csc_array, symmetric: bool) -> None:
        mumps = _mumps()
        with _LOCK:
            self._context = mumps.Context()
            self._context.set_matrix(matrix, symmetric=symmetric)
            try:
                # nested dissection by PORD, which every MUMPS has: a tenth fewer entries than minimum fill
                self._context.factor(ordering="pord", pivot_tol=DIAGONAL_PIVOT)
            except mumps.MUMPSError as error:
                if self._context.mumps_instance.infog[1] not in self.SINGULAR:
                    raise
                raise SingularMatrixError.of(matrix, error) from error

    def solve(self, right: Any, trans: str = "N") -> Any:
        """See :class:`Factors`."""
        with _LOCK:
            self._context.mumps_instance.icntl[9] = 1 if trans == "N" else 0
            return self._context.solve(right)

    @property
    def negative(self) -> int:
        """See :class:`Factors`."""
        return int(self._context.mumps_instance.infog[12])

    def __del__(self) -> None:
        with _LOCK:
            self._context.mumps_instance = None
