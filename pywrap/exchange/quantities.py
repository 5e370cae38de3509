"""What exports show of disks and contacts beside what a packing is: forces, mobilised friction, modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...analysis import Packing

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModeVectors:
    """A mode of a packing for an export.

    Attributes
    ----------
    name : str
        Of its fields.
    eigenvalue : complex
        lambda, 1 / time^2.
    displacement : ndarray of complex, shape (3, N)
        x, y and R theta.
    """

    name: str
    eigenvalue: complex
    displacement: NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame of a film of packings.

    Attributes
    ----------
    packing : Packing
        The packing. Its contacts are those that touch, without slips, if it is not `whole`.
    time : float
        F_x of an equilibrium, or the time of an undamped run.
    displacement : ndarray, shape (N, 2)
        From the first frame, length.
    whole : bool
        Whether angles and slips, and so the forces, are known: an undamped run stores positions alone.
    """

    packing: Packing
    time: float
    displacement: Floats
    whole: bool

    @property
    def number(self) -> dict[str, float]:
        """The time by its name: a ramp has none beside fx."""
        return {} if self.whole else {"time": self.time}


def contact_force(packing: Packing) -> Floats:
    """f_n n + f_t tau, the force on the first partner of each contact, shape (C, 2)."""
    g = packing.geometry
    return packing.normal_force[:, None] * g.normal + packing.tangential_force[:, None] * g.tangent


def contact_mobilised(packing: Packing) -> Floats:
    """|f_t|/(mu f_n) of each contact, shape (C,); zero without friction."""
    limit = packing.law.mu * packing.normal_force
    return np.divide(np.abs(packing.tangential_force), limit, out=np.zeros_like(limit), where=limit > 0)


def disk_force(packing: Packing) -> Floats:
    """Net force on each disk, load included, and torque over radius, shape (N, 3)."""
    return packing.net_force.reshape(3, -1).T


def disk_pressure(packing: Packing) -> Floats:
    """Sum of the normal forces on each disk, shape (N,)."""
    total = np.zeros(len(packing))
    pair = ~packing.contacts.floor
    np.add.at(total, packing.contacts.i, packing.normal_force)
    np.add.at(total, packing.contacts.j[pair], packing.normal_force[pair])
    return total


def disk_mobilised(packing: Packing) -> Floats:
    """The largest |f_t|/(mu f_n) of the contacts of each disk, shape (N,)."""
    largest = np.zeros(len(packing))
    pair, share = ~packing.contacts.floor, contact_mobilised(packing)
    np.maximum.at(largest, packing.contacts.i, share)
    np.maximum.at(largest, packing.contacts.j[pair], share[pair])
    return largest
