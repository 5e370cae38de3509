r"""The initial loose random packing: disks that do not touch, with the upper layer above the others.

The upper layer, whose radii alternate, is evenly spaced along x, in as many tiers as needed to keep its disks apart: if
it is wider than the box when stretched out, it closes the box and cannot sink into the bed. The other disks are
shuffled over the cells of a lattice that is wide enough for the largest disk, each at a random place inside its cell.
No two disks overlap, for any seed, at a cost proportional to their number. The paper says only "loosely packed disks".
A third of the area is filled, which carries no load: settling lays a bed first.

Even on a bed a heavy layer may sink, like a heavy liquid through a light one. Without friction a bed bears shear
stresses of at most a tenth of its pressure, which is the weight of the layer above. Where the layer is thin, the bed is
pushed up, the layer slides off the bulge, and becomes thinner still. A layer of one or two disks varies in thickness by
more than a tenth; a layer of several disks comes to rest. A tenth of all disks keeps the geometry of all sizes.
"""

import numpy as np

from ...analysis.files.formats import Disks

CELL = 1.25
"""Smallest side of a cell, in largest diameters: a quarter is the room for placing a largest disk."""


LAYER = 0.1
"""Share of the disks that are the upper layer, where a scene does not say."""


def layer_size(disks: int, radii: tuple[float, ...], width: float) -> int:
    """Number of disks of an upper layer that comes to rest: a tenth of all, and enough to close the box."""
    side_by_side = width / (2 * float(np.mean(radii)))
    return min(disks, max(1, round(max(LAYER * disks, side_by_side))))


def random_start(
    disks: int, radii: tuple[float, ...], top: int, width: float, seed: int, *, periodic: bool = True, draw: int = 0
) -> Disks:
    """Disks above the floor that overlap nowhere, the same on every platform for one seed of numpy's PCG64.

    Each radius goes to an equal share of the disks, a remainder to the first ones. The upper layer are the last `top`
    disks by index. All disks lie within the width, 0 <= x < width, whether x is periodic or not; the floor is y = 0.
    `draw` is which of the loose starts of the seed: 0 is the first.
    """
    sizes = np.resize(np.sort(radii), disks)
    diameter = 2 * sizes.max()
    draws = np.random.SeedSequence(seed, spawn_key=(draw,) if draw else ())  # each draw has numbers of its own
    generator = np.random.Generator(np.random.PCG64(draws))
    bulk = generator.permutation(sizes[top:])
    columns = max(1, int(width / (CELL * diameter)))
    side = np.array([width / columns, CELL * diameter])
    full, rest = divmod(len(bulk), columns)
    # In the last, incomplete row the free cells are as random as the disks.
    cells = np.concatenate([np.arange(full * columns), full * columns + generator.permutation(columns)[:rest]])
    corner = np.column_stack([cells % columns, cells // columns]) * side
    inside = corner + bulk[:, None] + (side - 2 * bulk[:, None]) * generator.random((len(bulk), 2))

    order = np.arange(top)
    # as many tiers as divide the layer, so that its ends do not meet across the periodic side
    tiers = next((t for t in range(1, top + 1) if top % t == 0 and diameter * top <= t * width), 1)
    height = side[1] * (full + (rest > 0)) + diameter * (order % tiers + 0.5)
    above = np.column_stack([width * (order + 0.5) / max(top, 1), height])
    return Disks(
        f"the loose start of the seed {seed}",
        position=np.concatenate([inside, above]),
        radius=np.concatenate([bulk, sizes[:top]]),
        id=np.arange(1, disks + 1),
        top=np.arange(disks) >= len(bulk),
        box_length=width if periodic else None,
    )
