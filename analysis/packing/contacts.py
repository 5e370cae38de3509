"""The contacts of a packing and their slips, in one canonical order."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Booleans, EqualToTheBit, Floats, Indices, derive_frozen, exactly, floats, set_frozen

FLOOR = -1
"""The index that stands for the floor as the second partner of a contact."""


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Contacts(EqualToTheBit):
    """The contacts of a packing and their slips, kept in one canonical order.

    For any given order, a pair is stored with i < j (the slip does not change under the exchange), pairs are in
    lexicographic order, and contacts with the floor follow after all pairs, sorted by disk.

    Parameters
    ----------
    i : array_like of int, shape (C,)
        First partner.
    j : array_like of int, shape (C,)
        Second partner; -1 is the floor.
    slip : array_like, shape (C,)
        Slip of each contact along tau, length.
    slip_low : array_like, shape (C,), optional
        Low parts of the slips, length; none by default.

    Raises
    ------
    ValueError
        If the arrays differ in shape, an index is negative, a slip is not finite, a disk touches itself, or a
        contact is listed twice.
    """

    i: Indices
    j: Indices
    slip: Floats
    slip_low: Floats | None

    def __init__(self, i: ArrayLike, j: ArrayLike, slip: ArrayLike, slip_low: ArrayLike | None = None) -> None:
        count = np.size(i)
        first, second = exactly("i", i, count, np.integer), exactly("j", j, count, np.integer)
        if np.any(first < 0) or np.any(second < FLOOR):
            raise ValueError("A contact has a negative disk index; only j may be -1, for the floor.")
        if np.any(first == second):
            raise ValueError(f"Disk {first[first == second][0]} is listed as touching itself.")
        slips = floats("slip", slip, (count,))
        low = None if slip_low is None else floats("slip_low", slip_low, (count,))
        floor = second == FLOOR
        low_end, high_end = np.minimum(first, second), np.maximum(first, second)
        first, second = np.where(floor, first, low_end), np.where(floor, FLOOR, high_end)
        order = np.lexsort((second, first, floor))
        first, second = first[order], second[order]
        twice = np.flatnonzero((np.diff(first) == 0) & (np.diff(second) == 0))
        if len(twice):
            raise ValueError(f"The contact ({first[twice[0]]}, {second[twice[0]]}) is listed twice.")
        set_frozen(self, i=first, j=second, slip=slips[order], slip_low=None if low is None else low[order])

    def __len__(self) -> int:
        return len(self.i)

    def __repr__(self) -> str:
        return f"<Contacts: {int((~self.floor).sum())} between disks, {int(self.floor.sum())} with the floor>"

    @property
    def floor(self) -> Booleans:
        """Which contacts are with the floor, shape (C,)."""
        return self.j == FLOOR

    def slipped(self, slip: ArrayLike, slip_low: ArrayLike | None = None) -> "Contacts":
        """The same contacts with other slips in the same order; length, shape (C,)."""
        low = None if slip_low is None else floats("slip_low", slip_low, self.i.shape)
        return derive_frozen(self, slip=floats("slip", slip, self.i.shape), slip_low=low)
