"""Rattlers out of the way: disks that carry nothing, moved to the middle of their cages.

A settled packing leaves a disk that nothing holds just about touching one of its neighbours. Where it lies is of no
consequence to anything but Newton's method: as the packing is sheared the neighbour runs into it, and a contact opens
as delta^(3/2) -> 0, to which Newton's method converges slowly, one such disk at a time. In a packing of 10,000 disks,
with its hundreds of rattlers, ten of them are hit in an increment of 1e-4 of the load. Such a disk may as well lie
where it touches nothing: its position is no property of the equilibrium.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..analysis import Packing, nearest_image, touching

FIRST, SHRINK = 0.03, 0.85
"""The first of the moves, in radii, and the factor from one to the next: together they reach 0.2 radii, a cage is a few
tenths wide."""

MOVES = 80
"""Moves of a disk: the last is of 1e-7 radii, far less than what the cages change from load to load."""


def clear_rattlers(packing: Packing, least: float) -> Packing:
    """Move every disk whose contacts carry no more than a given force to the middle of its cage.

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
    idle = packing.loaded(least).rattlers
    position = packing.position.copy()
    position[idle] = middle_of_cage(packing, idle)
    return replace(packing, position=position, contacts=touching(position, packing.radius, packing.box_length))


def middle_of_cage(packing: Packing, disks: NDArray[np.int64]) -> NDArray[np.float64]:
    """Where disks are far from all of their neighbours: each moves away from the nearest one, ever less.

    Parameters
    ----------
    packing : Packing
        Whose other disks are the cages.
    disks : ndarray of int, shape (D,)
        The disks to move.

    Returns
    -------
    ndarray, shape (D, 2)
        Their places, length; where there is none with a wider gap, the old one.
    """
    radius, box = packing.radius, packing.box_length
    position = packing.position.copy()
    wrapped = position.copy()
    if box is not None:
        wrapped[:, 0] %= box
    tree = cKDTree(wrapped, boxsize=None if box is None else [box, 0.0])
    for disk in disks:
        near = np.setdiff1d(tree.query_ball_point(wrapped[disk], radius[disk] + 2 * radius.max()), [disk])
        place, widest = position[disk].copy(), -np.inf
        for move in FIRST * radius[disk] * SHRINK ** np.arange(MOVES):
            branch = nearest_image(place - position[near], box)
            distance = np.hypot(branch[:, 0], branch[:, 1])
            gaps = np.append(distance - radius[near] - radius[disk], place[1] - radius[disk])
            closest = int(np.argmin(gaps))
            if gaps[closest] > widest:
                position[disk], widest = place, gaps[closest]
            away = np.array([0.0, 1.0]) if closest == len(near) else branch[closest] / distance[closest]
            place = place + move * away
    return position[disks]
