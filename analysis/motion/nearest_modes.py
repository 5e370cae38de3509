"""The modes nearest to a shift: eigenvalues of the stability operator with their right and left vectors."""

import numpy as np
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigs

from ..factors.sparse_lu import DIAGONAL_PIVOT, symmetric_lu
from ..has_configuration import HasConfiguration
from .eigenvalues import Complexes
from .modes import Modes
from .spectrum import dynamical_matrix


def nearest_modes(packing: HasConfiguration, near: complex, count: int, tolerance: float = 0.0) -> Modes:
    """Compute the eigenvalues nearest to a shift, with left and right vectors, by shift-invert Arnoldi (ARPACK).

    One sparse LU factorisation of :math:`A - \\sigma` serves the right vectors and, transposed, the left
    ones; the cost is a few solves, so that packings far too large for the dense solver are possible.

    Parameters
    ----------
    packing : Packing
        The configuration.
    near : complex
        The shift sigma, 1 / time^2. It must not be exactly an eigenvalue.
    count : int
        Number of eigenvalues, from 1 to E - 2, with E the number of coordinates on which a force acts.
    tolerance : float
        Relative error of the eigenvalues of the inverted operator at which the iteration may end; 0 for the precision
        of doubles.

    Returns
    -------
    Modes
        Sorted by real part, then imaginary part. A complex eigenvalue at the edge of this set may lack its partner.

    Raises
    ------
    ValueError
        If the count is out of range.
    scipy.sparse.linalg.ArpackError
        If Arnoldi's iteration does not converge.
    """
    from scipy.optimize import linear_sum_assignment

    matrix, active = dynamical_matrix(packing)
    size = matrix.shape[0]
    if not 1 <= count <= size - 2:
        raise ValueError(f"{count} eigenvalues were asked of an operator with {size}; at most {size - 2} are possible.")
    number = np.float64 if np.imag(near) == 0 else np.complex128
    shift = near if number is np.complex128 else complex(near).real
    matrix = matrix.astype(number)
    shifted = csc_array(matrix - shift * eye_array(size, dtype=number))
    factor = symmetric_lu(shifted, pivoting=DIAGONAL_PIVOT)  # the shift may be next to an eigenvalue
    # A fixed start vector makes ARPACK, and with it every result, reproducible.
    start = np.ones(size, dtype=number)
    solves = 0

    def solve(vector: Complexes, trans: str) -> Complexes:
        nonlocal solves
        solves += 1
        return factor.solve(vector, trans=trans)

    inverse = LinearOperator(shifted.shape, lambda v: solve(v, "N"), dtype=number)
    values, right = eigs(matrix, count, sigma=shift, OPinv=inverse, v0=start, tol=tolerance)
    adjoint = LinearOperator(shifted.shape, lambda v: solve(v, "H"), dtype=number)
    mirrored, left = eigs(matrix.T, count, sigma=np.conj(shift), OPinv=adjoint, v0=start, tol=tolerance)
    order = np.lexsort((values.imag, values.real))
    values, right = values[order], right[:, order]
    # left vectors beside the right vectors of the same eigenvalue
    _, partner = linear_sum_assignment(np.abs(values[:, None] - mirrored.conj()[None, :]))
    spread = np.zeros((2, packing.coordinates, len(values)), dtype=np.complex128)
    spread[0, active], spread[1, active] = right, left[:, partner]
    return Modes(values, spread[0], spread[1], axes=packing.axes, solves=solves)
