r"""Contacts at Coulomb's bound, to first order: each slides on ahead and sticks on the way back.

Let contact c have :math:`|\mathbf f_t| = \mu f_n`, and :math:`\mathbf e_c = \mathbf f_t / |\mathbf f_t|`. If the
contact stuck, its tangential force along :math:`\mathbf e_c` would pass the bound by

.. math::

    Y_c q &= -k_t'\, \mathbf e_c \cdot \mathrm d\mathbf s + (\mathbf e_c \cdot \mathbf b)\, \mathrm d\delta
    - \mu f_n'\, \mathrm d\delta \\
    Z_c \dot q &= -c_t\, \mathbf e_c \cdot \dot{\mathbf s} - \mu c_n\, \dot\delta

of springs and of dashpots, with the symbols of :mod:`~faultgouge.analysis.assembly`. The slider
takes this excess away: small motion of the packing is that of K and C of sticking contacts and of the forces
:math:`-G p`, where :math:`G_c` is the force on all coordinates of a unit tangential force along :math:`\mathbf e_c`
and :math:`p_c` is a play operator (backlash; Visintin, Differential Models of Hysteresis, 1994),

.. math:: p_c(t) = \max_{t' \le t} \left(Y_c q + Z_c \dot q\right)_+ .

For a law with two derivatives b is the mean of both, and :math:`h_c \int |\mathrm d\delta|` is added to the excess,
where :math:`h_c = \mathbf e_c \cdot (\mathbf b_+ - \mathbf b_-) / 2`.

**Two sliders.** LAMMPS's granular styles cut the history such that elastic and viscous force together stay at the
bound of the damped normal force: as written. The slip of this package yields to the elastic force alone,
:math:`p_c = \max (Y_c q)_+`; the viscous force is cut besides, by :math:`(Y_c q + Z_c \dot q - p_c)_+`, which the
contact does not remember, and the bound is that of the elastic normal force, without :math:`\mu c_n`.

Sideways, across :math:`\mathbf e_c`, a sliding contact is as stiff as one that sticks.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ..arrays import Floats, Indices, derive_frozen
from ..configuration import Configuration
from .linearised_contacts import tangential_rows, unit_forces


@dataclass(frozen=True, eq=False)
class Sliders:
    """The contacts at Coulomb's bound of a configuration: the numbers `contact` (B,) of them among all.

    `force` (coordinates, B) is G, forces (F, T/R) of unit tangential forces; `excess` and `viscous_excess` (B,
    coordinates) are Y, force / length, and Z, force time / length; `rectified` (B,) is h, force / length; `viscous`
    (B,) says whether p remembers the excess of dashpots, too.
    """

    contact: Indices
    force: csr_array
    excess: csr_array
    viscous_excess: csr_array
    rectified: Floats
    viscous: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.contact)


def with_sticking_contacts(configuration: Configuration) -> Configuration:
    """The configuration with all of its one-sided contacts sticking."""
    contacts = configuration.contacts
    slides = contacts.sliding & ~contacts.one_sided
    if np.array_equal(slides, contacts.sliding):
        return configuration
    return derive_frozen(configuration, contacts=derive_frozen(contacts, sliding=slides))


def sliders_of(configuration: Configuration) -> Sliders:
    """The one-sided contacts of a configuration; see :class:`Sliders`."""
    which = np.flatnonzero(configuration.contacts.one_sided)
    c = configuration.contacts.chosen(which)
    here = derive_frozen(configuration, contacts=c)
    along = c.tangential_force / np.linalg.norm(c.tangential_force, axis=1, keepdims=True)
    coupling = np.einsum("ca,ca->c", 0.5 * (c.closing + c.parting), along)
    friction = c.friction / c.normal_force
    loss = -friction * c.normal_dashpot * c.viscous_slider
    return Sliders(
        contact=which,
        force=csr_array(unit_forces(here, along).T),
        excess=tangential_rows(here, along, c.tangential_stiffness, coupling - friction * c.normal_stiffness),
        viscous_excess=tangential_rows(here, along, c.tangential_dashpot, loss),
        rectified=0.5 * np.einsum("ca,ca->c", c.closing - c.parting, along),
        viscous=c.viscous_slider,
    )
