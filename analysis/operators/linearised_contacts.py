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

For a sticking contact, S is P. For a sliding contact, S is P without the direction of :math:`\mathbf f_t`: sideways the
contact keeps its stiffness. The last term of :math:`\mathrm d\mathbf f_t` rotates the force with the contact, as in a
code that projects the history onto the new tangent plane. A twist about n changes nothing. The arms of slip s and of
torque l are both the radius in LAMMPS's gran/* styles; its style `granular` uses the radius for the slip and :math:`R -
\delta/2` for the torque, so that K is not symmetric even without b. A wall is a partner without coordinates, with
:math:`1/r = 0`. The three columns of a particle's rotation about its only contact vanish together: such motions have
the eigenvalue zero.

Dashpots follow from the same formulas with velocities in place of displacements,
:math:`f_n' \to c_n`, :math:`k_t' \to c_t`, and without forces. (Bonfanti et al., arXiv:1909.05070, have K of a smooth
law in three dimensions.)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, diags_array

from ..arrays import Floats, Indices, derive_frozen
from ..configuration import Configuration
from ..contacts import LinearisedContacts


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


def assembled_stiffness(configuration: Configuration, parting: ArrayLike = 0.5) -> csr_array:
    """K = -dF/dq of a configuration; see :func:`~faultgouge.analysis.stiffness_matrix`."""
    return _Blocks.of(configuration).matrix(configuration.contacts, parting)


def assembled_damping(configuration: Configuration) -> csr_array:
    """C = -dF/d(dq/dt) of a configuration; see :func:`~faultgouge.analysis.damping_matrix`."""
    c = configuration.contacts
    none, still = np.zeros(len(c)), np.zeros((len(c), 3))
    # where no normal rotates the tangential force is but the direction in which a contact slides
    dashpots = derive_frozen(
        c, normal_force=none, closing=still, parting=still, distance=np.full(len(c), np.inf), lever_slope=none,
        normal_stiffness=c.normal_dashpot, tangential_stiffness=c.tangential_dashpot,
    )  # fmt: skip
    matrix = _Blocks.of(configuration).matrix(dashpots)
    if not configuration.drag_rate:
        return matrix
    return csr_array(matrix + diags_array(configuration.drag_rate * configuration.coordinate_mass))


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Where the blocks of the contacts are in a matrix of all coordinates: one for each particle, and two for each pair
    of particles that touch.

    Attributes
    ----------
    configuration : Configuration
        Whose particles they are.
    place : ndarray of int, shape (N + 2P,)
        Which block of the matrix has the diagonal of each particle, and (i, j) and (j, i) of the P contacts of pairs.
    order : ndarray of int, shape (axes B,)
        Where the entries (axis, block) are in one axis of the rows.
    indices, indptr : ndarray of int32
        Columns and rows of the matrix, as in CSR.
    """

    configuration: Configuration
    place: Indices
    order: Indices
    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]

    @classmethod
    def of(cls, configuration: Configuration) -> "_Blocks":
        """Sort the pairs of particles that have a block."""
        count, axes, c = len(configuration), configuration.axes, configuration.contacts
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
        return cls(configuration, place, order.ravel(), np.tile(indices, axes), indptr)

    def matrix(self, contacts: LinearisedContacts, parting: ArrayLike = 0.5) -> csr_array:
        """-dF/dq of contacts of the same particles.

        Rows (F, T/R) and columns (translation, R theta) of both partners, from the blocks of each contact.
        """
        diagonal, off_diagonal = self._numbers(contacts, parting)
        axes, count = self.configuration.axes, self.configuration.coordinates
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
        configuration, pair = self.configuration, ~c.wall
        force, torque, growth = contact_derivatives(c, parting)
        partners = np.stack([c.i, np.where(pair, c.j, 0)])
        radius = configuration.radius[partners]
        rolling, lever = c.slip_arm.T / radius, c.lever_arm.T / radius
        takes_part = configuration.free[partners] & np.stack([np.ones(len(c), dtype=np.bool_), pair])
        # axes first: all that follows walks along contacts
        force, torque, growth = (np.ascontiguousarray(np.moveaxis(each, 0, -1)) for each in (force, torque, growth))
        blocks = np.empty((2, 2, 6, 6, len(c)))
        for p, of in enumerate((-1.0, 1.0)):  # the partner whose force changes, and the sign of -F
            for q, by in enumerate((1.0, -1.0)):  # the partner that moves
                both = (takes_part[p] & takes_part[q]).astype(np.float64)
                blocks[p, q, :3, :3] = (of * by * both) * force[0]
                blocks[p, q, :3, 3:] = (of * both * rolling[q]) * force[1]
                # -T/R = (l/R) n x f_t, with l that falls by `lever_slope` as the overlap grows
                turning = (by * both * lever[p]) * torque[0]
                blocks[p, q, 3:, :3] = turning - (by * both * c.lever_slope / radius[p]) * growth
                blocks[p, q, 3:, 3:] = (both * lever[p] * rolling[q]) * torque[1]
        if configuration.dimension == 2:
            in_plane = np.array([0, 1, 5])
            blocks = blocks[:, :, in_plane[:, None], in_plane]
        diagonal = np.zeros((*blocks.shape[2:4], len(configuration)))
        for row, column in np.ndindex(*diagonal.shape[:2]):
            for p in (0, 1):
                diagonal[row, column] += np.bincount(partners[p], blocks[p, p, row, column], len(configuration))
        return diagonal, np.concatenate([blocks[0, 1][..., pair], blocks[1, 0][..., pair]], axis=2)


def rescaling_operators(configuration: Configuration) -> tuple[csr_array, csr_array]:
    r"""What K of the mean derivative lacks where a contact closes with another derivative than it parts with.

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
    """Forces on all coordinates, (F, T/R), of a tangential force of each contact, shape (C, 3) on i; one row each."""
    c = configuration.contacts
    turn = np.cross(c.normal, force)
    rows = [
        np.hstack([sign * force, -(c.lever_arm[:, p] / configuration.radius[partner])[:, None] * turn])
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
    c, count = configuration.contacts, len(configuration)
    in_plane = np.arange(6) if configuration.dimension == 3 else np.array([0, 1, 5])
    contact = np.tile(np.arange(len(c)), len(in_plane))
    matrix = csr_array((len(c), configuration.coordinates))
    for numbers, partner in zip(rows, (c.i, c.j), strict=True):
        moves = (partner >= 0) & configuration.free[partner]
        coordinate = (np.arange(len(in_plane))[:, None] * count + np.where(moves, partner, 0)).ravel()
        values = (numbers * moves[:, None]).T[in_plane].ravel()
        matrix = matrix + csr_array((values, (contact, coordinate)), shape=matrix.shape)
    return csr_array(matrix)


def _outer(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, :, None] * b[:, None, :])


def _cross_matrix(a: Floats) -> Floats:
    """[a] with [a] x = a x x, shape (C, 3, 3)."""
    return np.asarray(np.cross(np.eye(3), a[:, None, :]))
