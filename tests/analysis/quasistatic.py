"""A readable quasi-static solver: the reference that the analysis is tested on.

An increment of the load is one unknown displacement q from the last equilibrium. Slips advance from their
values there, never from an iterate, with the tangent at the midpoint (along r_old + r_new); then they are
clamped. A new contact starts with s = 0 at the end of its first increment. The forces of each contact are
those of the formulas; only Newton's matrix is borrowed from the package, and a wrong one would cost
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
    before, after = (branches(place, old.box_length, now.i, now.j) for place in (old.position, position))
    tangent = turned(lengths_one(before + after))
    floor = now.j == FLOOR
    relative = shift[now.i] - np.where(floor[:, None], 0.0, shift[now.j])
    advance = np.sum(tangent * relative, axis=1) - du[now.i] - np.where(floor, 0.0, du[now.j])
    remembered = {(i, j): s for i, j, s in zip(old.contacts.i, old.contacts.j, old.contacts.slip, strict=True)}
    start = np.array([remembered.get(pair, np.nan) for pair in zip(now.i, now.j, strict=True)])
    reach = old.radius[now.i] + np.where(floor, 0.0, old.radius[now.j])
    overlap = reach - np.linalg.norm(after, axis=1)
    limit = old.law.mu * old.law.kn / old.law.kt * overlap if old.law.frictional else 0.0 * overlap
    slip = np.clip(np.where(np.isnan(start), 0.0, start + advance), -limit, limit)
    angle = old.angle + du / old.radius
    return replace(old, position=position, angle=angle, contacts=Contacts(now.i, now.j, slip), fx=fx)


def branches(position: np.ndarray, box_length: float | None, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """r_i - r_j of pairs, nearest image along x; from the floor, the height. Shape (pairs, 2)."""
    floor = j == FLOOR
    difference = position[i] - position[j]
    if box_length is not None:
        difference[:, 0] -= box_length * np.round(difference[:, 0] / box_length)
    height = np.column_stack([np.zeros(len(i)), position[i, 1]])
    return np.where(floor[:, None], height, difference)


def lengths_one(vectors: np.ndarray) -> np.ndarray:
    """The vectors in rows, each over its length."""
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def turned(normal: np.ndarray) -> np.ndarray:
    """The tangents of normals in rows."""
    return np.column_stack([-normal[:, 1], normal[:, 0]])


def forces(packing: Packing) -> np.ndarray:
    """Net forces (Fx.., Fy.., T/R..), each contact's by the formulas."""
    law, c, total = packing.law, packing.contacts, np.zeros((3, len(packing)))
    total[0, packing.top] += packing.fx
    total[1, packing.top] -= packing.fy
    between, floor = branches(packing.position, packing.box_length, c.i, c.j), c.j == FLOOR
    normal = lengths_one(between)
    overlap = packing.radius[c.i] + np.where(floor, 0.0, packing.radius[c.j]) - np.linalg.norm(between, axis=1)
    each = [
        plain_force(law.kn, law.kt, law.mu, gap, slip, law.exponent) for gap, slip in zip(overlap, c.slip, strict=True)
    ]
    fn, ft = np.array(each, dtype=float).reshape(-1, 2).T
    force = np.column_stack([fn[:, None] * normal + ft[:, None] * turned(normal), -ft]).T
    np.add.at(total, (slice(None), c.i), force)
    np.subtract.at(total, (slice(None), c.j[~floor]), force[:, ~floor] * np.array([[1.0], [1.0], [-1.0]]))
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
