"""A slow, readable quasi-static solver: the reference that the analysis is tested on.

An increment of the load is one unknown displacement q from the last equilibrium. Slips advance from their
values there, never from an iterate, with the tangent at the midpoint (along r_old + r_new); then they are
clamped. A new contact starts with s = 0 at the end of its first increment. Forces are summed contact by
contact from the formulas; only Newton's matrix is borrowed from the package, and a wrong one would cost
iterations, not digits.
"""

from dataclasses import replace

import numpy as np
from scipy.sparse.linalg import splu

from faultgouge.analysis import FLOOR, Contacts, NoEquilibriumError, Packing, stiffness_matrix, touching


def plain_force(kn, kt, mu, overlap, slip, exponent=1.5, coulomb=False):
    """f_n and f_t, from the formulas, in whatever arithmetic the arguments bring."""
    if overlap <= 0:
        return 0, 0
    normal = kn * overlap**exponent
    if kt == 0 or mu == 0:
        return normal, 0
    limit = mu * (kn / kt) * overlap
    slip = min(max(slip, -limit), limit)
    x = abs(slip) / limit
    return normal, -kt * overlap ** (exponent - 1) * (1 if coulomb else 1 + x - x**2) * slip


def moved(old: Packing, q: np.ndarray, fx: float) -> Packing:
    """The packing after the displacement q = (dx.., dy.., R dtheta..) from the equilibrium `old`."""
    shift, du = q[: 2 * len(old)].reshape(2, -1).T, q[2 * len(old) :]
    position = old.position + shift
    now = touching(position, old.radius, old.box_length)
    remembered = {(i, j): s for i, j, s in zip(old.contacts.i, old.contacts.j, old.contacts.slip, strict=True)}
    slips = []
    for i, j in zip(now.i, now.j, strict=True):
        before, after = (branch(place, old.box_length, i, j) for place in (old.position, position))
        tangent = turned((before + after) / np.hypot(*(before + after)))
        disks = [i] if j == FLOOR else [i, j]
        relative, turning = (shift[i], 0.0) if j == FLOOR else (shift[i] - shift[j], du[j])
        start = remembered.get((i, j))
        slip = 0.0 if start is None else start + (tangent @ relative - du[i] - turning)
        overlap = old.radius[disks].sum() - np.hypot(*after)
        limit = old.law.mu * old.law.kn / old.law.kt * overlap if old.law.frictional else 0.0
        slips.append(min(max(slip, -limit), limit))
    angle = old.angle + du / old.radius
    return replace(old, position=position, angle=angle, contacts=Contacts(now.i, now.j, np.array(slips)), fx=fx)


def branch(position: np.ndarray, box_length: float | None, i: int, j: int) -> np.ndarray:
    """r_i - r_j, nearest image along x; from the floor, the height."""
    if j == FLOOR:
        return np.array([0.0, position[i, 1]])
    difference = position[i] - position[j]
    if box_length is not None:
        difference[0] -= box_length * round(difference[0] / box_length)
    return difference


def turned(normal: np.ndarray) -> np.ndarray:
    """The tangent of a normal."""
    return np.array([-normal[1], normal[0]])


def forces(packing: Packing) -> np.ndarray:
    """Net forces (Fx.., Fy.., T/R..), contact by contact."""
    law, total = packing.law, np.zeros((3, len(packing)))
    total[0, packing.top] += packing.fx
    total[1, packing.top] -= packing.fy
    for i, j, slip in zip(packing.contacts.i, packing.contacts.j, packing.contacts.slip, strict=True):
        disks = [i] if j == FLOOR else [i, j]
        between = branch(packing.position, packing.box_length, i, j)
        distance = np.hypot(*between)
        normal, overlap = between / distance, packing.radius[disks].sum() - distance
        fn, ft = plain_force(law.kn, law.kt, law.mu, overlap, slip, law.exponent)
        force = fn * normal + ft * turned(normal)
        total[:2, i] += force
        if j != FLOOR:
            total[:2, j] -= force
        total[2, disks] -= ft
    return total.ravel()


def equilibrium(old: Packing, fx: float, good_enough: float = 1e-8) -> Packing:
    """Newton's equilibrium at fx from the equilibrium `old`, converged until rounding stops it."""
    q = np.zeros(3 * len(old))
    best, best_residual = None, np.inf
    for _ in range(60):
        trial = moved(old, q, fx)
        stiffness = stiffness_matrix(trial).tocsc()
        active = np.flatnonzero(np.diff(stiffness.tocsr().indptr))
        force = forces(trial)
        residual = np.abs(force[active]).max()
        if residual < good_enough and residual > 0.5 * best_residual:
            return best
        if residual < best_residual:
            best, best_residual = trial, residual
        q[active] += splu(stiffness[active][:, active]).solve(force[active])
    raise NoEquilibriumError(f"no equilibrium at fx = {fx}: residual {best_residual:.1e}")
