r"""Volume fraction phi of a layer, in the plane an area fraction.

.. math:: \phi = \frac{A(H)}{L\, H}

H is the mean height of the centres of the upper layer above the floor, L the period, or without one the width from the
leftmost to the rightmost point of the disks, and A(H) the area of all disks below H; of a disk that H cuts, only the
part below H counts. Rattlers count. An overlap counts for both disks, which adds less than a thousandth at usual loads.

The cut at the centres leaves out the ragged surface, where there is no packing. The region at the floor, where disks
fill the plane less well, is included. :func:`solid_fraction_below_top` also includes the surface.
"""

import numpy as np

from ..configuration import Configuration
from ..errors import BadInputError
from .packing import Packing


def solid_fraction(packing: Packing | Configuration) -> float:
    """Volume fraction phi of a layer, up to the mean height of the centres of its upper layer, or of a periodic box.

    Parameters
    ----------
    packing : Packing or Configuration
        A Packing without an upper layer has the largest height of a centre as H. A Configuration, which has no layer,
        is periodic along all of its axes, and phi is the share of its box that particles take.

    Returns
    -------
    float
        NaN if the centres of a Packing are not above the floor y = 0.

    Raises
    ------
    BadInputError
        If a Configuration is not periodic along an axis: nothing says where it ends there.
    """
    if packing.law is None:
        return _solid_in_box(packing.configuration)
    heights = packing.position[:, 1]
    return _solid_below(packing, float(heights[packing.top].mean() if packing.top.any() else heights.max()))


def _solid_in_box(configuration: Configuration) -> float:
    """Volume of all particles over the volume of the periodic box; of disks areas."""
    d = configuration.dimension
    edges = [axis for axis, closed in zip("xyz"[:d], configuration.periodic[:d], strict=True) if not closed]
    if edges:
        where = f"this one is open along {', '.join(edges)}"
        raise BadInputError(f"solid_fraction is that of a periodic box, and {where}: take a volume of your own.")
    volume = np.pi * configuration.radius**2 if d == 2 else 4 / 3 * np.pi * configuration.radius**3
    return float(volume.sum() / abs(np.linalg.det(configuration.box[:d, :d])))


def solid_fraction_below_top(packing: Packing) -> float:
    """Volume fraction below the highest point of any disk: the ragged surface counts as a part of the layer."""
    return _solid_below(packing, float((packing.position[:, 1] + packing.radius).max()))


def _solid_below(packing: Packing | Configuration, height: float) -> float:
    x, radius = packing.position[:, 0], packing.radius
    width = packing.box_length or float((x + radius).max() - (x - radius).min())
    above = np.clip((height - packing.position[:, 1]) / radius, -1.0, 1.0)  # of the cut, from the centre
    area = radius**2 * (np.pi - np.arccos(above) + above * np.sqrt(1.0 - above**2))
    return float(area.sum() / (width * height)) if height > 0 else float("nan")
