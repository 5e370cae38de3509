r"""The stability operator :math:`K = -\partial F / \partial q` of a packing.

Coordinates and forces are those of :mod:`~faultgouge.analysis.packing`, in the order (x_1.., y_1.., u_1..),
:math:`u = R\theta`. In the six coordinates :math:`(x_i, y_i, u_i, x_j, y_j, u_j)` of one contact put

.. math::

    N &= (\mathbf n, 0, -\mathbf n, 0), & \mathrm d\delta &= -N \cdot \mathrm dq \\
    P &= (\boldsymbol\tau, 0, -\boldsymbol\tau, 0), & \mathrm d\mathbf n &= \boldsymbol\tau\,
    (P \cdot \mathrm dq)/r, \quad \mathrm d\boldsymbol\tau = -\mathbf n\, (P \cdot \mathrm dq)/r \\
    T &= (\boldsymbol\tau, -1, -\boldsymbol\tau, -1), & \mathrm ds &= T \cdot \mathrm dq

The force on all six is :math:`f_n N + f_t T`, and its derivative, with a and b of
:mod:`~faultgouge.analysis.law`,

.. math::

    -K_c = -\tfrac32 k_n \delta^{1/2}\, N N^T + \frac{f_n}{r}\, P P^T + a\, T T^T
    - b\, T N^T - \frac{f_t}{r}\, N P^T

For the floor only the first three coordinates exist and P = 0. The last two terms are not symmetric: the
tangential force depends on the overlap while the normal force does not depend on the slip, and the tangential
force follows the turning contact. ``form="paper"`` leaves out the last term, as the operator published by
Charan, Pomyalov and Procaccia does: there the slip vector is differentiated with
:math:`\partial t/\partial r = 1 - \mathbf n \mathbf n^T` and the turning of the tangent is lost.
``form="consistent"`` is the exact derivative of the integrated forces.

Without friction only N and P are left, and K is an operator on the 2N coordinates (x, y): rows and columns of rotations
are empty.
"""

from typing import Literal

import numpy as np
from scipy.sparse import coo_array, csr_array

from .packing import Floats, Packing

Form = Literal["consistent", "paper"]


def stiffness_matrix(packing: Packing, form: Form = "consistent") -> csr_array:
    """Assemble K = -dF/dq.

    Parameters
    ----------
    packing : Packing
        The configuration; it need not be in balance.
    form : {"consistent", "paper"}
        The exact derivative, or the one without the turning of the tangent.

    Returns
    -------
    scipy.sparse.csr_array, shape (3N, 3N)
        Force / length, in the order (x.., y.., R theta..). Rows of rattlers are empty, and so are all rows and columns
        of rotations without friction.

    Raises
    ------
    ValueError
        If the form is neither of the two.
    """
    n, i, j, pair = len(packing), packing.contacts.i, packing.contacts.j, ~packing.contacts.floor
    blocks = contact_stiffness(packing, form)
    axes = 3 if packing.law.frictional else 2
    # Two disks share one contact, so the off-diagonal blocks are final; only the diagonal ones are sums.
    diagonal = np.empty((n, axes, axes))
    for row in range(axes):
        for column in range(axes):
            diagonal[:, row, column] = np.bincount(i, blocks[:, row, column], n)
            diagonal[:, row, column] += np.bincount(j[pair], blocks[pair, row + 3, column + 3], n)
    every, axis = np.arange(n, dtype=np.int32), np.arange(0, axes * n, n, dtype=np.int32)
    i, j = (
        i[pair].astype(np.int32),
        j[pair].astype(np.int32),
    )  # half the memory of what the sparse format sorts
    values = np.concatenate([diagonal, blocks[pair, :axes, 3 : 3 + axes], blocks[pair, 3 : 3 + axes, :axes]])
    rows = np.concatenate([every, i, j])[:, None, None] + axis[:, None]
    columns = np.concatenate([every, j, i])[:, None, None] + axis
    where = tuple(np.broadcast_to(index, values.shape).ravel() for index in (rows, columns))
    matrix = coo_array((values.ravel(), where), shape=(3 * n, 3 * n)).tocsr()
    matrix.eliminate_zeros()
    return matrix


def contact_stiffness(packing: Packing, form: Form = "consistent") -> Floats:
    """The 6 x 6 blocks K_c of the contacts in (x_i, y_i, u_i, x_j, y_j, u_j).

    Parameters
    ----------
    packing : Packing
        The configuration.
    form : {"consistent", "paper"}
        As in :func:`stiffness_matrix`.

    Returns
    -------
    ndarray, shape (C, 6, 6)
        Force / length; the rows and columns of j are zero for the floor, those of u without friction.
    """
    if form not in ("consistent", "paper"):
        raise ValueError(f'form = "{form}" must be "consistent" or "paper".')
    law, slip, floor = packing.law, packing.contacts.slip, packing.contacts.floor
    normal, tangent, distance, overlap = packing.geometry
    zero = np.zeros((len(slip), 1))
    big_n = np.hstack([normal, zero, -normal, zero])
    big_p = np.hstack([tangent, zero, -tangent, zero])
    big_n[floor, 3:] = big_p[floor] = 0.0
    # Only contacts of finite length turn; the floor's distance is a height and may even be zero.
    turning = np.where(floor, 0.0, 1.0) / np.where(floor, 1.0, distance)
    fn_over_r = law.normal_force(overlap) * turning
    c = law.normal_stiffness(overlap)
    if not law.frictional:
        left = np.stack([big_n, big_p], axis=2)
        return left @ np.stack([c[:, None] * big_n, -fn_over_r[:, None] * big_p], axis=1)
    one = np.ones_like(zero)
    big_t = np.hstack([tangent, -one, -tangent, -one])
    big_t[floor, 3:] = 0.0
    ft_over_r = law.tangential_force(overlap, slip) * turning * (form == "consistent")
    a = law.tangential_slip_derivative(overlap, slip)
    b = law.tangential_overlap_derivative(overlap, slip)
    left = np.stack([big_n, big_p, big_t], axis=2)
    right = np.stack(
        [
            c[:, None] * big_n + ft_over_r[:, None] * big_p,
            -fn_over_r[:, None] * big_p,
            -a[:, None] * big_t + b[:, None] * big_n,
        ],
        axis=1,
    )
    return left @ right
