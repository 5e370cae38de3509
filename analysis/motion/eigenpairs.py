"""Eigenvalues of the stability operator with their right and left vectors: all of them, or those nearest to a shift.

Vectors are in the mass-weighted coordinates of :mod:`~faultgouge.analysis.motion.spectrum`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigs

from ..configuration import HasConfiguration
from ..factors.sparse_lu import general_lu
from ..operators.stiffness import stiffness_matrix
from ..packing.packing import Floats
from .eigenvalues import SAFETY, Complexes, all_modes, mass_weighted, unit_rounding
from .spectrum import dynamical_matrix, participation_ratio, rotation_share


@dataclass(frozen=True, eq=False)
class Eigenpairs:
    """Some eigenvalues with their vectors, in mass-weighted coordinates M^(1/2) q.

    Attributes
    ----------
    values : ndarray of complex, shape (k,)
        Eigenvalues, 1 / time^2.
    right, left : ndarray of complex, shape (3N, k)
        Unit vectors A x = lambda x and y^H A = lambda y^H in columns, in the order (x.., y.., R theta..);
        zero for coordinates on which no force acts.
    solves : int
        Number of sparse solves; 0 for the dense solver.
    axes : int
        Coordinates per particle: 3 for disks, 6 for spheres.
    """

    values: Complexes
    right: Complexes
    left: Complexes
    solves: int
    axes: int = 3

    @property
    def participation(self) -> Floats:
        """Participation ratio of each mode, shape (k,)."""
        return participation_ratio(self.right, self.axes)

    @property
    def rotation(self) -> Floats:
        """Share of rotation in the kinetic energy of each mode, shape (k,)."""
        return rotation_share(self.right, self.axes)

    @property
    def overlap(self) -> Floats:
        """|y^H x| of each eigenvalue, shape (k,)."""
        return np.abs(np.sum(self.left.conj() * self.right, axis=0))


def normal_modes(packing: HasConfiguration) -> Eigenpairs:
    """Compute every mode with its left and right vectors, by LAPACK's dense solver.

    Parameters
    ----------
    packing : Packing
        The configuration.

    Returns
    -------
    Eigenpairs
        Sorted by real part, then imaginary part, as in :func:`spectrum`.
    """
    return Eigenpairs(*all_modes(mass_weighted(stiffness_matrix(packing), packing)), 0, packing.axes)


def closest_to_meeting(modes: Eigenpairs) -> tuple[int, int, float]:
    r"""Find the two real modes that are closest to a coalescence.

    At a coalescence of two real eigenvalues the vectors become one. In the normal form of two modes the cosine between
    the right vectors is :math:`\eta/\delta = 1 - \epsilon`, and :math:`\epsilon` is the distance from the coalescence.
    The two modes are therefore the real modes whose mass-weighted right vectors are most nearly parallel. Motions
    that no force opposes, whose eigenvalue is zero within rounding, do not count: LAPACK's vectors of several of them
    may be parallel by rounding alone.

    Parameters
    ----------
    modes : Eigenpairs
        All modes of a packing, from :func:`normal_modes`.

    Returns
    -------
    tuple of (int, int, float)
        Indices of the two modes, the lower eigenvalue first, and the cosine. The cosine is 0, up to rounding, for the
        modes of a symmetric operator.

    Raises
    ------
    ValueError
        If there are fewer than two such modes.
    """
    zero = np.abs(modes.values) <= SAFETY * unit_rounding(modes.values)
    real = np.flatnonzero((modes.values.imag == 0) & ~zero)
    if len(real) < 2:
        raise ValueError(f"There are {len(real)} real modes that a force opposes; two are needed to meet.")
    cosine = np.abs(modes.right[:, real].real.T @ modes.right[:, real].real)
    np.fill_diagonal(cosine, 0.0)
    first, second = sorted(np.unravel_index(np.argmax(cosine), cosine.shape))
    return int(real[first]), int(real[second]), float(cosine[first, second])


def eigenpairs(packing: HasConfiguration, near: complex, count: int, tolerance: float = 0.0) -> Eigenpairs:
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
    Eigenpairs
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
    factor = general_lu(shifted)
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
    return Eigenpairs(values, spread[0], spread[1], solves, packing.axes)
