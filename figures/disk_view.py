"""What lies in a picture: planes that particles touch, the box, images of particles, lines at which it repeats."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from faultgouge.analysis import Configuration, Packing
from faultgouge.analysis.arrays import Floats, Indices
from faultgouge.analysis.has_configuration import HasConfiguration

from .style import figure_of

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


def walls_of(packing: HasConfiguration) -> tuple[Wall, ...]:
    """The planes along the axes that particles touch; the floor of a Packing."""
    if isinstance(packing, Packing):
        return (Wall(1, 1.0, 0.0),)
    c, position, radius = packing.configuration.contacts, packing.position, packing.radius
    at = np.flatnonzero(c.wall & (np.abs(c.normal).max(axis=1) > ALONG_AXIS))
    axis = np.argmax(np.abs(c.normal[at]), axis=1)
    sign = np.sign(c.normal[at, axis])
    place = position[c.i[at], axis] - sign * (radius[c.i[at]] - c.overlap[at])
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


class View(NamedTuple):
    """Which images of the disks a picture shows, and its edges.

    Attributes
    ----------
    low, high : ndarray, shape (2,)
        Lower left and upper right corner, length.
    disk : ndarray of int, shape (n,)
        The disk of each image.
    place : ndarray, shape (n, 2)
        Its centre, length.
    contact : ndarray of int, shape (c,)
        The contact of each bar.
    start, end : ndarray, shape (c, 2)
        Where the bar begins and ends, length.
    walls : tuple of Wall
        Floor and walls.
    edges : ndarray, shape (e, 2, 2)
        Ends of the lines at which the picture repeats, length.
    """

    low: Floats
    high: Floats
    disk: Indices
    place: Floats
    contact: Indices
    start: Floats
    end: Floats
    walls: tuple[Wall, ...]
    edges: Floats

    @classmethod
    def of(cls, packing: HasConfiguration, margin: float = 0.0) -> "View":
        """Every image of every disk and contact that reaches to within a margin of the box; length."""
        configuration, radius, walls = packing.configuration, packing.radius, walls_of(packing)
        cell, origin, periodic = cell_of(configuration), configuration.origin[:2], configuration.periodic[:2]
        contacts, branch = configuration.contacts, configuration.branch[:, :2]
        position, reach = within_cell(configuration, packing.position), radius[:, None]
        low, high = (position - reach).min(axis=0), (position + reach).max(axis=0)
        below, above = np.full((2, 2), 0.3 * radius.max())
        if isinstance(packing, Packing):  # room for the arrows of the load
            above[:] = (0, (1.5 if packing.fx or packing.fy else 0.3) * radius.max())
            below[0] = 0
        for wall in walls:
            wall.cut(low, high)
        corners = origin + np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) @ cell
        low = np.where(periodic, corners.min(axis=0), low - below)
        high = np.where(periodic, corners.max(axis=0), high + above)
        around = [np.arange(-2, 3) if each else [0] for each in periodic]
        images = position + (np.stack(np.meshgrid(*around), axis=-1).reshape(-1, 1, 2) @ cell)
        near_low, near_high = (np.where(periodic, side, far) for side, far in ((low, -np.inf), (high, np.inf)))
        within = (images + reach > near_low - margin) & (images - reach < near_high + margin)
        image, disk = np.nonzero(within.all(axis=2))
        start = images[:, contacts.i]
        ends = np.stack([start, start - branch])
        within = (ends.max(axis=0) > near_low - margin) & (ends.min(axis=0) < near_high + margin)
        bar, contact = np.nonzero(within.all(axis=2))
        place, begin = images[image, disk], start[bar, contact]
        edges = corners[[[0, 1], [1, 3], [3, 2], [2, 0]]] if all(periodic) else _edges(periodic, low, high, walls)
        return cls(low, high, disk, place, contact, begin, begin - branch[contact], walls, edges)

    @property
    def size(self) -> Floats:
        """Width and height, length."""
        return self.high - self.low

    def points(self, axes: Axes) -> float:
        """Points per unit of length, so that widths of lines are to scale; as the axes stand now."""
        box = axes.get_window_extent()
        return float(72 / figure_of(axes).dpi * min((box.width, box.height) / self.size))

    def part_of(self, wall: Wall) -> Floats:
        """Corners of the part of a wall in the picture, shape (4, 2), length."""
        low, high = self.low.copy(), self.high.copy()
        wall.cut(high, low)
        return np.array([low, [high[0], low[1]], high, [low[0], high[1]]])


def _edges(periodic: Any, low: Floats, high: Floats, walls: tuple[Wall, ...]) -> Floats:
    """Lines at which a picture with one periodic side repeats, shape (e, 2, 2)."""
    begin, end, lines = low.copy(), high.copy(), []
    for wall in walls:
        wall.cut(begin, end)
    for axis in np.flatnonzero(periodic):
        for place in (low[axis], high[axis]):
            line = np.array([begin, end])
            line[:, axis] = place
            lines.append(line)
    return np.array(lines).reshape(-1, 2, 2)
