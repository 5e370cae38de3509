r"""Derivatives of the forces of linearised contacts, and K and C from them, in two and three dimensions.

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

For a sticking contact, S is P. For a sliding contact, S is P without the direction of :math:`\mathbf f_t`: sideways the
contact keeps its stiffness. The last term of :math:`\mathrm d\mathbf f_t` rotates the force with the contact, as in a
code that projects the history onto the new tangent plane. A twist about n changes nothing. The arms of slip s and of
torque l are both the radius in LAMMPS's gran/* styles; its style `granular` uses the radius for the slip and :math:`R -
\delta/2` for the torque, so that K is not symmetric even without b. A wall is a partner without coordinates, with
:math:`1/r = 0`. The three columns of a particle's rotation about its only contact vanish together: such motions have
the eigenvalue zero. In an entry of rolling friction (`couple`) :math:`\mathbf u` is in d delta and d n alone, and
:math:`\mathbf F = 0`.

Dashpots follow from the same formulas with velocities in place of displacements,
:math:`f_n' \to c_n`, :math:`k_t' \to c_t`, and without forces. (Bonfanti et al., arXiv:1909.05070, have K of a smooth
law in three dimensions.)
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from .arrays import Floats, derive_frozen
from .contacts import LinearisedContacts


class ContactDerivatives(NamedTuple):
    """Derivatives of a contact's force and torque, shape (3, 3, C) each: all that follows walks along contacts.

    `force_by_u`, `force_by_w`, `torque_by_u` and `torque_by_w` are those of F_i and of n x f_t; `growth`, (n x f_t)
    d delta by u, is what a lever arm that shrinks with the overlap adds.
    """

    force_by_u: Floats
    force_by_w: Floats
    torque_by_u: Floats
    torque_by_w: Floats
    growth: Floats


def contact_derivatives(c: LinearisedContacts, parting: ArrayLike = 0.5) -> ContactDerivatives:
    """The derivatives of each contact by u and w."""
    n, ft, b = (np.ascontiguousarray(each.T) for each in (c.normal, c.tangential_force, c.overlap_derivative(parting)))
    size = np.sqrt(dot(ft, ft))
    along = np.divide(ft, size, out=np.zeros_like(ft), where=size > 0) * c.sliding
    nn, curvature, stiff = _outer(n, n), 1.0 / c.distance, c.tangential_stiffness
    plane = np.eye(3)[:, :, None] - nn
    # d f_t, with the resistance k_t' S of the slip u + n x w
    in_plane = along - dot(along, n) * n
    acts = ~c.couple  # on translations, and by these
    ft_by_u = acts * stiff * (_outer(along, in_plane) - plane)
    ft_by_u -= _outer(b, n) + _outer(n, curvature * (ft - dot(ft, n) * n))
    ft_by_w = -stiff * (_cross_matrix(n) + _outer(along, cross(n, along)))
    force_by_u = acts * (ft_by_u + (c.normal_force * curvature) * plane - c.normal_stiffness * nn)
    tilted = curvature * (_cross_matrix(ft) + _outer(cross(n, ft), n))
    return ContactDerivatives(
        force_by_u, acts * ft_by_w, cross(n, ft_by_u) - tilted, cross(n, ft_by_w), -_outer(cross(n, ft), n)
    )


def as_springs(c: LinearisedContacts) -> LinearisedContacts:
    """Contacts whose springs are the dashpots of others: C is K of these."""
    none, still = np.zeros(len(c)), np.zeros((len(c), 3))
    # where no normal rotates the tangential force is but the direction in which a contact slides
    return derive_frozen(
        c, normal_force=none, closing=still, parting=still, distance=np.full(len(c), np.inf), lever_slope=none,
        normal_stiffness=c.normal_dashpot, tangential_stiffness=c.tangential_dashpot,
    )  # fmt: skip


def spring_of_layer(stiffness: float, top: NDArray[np.bool_], coordinates: int) -> csr_array:
    """K of the spring that draws a layer: k/n between all pairs of its n particles, along x, the first coordinates.

    Each particle feels -k X for the mean displacement X of the layer.
    """
    layer = np.flatnonzero(top)
    rows, columns = np.repeat(layer, len(layer)), np.tile(layer, len(layer))
    values = np.full(len(rows), stiffness / max(1, len(layer)))
    return csr_array((values, (rows, columns)), shape=(coordinates, coordinates))


def contact_matrices(
    radius: Floats, free: NDArray[np.bool_], axes: int, contacts: Sequence[LinearisedContacts], parting: ArrayLike = 0.5
) -> list[csr_array]:
    """-dF/dq of some kinds of contacts of the same partners, whose pattern is found once.

    Rows (F, T/R) and columns (translation, R theta), a block for each particle and two for each pair that touches.

    Parameters
    ----------
    radius, free : ndarray, shape (N,)
        Radii of the particles, length, and which of them move.
    axes : int
        Coordinates of each particle: 3 of a disk, 6 of a sphere.
    """
    c, count, pair = contacts[0], len(radius), ~contacts[0].wall
    i, j, every, all_pair = c.i[pair], c.j[pair], np.arange(count), bool(np.all(pair))
    # two particles that touch through two images have two contacts, which are added
    pairs, place = np.unique(np.concatenate([every * (count + 1), i * count + j, j * count + i]), return_inverse=True)
    row, column = np.divmod(pairs, count)
    length, blocks = np.bincount(row, minlength=count), len(pairs)
    before = np.concatenate([[0], np.cumsum(length)])
    # a row has the columns of all partners along x, then those along y, ...
    order = axes * before[row] + np.arange(blocks) - before[row] + np.arange(axes)[:, None] * length[row]
    indices = np.empty(order.size, np.int32)
    indices[order] = column + count * np.arange(axes)[:, None]
    indptr = np.concatenate([[0], np.cumsum(np.tile(axes * length, axes))]).astype(np.int32)
    partners = np.stack([c.i, np.where(pair, c.j, 0)])
    moves = free[partners] & np.stack([np.ones(len(c), dtype=np.bool_), pair])
    shares = [None if np.all(each) else each for each in (*moves, (moves[0] & moves[1])[pair])]
    chosen, size, found = ([0, 1, 2, 3, 4, 5] if axes == 6 else [0, 1, 5]), axes * count, []
    for each in contacts:
        d = contact_derivatives(each, parting)
        rolling, lever, shrinks = (
            arms / radius[partners] for arms in (each.slip_arm.T, each.lever_arm.T, each.lever_slope)
        )
        diagonal, off = np.zeros((axes, axes, count)), np.empty((axes, axes, 2, len(i)))
        block = np.empty((6, 6, len(c)))  # -dF of partner p by partner q
        for p, q in ((0, 0), (1, 1), (0, 1), (1, 0)):
            # +-1 for the sides of forces and translations, arms for rotations
            sign, by = (-1.0, 1.0)[p], (1.0, -1.0)[q]
            np.multiply(sign * by, d.force_by_u, out=block[:3, :3])
            np.multiply(sign * rolling[q], d.force_by_w, out=block[:3, 3:])
            # -T/R = (l/R) n x f_t, with l that falls by `lever_slope` as the overlap grows
            np.multiply(by * lever[p], d.torque_by_u, out=block[3:, :3])
            block[3:, :3] -= by * shrinks[p] * d.growth
            np.multiply(rolling[q] * lever[p], d.torque_by_w, out=block[3:, 3:])
            share = shares[p] if p == q else shares[2]
            for a, b in np.ndindex(axes, axes):
                number = block[chosen[a], chosen[b]]
                if p == q:
                    number = number if share is None else number * share
                    diagonal[a, b] += np.bincount(partners[p], number, count)
                else:
                    number = number if all_pair else number[pair]
                    off[a, b, p] = number if share is None else number * share
        data = np.empty((axes, order.size))
        for a, b in np.ndindex(axes, axes):
            data[a, order[b]] = np.bincount(place, np.concatenate([diagonal[a, b], off[a, b].ravel()]), blocks)
        matrix = csr_array((data.ravel(), np.tile(indices, axes), indptr.copy()), shape=(size, size))
        matrix.has_canonical_format = True
        matrix.eliminate_zeros()
        found.append(matrix)
    return found


def _outer(a: Floats, b: Floats) -> Floats:
    """Of vectors in columns, shape (3, 3, C)."""
    return np.asarray(a[:, None] * b[None])


def dot(a: Floats, b: Floats) -> Floats:
    """a . b of vectors in columns, shape (C,)."""
    return np.asarray(np.einsum("kc,kc->c", a, b))


def cross(a: Floats, b: Floats) -> Floats:
    """a x b of vectors in columns, or of a with each column of matrices, shape (3, C) or (3, 3, C)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _cross_matrix(a: Floats) -> Floats:
    """[a] with [a] x = a x x, shape (3, 3, C)."""
    zero = np.zeros_like(a[0])
    return np.array([[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]])
