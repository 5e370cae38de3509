r"""Hysteresis of a layer that is loaded and unloaded: the displacement that remains when F_x returns.

If contacts slide, the curve of F_x over the mean displacement u of the upper layer is different on the way back. Let
F_x have its last value for the first time at equilibrium a, and for the last time at equilibrium b, with a turning
point in between. If all contacts returned to their earlier state, so would the layer. The remainder is

.. math:: \Delta u = u_b - u_a, \qquad
          W = \sum_{top} \int_a^b (F_x\, \mathrm d x_i - F_y\, \mathrm d y_i),

the remaining displacement and the work of the loads, by the trapezoidal rule over the equilibria; F_y is constant, and
its part is exact. If the layer has returned, W is the heat produced by friction, plus the energy that rearranged
contacts still store, or minus the energy that they have released. The error of the rule falls as the square of the
increments.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..arrays import Floats
from ..packing.geometry import nearest_image
from ..packing.packing import Packing


@dataclass(frozen=True)
class Hysteresis:
    """A path of loads that comes back: its last F_x is `fx`, where it has been before, at the equilibrium number
    `begin`.

    Since then `remaining` is left of the displacement of the upper layer along x, and the loads on all disks of the
    layer have done the `work`. The path `closes` if what remains is rounding: 1e-9 of how far the layer has moved in
    between.
    """

    fx: float
    begin: int
    remaining: float
    work: float
    closes: bool


def layer_displacement(packings: Sequence[Packing]) -> Floats:
    """Mean displacement (x, y) of the upper layer, or without one of all disks, since the first of some equilibria of
    the same disks, length, shape (T, 2)."""
    first = packings[0]
    upper = first.top if first.top.any() else np.ones(len(first), dtype=bool)
    moved = [np.zeros(2)]
    for here, there in pairwise(packings):
        step = nearest_image(there.position[upper] - here.position[upper], first.box_length)
        if here.position_low is not None and there.position_low is not None:
            step = step + (there.position_low[upper] - here.position_low[upper])
        moved.append(step.mean(axis=0))
    return np.cumsum(moved, axis=0)


def turning_points(fx: Floats) -> list[int]:
    """Which loads of a path are larger than both neighbours, or smaller; indices from 0."""
    steps = np.diff(fx)
    return [k + 1 for k in range(len(steps) - 1) if steps[k] * steps[k + 1] < 0]


def hysteresis(packings: Sequence[Packing]) -> Hysteresis | None:
    """What remains when F_x returns, of equilibria one after the other; None if F_x did not have its last value before
    a turning point."""
    fx = np.array([packing.fx for packing in packings])
    turns, begin = turning_points(fx), int(np.argmax(fx == fx[-1]))
    if not any(begin < turn < len(fx) - 1 for turn in turns):
        return None
    moved = layer_displacement(packings)[begin:]
    last, disks = packings[-1], int(packings[0].top.sum())
    mean = 0.5 * (fx[begin + 1 :] + fx[begin:-1])
    work = mean @ np.diff(moved[:, 0]) - last.fy * (moved[-1, 1] - moved[0, 1])
    remaining = float(moved[-1, 0] - moved[0, 0])
    # coordinates have 1e-16, which is 1e-12 of a displacement of 1e-4 diameters, and soft modes magnify it
    closes = abs(remaining) <= 1e-9 * float(np.ptp(moved[:, 0]))
    return Hysteresis(last.fx, begin, remaining, disks * float(work), closes)
