"""The loads of a ramp: multiples of its step, the same to the bit on each way through its turning points."""

from __future__ import annotations

import math

import numpy as np

from ...analysis.arrays import Floats
from ..scenes.scene import Scene
from ..scenes.sections import Ramp
from ..scenes.validation import SceneError, require_section


def ramp_loads(scene: Scene) -> Floats:
    """The loads of a scene's ramp at which onsets are sought: from 0 up to the first turning point.

    Returns
    -------
    ndarray, shape (S,)
        F_x, force on each disk of the upper layer.

    Raises
    ------
    SceneError
        If the scene has no section [ramp], or F_x goes below 0 first.
    """
    settings = require_section(scene.ramp, "ramp")
    if settings.first < 0:
        cure = "and onsets are sought above 0: give a first turning point above 0"
        raise SceneError(f"ramp.until goes to F_x = {settings.first:g} first, {cure}")
    return way_to(0.0, settings.first, settings.step)


def all_loads(settings: Ramp) -> Floats:
    """F_x of all equilibria of a ramp, force, from 0 through its turning points: multiples of the step in between, the
    same to the bit on each way."""
    way = way_to(0.0, settings.first, settings.step)
    for point in settings.turning_points[1:]:
        way = np.append(way, way_to(float(way[-1]), point, settings.step)[1:])
    return way


def way_to(begin: float, end: float, step: float) -> Floats:
    """From one load to another, force: multiples of the step, to the bit, between both."""
    # half a step in a million is far above the rounding of end/step, and far below a step
    rounding = 5e-7 * max(abs(begin), abs(end)) / step
    sign = 1.0 if end > begin else -1.0
    first, last = (math.floor(sign * load / step + rounding) for load in (begin, end))
    # adding 0 makes 0 of -0
    way = np.append(begin, sign * np.arange(first + 1, last + 1, dtype=np.float64) * step + 0.0)
    return np.append(way, end) if sign * (end - way[-1]) > rounding * step else way


def count_behind(settings: Ramp, reached: Floats) -> int:
    """How many loads of a ramp lie behind a run that reached these; F_x of its equilibria, force.

    Raises SceneError if the run went another way.
    """
    wanted = all_loads(settings)
    count = min(len(wanted), len(reached))
    other = np.flatnonzero(wanted[:count] != reached[:count])
    if len(other) == 0:
        return count
    k = int(other[0])
    # `until` of one of the two is no multiple of the step, and the other one goes on from there
    for one, more, behind in ((reached, wanted, k), (wanted, reached, len(wanted))):
        if 0 < k == len(one) - 1 and min(more[k - 1 : k + 1]) < one[k] < max(more[k - 1 : k + 1]):
            return behind
    leads = f"ramp.until leads to F_x = {wanted[k]:g}: give another name with -o, or delete it"
    raise SceneError(f"the run has gone to F_x = {reached[k]:g} where {leads}")
