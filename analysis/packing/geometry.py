"""Positions and directions of contacts, in a box that may be periodic; definitions as in `packing`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, floats, frozen
from ..errors import BadInputError
from .compensated import DoubleDouble, exact_sum, overlap_and_distance, separation
from .contacts import FLOOR, Contacts

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


class ContactGeometry(NamedTuple):
    """Normal, tangent, distance and overlap of each contact, as read-only arrays over contacts.

    Attributes
    ----------
    normal : ndarray, shape (C, 2)
        Unit vector n towards i.
    tangent : ndarray, shape (C, 2)
        Unit vector tau = (-n_y, n_x).
    distance : ndarray, shape (C,)
        Length r of the branch vector; for the floor the height y.
    overlap : ndarray, shape (C,)
        delta = R_i + R_j - r, or R - y for the floor; length.
    """

    normal: Floats
    tangent: Floats
    distance: Floats
    overlap: Floats


def contact_geometry(
    position: Floats, low: Floats | None, radius: Floats, contacts: Contacts, box_length: float | None
) -> tuple[ContactGeometry, DoubleDouble, DoubleDouble]:
    """The geometry of contacts of a Packing, and their branch vectors and overlaps with low parts; `low` are the low
    parts of its positions. A BadInputError if two disks in contact have the same centre."""
    i, j, floor = contacts.i, contacts.j, contacts.floor
    low_i, low_j = (None, None) if low is None else (low[i], low[j])
    branch = separation(position[i], low_i, position[j], low_j, box_length)
    foot = np.zeros((floor.sum(), 2))
    branch[0][floor] = foot + position[i[floor]] * (0.0, 1.0)
    branch[1][floor] = foot if low is None else low[i[floor]] * (0.0, 1.0)
    reach = exact_sum(radius[i], np.where(floor, 0.0, radius[j]))
    overlap, distance = overlap_and_distance(branch, reach)
    distance[floor] = branch[0][floor, 1]  # signed: a centre below the floor is pushed up all the same
    height = exact_sum(radius[i[floor]], -distance[floor])
    overlap[0][floor], overlap[1][floor] = exact_sum(height[0], height[1] - branch[1][floor, 1])
    if np.any(distance[~floor] == 0):
        k = np.flatnonzero(~floor & (distance == 0))[0]
        both = f"Disks {i[k]} and {j[k]} have the same centre"
        raise BadInputError(f"{both}, so that their contact has no direction: separate them.")
    normal = branch[0] / np.where(floor, 1.0, distance)[:, None]
    normal[floor] = (0.0, 1.0)
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    return ContactGeometry(*(frozen(each) for each in (normal, tangent, distance, overlap[0]))), branch, overlap


def nearest_image(difference: Floats, box_length: float | None) -> Floats:
    """Coordinate differences, shape (..., 2), to the nearest image by the period along x, length; a new array."""
    difference = np.array(difference, dtype=np.float64)
    if box_length is not None:
        difference[..., 0] -= box_length * np.round(difference[..., 0] / box_length)
    return difference


def touching(position: ArrayLike, radius: ArrayLike, box_length: float | None = None) -> Contacts:
    """Find every contact from positions alone, with zero slips.

    Parameters
    ----------
    position : array_like, shape (N, 2)
        Centres, length.
    radius : array_like, shape (N,)
        Radii, length.
    box_length : float, optional
        Period along x.

    Returns
    -------
    Contacts
        All pairs with positive overlap, and all disks that reach below y = 0.

    Raises
    ------
    ValueError
        If a number is not finite, shapes do not fit, or the box is narrower than two largest diameters.
    """
    radius = floats("radius", radius, np.shape(radius))
    position = floats("position", position, (len(radius), 2))
    check_box(radius, box_length)
    i, j = neighbour_tree(position, box_length).query_pairs(2 * radius.max(), output_type="ndarray").T
    branch = separation(position[i], None, position[j], None, box_length)
    near = overlap_and_distance(branch, exact_sum(radius[i], radius[j]))[0][0] > 0
    floor = np.flatnonzero(radius - position[:, 1] > 0)
    i, j = np.concatenate([i[near], floor]), np.concatenate([j[near], np.full(len(floor), FLOOR)])
    return Contacts(i, j, np.zeros(len(i)))


def neighbour_tree(position: Floats, box_length: float | None) -> cKDTree:
    """The tree that finds near centres, shape (N, 2), also across the periodic sides."""
    from scipy.spatial import cKDTree

    wrapped = position.copy()
    if box_length is not None:
        wrapped[:, 0] %= box_length
        wrapped[wrapped[:, 0] >= box_length, 0] = 0.0  # a tiny negative x modulo L rounds to L
    return cKDTree(wrapped, boxsize=None if box_length is None else [box_length, 0.0])


def check_box(radius: Floats, box_length: float | None) -> None:
    """A ValueError if the box is too narrow."""
    # In a narrower box a disk can touch two images of one neighbour, and one slip cannot describe that.
    if box_length is not None and box_length < 4 * radius.max():
        raise ValueError(f"The box length {box_length} is under two largest diameters, {4 * radius.max()}.")
