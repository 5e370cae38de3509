"""Particles that nearly touch others, or planes: the contacts that a small motion may make.

A motion that opens a contact moves particles by the overlap of this contact. So gaps that are larger than the largest
overlap of a packing are left out. Planes are those that other particles touch.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.sparse import csr_array

from ..arrays import Floats, Indices
from ..configuration import Configuration
from ..contacts import WALL
from .linearised_contacts import particle_rows

SAME_PLANE = 1e-7
"""Difference of two normals, and of two places over the mean radius, that are of one plane."""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Pairs that nearly touch, G of them.

    Attributes
    ----------
    i, j : ndarray of int, shape (G,)
        Partners; j is -1 for a plane.
    normal : ndarray, shape (G, 3)
        Unit vector towards i.
    gap : ndarray, shape (G,)
        Distance of the surfaces, length.
    """

    i: Indices
    j: Indices
    normal: Floats
    gap: Floats

    def rates(self, configuration: Configuration) -> csr_array:
        """By how much each gap closes by displacements, shape (G, coordinates)."""
        closing = np.hstack([-self.normal, np.zeros_like(self.normal)])
        return particle_rows(configuration, (self.i, self.j), np.array([closing, -closing]))


def gaps_of(configuration: Configuration) -> Gaps:
    """Pairs of particles, and particles and planes, that do not touch and are nearer than the largest overlap."""
    largest = float(configuration.contacts.overlap.max(initial=0.0))
    place = np.zeros((len(configuration), 3))
    place[:, : configuration.dimension] = configuration.position
    parts = [_between_particles(configuration, place, largest), _at_planes(configuration, place, largest)]
    i, j, normal, gap = (np.concatenate(each) for each in zip(*parts, strict=True))
    near = (gap > 0) & (gap < largest) & ~_touch(configuration, i, j)
    return Gaps(i[near], j[near], normal[near], gap[near])


def _touch(configuration: Configuration, i: Indices, j: Indices) -> np.ndarray:
    """Which pairs of particles have a contact already, as cohesive ones that are apart do."""
    count, c = len(configuration), configuration.contacts
    pairs, contacts = (np.minimum(a, b) * count + np.maximum(a, b) for a, b in ((i, j), (c.i, c.j)))
    return np.isin(pairs, contacts[~c.wall]) & (j != WALL)


def _between_particles(c: Configuration, place: Floats, largest: float) -> tuple[Indices, Indices, Floats, Floats]:
    """Pairs of particles, through the sides of the box, too: the larger of two, or the later one, finds the other."""
    from scipy.spatial import cKDTree  # which takes as long to import as all of `scipy.sparse`

    tree, far = cKDTree(place), 2 * c.radius + largest
    low, high = place.min(axis=0) - far.max(), place.max(axis=0) + far.max()
    found = [(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3)))]
    for image in product(*((-1, 0, 1) if each else (0,) for each in c.periodic)):
        shifted = place + np.array(image) @ c.box
        inside = np.flatnonzero(np.all((shifted >= low) & (shifted <= high), axis=1))
        if not len(inside):
            continue
        near = tree.query_ball_point(shifted[inside], far[inside])
        j = np.repeat(inside, [len(each) for each in near])
        i = np.concatenate([np.zeros(0, int), *(np.array(each, int) for each in near)])
        once = (c.radius[i] < c.radius[j]) | ((c.radius[i] == c.radius[j]) & (i < j))
        found.append((i[once], j[once], (place[i] - shifted[j])[once]))
    i, j, branch = (np.concatenate(each) for each in zip(*found, strict=True))
    distance = np.linalg.norm(branch, axis=1)
    normal = branch / np.maximum(distance, np.finfo(float).tiny)[:, None]
    return i, j, normal, distance - c.radius[i] - c.radius[j]


def _at_planes(c: Configuration, place: Floats, largest: float) -> tuple[Indices, Indices, Floats, Floats]:
    walls = c.contacts.chosen(c.contacts.wall)
    surface = np.einsum("ca,ca->c", place[walls.i], walls.normal) - c.radius[walls.i] + walls.overlap
    scale = float(c.radius.mean())
    _, which = np.unique(
        np.round(np.column_stack([walls.normal, surface / scale]) / SAME_PLANE), axis=0, return_index=True
    )
    found = [(np.zeros(0, int), np.zeros((0, 3)), np.zeros(0))]
    for k in which:
        height = place @ walls.normal[k] - surface[k] - c.radius
        i = np.flatnonzero((height > SAME_PLANE * scale) & (height < largest))
        found.append((i, np.tile(walls.normal[k], (len(i), 1)), height[i]))
    i, normal, gap = (np.concatenate(each) for each in zip(*found, strict=True))
    return i, np.full(len(i), WALL), normal, gap
