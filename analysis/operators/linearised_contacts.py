r"""What contacts add to K and C one by one: unit forces, rates of overlaps, and the rescaling of slips.

Symbols are those of :mod:`~faultgouge.analysis.assembly`.
"""

import numpy as np
from scipy.sparse import csr_array

from ..arrays import Floats
from ..assembly import each_of
from ..configuration import Configuration


def rescaling_operators(configuration: Configuration) -> tuple[csr_array, csr_array]:
    r"""The part of the force that K of the mean derivative lacks, of contacts whose derivative differs between closing
    and parting.

    With :math:`\dot\delta = N \dot q` the forces change by :math:`-K \dot q + B\, |N \dot q|`. Returns N, shape (C,
    coordinates), and B, shape (coordinates, C), half of the difference of both derivatives; force / length.
    """
    c = configuration.contacts
    difference = 0.5 * (c.overlap_derivative(0.0) - c.overlap_derivative(1.0))
    return overlap_rows(configuration), csr_array(unit_forces(configuration, difference).T)


def overlap_rows(configuration: Configuration) -> csr_array:
    """Changes of the overlaps by displacements, shape (C, coordinates)."""
    return csr_array(each_of(-configuration.contacts.normal) @ configuration.pair_rows())


def unit_forces(configuration: Configuration, force: Floats) -> csr_array:
    """Forces on all coordinates, (F, T/R), of a tangential force of each contact, shape (C, 3) on i; one row each, with
    sums where coordinates move as one."""
    c = configuration.contacts
    push, turn = each_of(~c.couple[:, None] * force), each_of(np.cross(c.normal, force))
    rows = configuration.pair_rows(forces=True), configuration.pair_rows(arms=c.lever_arm, forces=True)
    return csr_array(push @ rows[0] - turn @ rows[1])


def tangential_rows(configuration: Configuration, along: Floats, tangential: Floats, normal: Floats) -> csr_array:
    """Rows -k e . ds + b d delta of the contacts, of unit vectors e in their planes and of numbers k and b."""
    c = configuration.contacts
    shift = each_of((tangential * ~c.couple)[:, None] * along + normal[:, None] * c.normal)
    turn = each_of(tangential[:, None] * np.cross(along, c.normal))
    return csr_array(-(shift @ configuration.pair_rows() + turn @ configuration.pair_rows(arms=c.slip_arm)))
