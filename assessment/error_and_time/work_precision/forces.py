r"""Net forces of a displaced packing in any arithmetic: doubles, extended precision, complex numbers.

The same law as that of the analysis and of the pair style, with slips that advance along the midpoint tangent of the
displacement. Comparisons look at real parts and nothing takes a modulus, so that F is analytic wherever its real
counterpart is smooth, and a *complex step*

.. math:: \frac{\partial F}{\partial q_k} = \frac{\mathrm{Im}\, F(q + i h e_k)}{h}

has neither cancellation nor, with a tiny h, truncation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....analysis import Packing
from ....analysis.packing.packing import Floats

Numbers = NDArray[Any]


def net_force(packing: Packing, displacement: Numbers) -> Numbers:
    """F(q) without the load, for many displacements at once.

    Parameters
    ----------
    packing : Packing
        Where the displacements begin.
    displacement : ndarray, shape (3N, m)
        Columns (dx.., dy.., R dtheta..), length; their type is that of the result.

    Returns
    -------
    ndarray, shape (3N, m)
        Forces (Fx.., Fy.., T/R..) of the contacts of the packing; one that opens exerts nothing, none forms.
    """
    n, m = len(packing), displacement.shape[1]
    real = displacement.real.dtype
    contacts, law = packing.contacts, packing.law
    kn, kt, mu = (real.type(number) for number in (law.kn, law.kt, law.mu))
    i, j, floor = contacts.i, np.where(contacts.floor, n, contacts.j), contacts.floor[:, None]
    q = np.concatenate([displacement.reshape(3, n, m), np.zeros((3, 1, m), displacement.dtype)], axis=1)
    position = np.concatenate([packing.position.T.astype(real), np.zeros((2, 1), real)], axis=1)[:, :, None]

    before = position[:, i] - position[:, j]
    if packing.box_length is not None:
        before[0] -= real.type(packing.box_length) * np.round(before[0] / real.type(packing.box_length))
    before[0] = np.where(floor, 0, before[0])
    moved = q[:2, i] - q[:2, j]
    turning = np.stack([np.where(floor, 0, moved[0]), moved[1]])
    after, middle = before + turning, before + turning / 2
    middle = np.where(floor, before, middle)
    distance = np.sqrt(after[0] ** 2 + after[1] ** 2)
    normal = after / distance
    reach = packing.radius[i].astype(real) + np.append(packing.radius, 0.0)[j].astype(real)
    overlap = reach[:, None] - distance
    overlap = np.where(overlap.real > 0, overlap, 0)

    along = (middle[0] * moved[1] - middle[1] * moved[0]) / np.sqrt(middle[0] ** 2 + middle[1] ** 2)
    slip = contacts.slip.astype(real)[:, None] + along - q[2, i] - q[2, j]
    limit = mu * (kn / kt) * overlap
    slip = np.where(slip.real > limit.real, limit, np.where(slip.real < -limit.real, -limit, slip))
    x = np.where(slip.real < 0, -slip, slip) / np.where(limit == 0, 1, limit)
    growth = law.growth(overlap)
    fn, ft = kn * overlap * growth, -kt * growth * (1 + x - x * x) * slip

    on_i = np.stack([fn * normal[0] - ft * normal[1], fn * normal[1] + ft * normal[0], -ft])
    total = np.zeros_like(q)
    for axis, sign in enumerate((-1, -1, 1)):
        np.add.at(total[axis], i, on_i[axis])
        np.add.at(total[axis], j, sign * on_i[axis])
    return total[:, :n].reshape(3 * n, m)


def complex_step(packing: Packing, number: type = np.complex128) -> Floats:
    """K = -dF/dq by complex steps, shape (3N, 3N), in doubles or with ``numpy.clongdouble`` in extended precision."""
    tiny = np.finfo(number).tiny ** 0.25  # any step whose square is nothing beside one
    identity: Numbers = np.eye(3 * len(packing), dtype=number)
    return -net_force(packing, 1j * tiny * identity).imag / tiny


def central_differences(packing: Packing, step: float) -> Floats:
    """K by central differences of the same forces in doubles, shape (3N, 3N)."""
    identity: Floats = step * np.eye(3 * len(packing))
    return -(net_force(packing, identity) - net_force(packing, -identity)) / (2 * step)
