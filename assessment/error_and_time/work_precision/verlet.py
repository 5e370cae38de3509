r"""Velocity Verlet in NumPy, with the tangent of the slip increment at the middle or at the end of the step.

The reference for what the pair style integrates, written to be read: forces are those of
:class:`~faultgouge.analysis.Packing`. A step moves the disks by :math:`\mathbf v\,\Delta t` with the velocities of the
half step, advances each slip by

.. math:: \Delta s = \boldsymbol\tau \cdot \Delta(\mathbf r_i - \mathbf r_j) - (\Delta u_i + \Delta u_j)

and clamps it. While a contact turns by :math:`\Delta\varphi` and is compressed by :math:`\Delta\delta`, the tangent at
the end of the step errs by :math:`\tfrac12 \Delta\varphi\, \Delta\delta` in each step, and so by the first order of
:math:`\Delta t` in a given time; the tangent at the middle by the second order.
"""

from typing import Literal

import numpy as np

from ....analysis import Packing
from ....analysis.packing.packing import Floats

Tangent = Literal["midpoint", "end"]


def verlet(packing: Packing, tangent: Tangent, dt: float, steps: int) -> Floats:
    """(x, y, u) of the disks after so many steps from rest, shape (3, N), length; no contact may form or open."""
    i, j, pair = packing.contacts.i, packing.contacts.j, ~packing.contacts.floor
    mass = packing.mass * np.array([[1.0], [1.0], [packing.inertia_factor]])
    velocity = np.zeros_like(mass)
    for _ in range(steps):
        velocity += 0.5 * dt / mass * packing.net_force.reshape(mass.shape)
        step = dt * velocity
        moved, turned = step[:2, i] - step[:2, j] * pair, step[2, i] + step[2, j] * pair
        position, angle = packing.position + step[:2].T, packing.angle + step[2] / packing.radius
        there = packing.moved(position, angle, packing.contacts)
        middle = packing.moved(position - 0.5 * step[:2].T, angle, packing.contacts)
        along = (middle if tangent == "midpoint" else there).geometry.tangent
        slip = packing.contacts.slip + np.sum(along.T * moved, axis=0) - turned
        clamped = packing.law.clamped(there.geometry.overlap, slip)
        packing = packing.moved(position, angle, packing.contacts.slipped(clamped))
        velocity += 0.5 * dt / mass * packing.net_force.reshape(mass.shape)
    return np.array([*packing.position.T, packing.scaled_angle])
