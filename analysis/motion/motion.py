r"""Small motion of a configuration about its equilibrium: the operators.

With the stiffness K, the damping C and the masses M, small motion obeys :math:`M \ddot q + C \dot q + K q = 0`. A
`Motion` has :math:`A = M^{-1/2} K M^{-1/2}` and :math:`G = M^{-1/2} C M^{-1/2}` on the coordinates that feel a force.
A motion :math:`e^{st}` has :math:`s^2 + s G + A` singular; the mean square displacement D grows as
:math:`e^{2 \mathrm{Re}\, s\, t}`. Without dissipation :math:`s = \pm i\sqrt\lambda` for the eigenvalues of A.

**Contacts at Coulomb's bound** slide on ahead and stick on the way back
(:mod:`~faultgouge.analysis.operators.sliders`). Two linear systems are their neighbours: all stick, with K and C; or
all slide on for ever, with :math:`K + G Y` and :math:`C + G Z`, since then the play :math:`p = Y q + Z \dot q`.
Neither bounds what contacts do that stick and slide in turn.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import bsr_array, csr_array

from ..arrays import Floats, Indices
from ..configuration import Configuration
from ..has_configuration import HasConfiguration
from ..operators.sliders import sliders_of, with_sticking_contacts
from ..operators.stiffness import stiffness_matrix
from .eigenvalues import active_coordinates, mass_weighted
from .energy_norm import EnergyNorm


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
        return cls.of_matrices(configuration, k, c)

    @classmethod
    def of_matrices(cls, configuration: Configuration, k: csr_array, c: csr_array) -> "Motion":
        """Of K and C of all coordinates, which are assembled already."""
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
    def translating_mass(self) -> Floats:
        """Masses of the coordinates among these that are translations."""
        c = self.configuration
        return np.asarray(self.root_mass[self.active < c.dimension * len(c)] ** 2)

    @property
    def dissipative(self) -> bool:
        """Whether there is dissipation."""
        return self.damping.nnz > 0

    def in_blocks(self, matrix: csr_array) -> bsr_array:
        """A matrix of these coordinates in dense blocks, one a contact, if of each particle as many take part.

        A product with one vector takes half of the time.
        """
        counts = np.bincount(self.particle)
        counts = np.unique(counts[counts > 0])
        size = int(counts[0]) if len(counts) == 1 else 1
        return bsr_array(matrix, blocksize=(size, size))

    @cached_property
    def energy_norm(self) -> EnergyNorm:
        """The coordinates in which the energy is a sum of squares."""
        return EnergyNorm.of(self.stiffness)

    @property
    def first_order(self) -> Floats:
        """Z, the dense matrix of the first-order system in coordinates of the energy, shape (2E, 2E), 1 / time."""
        return self.energy_norm.first_order(self.stiffness, self.damping)
