"""The graph of touching disks, and index arrays that remain valid as long as the graph does not change.

Contacts seldom change from one Newton iteration to the next. The index arrays for sums over the contacts of each disk,
and for the places of their stiffnesses in a matrix, are therefore kept.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...analysis import FLOOR, Contacts
from ...analysis.arrays import Floats, Indices
from ...analysis.factors.linear_solver import Band, Booleans, band


class ContactGraph:
    """The contacts of a packing without their slips.

    Parameters
    ----------
    contacts : Contacts
        Of the packing; their slips do not matter.
    radius : ndarray, shape (N,)
        Of the disks, length.

    Attributes
    ----------
    i, j : ndarray of int, shape (C,)
        Partners; j = -1 is the floor.
    pairs : int
        Contacts of two disks; those with the floor follow.
    """

    def __init__(self, contacts: Contacts, radius: Floats) -> None:
        self.contacts, self.radius = contacts, radius
        self.i, self.j = contacts.i, contacts.j
        self.pairs = int(np.count_nonzero(self.j != FLOOR))
        self._band: Band | None = None

    @cached_property
    def reach(self) -> Floats:
        """R_i + R_j of each contact, R_i for the floor; length, shape (C,)."""
        reach = self.radius[self.i]
        reach[: self.pairs] += self.radius[self.j[: self.pairs]]
        return reach

    @cached_property
    def _ends(self) -> tuple[Indices, Indices]:
        """The disks at the ends of all contacts, and which contacts these are."""
        contact = np.arange(len(self.i))
        return np.concatenate([self.i, self.j[: self.pairs]]), np.concatenate([contact, contact[: self.pairs]])

    @cached_property
    def _coordinate_ends(self) -> tuple[Indices, Indices]:
        disk, contact = self._ends
        return (disk + len(self.radius) * np.arange(3)[:, None]).ravel(), contact

    @cached_property
    def degree(self) -> Indices:
        """Contacts of each disk, shape (N,)."""
        return np.bincount(self._ends[0], minlength=len(self.radius))

    @cached_property
    def has_contact(self) -> Booleans:
        """Disks that have a contact, shape (N,)."""
        return self.degree > 0

    def old(self, earlier: "ContactGraph") -> Booleans | None:
        """Which contacts there were earlier, too, shape (C,); None if all were."""
        if earlier is self:
            return None
        number = len(self.radius) + 1  # the floor, -1, is none of the disks before
        old = np.isin(number * self.i + self.j, number * earlier.i + earlier.j, assume_unique=True)
        return None if old.all() else old

    def per_disk(self, values: Floats | Booleans) -> NDArray:
        """Sums of numbers over the contacts of each disk, shape (N,)."""
        disk, contact = self._ends
        return np.bincount(disk, values.take(contact), len(self.radius))

    def count(self, chosen: Booleans) -> NDArray:
        """How many of the chosen contacts each disk has, shape (N,)."""
        return self.degree if chosen.all() else self.per_disk(chosen)

    def per_coordinate(self, values: Floats) -> NDArray:
        """Three such sums, one after the other, shape (3N,), of numbers of shape (3, C)."""
        coordinate, contact = self._coordinate_ends
        return np.bincount(coordinate, values.take(contact, axis=1).ravel(), 3 * len(self.radius))

    def band(self, active: Booleans) -> Band:
        """Where the stiffnesses of the contacts are in the matrix of some coordinates; remembered for the last ones."""
        if self._band is None or not (self._band.active == active).all():
            self._band = band(self.i, self.j, active)
        return self._band
