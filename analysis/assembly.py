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
:math:`1/r = 0`. In an entry of rolling friction (`couple`) :math:`\mathbf u` is in d delta and d n alone, and
:math:`\mathbf F = 0`.

**Operators.** With the matrices U and W of all :math:`\mathbf u` and :math:`\mathbf w`, and the forces on the
coordinates by those of contacts,

.. math:: -K = \left(U^T F_u - L^T T_u + L'^T T' \right) U + \left(U^T F_w - L^T T_w\right) W ,

where L is W with the arms of torques. Dashpots follow from the same formulas with velocities in place of displacements,
:math:`f_n' \to c_n`, :math:`k_t' \to c_t`, and without forces. (Bonfanti et al., arXiv:1909.05070, have K of a smooth
law in three dimensions.)
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from .arrays import Floats, Indices, derive_frozen, ratio
from .contacts import LinearisedContacts


class ContactDerivatives(NamedTuple):
    """Derivatives of the force F_i and of n x f_t of each contact by u and by w, shape (C, 3, 3) each; `growth`,
    (n x f_t) d delta by u, is what a lever arm that shrinks with the overlap adds."""

    force_by_u: Floats
    force_by_w: Floats
    torque_by_u: Floats
    torque_by_w: Floats
    growth: Floats


def contact_derivatives(c: LinearisedContacts, parting: ArrayLike = 0.5) -> ContactDerivatives:
    """The derivatives of each contact by u and w."""
    n, ft, b = c.normal, c.tangential_force, c.overlap_derivative(parting)
    along = ratio(ft, np.linalg.norm(ft, axis=1, keepdims=True)) * c.sliding[:, None]
    numbers = ~c.couple, 1.0 / c.distance, c.tangential_stiffness, c.normal_force, c.normal_stiffness
    acts, curvature, stiff, force, steep = (np.asarray(each, float)[:, None, None] for each in numbers)
    nn, turned = _outer(n, n), np.cross(n, ft)
    plane = np.eye(3) - nn
    # d f_t, with the resistance k_t' S of the slip u + n x w
    ft_by_u = acts * stiff * (_outer(along, _in_plane(along, n)) - plane)
    ft_by_u -= _outer(b, n) + curvature * _outer(n, _in_plane(ft, n))
    ft_by_w = -stiff * (_cross_matrix(n) + _outer(along, np.cross(n, along)))
    force_by_u = acts * (ft_by_u + force * curvature * plane - steep * nn)
    across, growth = _cross_matrix(n), -_outer(turned, n)
    tilted = curvature * (_cross_matrix(ft) - growth)
    return ContactDerivatives(force_by_u, acts * ft_by_w, across @ ft_by_u - tilted, across @ ft_by_w, growth)


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
    layer = csr_array(np.pad(top.astype(np.float64), (0, coordinates - len(top)))[None])
    return csr_array(layer.T @ layer * (stiffness / max(1, layer.nnz)))


def pair_rows(
    radius: Floats, free: NDArray[np.bool_], axes: int, partners: tuple[Indices, Indices], arms: Floats | None = None
) -> csr_array:
    """U of pairs of particles, or with arms, shape (C, 2), W: three rows a pair, by all coordinates.

    A partner that is fixed, or -1, a wall, has no part in it.
    """
    count, spheres = len(radius), axes == 6
    if arms is None:
        weight, components, first = np.tile([1.0, -1.0], (len(partners[0]), 1)), np.arange(2 + spheres), 0
    else:
        weight, components, first = arms / radius[np.stack(partners, 1)], np.arange(3)[0 if spheres else 2 :], axes - 3
    found = []
    for side, partner in enumerate(partners):
        moves = np.flatnonzero((partner >= 0) & free[partner])
        rows, columns = components[:, None] + 3 * moves, (components[:, None] + first) * count + partner[moves]
        found.append([np.broadcast_to(weight[moves, side], rows.shape).ravel(), rows.ravel(), columns.ravel()])
    values, rows, columns = (np.concatenate(each) for each in zip(*found, strict=True))
    return csr_array((values, (rows, columns)), shape=(3 * len(partners[0]), axes * count))


def each_of(blocks: Floats) -> csr_array:
    """A matrix with the blocks of contacts on its diagonal, shapes (C, r, 3) and (r C, 3 C); a vector is one row."""
    blocks = blocks[:, None] if blocks.ndim == 2 else blocks
    count, rows, _ = blocks.shape
    columns = 3 * np.arange(count)[:, None, None] + np.broadcast_to(np.arange(3), blocks.shape)
    parts = blocks.ravel(), columns.ravel(), 3 * np.arange(rows * count + 1)
    return csr_array(parts, shape=(rows * count, 3 * count))


def _outer(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, :, None] * b[:, None])


def _in_plane(a: Floats, n: Floats) -> Floats:
    return np.asarray(a - np.einsum("ca,ca->c", a, n)[:, None] * n)


def _cross_matrix(a: Floats) -> Floats:
    """[a] with [a] x = a x x, shape (C, 3, 3)."""
    return np.cross(a[:, None], np.eye(3)).swapaxes(1, 2)
