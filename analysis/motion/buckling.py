r"""Negative eigenvalues of the stability operator, the classical instability, and eigenvalues next to a shift.

A real :math:`\lambda < 0` makes :math:`\omega` imaginary: disks leave the equilibrium without oscillation, and D grows
as :math:`e^{2 \sqrt{-\lambda}\, t}`. With dissipation such an eigenvalue still has a real :math:`s > 0`. Along a branch
of equilibria :math:`\lambda` passes through zero at a turning point. Newton's method may step across a turning point.

Most packings have no negative eigenvalue, and the proof computes none. Every eigenvalue of A has
:math:`\mathrm{Re}\,\lambda \ge \min \lambda(S)` with :math:`S = (A + A^T)/2` (Bendixson, Acta Math. 25, 359
(1902)), and S is positive definite if its factors :math:`L D L^T` have positive pivots (Sylvester's law of inertia).
Otherwise the factors of :math:`S + c` give a bound :math:`-c` below all real parts, and all real negative
eigenvalues lie within c/2 of -c/2, where Arnoldi's iteration with that shift finds every eigenvalue.
"""

from functools import partial

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigs

from ..factors.sparse_lu import DIAGONAL_PIVOT, negative_pivots, symmetric_lu
from ..has_configuration import HasConfiguration
from ..packing.packing import Floats
from .eigenvalues import SAFETY, imbalance, is_negative, operator_rounding, zero_uncertainties
from .modes import Modes
from .spectrum import DENSE_LARGEST, dynamical_matrix, spectrum


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
    particle, symmetric = active % len(packing.configuration), csc_array(0.5 * (matrix + matrix.T))
    shifts = SAFETY * rounding + imbalance(packing)[particle]
    if _is_positive(symmetric, shifts):
        return np.zeros(0)
    if size <= DENSE_LARGEST:
        return spectrum(packing).negative
    bound = max(float(shifts.max()), np.finfo(float).eps ** 0.5 * float(np.abs(matrix.data).max()))
    while not _is_positive(symmetric, bound):
        bound *= 4  # each costs factors, and a loose one more eigenvalues
    count, found = 8, None
    while found is None or (count < size - 2 and np.abs(found.values + 0.5 * bound).max() <= 0.5 * bound):
        count = min(2 * count, size - 2)
        found = nearest_modes(packing, -0.5 * bound, count)
    zero = zero_uncertainties(packing, rounding, particle, found.left[active], found.right[active])
    return np.sort(found.values[is_negative(found.values, found.overlap, rounding, zero)].real)


def _is_positive(symmetric: csc_array, shift: Floats | float) -> bool:
    """Whether S + shift has positive pivots alone; shift is a number, or the entries of a diagonal."""
    shifts = diags_array(np.broadcast_to(shift, symmetric.shape[0]))
    return not symmetric.shape[0] or negative_pivots(csc_array(symmetric + shifts)) == 0


def nearest_modes(packing: HasConfiguration, near: complex, count: int) -> Modes:
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
    shift = near if np.imag(near) else complex(near).real
    number = type(shift)
    matrix = matrix.astype(number)
    shifted = csc_array(matrix - shift * eye_array(size, dtype=number))
    factor = symmetric_lu(shifted, pivoting=DIAGONAL_PIVOT)  # the shift may be next to an eigenvalue
    # A fixed start vector makes ARPACK, and with it every result, reproducible.
    start = np.ones(size, dtype=number)
    inverse, adjoint = (LinearOperator(shifted.shape, partial(factor.solve, trans=side), dtype=number) for side in "NH")
    values, right = eigs(matrix, count, sigma=shift, OPinv=inverse, v0=start)
    mirrored, left = eigs(matrix.T, count, sigma=np.conj(shift), OPinv=adjoint, v0=start)
    order = np.lexsort((values.imag, values.real))
    values, right = values[order], right[:, order]
    # left vectors beside the right vectors of the same eigenvalue
    _, partner = linear_sum_assignment(np.abs(values[:, None] - mirrored.conj()[None, :]))
    return Modes(values, right, left[:, partner], packing.axes).placed(active, packing.coordinates)
