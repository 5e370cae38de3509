r"""The norm of the energy, and small motion as a first-order system in its coordinates.

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
eigenvalue s of Z is an eigenvalue of :math:`s^2 M + s C + K`, and the upper half of its eigenvector belongs to the
displacement.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array

from ..arrays import Floats, Indices
from .eigenvalues import active_coordinates

SOFTEST_SHARE = 1e-6
"""Eigenvalues of the symmetric part below this share of the largest weigh as much: a mode without a restoring force has
no energy of its own."""


@dataclass(frozen=True, eq=False)
class EnergyNorm:
    """The coordinates p = W z of a stiffness A, without coordinates that feel no force.

    Attributes
    ----------
    active : ndarray of int, shape (E,)
        Which coordinates of A feel a force.
    weight, unweight : ndarray, shape (E, E)
        W, 1 / time, and its inverse.
    positive : bool
        Whether the symmetric part of A is positive definite, so that the norm of a state is twice its energy.
    """

    active: Indices
    weight: Floats
    unweight: Floats
    positive: bool

    @classmethod
    def of(cls, stiffness: csr_array) -> "EnergyNorm":
        """The norm of A, shape (n, n)."""
        active = active_coordinates(stiffness)
        a = stiffness[active][:, active].toarray()
        values, vectors = eigh(0.5 * (a + a.T)) if len(active) else (np.zeros(0), a)
        least = SOFTEST_SHARE * np.abs(values).max(initial=0.0)
        size = np.sqrt(np.maximum(np.abs(values), least))
        return cls(active, size[:, None] * vectors.T, vectors / size, bool(np.all(values > least)))

    def first_order(self, stiffness: csr_array, damping: csr_array) -> Floats:
        """Z of A and G, shape (2E, 2E), 1 / time."""
        a, g = (matrix[self.active][:, self.active].toarray() for matrix in (stiffness, damping))
        size = len(self.active)
        z = np.zeros((2 * size, 2 * size))
        z[:size, size:] = self.weight
        z[size:, :size] = -a @ self.unweight
        z[size:, size:] = -g
        return z

    def state(self, displacement: Floats, velocity: Floats) -> Floats:
        """(p, v) of a mass-weighted displacement z and its rate, shape (2E,)."""
        return np.concatenate([self.weight @ displacement, velocity])
