"""What lies in a picture of disks: images of particles and contacts, and the lines at which it repeats."""

from typing import NamedTuple

import numpy as np

from faultgouge.analysis import Configuration
from faultgouge.analysis.arrays import Floats, Indices
from faultgouge.analysis.has_configuration import HasConfiguration

Plane = tuple[int, float, float]
"""A wall: its axis, the sign along it of its inner side, and its place."""


def cut(planes: tuple[Plane, ...], low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Lower and upper corner of a frame that ends at walls."""
    low, high = low.copy(), high.copy()
    for axis, sign, place in planes:
        (low if sign > 0 else high)[axis] = place
    return low, high


def in_box(own: Configuration) -> tuple[Floats, Floats]:
    """Edges of the box in rows, shape (d, d), length, and positions, shape (N, d), within its periodic sides."""
    d = own.dimension
    cell, origin = own.box[:d, :d].copy(), own.origin[:d]
    cell[~cell.any(axis=1)] = np.eye(d)[~cell.any(axis=1)]  # an open side of no length has a length of one
    share = (own.position - origin) @ np.linalg.inv(cell)
    return cell, np.asarray(origin + (share - np.where(own.periodic[:d], np.floor(share), 0.0)) @ cell)


class View(NamedTuple):
    """Which images of the disks a picture shows, from its lower left corner `low` to its upper right corner `high`.

    `disk` (n,) and `place` (n, 2) are the disk of each image and its centre; `contact`, `start` and `end` the contact
    of each bar, and where the bar begins and ends. The picture repeats at the lines `edges` (e, 2, 2).
    """

    low: Floats
    high: Floats
    disk: Indices
    place: Floats
    contact: Indices
    start: Floats
    end: Floats
    edges: Floats

    @classmethod
    def of(cls, packing: HasConfiguration, margin: float = 0.0) -> "View":
        """Every image of every disk and contact that reaches to within a margin of the box; length."""
        own, reach, room = packing.configuration, packing.radius[:, None], 0.3 * packing.radius.max()
        (cell, position), origin, periodic = in_box(own), own.origin[:2], own.periodic[:2]
        low, high = cut(packing.planes, (position - reach).min(axis=0), (position + reach).max(axis=0))
        corners = origin + np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) @ cell
        above = np.array([room, 7 * room if packing.top.any() else room])  # for the arrows of the load
        low = np.where(periodic, corners.min(axis=0), low - room)
        high = np.where(periodic, corners.max(axis=0), high + above)
        around = np.stack(np.meshgrid(*(np.arange(-2, 3) if each else [0] for each in periodic)), axis=-1)
        images = position + around.reshape(-1, 1, 2) @ cell
        near_low, near_high = np.where(periodic, low, -np.inf) - margin, np.where(periodic, high, np.inf) + margin
        image, disk = np.nonzero(((images + reach > near_low) & (images - reach < near_high)).all(axis=2))
        branch, start = own.branch[:, :2], images[:, own.contacts.i]
        ends = np.stack([start, start - branch])
        within = ((ends.max(axis=0) > near_low) & (ends.min(axis=0) < near_high)).all(axis=2)
        bar, contact = np.nonzero(within & ~own.contacts.couple)
        begin = start[bar, contact]
        if all(periodic):
            edges = corners[[[0, 1], [1, 3], [3, 2], [2, 0]]]
        else:
            lines = [np.array(cut(packing.planes, low, high)) for _ in range(2 * sum(periodic))]
            for line, axis, place in zip(lines, 2 * [*np.flatnonzero(periodic)], (low, high), strict=False):
                line[:, axis] = place[axis]
            edges = np.array(lines).reshape(-1, 2, 2)
        return cls(low, high, disk, images[image, disk], contact, begin, begin - branch[contact], edges)

    @property
    def size(self) -> Floats:
        """Width and height, length."""
        return self.high - self.low
