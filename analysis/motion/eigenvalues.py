r"""Eigenvalues of a mass-weighted operator: which grow, and which are real, negative or zero but for rounding.

This is the one place that says what grows. An eigenvalue of :math:`A = M^{-1/2} K M^{-1/2}` grows if its imaginary part
exceeds :math:`\kappa u |A|`, or if it is real and below zero by more than the uncertainty of zero. With dissipation an
eigenvalue s of the first-order matrix Z grows if Re s exceeds :math:`\kappa u |Z|`. Here u is the unit roundoff and
:math:`\kappa = 1/|y^H x|` of unit left and right vectors.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ..arrays import Complexes, Floats, Indices
from ..has_configuration import HasConfiguration

SAFETY = 50.0
"""Imaginary parts count from this many times their rounding uncertainty.

LAPACK's eigenvalues of one operator with its coordinates in different orders differ by up to 20 kappa u |A|_F
over the 285 eigenvalues of a packing of 100 disks (measured, at five loads), and kappa of a pair that is
itself noise is uncertain by a factor of two or so.
"""


@dataclass(frozen=True)
class Linear:
    """What is known of linear motion: the one holder of a growth rate.

    Attributes
    ----------
    stable : bool or None
        Whether no motion grows beyond rounding; None if that is not known, for the `reasons`.
    growth_rate : float
        Of D, 1 / time: the largest 2 Re s that is known, negative if every motion decays; zero if that is zero but for
        rounding, or if none is known.
    error : float
        Of the growth rate, 1 / time.
    free : int
        Motions that no force opposes, and that drift; they do not count.
    s : complex
        Of the fastest motion, Im s >= 0, 1 / time.
    said : str
        How it is known, a clause; empty where all eigenvalues are.
    at_least : bool
        Whether the growth rate is only known to be no less.
    searched : float
        Growth rate of D, 1 / time, below which growth may not have been seen; 0 where nothing else grows.
    reasons : tuple of str
        Why it is not known whether the packing is stable, clauses.
    """

    stable: bool | None
    growth_rate: float
    error: float = 0.0
    free: int = 0
    s: complex = 0j
    said: str = ""
    at_least: bool = False
    searched: float = 0.0
    reasons: tuple[str, ...] = ()


def mass_weighted(stiffness: csr_array, packing: HasConfiguration) -> csr_array:
    """M^(-1/2) K M^(-1/2), zero rows and all; 1 / time^2."""
    scale = 1.0 / np.sqrt(packing.coordinate_mass)
    rows = np.repeat(scale, np.diff(stiffness.indptr))
    columns = stiffness.indices
    return csr_array((rows * stiffness.data * scale[columns], columns, stiffness.indptr), shape=stiffness.shape)


def active_coordinates(matrix: csr_array) -> Indices:
    """Coordinates that feel a force: the rows that are not zero."""
    return np.flatnonzero(np.diff(matrix.indptr))


def unit_rounding(matrix: Floats | Complexes) -> float:
    """u |A|_F with the unit roundoff u = 2^-53: the backward error scale of an eigenvalue solver."""
    return float(0.5 * np.finfo(np.float64).eps * np.linalg.norm(matrix))


def operator_rounding(packing: HasConfiguration, matrix: Floats | Complexes) -> float:
    """Backward error of eigenvalues over SAFETY: of the solver, or of the differences by which a K was measured."""
    error = packing.configuration.operator_error * float(np.linalg.norm(matrix))
    return max(unit_rounding(matrix), error / SAFETY)


def in_balance(packing: HasConfiguration) -> bool:
    """Whether the net force on each particle is rounding, at most that of a dump's digits."""
    force = packing.configuration.largest_force
    if not force and packing.configuration.stiffness is not None:
        return True  # no force is known to compare with; whoever measured K has looked
    # dumps with few digits leave 1e-6; a packing before it is brought to rest, 1e-2 and more
    return packing.residual <= 1e-4 * force


def imbalance(packing: HasConfiguration) -> Floats:
    """What forces that are out of balance leave of an eigenvalue of zero, by particle, shape (N,), 1 / time^2.

    A motion that stretches no contact has the eigenvalue zero as the forces F of the contacts cancel, whose parts in A
    are F / (R m). Forces on a particle that are out of balance by r leave r / (R m) of these in the rows of this
    particle. Of a packing that moves, A counts as it is: zeros.
    """
    c = packing.configuration
    return c.particle_residual / (c.radius * c.mass) if in_balance(packing) else np.zeros(len(c))


def zero_uncertainty(packing: HasConfiguration, rounding: float) -> float:
    """Uncertainty of an eigenvalue of zero that is perfectly conditioned, 1 / time^2, of whatever particles move."""
    return SAFETY * rounding + float(imbalance(packing).max(initial=0.0))


def zero_uncertainties(
    packing: HasConfiguration, rounding: float, particle: Indices, left: Complexes, right: Complexes
) -> Floats:
    """The same of modes that are known, shape (k,): forces on particles that take no part do not count.

    `left` and `right` (n, k) have the unit vectors y and x of the modes: to first order an eigenvalue changes by y^H dA
    x / y^H x. `particle` (n,) says whose coordinates their rows are; `rounding` is u |A|_F, 1 / time^2.
    """
    return np.asarray(SAFETY * rounding + imbalance(packing)[particle] @ (np.abs(left) * np.abs(right)))


def is_negative(values: Complexes, overlap: Floats, rounding: float, uncertainty: Floats | float) -> NDArray[np.bool_]:
    """Which eigenvalues are real but for rounding, which makes pairs of equal ones, and below zero by more than kappa
    times the uncertainty of one of zero."""
    return (np.abs(values.imag) * overlap <= SAFETY * rounding) & (-values.real * overlap > uncertainty)


def is_zero(values: Complexes, overlap: Floats, alike: float, uncertainty: Floats) -> NDArray[np.bool_]:
    """Which eigenvalues are zero: within the uncertainty of zero of all modes alike, and kappa times that of each."""
    return (np.abs(values) <= alike) & (np.abs(values) * overlap <= uncertainty)


def exceeds_rounding(eigenvalue: complex, overlap: float | np.floating, rounding: float) -> bool:
    """Whether an imaginary part exceeds SAFETY kappa u |A|, its own rounding uncertainty; `overlap` is |y^H x| of its
    unit vectors, and `rounding` u |A|_F of the operator."""
    return bool(abs(eigenvalue.imag) * overlap > SAFETY * rounding)


def growing_undamped(
    values: Complexes, overlap: Floats, rounding: float, zero: Floats | float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which eigenvalues of A grow with oscillation, as complex pairs, and which without, as negative ones.

    `overlap` is |y^H x| of their unit vectors, `rounding` u |A|_F, and `zero` the uncertainty of an eigenvalue of zero,
    of all modes alike or of each; 1 / time^2.
    """
    return np.abs(values.imag) * overlap > SAFETY * rounding, is_negative(values, overlap, rounding, zero)


def exponential(rate: float, digits: int, at_least: bool = False) -> str:
    """D as an exponential, with so many digits; where the rate is `at_least` that, with two digits, rounded down."""
    if not at_least or rate <= 0:
        return f"D as exp({rate:.{digits}g} t)"
    place = 10.0 ** (np.floor(np.log10(rate)) - 1)
    return f"D at least as exp({place * np.floor(rate / place):.2g} t), not known closer"
