"""Steps of a driven run: where it is sampled, where a part of it ends, and how long it is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...analysis import Packing
from ...analysis.motion.slips import SlipDetector
from ..scenes.drive_section import Drive
from ..scenes.validation import SceneError

LOADED_SHARE, MOVED_DIAMETERS = 0.016, 0.01
"""Where a scene does not say when states are stored: share of mu F_y by which the spring loads a layer that sticks from
one to the next, and way of a rigid drive in smallest diameters. The length of the run has no part in it, so that a run
is the same up to the end of a shorter one."""

SAMPLES_A_PERIOD, SAMPLES_A_PART = 20, 10
"""Rows of the series: so many in a period of the layer on the spring, and at least so many in a part of the run."""

MOST_STEPS = 2**53
"""Time steps of a run at the most: as many are counted exactly by its time, a double."""

MOST_STEPS_OF_RUN = 2**31 - 1
"""Time steps of one command `run` of LAMMPS at the most."""


@dataclass(frozen=True)
class Plan:
    """Steps of a driven run.

    Attributes
    ----------
    dt : float
        Time step, time.
    part, every, total : int
        Steps between two stored states, between two rows of the series, and of the run.
    """

    dt: float
    part: int
    every: int
    total: int

    @classmethod
    def of(cls, settings: Drive, start: Packing, dt: float) -> Plan:
        """The plan of a run from an equilibrium with a time step; a SceneError of a run that has no end."""
        steps = settings.length(strength(start)) / dt
        if steps > MOST_STEPS:
            raise SceneError(
                f"the run would take {steps:.1g} time steps of {dt:.3g}, which no machine does: give a shorter "
                "drive.until, or a faster drive"
            )
        between = settings.states or _between_states(settings, start)
        part = math.ceil(min(between / dt, MOST_STEPS))
        period = layer_period(settings, start)
        most = max(1, min(part // SAMPLES_A_PART, MOST_STEPS_OF_RUN))
        every = most if period is None else min(most, max(1, int(period / SAMPLES_A_PERIOD / dt)))
        return cls(dt, part, every, math.ceil(steps))

    def is_even(self, time: float) -> bool:
        """Whether a part of the run ends at the time of a row, and the state there is stored."""
        return round(time / self.dt) % self.part == 0

    def steps(self, after: int) -> Iterator[int]:
        """Steps at which the run is sampled, after a step."""
        step = after
        while step < self.total:
            step = min(self.total, *(step - step % each + each for each in (self.every, self.part)))
            yield step


def strength(packing: Packing) -> float:
    """mu F_y, the largest force along x that friction bears on each disk of the layer; F_y without friction."""
    return float((packing.law.mu or 1.0) * packing.fy)


def _between_states(settings: Drive, start: Packing) -> float:
    """Time between two stored states of a scene that does not say it."""
    if settings.spring == "rigid":
        return float(MOVED_DIAMETERS * 2 * start.radius.min() / settings.fastest)
    return LOADED_SHARE * strength(start) / (settings.spring * settings.fastest)


def layer_period(settings: Drive, packing: Packing) -> float | None:
    """Period of the layer on the spring, time; None of a rigid drive."""
    if settings.spring == "rigid":
        return None
    return float(2 * math.pi * np.sqrt(packing.mass[packing.top].mean() / settings.spring))


def slip_detector(settings: Drive, packing: Packing) -> SlipDetector | None:
    """Finds the slips of a run; None of a rigid drive, whose layer never sticks."""
    period = layer_period(settings, packing)
    return None if period is None else SlipDetector(settings.fastest, period)
