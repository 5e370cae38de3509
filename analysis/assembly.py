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

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from .arrays import Floats, Indices, derive_frozen
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


@dataclass(frozen=True, eq=False)
class ContactBlocks:
    """Where the blocks of the contacts are in a matrix of all coordinates: one for each particle, and two for each pair
    of particles that touch.

    Attributes
    ----------
    radius : ndarray, shape (N,)
        Radii of the particles, length.
    free : ndarray of bool, shape (N,)
        Which particles move.
    axes : int
        Coordinates of each particle: 3 of a disk, 6 of a sphere.
    place : ndarray of int, shape (N + 2P,)
        Which block of the matrix has the diagonal of each particle, and (i, j) and (j, i) of the P contacts of pairs.
    order : ndarray of int, shape (axes B,)
        Where the entries (axis, block) are in one axis of the rows.
    indices, indptr : ndarray of int32
        Columns and rows of the matrix, as in CSR.
    """

    radius: Floats
    free: NDArray[np.bool_]
    axes: int
    place: Indices
    order: Indices
    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]

    @classmethod
    def of(cls, radius: Floats, free: NDArray[np.bool_], axes: int, c: LinearisedContacts) -> "ContactBlocks":
        """Sort the pairs of particles that have a block."""
        count = len(radius)
        i, j, every = c.i[~c.wall], c.j[~c.wall], np.arange(count)
        # two particles that touch through two images have two contacts, which are added
        pairs, place = np.unique(
            np.concatenate([every * (count + 1), i * count + j, j * count + i]), return_inverse=True
        )
        row, column = np.divmod(pairs, count)
        length = np.bincount(row, minlength=count)
        before = np.concatenate([[0], np.cumsum(length)])
        # a row has the columns of all partners along x, then those along y, ...
        order = axes * before[row] + np.arange(len(pairs)) - before[row] + np.arange(axes)[:, None] * length[row]
        indices = np.empty(order.size, np.int32)
        indices[order] = column + count * np.arange(axes)[:, None]
        indptr = np.concatenate([[0], np.cumsum(np.tile(axes * length, axes))]).astype(np.int32)
        return cls(radius, free, axes, place, order.ravel(), np.tile(indices, axes), indptr)

    def matrix(self, contacts: LinearisedContacts, parting: ArrayLike = 0.5) -> csr_array:
        """-dF/dq of contacts of the same particles.

        Rows (F, T/R) and columns (translation, R theta) of both partners, from the blocks of each contact.
        """
        diagonal, off_diagonal = self._numbers(contacts, parting)
        axes = self.axes
        count = axes * len(self.radius)
        data = np.empty((axes, len(self.order)))
        blocks = len(self.order) // axes
        for row in range(axes):
            numbers = np.concatenate([diagonal[row], off_diagonal[row]], axis=1)
            data[row, self.order] = np.concatenate([np.bincount(self.place, each, blocks) for each in numbers])
        matrix = csr_array((data.ravel(), self.indices.copy(), self.indptr.copy()), shape=(count, count))
        matrix.has_canonical_format = True
        matrix.eliminate_zeros()
        return matrix

    def _numbers(self, c: LinearisedContacts, parting: ArrayLike) -> tuple[Floats, Floats]:
        """The diagonal blocks, shape (axes, axes, N), and (i, j) and (j, i) of contacts of pairs, (axes, axes, 2P)."""
        pair = ~c.wall
        d = contact_derivatives(c, parting)
        partners = np.stack([c.i, np.where(pair, c.j, 0)])
        radius = self.radius[partners]
        moves = self.free[partners] & np.stack([np.ones(len(c), dtype=np.bool_), pair])
        rolling, lever, shrinks = (each / radius for each in (c.slip_arm.T, c.lever_arm.T, c.lever_slope))

        def block(p: int, q: int, row: int, column: int) -> Floats:
            """-dF of partner p by partner q: +-1 for the sides of forces and translations, arms for rotations."""
            by = (1.0, -1.0)[q] if column < 3 else rolling[q]
            if row < 3:
                number = (-1.0, 1.0)[p] * by * (d.force_by_u if column < 3 else d.force_by_w)[row, column % 3]
            else:  # -T/R = (l/R) n x f_t, with l that falls by `lever_slope` as the overlap grows
                number = by * lever[p] * (d.torque_by_u if column < 3 else d.torque_by_w)[row - 3, column % 3]
                if column < 3:
                    number -= by * shrinks[p] * d.growth[row - 3, column]
            return number

        count, between = len(self.radius), int(pair.sum())
        shares = [None if np.all(each) else each for each in (moves[0], moves[1], (moves[0] & moves[1])[pair])]
        axes = range(6) if self.axes == 6 else (0, 1, 5)
        diagonal = np.zeros((len(axes), len(axes), count))
        off = np.empty((len(axes), len(axes), 2, between))
        for place in np.ndindex(*diagonal.shape[:2]):
            row, column = (axes[k] for k in place)
            for p in (0, 1):
                own, other = block(p, p, row, column), block(p, 1 - p, row, column)
                diagonal[place] += np.bincount(partners[p], _part(own, shares[p]), count)
                off[place][p] = _part(other if between == len(pair) else other[pair], shares[2])
        return diagonal, off.reshape(*diagonal.shape[:2], -1)


def _part(numbers: Floats, share: NDArray[np.bool_] | None) -> Floats:
    """The numbers of those that move; None if all do."""
    return numbers if share is None else numbers * share


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
