r"""What contacts add to K and C one by one: unit forces, rates of overlaps, and the rescaling of slips.

Symbols are those of :mod:`~faultgouge.analysis.assembly`.
"""

import numpy as np
from scipy.sparse import csr_array

from ..arrays import Floats, Indices
from ..configuration import Configuration


def rescaling_operators(configuration: Configuration) -> tuple[csr_array, csr_array]:
    r"""The part of the force that K of the mean derivative lacks, of contacts whose derivative differs between closing
    and parting.

    With :math:`\dot\delta = N \dot q` the forces change by :math:`-K \dot q + B\, |N \dot q|`.

    Returns
    -------
    n : scipy.sparse.csr_array, shape (C, coordinates)
        Rates of the overlaps by velocities.
    b : scipy.sparse.csr_array, shape (coordinates, C)
        Forces by absolute rates of the overlaps, half of the difference of both derivatives; force / length.
    """
    c = configuration.contacts
    difference = 0.5 * (c.overlap_derivative(0.0) - c.overlap_derivative(1.0))
    closing = np.repeat(np.hstack([-c.normal, np.zeros_like(difference)])[None], 2, axis=0)
    closing[1] *= -1.0
    return contact_rows(configuration, closing), csr_array(unit_forces(configuration, difference).T)


def unit_forces(configuration: Configuration, force: Floats) -> csr_array:
    """Forces on all coordinates, (F, T/R), of a tangential force of each contact, shape (C, 3) on i; one row each, with
    sums where coordinates move as one."""
    c = configuration.contacts
    turn = np.cross(c.normal, force)
    rows = [
        np.hstack(
            [sign * ~c.couple[:, None] * force, -(c.lever_arm[:, p] / configuration.radius[partner])[:, None] * turn]
        )
        for p, (partner, sign) in enumerate(((c.i, 1.0), (c.j, -1.0)))
    ]
    on_particles = _rows_of_particles(configuration, (c.i, c.j), np.array(rows))
    if configuration.constraint is None:
        return on_particles
    return csr_array(on_particles @ (configuration.constraint != 0).astype(np.float64))


def tangential_rows(configuration: Configuration, along: Floats, tangential: Floats, normal: Floats) -> csr_array:
    """Rows -k e . ds + b d delta of the contacts.

    Parameters
    ----------
    along : ndarray, shape (C, 3)
        Unit vectors e in the planes of the contacts.
    tangential, normal : ndarray, shape (C,)
        k and b.
    """
    c = configuration.contacts
    across = np.cross(along, c.normal)
    shift = -(tangential * ~c.couple)[:, None] * along - normal[:, None] * c.normal
    rows = [
        np.hstack([sign * shift, -(tangential * c.slip_arm[:, p] / configuration.radius[partner])[:, None] * across])
        for p, (partner, sign) in enumerate(((c.i, 1.0), (c.j, -1.0)))
    ]
    return contact_rows(configuration, np.array(rows))


def contact_rows(configuration: Configuration, rows: Floats) -> csr_array:
    """A matrix with a row a contact, from its numbers on (translation, rotation as R theta) of i and of j.

    Parameters
    ----------
    rows : ndarray, shape (2, C, 6)
        Numbers of the partner i, and of the partner j. Those of walls and of fixed particles are left out.
    """
    return particle_rows(configuration, (configuration.contacts.i, configuration.contacts.j), rows)


def particle_rows(configuration: Configuration, partners: tuple[Indices, Indices], rows: Floats) -> csr_array:
    """The same of other pairs of particles, whose second partner is -1 where it is none."""
    by_particles = _rows_of_particles(configuration, partners, rows)
    return by_particles if configuration.constraint is None else csr_array(by_particles @ configuration.constraint)


def _rows_of_particles(configuration: Configuration, partners: tuple[Indices, Indices], rows: Floats) -> csr_array:
    """The same by the particles' own coordinates."""
    pairs, count = len(partners[0]), len(configuration)
    in_plane = np.arange(6) if configuration.dimension == 3 else np.array([0, 1, 5])
    contact = np.tile(np.arange(pairs), len(in_plane))
    matrix = csr_array((pairs, configuration.coordinates))
    for numbers, partner in zip(rows, partners, strict=True):
        moves = (partner >= 0) & configuration.free[partner]
        coordinate = (np.arange(len(in_plane))[:, None] * count + np.where(moves, partner, 0)).ravel()
        values = (numbers * moves[:, None]).T[in_plane].ravel()
        matrix = matrix + csr_array((values, (contact, coordinate)), shape=matrix.shape)
    return csr_array(matrix)
