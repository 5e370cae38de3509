r"""Velocity Verlet of a few disks in NumPy, with the tangent of the slip increment at the middle or at the end of the
step.

The reference for what the pair style integrates, written to be read: all pairs are candidates, forces are those of
:class:`~faultgouge.analysis.MindlinLaw`. A step moves the disks by :math:`\mathbf v\,\Delta t` with the velocities of
the half step, advances each slip by

.. math:: \Delta s = \boldsymbol\tau \cdot \Delta(\mathbf r_i - \mathbf r_j) - (\Delta u_i + \Delta u_j)

and clamps it. While a contact turns by :math:`\Delta\varphi` and is compressed by :math:`\Delta\delta`, the tangent at
the end of the step errs by :math:`\tfrac12 \Delta\varphi\, \Delta\delta` in each step, and so by the first order of
:math:`\Delta t` in a given time; the tangent at the middle by the second order.
"""

from typing import Literal

import numpy as np

from ....analysis import Packing
from ....analysis.packing.packing import Floats

Tangent = Literal["midpoint", "end"]


class Verlet:
    """Undamped disks between open sides, from rest.

    Parameters
    ----------
    packing : Packing
        The start, not periodic. All contacts that overlap must be in it.
    tangent : {"midpoint", "end"}
        Where in the step the slip increment takes its tangent.
    """

    def __init__(self, packing: Packing, tangent: Tangent = "midpoint") -> None:
        n = len(packing)
        i, j = np.triu_indices(n, 1)
        # the floor is a last disk that never moves, and whose normal never turns
        self._i, self._j = np.append(i, np.arange(n)), np.append(j, np.full(n, n))
        self._floor = self._j == n
        self._packing, self._tangent = packing, tangent
        self._reach = packing.radius[self._i] + np.append(packing.radius, 0.0)[self._j]
        self._load = np.zeros((3, n))
        self._load[0, packing.top], self._load[1, packing.top] = packing.fx, -packing.fy
        self._mass = packing.mass * np.array([[1.0], [1.0], [packing.inertia_factor]])
        # (x, y, u) of the disks and of the floor, shape (3, N + 1)
        self._q = np.zeros((3, n + 1))
        self._q[:, :n] = *packing.position.T, packing.scaled_angle
        self._slip = np.zeros(len(self._i))
        contacts = packing.contacts
        for a, b, slip in zip(contacts.i, np.where(contacts.floor, n, contacts.j), contacts.slip, strict=True):
            self._slip[(self._i == a) & (self._j == b)] = slip
        self._closed = self._overlap(self._branch()) > 0

    def run(self, dt: float, steps: int) -> Floats:
        """(x, y, u) of the disks after so many steps, shape (3, N), length."""
        n = len(self._packing)
        velocity = np.zeros((3, n))
        kick = 0.5 * dt / self._mass
        branch = self._branch()
        force = self._forces(branch)
        for _ in range(steps):
            velocity += kick * force
            step = np.append(dt * velocity, np.zeros((3, 1)), axis=1)
            self._q += step
            branch = self._branch()
            self._advance(branch, step)
            force = self._forces(branch)
            velocity += kick * force
        return self._q[:, :n].copy()

    def _branch(self) -> Floats:
        """r_i - r_j of every candidate, shape (2, C); for the floor (0, y)."""
        branch = self._q[:2, self._i] - self._q[:2, self._j]
        branch[0, self._floor] = 0.0
        return branch

    def _overlap(self, branch: Floats) -> Floats:
        return self._reach - np.hypot(*branch)

    def _advance(self, branch: Floats, step: Floats) -> None:
        """Slips after a step that ended at these branch vectors; new contacts begin with none, lost ones forget."""
        moved = step[:2, self._i] - step[:2, self._j]
        along = branch - 0.5 * np.where(self._floor, 0.0, moved) if self._tangent == "midpoint" else branch
        # tau . moved, with tau = z x along/|along|
        turned = (along[0] * moved[1] - along[1] * moved[0]) / np.hypot(*along)
        overlap = self._overlap(branch)
        slip = self._slip + turned - step[2, self._i] - step[2, self._j]
        self._slip = np.where(self._closed, self._packing.law.clamped(overlap, slip), 0.0)
        self._closed = overlap > 0

    def _forces(self, branch: Floats) -> Floats:
        """Forces (Fx, Fy, T/R) on the disks, shape (3, N)."""
        law, overlap = self._packing.law, self._overlap(branch)
        normal = branch / np.hypot(*branch)
        fn, ft = law.normal_force(overlap), law.tangential_force(overlap, self._slip)
        on_i = np.array([fn * normal[0] - ft * normal[1], fn * normal[1] + ft * normal[0], -ft])
        total = np.zeros_like(self._q)
        for axis, on_j in enumerate((-on_i[0], -on_i[1], on_i[2])):
            np.add.at(total[axis], self._i, on_i[axis])
            np.add.at(total[axis], self._j, on_j)
        return total[:, :-1] + self._load
