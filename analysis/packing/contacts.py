"""The contacts of a packing and their slips, in one canonical order."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Indices, derive_frozen, floats, integers, same_bits, set_frozen

FLOOR = -1
"""The index that stands for the floor as the second partner of a contact."""


@dataclass(frozen=True, init=False, eq=False)
class Contacts:
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
        first, second = integers("i", i), integers("j", j)
        if first.shape != second.shape:
            raise ValueError(f"The contact arrays i and j have different shapes, {first.shape} and {second.shape}.")
        if np.any(first < 0) or np.any(second < FLOOR):
            raise ValueError("A contact has a negative disk index; only j may be -1, for the floor.")
        if np.any(first == second):
            raise ValueError(f"Disk {first[first == second][0]} is listed as touching itself.")
        slips = floats("slip", slip, first.shape)
        low = None if slip_low is None else floats("slip_low", slip_low, first.shape)
        if not _canonical(first, second):
            first, second, order = _sort_contacts(first, second)
            slips, low = slips[order], None if low is None else low[order]
        set_frozen(self, i=first, j=second, slip=slips, slip_low=low)

    def __len__(self) -> int:
        return len(self.i)

    def __eq__(self, other: object) -> bool:
        """Whether partners and slips are the same to the bit."""
        return same_bits(self, other)

    def __hash__(self) -> int:
        return hash((len(self), self.slip.tobytes()))

    def __repr__(self) -> str:
        return f"<Contacts: {int((~self.floor).sum())} between disks, {int(self.floor.sum())} with the floor>"

    @property
    def floor(self) -> NDArray[np.bool_]:
        """Which contacts are with the floor, shape (C,)."""
        return self.j == FLOOR

    def slipped(self, slip: ArrayLike, slip_low: ArrayLike | None = None) -> "Contacts":
        """The same contacts with other slips in the same order; length, shape (C,)."""
        low = None if slip_low is None else floats("slip_low", slip_low, self.i.shape)
        return derive_frozen(self, slip=floats("slip", slip, self.i.shape), slip_low=low)


def _canonical(i: Indices, j: Indices) -> bool:
    """Whether contacts are in the order of storage, and none is listed twice."""
    floor, disks = j == FLOOR, int(i.max(initial=0)) + int(j.max(initial=0)) + 2
    place = np.where(floor, disks * disks, disks * i + j) + np.where(floor, i, 0)
    return bool(np.all((i < j) | floor) and np.all(place[1:] > place[:-1]))


def _sort_contacts(i: Indices, j: Indices) -> tuple[Indices, Indices, Indices]:
    """i and j in the order of storage, and the place that each contact had before."""
    floor = j == FLOOR
    first = np.where(floor, i, np.minimum(i, j))
    second = np.where(floor, FLOOR, np.maximum(i, j))
    order = np.lexsort((second, first, floor))
    first, second = first[order], second[order]
    twice = (np.diff(first) == 0) & (np.diff(second) == 0)
    if np.any(twice):
        k = np.flatnonzero(twice)[0]
        raise ValueError(f"The contact ({first[k]}, {second[k]}) is listed twice.")
    return first, second, order
