r"""Differences of coordinates and overlaps, accurate to the last digit, however small they are.

A coordinate may have a low part: x + x', an unevaluated sum of about 100 bits, from the compensated arithmetic of
the pair style. Without low parts the coordinates are treated as exact doubles. Either way
:math:`\delta = R_i + R_j - r` would lose the digits in which both sides agree, eleven of sixteen at an overlap of
1e-11. Instead

.. math:: \delta = \frac{c^2 - r^2}{c + r}, \qquad c = R_i + R_j,

with :math:`c^2 - r^2` from sums and products with their rounding errors (Knuth's two-sum, Dekker's product). A number
with its error is a pair of arrays, (high, low), and represents their sum.
"""

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats

DoubleDouble = tuple[Floats, Floats]

SPLITTER = 2.0**27 + 1
"""Splits a double into two halves of 26 bits each, whose products are exact."""


def exact_sum(a: ArrayLike, b: ArrayLike) -> DoubleDouble:
    """The sum of two doubles and its rounding error; of a pair, its sum with the closest double as the high part."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def exact_product(a: ArrayLike, b: ArrayLike) -> DoubleDouble:
    """The product of two doubles and its rounding error; factors up to 1e290."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    product = a * b
    a_high = SPLITTER * a - (SPLITTER * a - a)
    b_high = SPLITTER * b - (SPLITTER * b - b)
    a_low, b_low = a - a_high, b - b_high
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def separation(
    position: Floats, low: Floats | None, other: Floats, other_low: Floats | None, box_length: float | None
) -> DoubleDouble:
    """Vectors from other points to points, shape (..., 2), by the nearest image along x, with their low parts; low
    parts of coordinates are None for exact doubles."""
    difference, error = exact_sum(position, -np.asarray(other))
    if box_length is not None:
        shift = np.zeros_like(difference)
        shift[..., 0] = np.round(difference[..., 0] / box_length)
        # a number of periods times the length is exact enough: it is a small integer, and zero or one in a contact
        period, period_low = exact_product(shift, box_length)
        difference, more = exact_sum(difference, -period)
        error = error + (more - period_low)
    if low is not None:
        error = error + low
    if other_low is not None:
        error = error - other_low
    return exact_sum(difference, error)


def overlap_and_distance(branch: DoubleDouble, reach: DoubleDouble) -> tuple[DoubleDouble, Floats]:
    """Overlap R_i + R_j - r of branch vectors, shape (C, 2), and sums of radii, and the distance r. The high part of
    the overlap has full relative precision, also where it is negative."""
    (high, low), (c, c_low) = branch, reach
    distance = np.hypot(high[:, 0], high[:, 1])
    gap = exact_product(c, c)
    for axis in (0, 1):
        square, error = exact_product(high[:, axis], high[:, axis])
        total, more = exact_sum(gap[0], -square)
        gap = total, gap[1] + (more - error)
    cross = 2 * c * c_low - 2 * np.sum(high * low, axis=1)
    gap = exact_sum(gap[0], gap[1] + (cross + (c_low * c_low - np.sum(low * low, axis=1))))
    overlap = gap[0] / (c + distance)
    # gap = overlap (2 c - overlap): what the approximation lacks
    other, other_low = exact_sum(2 * c, -overlap)
    product, error = exact_product(overlap, other)
    lacks = (gap[0] - product) + (gap[1] - error) - overlap * (other_low + 2 * c_low)
    with np.errstate(divide="ignore", invalid="ignore"):
        correction = np.where(distance > 0, lacks / (2 * distance), 0.0)
    return exact_sum(overlap, correction), distance
