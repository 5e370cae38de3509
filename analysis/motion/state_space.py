r"""Small motion with dissipation as a first-order system, in coordinates in which the energy is a sum of squares.

With the stiffness K, the damping matrix C and the masses M, small motion obeys
:math:`M \ddot q + C \dot q + K q = 0`. In mass-weighted coordinates :math:`z = M^{1/2} q` the matrices are
:math:`A = M^{-1/2} K M^{-1/2}` and :math:`G = M^{-1/2} C M^{-1/2}`. Let the symmetric part of A have the
eigenvectors Q and the eigenvalues :math:`\Lambda`, and put :math:`p = W z`, :math:`W = |\Lambda|^{1/2} Q^T`,
:math:`v = \dot z`. Then

.. math::

    \frac{\mathrm d}{\mathrm dt} \begin{pmatrix} p \\ v \end{pmatrix} = Z \begin{pmatrix} p \\ v \end{pmatrix},
    \qquad Z = \begin{pmatrix} 0 & W \\ -A W^{-1} & -G \end{pmatrix}, \qquad
    \tfrac12 (|p|^2 + |v|^2) = \tfrac12 \dot q^T M \dot q + \tfrac12 q^T K_s q,

the kinetic energy and the energy of the symmetric part :math:`K_s` of K, where :math:`K_s` is positive. If K is
symmetric and there is no dissipation, Z is antisymmetric: every eigenvalue is perfectly conditioned, and no state grows
in the norm of the energy. Any other part of Z comes from the antisymmetric part of K, or from dissipation. An
eigenvalue s of Z is an eigenvalue of
:math:`s^2 M + s C + K`, and the upper half of its eigenvector belongs to the displacement.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array

from ..configuration import HasConfiguration
from ..operators.damping import coordinate_mass, damping_matrix
from ..operators.stiffness import stiffness_matrix
from ..packing.packing import Floats, Indices
from .eigenvalues import Complexes, active_coordinates, mass_weighted

SOFTEST = 1e-6
"""Eigenvalues of the symmetric part below this share of the largest weigh as much: a mode without a restoring force has
no energy of its own."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    """The first-order system of a packing, without coordinates that feel no force.

    Attributes
    ----------
    active : ndarray of int, shape (E,)
        Which of the 3N coordinates (x.., y.., R theta..) take part.
    root_mass : ndarray, shape (E,)
        M^(1/2).
    stiffness, damping : ndarray, shape (E, E)
        A, 1 / time^2, and G, 1 / time.
    weight, unweight : ndarray, shape (E, E)
        W, 1 / time, and its inverse.
    positive : bool
        Whether the symmetric part of A is positive definite, so that the norm of a state is twice its energy.
    """

    active: Indices
    root_mass: Floats
    stiffness: Floats
    damping: Floats
    weight: Floats
    unweight: Floats
    positive: bool

    @classmethod
    def of(cls, packing: HasConfiguration) -> "StateSpace":
        """Set up the system of a packing.

        Parameters
        ----------
        packing : Packing
            The equilibrium, with its dashpots and drag.
        """
        a = mass_weighted(stiffness_matrix(packing), packing)
        g = mass_weighted(damping_matrix(packing), packing)
        return cls.of_matrices(a, g, np.sqrt(coordinate_mass(packing)))

    @classmethod
    def of_matrices(cls, stiffness: csr_array, damping: csr_array, root_mass: Floats) -> "StateSpace":
        """Set up the system of A and G, shape (n, n), and of M^(1/2), shape (n,); zero rows of A are left out."""
        active = active_coordinates(csr_array(stiffness))
        a, g = (csr_array(matrix)[active][:, active].toarray() for matrix in (stiffness, damping))
        values, vectors = eigh(0.5 * (a + a.T)) if len(active) else (np.zeros(0), a)
        least = SOFTEST * np.abs(values).max(initial=0.0)
        size = np.sqrt(np.maximum(np.abs(values), least))
        weight, unweight = size[:, None] * vectors.T, vectors / size
        return cls(active, root_mass[active], a, g, weight, unweight, bool(np.all(values > least)))

    @property
    def matrix(self) -> Floats:
        """Z, shape (2E, 2E), 1 / time."""
        size = len(self.active)
        z = np.zeros((2 * size, 2 * size))
        z[:size, size:] = self.weight
        z[size:, :size] = -self.stiffness @ self.unweight
        z[size:, size:] = -self.damping
        return z

    def state(self, displacement: Floats, velocity: Floats) -> Floats:
        """(p, v) of a mass-weighted displacement z and its rate, shape (2E,)."""
        return np.concatenate([self.weight @ displacement, velocity])


def released_motion(rate: Complexes, time: Floats) -> tuple[Complexes]:
    """x' = s x from x = 1."""
    return (np.exp(rate * time),)


def driven_motion(omega: float, rate: Complexes, time: Floats) -> tuple[Complexes]:
    """x' = s x + cos(omega t) from x = 0: the mean of (exp(i omega t) - exp(s t)) / (i omega - s) and its mirror."""
    rate = np.asarray(rate, dtype=np.complex128)
    return (0.5 * (_quotient(rate, 1j * omega, time) + _quotient(rate, -1j * omega, time)),)


def _quotient(a: Complexes, b: complex, time: Floats) -> Complexes:
    """(exp(a t) - exp(b t)) / (a - b), without cancellation near a = b and without overflow."""
    first, second = np.broadcast_arrays(a, np.complex128(b))
    swap = first.real < second.real
    larger, smaller = np.where(swap, second, first), np.where(swap, first, second)
    difference = smaller - larger  # exp(larger t) expm1(difference t) / difference
    safe = np.where(difference == 0, 1, difference)
    value = np.where(difference == 0, time, np.expm1(difference * time) / safe)
    return np.asarray(np.exp(larger * time) * value)
