r"""Negative eigenvalues of the stability operator: the classical instability, for packings of any size.

A real :math:`\lambda < 0` makes :math:`\omega` imaginary: disks leave the equilibrium without oscillation, and D grows
as :math:`e^{2 \sqrt{-\lambda}\, t}`. With dissipation such an eigenvalue still has a real :math:`s > 0`. Along a branch
of equilibria :math:`\lambda` passes through zero at a turning point. Newton's method may step across a turning point.

Most packings have no negative eigenvalue, and the proof computes none. Every eigenvalue of A has
:math:`\mathrm{Re}\,\lambda \ge \min \lambda(S)` with :math:`S = (A + A^T)/2` (Bendixson, Acta Math. 25, 359
(1902)), and S is positive definite if its factors :math:`L D L^T` have positive pivots (Sylvester's law of inertia).
Otherwise the factors of :math:`S + c` give a bound :math:`-c` below all real parts, and all real negative
eigenvalues lie within c/2 of -c/2, where Arnoldi's iteration with that shift finds every eigenvalue.
"""

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array

from ..factors.sparse_lu import SingularMatrixError, symmetric_lu
from ..has_configuration import HasConfiguration
from ..packing.packing import Floats
from .eigenvalues import SAFETY, active_coordinates, imbalance, is_negative, operator_rounding, zero_uncertainties
from .nearest_modes import nearest_modes
from .spectrum import DENSE_LARGEST, dynamical_matrix, spectrum

BOUND_FACTOR = 4.0
"""Factor from one bound that is tried to the next: each costs factors, and a loose one more eigenvalues."""

FIRST_COUNT = 16
"""Eigenvalues that are asked for at first; twice as many until the interval is covered."""


def negative_eigenvalues(packing: HasConfiguration) -> Floats:
    """The real negative eigenvalues of a packing, beyond the uncertainty of rounding and of forces out of balance.

    If the symmetric part of the operator is positive definite, a sparse factorisation shows that there are none.

    Parameters
    ----------
    packing : Packing or Configuration
        In equilibrium.

    Returns
    -------
    ndarray, shape (B,)
        The most negative first, 1 / time^2. Empty if the packing does not buckle. Complex pairs are not included.
    """
    matrix, active = dynamical_matrix(packing)
    size, rounding = matrix.shape[0], operator_rounding(packing, matrix.data)
    particle = active % len(packing.configuration)
    symmetric = csc_array(0.5 * (matrix + matrix.T))
    shifts = SAFETY * rounding + imbalance(packing)[particle]
    if _is_positive(symmetric, shifts):
        return np.zeros(0)
    if size <= DENSE_LARGEST:
        return spectrum(packing).negative
    bound = max(float(shifts.max()), np.finfo(float).eps ** 0.5 * float(np.abs(matrix.data).max()))
    while not _is_positive(symmetric, bound):
        bound *= BOUND_FACTOR
    count = FIRST_COUNT
    while True:
        count = min(count, size - 2)
        found = nearest_modes(packing, -0.5 * bound, count)
        if count == size - 2 or np.abs(found.values + 0.5 * bound).max() > 0.5 * bound:
            break
        count *= 2
    zero = zero_uncertainties(packing, rounding, particle, found.left[active], found.right[active])
    return np.sort(found.values[is_negative(found.values, found.overlap, rounding, zero)].real)


def surely_positive(matrix: csr_array) -> bool:
    """Whether no eigenvalue of an operator is negative, as its symmetric part is positive definite.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array, shape (n, n)
        Zero rows are left out.
    """
    active = active_coordinates(matrix)
    inner = matrix[active][:, active]
    return _is_positive(csc_array(0.5 * (inner + inner.T)), 0.0)


def _is_positive(symmetric: csc_array, shift: Floats | float) -> bool:
    """Whether S + shift has positive pivots alone; shift is a number, or the entries of a diagonal."""
    size = symmetric.shape[0]
    if size == 0:
        return True
    try:
        return (
            symmetric_lu(csc_array(symmetric + diags_array(np.broadcast_to(shift, size))), symmetric=True).negative == 0
        )
    except SingularMatrixError:
        return False
