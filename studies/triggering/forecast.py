"""Prediction of linear theory, before any run, for a packing with weakened friction.

If friction falls from mu to a smaller value, the disks do not move at once, but the tangential forces change: the
packing is out of balance by f, and moves as :math:`M \\ddot q + K q = f` from rest, with f and K those of the smaller
mu. This motion contains both the jump and, if K has complex eigenvalues, the growth after the jump. It holds while
displacements are small against overlaps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...analysis import spectrum
from ...analysis.motion.growth_of_run import JUMP_SHARE, LINEAR_RANGE
from ...analysis.motion.response import LinearMotion
from ...pywrap import Equilibrium

FORECAST_TIMES = 2000
"""Times at which the linear motion is looked at."""


@dataclass(frozen=True)
class Forecast:
    """The linear motion after friction has weakened.

    Attributes
    ----------
    jump : float
        Largest D within the window of the jump, length^2.
    growth : float
        Decades from the jump to the largest D of the whole run; without bound, where a pair grows.
    room : float
        Decades from the jump to the D at which the motion ceases to be linear.
    rate : float
        Growth rate of D of the fastest motion, 1 / time; 0 if none grows.
    """

    jump: float
    growth: float
    room: float
    rate: float


def forecast(start: Equilibrium, mu: float, time: float, window: float | None = None) -> Forecast:
    """Jump and growth of an equilibrium whose friction coefficient becomes `mu`, in the `time` that follows.

    The jump is what happens within `window`, by default `JUMP_SHARE` of the time.
    """
    packing = start.packing
    weak = replace(packing, law=replace(packing.law, mu=mu))
    times = time * np.arange(1, FORECAST_TIMES + 1) / FORECAST_TIMES
    with np.errstate(over="ignore"):
        msd = LinearMotion.of(weak).response(times, force=weak.net_force - packing.net_force).msd
    msd = np.fmin(msd, np.finfo(float).max)
    first = float(msd[times <= (JUMP_SHARE * time if window is None else window)].max(initial=msd[0]))
    return Forecast(
        jump=first,
        growth=float(np.log10(msd.max() / first)),
        room=float(np.log10((LINEAR_RANGE * packing.smallest_overlap) ** 2 / first)),
        rate=spectrum(weak).growth_rate(),
    )
