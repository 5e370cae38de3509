r"""Stiffness and damping of a packing from its linearised contacts, in two and three dimensions.

For one contact of i and j let :math:`\mathbf u = \mathrm d\mathbf r_i - \mathrm d\mathbf r_j`,
:math:`\mathbf w = s_i\, \mathrm d\boldsymbol\theta_i + s_j\, \mathrm d\boldsymbol\theta_j`, and
:math:`P = 1 - \mathbf n \mathbf n^T`. Then

.. math::

    \mathrm d\delta &= -\mathbf n \cdot \mathbf u, \qquad \mathrm d\mathbf n = P \mathbf u / r, \qquad
    \mathrm d\mathbf s = P \mathbf u + \mathbf n \times \mathbf w \\
    \mathbf F_i &= f_n \mathbf n + \mathbf f_t = -\mathbf F_j, \qquad
    \mathbf T_i = -l_i\, \mathbf n \times \mathbf f_t, \qquad \mathbf T_j = -l_j\, \mathbf n \times \mathbf f_t \\
    \mathrm d\mathbf f_t &= -k_t' S\, \mathrm d\mathbf s + \mathbf b\, \mathrm d\delta
    - \mathbf n\, (\mathbf f_t \cdot \mathrm d\mathbf n) \\
    \mathrm d\mathbf F_i &= f_n' \mathbf n\, \mathrm d\delta + f_n\, \mathrm d\mathbf n + \mathrm d\mathbf f_t \\
    \mathrm d\mathbf T_i &= -l_i\, (\mathrm d\mathbf n \times \mathbf f_t + \mathbf n \times \mathrm d\mathbf f_t)
    - l_i'\, \mathbf n \times \mathbf f_t\, \mathrm d\delta .

S is P where the contact sticks; where it slides, it is P without the direction of :math:`\mathbf f_t`: sideways the
contact is as stiff as before. The last term of :math:`\mathrm d\mathbf f_t` turns the force with the contact, as a code
does that projects its history onto the new plane. A twist about n changes nothing. The arms of slip s and of torque l
are both the radius in LAMMPS's gran/* styles; its `granular` takes the radius for the slip and
:math:`R - \delta/2` for the torque, so that K is not symmetric even without b. A wall is a partner that has no
coordinates, and :math:`1/r = 0`. The three columns of a particle's spin about its only contact vanish together:
such motions have the eigenvalue zero.

Dashpots are the same formulas with velocities for displacements,
:math:`f_n' \to c_n`, :math:`k_t' \to c_t`, and without forces. (Bonfanti et al., arXiv:1909.05070, have K of a smooth
law in three dimensions.)
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array

from ..packing.arrays import Floats, derived
from ..packing.snapshot import LinearisedContacts, Snapshot


def contact_derivatives(contacts: LinearisedContacts, parting: ArrayLike = 0.5) -> tuple[Floats, Floats, Floats]:
    """Derivatives of force and torque by u and w, and what the arms of torques add.

    Returns
    -------
    force, torque : ndarray, shape (C, 2, 3, 3)
        d F_i, and d (n x f_t), by u and by w: force / length.
    growth : ndarray, shape (C, 3, 3)
        (n x f_t) d delta by u: what a lever arm that shrinks with the overlap adds.
    """
    c, one = contacts, np.eye(3)
    n, ft, b = c.normal, c.tangential_force, c.overlap_derivative(parting)
    plane = one - _outer(n, n)
    size = np.linalg.norm(ft, axis=1, keepdims=True)
    along = np.divide(ft, size, out=np.zeros_like(ft), where=size > 0) * c.sliding[:, None]
    resisting = c.tangential_stiffness[:, None, None] * (plane - _outer(along, along))
    overlap, turn, cross = -n, plane / c.distance[:, None, None], _cross_matrix(n)
    ft_by_u = -resisting @ plane + _outer(b, overlap) - _outer(n, np.einsum("ca,cab->cb", ft, turn))
    ft_by_w = -resisting @ cross
    force_by_u = _outer(c.normal_stiffness[:, None] * n, overlap) + c.normal_force[:, None, None] * turn + ft_by_u
    torque_by_u = cross @ ft_by_u - _cross_matrix(ft) @ turn
    force = np.stack([force_by_u, ft_by_w], axis=1)
    return force, np.stack([torque_by_u, cross @ ft_by_w], axis=1), _outer(np.cross(n, ft), overlap)


def assembled_stiffness(snapshot: Snapshot, parting: ArrayLike = 0.5) -> csr_array:
    """K = -dF/dq of a snapshot; see :func:`~faultgouge.analysis.stiffness_matrix`."""
    return _assemble(snapshot, snapshot.contacts, parting)


def assembled_damping(snapshot: Snapshot) -> csr_array:
    """C = -dF/d(dq/dt) of a snapshot; see :func:`~faultgouge.analysis.damping_matrix`."""
    c = snapshot.contacts
    none, still = np.zeros(len(c)), np.zeros((len(c), 3))
    # the direction in which a contact slides is that of its tangential force, which has no part in C but for this
    sliding = np.divide(c.tangential_force, 1.0, out=still.copy(), where=c.sliding[:, None])
    dashpots = derived(
        c, normal_force=none, tangential_force=sliding, closing=still, parting=still, distance=np.full(len(c), np.inf),
        normal_stiffness=c.normal_dashpot, tangential_stiffness=c.tangential_dashpot, lever_slope=none,
    )  # fmt: skip
    return _assemble(snapshot, dashpots, 0.5)


def _assemble(snapshot: Snapshot, contacts: LinearisedContacts, parting: ArrayLike) -> csr_array:
    """-dF/dq: rows (F, T/R) and columns (translation, R theta) of both partners, from the blocks of each contact."""
    count, d, n = len(contacts), snapshot.dimension, len(snapshot)
    moves, turns = (slice(0, 3), slice(0, 3)) if d == 3 else (slice(0, 2), slice(2, 3))
    force, torque, growth = contact_derivatives(contacts, parting)
    partners = np.stack([contacts.i, contacts.j])
    radius = np.stack([snapshot.radius[contacts.i], snapshot.radius[np.maximum(contacts.j, 0)]])
    rolling, lever = contacts.slip_arm.T / radius, contacts.lever_arm.T / radius
    slope = contacts.lever_slope / radius
    known = np.stack([snapshot.free[contacts.i], ~contacts.wall & snapshot.free[np.maximum(contacts.j, 0)]])
    sign = (1.0, -1.0)
    parts: list[tuple[NDArray, NDArray, Floats]] = []
    for p in (0, 1):  # the partner whose force changes
        # T/R = -(l/R) n x f_t, with l that falls by `lever_slope` as the overlap grows
        turned = -lever[p][:, None, None, None] * torque
        turned[:, 0] += slope[p][:, None, None] * growth
        for q in (0, 1):  # the partner that moves
            here = known[p] & known[q]
            for block, rows, turning in ((sign[p] * force, moves, False), (turned, turns, True)):
                row = _numbers(partners[p][here], rows, turning, d, n)
                for values, columns, rolls in (
                    (sign[q] * block[here, 0, rows, moves], moves, False),
                    (rolling[q][here, None, None] * block[here, 1, rows, turns], turns, True),
                ):
                    column = _numbers(partners[q][here], columns, rolls, d, n)
                    where = (np.broadcast_to(index, values.shape).ravel() for index in (row[:, :, None], column[:, None]))
                    parts.append((*where, -values.ravel()))
    size = snapshot.coordinates
    if count == 0:
        return csr_array((size, size))
    row, column, value = (np.concatenate(each) for each in zip(*parts, strict=True))
    matrix = coo_array((value, (row, column)), shape=(size, size)).tocsr()
    matrix.eliminate_zeros()
    return matrix


def _numbers(particles: NDArray, axes: slice, turning: bool, dimension: int, count: int) -> NDArray:
    """Numbers of the coordinates of particles along some axes, shape (C, axes); 32 bits halve what is sorted."""
    which = np.arange(3)[axes]
    place = (dimension + (which - axes.start if dimension == 2 else which)) if turning else which
    return np.asarray(place[None, :] * count + particles[:, None], dtype=np.int32)


def _outer(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, :, None] * b[:, None, :])


def _cross_matrix(a: Floats) -> Floats:
    """[a] with [a] x = a x x, shape (C, 3, 3)."""
    found = np.zeros((len(a), 3, 3))
    found[:, 0, 1], found[:, 0, 2], found[:, 1, 2] = -a[:, 2], a[:, 1], -a[:, 0]
    found[:, 1, 0], found[:, 2, 0], found[:, 2, 1] = a[:, 2], -a[:, 1], a[:, 0]
    return found
