r"""Small motion of a configuration about its equilibrium: the operators.

With the stiffness K, the damping C and the masses M, small motion obeys :math:`M \ddot q + C \dot q + K q = 0`. A
`Motion` has :math:`A = M^{-1/2} K M^{-1/2}` and :math:`G = M^{-1/2} C M^{-1/2}` on the coordinates that feel a force.
A motion :math:`e^{st}` has :math:`s^2 + s G + A` singular; the mean square displacement D grows as
:math:`e^{2 \mathrm{Re}\, s\, t}`. Without dissipation :math:`s = \pm i\sqrt\lambda` for the eigenvalues of A.

**Contacts at Coulomb's bound** slide on ahead and stick on the way back
(:mod:`~faultgouge.analysis.operators.sliders`). Two linear systems are their neighbours: all stick, with K and C; or
all slide on for ever, with :math:`K + G Y` and :math:`C + G Z`, since then the play :math:`p = Y q + Z \dot q`.
Neither bounds what contacts do that stick and slide in turn.

**The norm of the energy.** Let the symmetric part of A have the eigenvectors Q and the eigenvalues :math:`\Lambda`, and
put :math:`p = W z`, :math:`W = |\Lambda|^{1/2} Q^T`, :math:`v = \dot z` with :math:`z = M^{1/2} q`. Then

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
from functools import cached_property
from types import SimpleNamespace

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array

from ..arrays import Floats, Indices
from ..configuration import Configuration
from ..has_configuration import HasConfiguration
from ..operators.sliders import sliders_of, with_sticking_contacts
from ..operators.stiffness import stiffness_matrix
from .eigenvalues import active_coordinates, mass_weighted


def energy_norm(stiffness: Floats) -> SimpleNamespace:
    """The coordinates p = W z of a stiffness A, shape (E, E).

    Returns
    -------
    SimpleNamespace
        `weight` and `unweight`, W, 1 / time, and its inverse, shape (E, E); `positive`: whether the symmetric part of A
        is positive definite, so that the norm of a state is twice its energy.
    """
    values, vectors = eigh(0.5 * (stiffness + stiffness.T)) if len(stiffness) else (np.zeros(0), stiffness)
    # a mode without a restoring force has no energy of its own: it weighs as much as one of this share
    least = 1e-6 * np.abs(values).max(initial=0.0)
    size = np.sqrt(np.maximum(np.abs(values), least))
    positive = bool(np.all(values > least))
    return SimpleNamespace(weight=size[:, None] * vectors.T, unweight=vectors / size, positive=positive)


def matrix_in_norm(norm: SimpleNamespace, stiffness: Floats, damping: Floats) -> Floats:
    """Z of A and G in an energy norm, shape (2E, 2E), 1 / time."""
    return np.block([[np.zeros_like(norm.weight), norm.weight], [-stiffness @ norm.unweight, -damping]])


@dataclass(frozen=True, eq=False)
class Motion:
    """The linear motion of a configuration, in mass-weighted coordinates M^(1/2) q that feel a force.

    Attributes
    ----------
    configuration : Configuration
        Whose motion it is.
    active : ndarray of int, shape (E,)
        Which coordinates take part, particle by particle.
    root_mass : ndarray, shape (E,)
        M^(1/2).
    stiffness : scipy.sparse.csr_array, shape (E, E)
        A, 1 / time^2.
    damping : scipy.sparse.csr_array, shape (E, E)
        G, 1 / time; without entries if there is no dissipation.
    """

    configuration: Configuration
    active: Indices
    root_mass: Floats
    stiffness: csr_array
    damping: csr_array

    @classmethod
    def of(cls, packing: HasConfiguration, *, sliding: bool | None = None, dissipation: bool = True) -> "Motion":
        """Assemble the operators.

        Parameters
        ----------
        packing : Configuration or Packing
            The equilibrium.
        sliding : bool, optional
            Whether all contacts at Coulomb's bound slide on, or all stick; as the configuration says by default.
        dissipation : bool
            Whether dashpots and drag count.
        """
        configuration = packing.configuration if sliding is None else with_sticking_contacts(packing.configuration)
        if dissipation and configuration.damped:
            k, c = configuration.assembled_operators()
        else:
            k = stiffness_matrix(configuration)
            c = csr_array(k.shape)
        if sliding:
            sliders = sliders_of(configuration)
            k = csr_array(k + sliders.force @ sliders.excess)
            if c.nnz:
                c = csr_array(c + sliders.force @ sliders.viscous_excess)
        a, g = (mass_weighted(matrix, configuration) for matrix in (k, c))
        active = active_coordinates(a)
        active = active[np.argsort(active % len(configuration), kind="stable")]
        root = np.sqrt(configuration.coordinate_mass[active])
        return cls(configuration, active, root, a[active][:, active], g[active][:, active])

    @property
    def particle(self) -> Indices:
        """Whose coordinates they are, shape (E,)."""
        return self.active % len(self.configuration)

    @property
    def dissipative(self) -> bool:
        """Whether there is dissipation."""
        return self.damping.nnz > 0

    @cached_property
    def energy_norm(self) -> SimpleNamespace:
        """The coordinates in which the energy is a sum of squares."""
        return energy_norm(self.stiffness.toarray())

    @property
    def first_order(self) -> Floats:
        """Z, the dense matrix of the first-order system in coordinates of the energy, shape (2E, 2E), 1 / time."""
        return matrix_in_norm(self.energy_norm, self.stiffness.toarray(), self.damping.toarray())
