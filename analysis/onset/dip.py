r"""Where a window narrower than the increment may hide.

At either end of an increment a pair's discriminant D and its slope are known: with the sensitivities :math:`\lambda' =
y^H A' x / y^H x`, A' the difference of both operators, :math:`D' = 2 (\lambda_1 - \lambda_2)(\lambda_1' - \lambda_2')`.
Two levels that pass each other dip to D = 0 in between; the product of their couplings decides between an avoided
crossing and a window of width proportional to its root.

A cubic goes through both values and slopes, and a parabola through either slope and both values. The lowest point of
the cubic, less the disagreement of the three, is a bound. Where the bound is negative a window may hide.
"""

import numpy as np

from ..packing import Floats
from .limits import LIMITS, Limits
from .pair import Pair


def deepest_dip(d0: Floats, s0: Floats, d1: Floats, s1: Floats, bend: float) -> tuple[Floats, Floats]:
    """The widest stretch of 0 < t < 1 on which functions known at both ends may be negative.

    d0, s0 and d1, s1, each of shape (P,), are values, positive, and slopes at t = 0 and at t = 1; `bend` is that of
    `Limits`. Returned are the largest possible width in t, zero where a function surely stays positive, and where it is
    deepest.
    """
    # Parabolas d0 + s0 t + f t^2 and d1 - s1 r + g r^2, r = 1 - t; cubic d0 + s0 t + h t^2 + k t^3.
    f, g = d1 - d0 - s0, d0 - d1 + s1
    h, k = 3 * (d1 - d0) - 2 * s0 - s1, 2 * (d0 - d1) + s0 + s1
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(h * h - 3 * k * s0, 0.0))
        t = np.array([-s0 / (2 * f), 1 - s1 / (2 * g), (root - h) / (3 * k)])
        t = np.clip(np.nan_to_num(t, nan=0.5), 0.0, 1.0)
        r = 1 - t
        cubic = d0 + t * (s0 + t * (h + t * k))
        spread = np.maximum(np.abs(d0 + t * (s0 + t * f) - cubic), np.abs(d1 - r * (s1 - r * g) - cubic))
        lowest = cubic - spread - bend * np.minimum(d0, d1) * (4 * t * r)
        deepest = np.argmin(lowest, axis=0), np.arange(len(d0))
        depth = np.maximum(-lowest[deepest], 0.0)
        width = np.where(depth > 0, 2 * np.sqrt(depth / np.maximum(np.abs(f), np.abs(g))), 0.0)
    return np.minimum(width, 1.0), t[deepest]


def dip_between(here: Pair, there: Pair, limits: Limits = LIMITS) -> tuple[float, float]:
    """Where the discriminant of a pair may change its sign and back between two loads with the same sign of it.

    Returned are the width of the widest stretch with the other sign that is possible, force, zero if there is surely
    none, and the load at which D is closest to zero, or deepest beyond.
    """
    sign, change, increment = np.sign(here.discriminant), there.matrix - here.matrix, there.fx - here.fx
    ends = ((pair.discriminant, pair.slope(change)) for pair in (here, there))
    d0, s0, d1, s1 = (sign * np.array([number]) for end in ends for number in end)
    width, at = deepest_dip(d0, s0, d1, s1, limits.bend)
    return float(width[0]) * increment, here.fx + float(at[0]) * increment
