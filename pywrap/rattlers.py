"""Rattlers out of the way: disks that carry nothing, moved to the middle of their cages.

A settled packing leaves a disk that nothing holds just about touching one of its neighbours. Where it lies is of no
consequence to anything but Newton's method: as the packing is sheared the neighbour runs into it, and a contact opens
as delta^(3/2) -> 0, to which Newton's method converges slowly. Such a disk may as well lie where it touches nothing:
its position is no property of the equilibrium.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..analysis import Packing, nearest_image, touching

STEP = 0.01
"""Length of a move, in radii: a cage is a few tenths of a radius wide."""

MOVES = 60
"""Moves of a disk, at the most: across its cage and back."""


def clear_rattlers(packing: Packing, least: float) -> Packing:
    """Move every disk whose contacts carry no more than a given force away from what it touches.

    Each goes from its nearest neighbour, again and again, and stays where it was farthest from all of them.

    Parameters
    ----------
    packing : Packing
        At rest, without friction: its contacts have no history that could be lost.
    least : float
        Normal force up to which a contact counts as carrying nothing.

    Returns
    -------
    Packing
        The same but for the positions of these disks, and their contacts, which are gone.
    """
    position = packing.position.copy()
    wrapped = position.copy()
    if packing.box_length is not None:
        wrapped[:, 0] %= packing.box_length
    reach = 2 * packing.radius.max() * 1.5
    tree = cKDTree(wrapped, boxsize=None if packing.box_length is None else [packing.box_length, 0.0])
    for disk in packing.loaded(least).rattlers:
        near = np.setdiff1d(tree.query_ball_point(wrapped[disk], reach), [disk])
        position[disk] = _clear(disk, near, position, packing)
    contacts = touching(position, packing.radius, packing.box_length)
    return replace(packing, position=position, contacts=contacts)


def _clear(disk: int, near: NDArray[np.int64], position: NDArray[np.float64], packing: Packing) -> NDArray[np.float64]:
    """Where the disk is farthest from its neighbours and the floor, of the places on its way."""
    radius = packing.radius
    place = position[disk].copy()
    best, widest = place.copy(), -np.inf
    for _ in range(MOVES):
        branch = nearest_image(place - position[near], packing.box_length)
        distance = np.hypot(branch[:, 0], branch[:, 1])
        gaps = np.append(distance - radius[near] - radius[disk], place[1] - radius[disk])
        closest = int(np.argmin(gaps))
        if gaps[closest] > widest:
            best, widest = place.copy(), gaps[closest]
        away = np.array([0.0, 1.0]) if closest == len(near) else branch[closest] / distance[closest]
        place = place + STEP * radius[disk] * away
    return best
