r"""Move rattlers, disks that carry no force, to the middle of their cages.

In a settled packing a disk that nothing holds barely touches one of its neighbours. Its position matters only to
Newton's method: as the packing is sheared, the neighbour hits the disk, and a contact opens as delta^(3/2) -> 0, for
which Newton's method converges slowly, one such disk at a time. In a packing of 10,000 disks, with hundreds of
rattlers, ten rattlers are hit in an increment of 1e-4 of the load. Such a disk may be moved to where it touches
nothing: its position is not a property of the equilibrium.

The middle of a cage is the point at which the narrowest gap is largest. A gap :math:`g_j = |x - x_j| - R - R_j` is a
convex function of the disk's position, so that its linearisation is a lower bound. The linear program

.. math:: \max_{d, t} t \quad\text{with}\quad t \le g_j + n_j \cdot d

over a move d of the disk therefore never makes the narrowest gap t smaller, and a few such programs in turn reach the
maximum, however narrow the cage.
"""

from dataclasses import replace

import numpy as np

from ...analysis import Packing, nearest_image, touching
from ...analysis.arrays import Floats, Indices
from ...analysis.packing.geometry import neighbour_tree

TRAVEL = 0.3
"""How far a disk may move along x and along y, in radii: cages are a few tenths wide."""

LINEAR_PROGRAMS = 20
"""Linear programs for a disk at the most; two or three do."""

BEYOND_A_BOUND = 1e-12
"""By how much a point may be beyond a bound, in about a radius: rounding has it be so."""

WIDENING = 0.05
"""Share by which a linear program has to widen the narrowest gap for another one to follow."""


def clear_rattlers(packing: Packing, idle: Indices) -> Packing:
    """Move disks whose contacts carry nothing to the middle of their cages, and take these contacts away.

    The packing is at rest, without friction: its contacts have no history that could be lost.
    """
    position = packing.position.copy()
    position[idle] = middle_of_cage(packing, idle)
    return place_disks(packing, position)


def place_disks(packing: Packing, position: Floats) -> Packing:
    """The packing with its disks elsewhere, shape (N, 2); all that touches there is in contact, without slip."""
    return replace(packing, position=position, contacts=touching(position, packing.radius, packing.box_length))


def middle_of_cage(packing: Packing, disks: Indices) -> Floats:
    """Where the narrowest gap between a disk and its neighbours, the other disks of the packing, is widest, one disk
    after the other, shape (D, 2)."""
    radius, box = packing.radius, packing.box_length
    position = packing.position.copy()
    tree = neighbour_tree(position, box)
    # both may move, by sqrt(2) TRAVEL
    reach = radius[disks] + (1 + 4 * TRAVEL) * radius.max()
    for disk, near in zip(disks, tree.query_ball_point(tree.data[disks], reach), strict=True):
        cage = np.setdiff1d(near, [disk])
        branch = nearest_image(position[disk] - position[cage], box)
        position[disk] += _to_the_middle(branch, radius[cage] + radius[disk], position[disk, 1], radius[disk])
    return position[disks]


def _to_the_middle(branch: Floats, contact: Floats, height: float, radius: float) -> Floats:
    """The move of a disk with these branch vectors to its neighbours, of these lengths at contact, shape (2,)."""
    # rounding is known beside lengths near one: lengths in a power of two near the radius, which rounds nothing
    unit = 2.0 ** np.frexp(radius)[1]
    branch, contact, height, radius = branch / unit, contact / unit, height / unit, radius / unit
    move, room = np.zeros(2), TRAVEL * radius
    for _ in range(LINEAR_PROGRAMS):
        distance = np.hypot(branch[:, 0] + move[0], branch[:, 1] + move[1])
        normal = np.vstack([(branch + move) / distance[:, None], [0.0, 1.0]])  # the floor is the last one
        gap = np.append(distance - contact, height + move[1] - radius)
        narrowest = min(float(gap.min()), radius)  # no gap needs to be wider
        sides = np.vstack([np.column_stack([-normal, np.ones(len(gap))]), np.eye(3), -np.eye(3)])
        step = highest_corner(sides, np.concatenate([gap, room - move, [radius], room + move, [-narrowest]]))
        move += step[:2]
        if step[2] - narrowest <= WIDENING * abs(narrowest):
            break
    return unit * move


def highest_corner(sides: Floats, bounds: Floats) -> Floats:
    """Solve a linear program in three unknowns: the point z where three bounds meet and the third unknown is largest.

    `sides @ z <= bounds` with B sides, shape (B, 3), of which there must be a solution. A cage has up to twenty bounds.
    All threes of them are looked at, in a fifth of the time of a general solver, whose import alone takes a tenth of
    the time of a whole command.
    """
    n = np.arange(len(bounds))
    threes = np.array(np.nonzero((n[:, None, None] < n[:, None]) & (n[:, None] < n)))
    (a, b, c), (p, q, r) = sides[threes], bounds[threes][..., None]
    bc, ca, ab = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    with np.errstate(divide="ignore", invalid="ignore"):  # of parallel bounds
        corners = (p * bc + q * ca + r * ab) / np.sum(a * bc, axis=1)[:, None]
        corners = corners[np.all(corners @ sides.T <= bounds + BEYOND_A_BOUND, axis=1)]
    return np.asarray(corners[np.argmax(corners[:, 2])])
