"""The graph of touching disks, and index arrays that remain valid as long as the graph does not change.

Contacts seldom change from one Newton iteration to the next. The index arrays for sums over the contacts of each disk,
and for the places of their stiffnesses in a matrix, are therefore kept.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ...analysis import FLOOR, Contacts
from ...analysis.arrays import Floats
from ...analysis.factors.linear_solver import Band, Booleans, band


class ContactGraph:
    """The contacts of a packing without their slips: partners `i` and `j` (C,), with j = -1 of the floor.

    The `pairs` contacts of two disks come first. `reach` (C,) is R_i + R_j, or R_i with the floor; `has_contact` (N,)
    says which disks have a contact.
    """

    def __init__(self, contacts: Contacts, radius: Floats) -> None:
        self.contacts, self.disks = contacts, len(radius)
        self.i, self.j = contacts.i, contacts.j
        self.pairs = pairs = int(np.count_nonzero(self.j != FLOOR))
        self.reach = radius[self.i]
        self.reach[:pairs] += radius[self.j[:pairs]]
        contact = np.arange(len(self.i))
        self._end = np.concatenate([self.i, self.j[:pairs]])
        self._contact = np.concatenate([contact, contact[:pairs]])
        self._coordinate = (self._end + self.disks * np.arange(3)[:, None]).ravel()
        self.has_contact = np.bincount(self._end, minlength=self.disks) > 0
        self._band: Band | None = None

    def old(self, earlier: "ContactGraph") -> Booleans | None:
        """Which contacts there were earlier, too, shape (C,); None if all were."""
        number = self.disks + 1  # the floor, -1, is none of the disks before
        old = np.isin(number * self.i + self.j, number * earlier.i + earlier.j, assume_unique=True)
        return None if old.all() else old

    def per_disk(self, values: Floats | Booleans) -> NDArray:
        """Sums of numbers over the contacts of each disk, shape (N,)."""
        return np.bincount(self._end, values.take(self._contact), self.disks)

    def per_coordinate(self, values: Floats) -> NDArray:
        """Three such sums, one after the other, shape (3N,), of numbers of shape (3, C)."""
        return np.bincount(self._coordinate, values.take(self._contact, axis=1).ravel(), 3 * self.disks)

    def rounding(self, stiffness: Floats, unit: float) -> float:
        """Largest error of the force on a disk if every overlap has an independent error of one unit, a length, with
        the normal stiffness of each contact, shape (C,)."""
        return unit * math.sqrt(self.per_disk(stiffness**2).max(initial=0.0))

    def band(self, active: Booleans) -> Band:
        """Where the stiffnesses of the contacts are in the matrix of some coordinates; remembered for the last ones."""
        if self._band is None or not (self._band.active == active).all():
            self._band = band(self.i, self.j, active)
        return self._band
