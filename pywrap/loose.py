r"""Where a settling starts: disks that touch nothing yet, the upper layer in one row above them.

The disks have equal shares of the given radii. The smallest of them make the upper layer, evenly spaced along
x; the others are shuffled over the cells of a lattice that is wide enough for the largest disk, each at a
random place inside its own cell. So no two disks overlap, whatever the seed, at a cost that grows as their
number. The paper says only "loosely packed disks". A layer as open as this one, of which a third is filled,
does not carry: without weight of their own the disks give way, and an upper layer that is loaded alone sinks
to the floor. A settling from here has to lay a bed first.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

CELL = 1.25
"""Smallest side of a cell, in largest diameters: a quarter is the room for placing a largest disk."""


@dataclass(frozen=True, eq=False)
class Start:
    """Disks in a box, at rest, without contacts or history.

    Attributes
    ----------
    position : ndarray, shape (N, 2)
        Centres, length; the floor is y = 0.
    radius : ndarray, shape (N,)
        Radii, length.
    top : ndarray of bool, shape (N,)
        The disks of the upper layer.
    box_length : float or None
        Period along x, length; None where the sides are open.
    """

    position: NDArray[np.float64]
    radius: NDArray[np.float64]
    top: NDArray[np.bool_]
    box_length: float | None

    def __len__(self) -> int:
        return len(self.radius)


def loose_start(
    disks: int,
    radii: tuple[float, ...],
    top: int,
    width: float,
    seed: int,
    *,
    periodic: bool = True,
) -> Start:
    """Disks above the floor that overlap nowhere, the same on every platform for one seed.

    Parameters
    ----------
    disks : int
        Number of disks, the upper layer included.
    radii : tuple of float
        Radii, length; each is given to an equal share of the disks, a remainder to the first ones.
    top : int
        Number of disks in the upper layer: the last ones by index, the smallest ones by size.
    width : float
        Width of the box, 0 <= x < width, length.
    seed : int
        Seed of numpy's PCG64.
    periodic : bool
        Whether x is periodic. All disks lie within the width in either case.

    Returns
    -------
    Start

    Raises
    ------
    ValueError
        If the upper layer has more disks than there are or does not fit the width in one row, or if a disk is
        wider than the box.
    """
    if not 0 <= top <= disks or disks < 1:
        raise ValueError(f"an upper layer of {top} disks cannot be made from {disks}")
    sizes = np.sort(np.resize(radii, disks))
    row, bulk = sizes[:top], sizes[top:]
    if 2 * sizes[-1] > width:
        raise ValueError(f"a disk of radius {sizes[-1]} is wider than the box of width {width}")
    if top and 2 * row[-1] * top > width:
        raise ValueError(f"{top} disks of radius {row[-1]} do not fit into one row of width {width}")

    generator = np.random.Generator(np.random.PCG64(seed))
    bulk = generator.permutation(bulk)
    columns = max(1, int(width / (CELL * 2 * sizes[-1])))
    side = np.array([width / columns, CELL * 2 * sizes[-1]])
    full, rest = divmod(len(bulk), columns)
    # In the last, incomplete row the free cells are as random as the disks.
    cells = np.concatenate(
        [np.arange(full * columns), full * columns + generator.permutation(columns)[:rest]]
    )
    corner = np.column_stack([cells % columns, cells // columns]) * side
    room = side - 2 * bulk[:, None]
    inside = corner + bulk[:, None] + room * generator.random((len(bulk), 2))

    spacing = width / max(top, 1)
    height = side[1] * (full + (rest > 0)) + (row[-1] if top else 0.0)
    above = np.column_stack([spacing * (np.arange(top) + 0.5), np.full(top, height)])
    return Start(
        position=np.concatenate([inside, above]),
        radius=np.concatenate([bulk, row]),
        top=np.arange(disks) >= len(bulk),
        box_length=width if periodic else None,
    )


def read_start(path: Path) -> Start:
    """Disks from a JSON file.

    Parameters
    ----------
    path : Path
        A file with the keys x, y and radius (lists of N numbers), top (indices of the upper layer's disks
        counted from 0, or N booleans) and box_length (a number, or null where the sides are open). Other keys
        are left alone.

    Returns
    -------
    Start

    Raises
    ------
    ValueError
        If the file cannot be read or is no JSON, a key is missing, lists differ in length, a number is not
        finite, a radius is not positive, the upper layer names a disk that does not exist, or the box is
        under two largest diameters; one sentence that does not name the file.
    """
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"the file cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise ValueError(f"the file is not valid JSON ({error})") from None
    keys = ("x", "y", "radius", "top", "box_length")
    missing = [key for key in keys if not isinstance(stored, dict) or key not in stored]
    if missing:
        raise ValueError(f"the file lacks {' and '.join(missing)}; it needs the keys {', '.join(keys)}")

    x, y, radius = (_numbers(key, stored[key]) for key in ("x", "y", "radius"))
    if not len(x) == len(y) == len(radius) > 0:
        raise ValueError(
            f"x, y and radius have {len(x)}, {len(y)} and {len(radius)} values, not one for each disk"
        )
    if radius.min() <= 0:
        raise ValueError(f"disk {radius.argmin()} has the radius {radius.min()}, which is not above 0")
    length = stored["box_length"]
    if length is not None:
        length = _numbers("box_length", [length])[0].item()
        if length < 4 * radius.max():
            raise ValueError(f"box_length = {length} is under two largest diameters, {4 * radius.max()}")
    return Start(np.column_stack([x, y]), radius, _mask(stored["top"], len(x)), length)


def _numbers(key: str, values: object) -> NDArray[np.float64]:
    if not isinstance(values, list) or any(
        isinstance(v, bool) or not isinstance(v, (int, float)) for v in values
    ):
        raise ValueError(f"{key} holds something that is not a number")
    array = np.array(values, dtype=np.float64)
    if not np.isfinite(array).all():
        raise ValueError(f"{key} holds a number that is not finite")
    return array


def _mask(top: object, disks: int) -> NDArray[np.bool_]:
    """The upper layer as N booleans, from N booleans or from indices."""
    if isinstance(top, list) and len(top) == disks and all(type(entry) is bool for entry in top):
        return np.array(top)
    if not isinstance(top, list) or any(type(entry) is not int or not 0 <= entry < disks for entry in top):
        raise ValueError(f"top is neither {disks} booleans nor a list of indices from 0 to {disks - 1}")
    mask = np.zeros(disks, dtype=bool)
    mask[top] = True
    return mask
