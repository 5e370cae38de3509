"""A packing on a page, in two or three dimensions: images of particles and contacts, walls and the box."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from faultgouge.analysis import Configuration
from faultgouge.analysis.arrays import Floats, Indices
from faultgouge.analysis.has_configuration import HasConfiguration

from .disk_view import View, Wall, cell_of, walls_of, within_cell

IMAGE_MARGIN = 0.5
"""Images of disks beyond the sides of a periodic box that move into sight, in units of the largest radius."""


@dataclass(frozen=True, eq=False)
class Images:
    """Every image of a particle and of a contact that the page draws.

    Attributes
    ----------
    dimension : int
        2 or 3.
    place : ndarray, shape (n, 3)
        Centres, length.
    particle : ndarray of int, shape (n,)
        Index of the particle of each image.
    bar : ndarray, shape (c, 2, 3)
        Ends of the bars of contacts, length.
    contact : ndarray of int, shape (c,)
        Index of the contact of each bar.
    low, high : ndarray, shape (dimension,)
        The frame of the picture of disks; of spheres the box along its periodic edges, and else what lies in it.
    walls : tuple of Wall
    corners : ndarray, shape (8, 3)
        Of the box of spheres; bit k of the number of a corner says on which side along edge k.
    periodic : bool
        Whether a picture of disks repeats along x.
    """

    dimension: int
    place: Floats
    particle: Indices
    bar: Floats
    contact: Indices
    low: Floats
    high: Floats
    walls: tuple[Wall, ...]
    corners: Floats
    periodic: bool

    @classmethod
    def of(cls, packing: HasConfiguration) -> "Images":
        """The images of a packing."""
        if packing.dimension == 3:
            return cls._of_spheres(packing.configuration)
        view = View.of(packing, margin=IMAGE_MARGIN * packing.radius.max())
        top = float((packing.position[:, 1] + packing.radius).max())
        room = 1.1 if packing.top.any() else 0.3  # for the arrow of the load
        return cls(
            dimension=2,
            place=_flat(view.place),
            particle=view.disk,
            bar=np.stack([_flat(view.start), _flat(view.end)], axis=1),
            contact=view.contact,
            low=np.array([view.left, view.bottom]),
            high=np.array([view.right, top + room * float(packing.radius.min())]),
            walls=view.walls,
            corners=np.zeros((0, 3)),
            periodic=bool(len(view.edges)),
        )

    @classmethod
    def _of_spheres(cls, packing: Configuration) -> "Images":
        """Spheres within the box; of a contact through a periodic side each partner has half."""
        cell, place = cell_of(packing), within_cell(packing, packing.position)
        c, branch = packing.contacts, packing.branch
        bars = np.stack([place[c.i], place[c.i] - branch], axis=1)
        through = np.flatnonzero(
            ~c.wall & (np.linalg.norm(bars[:, 1] - place[c.j], axis=1) > 1e-6 * packing.radius.max())
        )
        bars[through, 1] += 0.5 * branch[through]
        again = np.stack([place[c.j[through]] + 0.5 * branch[through], place[c.j[through]]], axis=1)
        low, high = (place - packing.radius[:, None]).min(axis=0), (place + packing.radius[:, None]).max(axis=0)
        walls = walls_of(packing)
        for wall in walls:
            wall.cut(low, high)
        sides = [
            (np.zeros(3), cell[k]) if packing.periodic[k] else (np.eye(3)[k] * low[k], np.eye(3)[k] * (high - low)[k])
            for k in range(3)
        ]
        begin = np.where(packing.periodic, packing.origin, 0.0) + sum(side[0] for side in sides)
        corners = [begin + sum((number >> k & 1) * sides[k][1] for k in range(3)) for number in range(8)]
        return cls(
            dimension=3,
            place=place,
            particle=np.arange(len(packing)),
            bar=np.concatenate([bars, again]),
            contact=np.concatenate([np.arange(len(c)), through]),
            low=low,
            high=high,
            walls=walls,
            corners=np.array(corners),
            periodic=False,
        )

    @staticmethod
    def frame(images: Sequence["Images"]) -> dict[str, Any]:
        """The frame that holds all packings of a page, as lists."""
        low = np.min([each.low for each in images], axis=0)
        high = np.max([each.high for each in images], axis=0)
        first = images[0]
        return {
            "extent": [low.tolist(), high.tolist()],
            "periodic": first.periodic,
            "walls": [wall._asdict() for wall in first.walls],
            "corners": first.corners.tolist(),
        }


def _flat(points: Floats) -> Floats:
    return np.column_stack([points, np.zeros(len(points))])
