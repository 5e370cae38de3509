"""K of single contacts: by the formula, as a slow reference, and as the package assembles it."""

import numpy as np

from faultgouge.analysis import stiffness_matrix


def block(packing, form="consistent"):
    """K of a packing of one contact in (x_i, y_i, u_i, x_j, y_j, u_j), shape (6, 6)."""
    disks, order = len(packing), [disk + len(packing) * axis for disk in range(len(packing)) for axis in range(3)]
    found = np.zeros((6, 6))
    found[: 3 * disks, : 3 * disks] = stiffness_matrix(packing, form).toarray()[np.ix_(order, order)]
    return found


def contact_blocks(packing, form="consistent"):
    """The blocks K_c of all contacts, shape (C, 6, 6); zero for the floor, and for rotations without friction."""
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
