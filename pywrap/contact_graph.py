"""Which disks touch, and the index arrays that serve as long as it stays so.

Contacts change seldom from one Newton iteration to the next, and what has been counted, sorted or looked up for them
need not be again: sums over the contacts of each disk, and the places of their stiffnesses in a matrix.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..analysis.packing import FLOOR
from .band import Band, band

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Booleans = NDArray[np.bool_]


class ContactGraph:
    """The contacts of a packing without their slips.

    Parameters
    ----------
    i, j : ndarray of int, shape (C,)
        Partners, in the canonical order of :class:`~faultgouge.analysis.Contacts`; j = -1 is the floor.
    radius : ndarray, shape (N,)
        Of the disks, length.
    """

    def __init__(self, i: Indices, j: Indices, radius: Floats) -> None:
        self.i, self.j, self.radius = i, j, radius
        self.pairs = int(np.count_nonzero(j != FLOOR))
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
    def degree(self) -> Indices:
        """Contacts of each disk, shape (N,)."""
        return np.bincount(self._ends[0], minlength=len(self.radius))

    def per_disk(self, values: NDArray) -> Floats:
        """Sums of numbers over the contacts of each disk, shape (N,)."""
        disk, contact = self._ends
        return np.bincount(disk, values.take(contact), len(self.radius))

    def count(self, chosen: Booleans) -> Indices:
        """How many of the chosen contacts each disk has, shape (N,)."""
        return self.degree if np.all(chosen) else self.per_disk(chosen).astype(np.int64)

    def band(self, active: Booleans) -> Band:
        """Where the stiffnesses of the contacts are in the matrix of some coordinates; the last one if it has the same."""
        if self._band is None or not np.array_equal(self._band.active, active):
            self._band = band(self.i, self.j, active)
        return self._band
