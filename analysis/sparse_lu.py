"""SuperLU for large matrices with a symmetric pattern, such as K: factors as sparse as those of a symmetric matrix.

The order of elimination is one of minimum degree on the pattern, and pivots are taken from the diagonal. SuperLU would
also join small columns of the elimination tree to supernodes and fill them with zeros; without that the factors of
300,000 coordinates have three quarters of the entries, and take half of the time.
"""

from typing import Any

from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from .errors import FaultgougeError


class SingularMatrixError(FaultgougeError):
    """A matrix has no factors: a pivot is zero."""


SYMMETRIC: dict[str, Any] = {"relax": 1, "options": {"SymmetricMode": True}}


def symmetric_lu(matrix: csc_array, *, ordered: bool = False, pivoting: float = 0.0) -> SuperLU:
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

    Raises
    ------
    SingularMatrixError
        If a pivot is zero.
    """
    order = "NATURAL" if ordered else "MMD_AT_PLUS_A"
    try:
        return splu(matrix, permc_spec=order, diag_pivot_thresh=pivoting, **SYMMETRIC)
    except RuntimeError as error:  # SuperLU's only word for it
        raise SingularMatrixError(f"The sparse factors of a matrix of {matrix.shape[0]} rows: {error}.") from error
