"""The cost of one way to do the same work beside another way, and its line in the table.

The ratio is that of two runs in one turn. The time of one thread is the processor time of this process, which does not
count pauses for other processes; the time of several threads is wall time. Medians and quartiles over the turns are
kept: the slowest turns would dominate a mean.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any

import numpy as np

from ...analysis.arrays import Floats
from ...pywrap.lammps.dynamics import MotionState
from ..timing import in_turns

TURNS, FEW_TURNS = 11, 5
"""Turns of a comparison: quartiles of fewer jump; and turns of what may take long."""

SECONDS_A_TURN = 10e-3
"""Seconds that one of the two takes in a turn, if it can be chosen: far above the clock and the call."""


@dataclass(frozen=True, eq=False)
class Cost:
    """Times of a thing without and with a feature.

    Attributes
    ----------
    per : str
        What was done once: a step, an equilibrium, ...
    seconds : ndarray, shape (turns, 2)
        Time of one without and with it, in each turn.
    """

    per: str
    seconds: Floats

    @property
    def medians(self) -> tuple[float, float]:
        """Times without and with it, s."""
        without, with_it = np.median(self.seconds, axis=0).tolist()
        return without, with_it

    @property
    def ratio(self) -> tuple[float, float, float]:
        """Time with it over time without it: lower quartile, median, upper quartile of the turns."""
        low, middle, high = np.quantile(self.seconds[:, 1] / self.seconds[:, 0], (0.25, 0.5, 0.75)).tolist()
        return low, middle, high

    def as_dict(self) -> dict[str, object]:
        """Medians in seconds and the ratio with its quartiles, for JSON."""
        low, middle, high = self.ratio
        without, with_it = self.medians
        return {"per": self.per, "without": without, "with": with_it, "ratio": middle, "quartiles": [low, high]}


def cost_of(
    per: str,
    without: Callable[[], object],
    with_it: Callable[[], object],
    turns: int,
    count: int = 1,
    parallel: bool = False,
) -> Cost | None:
    """Time the work without and with a feature in turns, after one that is not counted.

    Parameters
    ----------
    per : str
        What a call does `count` times.
    without, with_it : callable
        The work.
    turns : int
        How often both are timed. With 0 both do their work once, and there is no cost.
    count : int
        Times are divided by it.
    parallel : bool
        Whether the work is that of several threads or processes.
    """
    _, seconds = in_turns((without, with_it), turns + 1, perf_counter if parallel else process_time)
    return Cost(per, seconds[1:] / count) if turns else None


@dataclass(frozen=True)
class Part:
    """One line of the explanation.

    Attributes
    ----------
    name : str
        The feature.
    included : bool
        Whether the scene has it, as LAMMPS says.
    reason : str
        Why, in a clause.
    adds : tuple of str
        What it loads, or would load.
    cost : Cost or None
        Times without and with it; None if they were not wanted, or cannot be measured here.
    same : str
        What both compute.
    identical : bool or None
        Whether that agrees to the bit; None if it was not tried.
    """

    name: str
    included: bool
    reason: str
    adds: tuple[str, ...]
    cost: Cost | None
    same: str
    identical: bool | None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return vars(self) | {"cost": self.cost.as_dict() if self.cost else None}


def same_motion(one: MotionState, other: MotionState) -> bool:
    """Whether positions and velocities are the same to the bit."""
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in one._fields)
