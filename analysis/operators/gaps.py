"""Particles that nearly touch others, or planes: the contacts that a small motion may make.

A motion that opens a contact moves particles by the overlap of this contact. So gaps that are larger than the largest
overlap of a packing are left out. Planes are those that other particles touch.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from ..arrays import Floats, Indices
from ..assembly import each_of
from ..configuration import Configuration
from ..contacts import WALL

SAME_PLANE = 1e-7
"""Difference of two normals, and of two places over the mean radius, that are of one plane."""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Pairs that nearly touch, G of them: partners, j = -1 for a plane; unit vectors towards i; distances of the
    surfaces."""

    i: Indices
    j: Indices
    normal: Floats
    gap: Floats

    def rates(self, configuration: Configuration) -> csr_array:
        """By how much each gap closes by displacements, shape (G, coordinates)."""
        return csr_array(each_of(-self.normal) @ configuration.pair_rows((self.i, self.j)))


def near_pairs(
    position: Floats, radius: Floats, box: Floats, periodic: ArrayLike, apart: float = 0.0
) -> tuple[Indices, Indices, Floats]:
    """Pairs i < j of spheres whose surfaces are nearer than `apart`, 0 for those that overlap, ascending, and the
    vectors from j to i, shape (C, 3); through the sides of the box, too, whose edges are rows. A sphere that is near
    two images of another makes two pairs."""
    from scipy.spatial import cKDTree  # which takes as long to import as all of `scipy.sparse`

    tree, far = cKDTree(position), 2 * radius + apart
    low, high = position.min(axis=0) - far.max(), position.max(axis=0) + far.max()
    found = [np.zeros((0, 2), int)], [np.zeros((0, 3))]
    for image in product(*((-1, 0, 1) if each else (0,) for each in np.asarray(periodic))):
        shifted = position + np.array(image) @ box
        inside = np.flatnonzero(np.all((shifted >= low) & (shifted <= high), axis=1))
        if len(inside):
            near = tree.query_ball_point(shifted[inside], far[inside])
            j = np.repeat(inside, [len(each) for each in near])
            i = np.concatenate([np.array(each, int) for each in near])
            once = (radius[i] < radius[j]) | ((radius[i] == radius[j]) & (i < j))
            found[0].append(np.column_stack([i, j])[once])
            found[1].append((position[i] - shifted[j])[once])
    pairs, branch = np.concatenate(found[0]), np.concatenate(found[1])
    near = np.linalg.norm(branch, axis=1) < radius[pairs].sum(axis=1) + apart
    back = (pairs[:, 0] > pairs[:, 1])[near]
    pairs, branch = np.sort(pairs[near], axis=1), np.where(back[:, None], -branch[near], branch[near])
    order = np.lexsort(pairs.T[::-1])
    return pairs[order, 0], pairs[order, 1], branch[order]


def gaps_of(configuration: Configuration) -> Gaps:
    """Pairs of particles, and particles and planes, that do not touch and are nearer than the largest overlap."""
    c, radius, count = configuration.contacts, configuration.radius, len(configuration)
    largest = float(c.overlap.max(initial=0.0))
    place = np.pad(configuration.position, ((0, 0), (0, 3 - configuration.dimension)))
    i, j, branch = near_pairs(place, radius, configuration.box, configuration.periodic, largest)
    distance = np.linalg.norm(branch, axis=1)
    gap, normal = distance - radius[i] - radius[j], branch / np.maximum(distance, np.finfo(float).tiny)[:, None]
    # cohesive particles that are apart have a contact already
    known = np.minimum(c.i, c.j) * count + np.maximum(c.i, c.j)
    near = (gap > 0) & (gap < largest) & ~np.isin(i * count + j, known[~c.wall])
    found = [(i[near], j[near], normal[near], gap[near])]
    walls = c.chosen(c.wall)
    surface = np.einsum("ca,ca->c", place[walls.i], walls.normal) - radius[walls.i] + walls.overlap
    scale = float(radius.mean())
    planes = np.round(np.column_stack([walls.normal, surface / scale]) / SAME_PLANE)
    for k in np.unique(planes, axis=0, return_index=True)[1]:
        height = place @ walls.normal[k] - surface[k] - radius
        i = np.flatnonzero((height > SAME_PLANE * scale) & (height < largest))
        found.append((i, np.full(len(i), WALL), np.tile(walls.normal[k], (len(i), 1)), height[i]))
    return Gaps(*(np.concatenate(each) for each in zip(*found, strict=True)))
