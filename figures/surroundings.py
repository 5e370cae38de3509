"""The surroundings of the particles of a picture: planes that they touch, and the box."""

from typing import NamedTuple

import numpy as np

from faultgouge.analysis import Configuration
from faultgouge.analysis.arrays import Floats

ALONG_AXIS = 1 - 1e-9
"""Component of a normal from which on it is along an axis."""


class Wall(NamedTuple):
    """A wall: all that lies beyond a place along an axis, seen along sign times the axis."""

    axis: int
    sign: float
    place: float

    def cut(self, low: Floats, high: Floats) -> None:
        """Move the lower or the upper corner of a frame to the wall, in place."""
        (low if self.sign > 0 else high)[self.axis] = self.place


def walls_of(configuration: Configuration) -> tuple[Wall, ...]:
    """The planes along the axes that particles touch."""
    c = configuration.contacts
    at = np.flatnonzero(c.wall & (np.abs(c.normal).max(axis=1) > ALONG_AXIS))
    axis = np.argmax(np.abs(c.normal[at]), axis=1)
    sign = np.sign(c.normal[at, axis])
    place = configuration.position[c.i[at], axis] - sign * (configuration.radius[c.i[at]] - c.overlap[at])
    sides = sorted({*zip(axis.tolist(), sign.tolist(), strict=True)})
    return tuple(Wall(a, s, float(np.mean(place[(axis == a) & (sign == s)]))) for a, s in sides)


def cell_of(configuration: Configuration) -> Floats:
    """Edges of the box in rows, shape (d, d), length; an open side of no length has a length of one."""
    d = configuration.dimension
    cell = configuration.box[:d, :d].copy()
    cell[~cell.any(axis=1)] = np.eye(d)[~cell.any(axis=1)]
    return cell


def within_cell(configuration: Configuration, position: Floats) -> Floats:
    """Positions, shape (N, d), moved into the box by whole edges along its periodic sides."""
    d, cell = configuration.dimension, cell_of(configuration)
    origin, periodic = configuration.origin[:d], configuration.periodic[:d]
    share = (position - origin) @ np.linalg.inv(cell)
    return np.asarray(origin + (share - np.where(periodic, np.floor(share), 0.0)) @ cell)
