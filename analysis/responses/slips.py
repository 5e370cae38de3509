r"""Slips of a layer that a spring draws: beginning, end, force drop, slip, energy, from the series of the run.

A spring of stiffness k whose far end moves at V draws a layer. While the layer sticks, its velocity is far below V, and
the force rises by k V a unit of time. In a slip the layer is much faster than V, and the force falls.

**The rule.** The layer is fast if its mean velocity along the force, over `VELOCITY_WINDOW` of a period, exceeds
`SLIP_VELOCITY` |V|, with V the fastest velocity of the far end. A slip is recognised once the layer is fast. The slip
begins where the force was largest in the last `LOOK_BACK` periods: up to there the layer was slower than the far end.
The slip ends with the last row in which the layer is fast, if the layer then is not fast for `SLIP_END` periods. The
period of the layer on the spring is

.. math:: T_k = 2\pi \sqrt{m/k}, \qquad m \text{ the mass of a disk, } k \text{ the stiffness for each disk.}

So the vibration after a slip belongs to the slip while the layer is fast. The rule needs no later row: the slips of a
run that goes on are those that its series has in the end.

Springs that draw blocks and granular layers as models of faults: J. M. Carlson, J. S. Langer, Phys. Rev. A 40, 6470
(1989); M. Pica Ciamarra et al., Phys. Rev. Lett. 104, 238001 (2010).
"""

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats

SLIP_VELOCITY = 6.0
"""Velocity of the layer from which on it slips, in units of the fastest velocity of the far end. After a slip the layer
of 100 disks rings with 2 to 5 of these units; its slips have 8 to 40."""

VELOCITY_WINDOW = 0.25
"""Periods of the layer on the spring over which its velocity is a mean: faster vibrations are no slips."""

SLIP_END, LOOK_BACK = 2.0, 4.0
"""Periods of the layer on the spring without fast motion that end a slip; and before fast motion, in which the slip
begins."""


@dataclass(frozen=True)
class Slip:
    """A slip of the layer.

    Attributes
    ----------
    begins, ends : float
        Times of the largest force before the layer was fast, and of the last fast motion.
    force_before, force_after : float
        Force of the spring on each disk of the layer at these times.
    slip : float
        Displacement of the layer in between, length.
    kinetic_energy : float
        The largest of all disks in between.
    """

    begins: float
    ends: float
    force_before: float
    force_after: float
    slip: float
    kinetic_energy: float

    @property
    def force_drop(self) -> float:
        """Force before less force after."""
        return self.force_before - self.force_after


class _Row(NamedTuple):
    time: float
    force: float
    displacement: float


class SlipDetector:
    """Finds slips while a run goes on, by the rule of this module."""

    def __init__(self, velocity: float, period: float) -> None:
        self._threshold = SLIP_VELOCITY * abs(velocity)
        self._window = VELOCITY_WINDOW * period
        self.quiet, self.look_back = SLIP_END * period, LOOK_BACK * period
        self._past = deque[_Row]()
        self._begin: _Row | None = None
        self._end: _Row | None = None
        self._energy = self._energy_at_end = 0.0

    @property
    def so_far(self) -> Slip | None:
        """The slip under way, up to its last fast motion; None between slips."""
        (begin, end), energy = (self._begin, self._end), self._energy_at_end
        if begin is None or end is None:
            return None
        return Slip(begin.time, end.time, begin.force, end.force, end.displacement - begin.displacement, energy)

    @property
    def undecided(self) -> set[float]:
        """Times of the rows at which a slip may yet be found to begin, or the slip under way to end."""
        if self._begin is not None:
            return {self._end.time} if self._end else set()
        found, highest, lowest = {row.time for row in list(self._past)[-1:]}, 0.0, 0.0
        for row in reversed(self._past):  # no later force in the same direction is as large
            if not lowest <= row.force <= highest:
                found.add(row.time)
                highest, lowest = max(highest, row.force), min(lowest, row.force)
        return found

    def add(self, time: float, force: float, displacement: float, kinetic_energy: float) -> Slip | None:
        """Take the next row of a series, and give the slip that it ends, if any."""
        row, found = _Row(time, force, displacement), None
        if self._past:
            early = (old for old in reversed(self._past) if old.time <= time - self._window)
            before = next(early, row)  # no motion where the rows do not fill the window
            # a slip that overshoots goes on in its direction while the spring pushes back
            moved = np.sign((self._begin or before).force) * (displacement - before.displacement)
            fast = moved > self._threshold * (time - before.time)
            if fast and self._begin is None:  # where the force along its present direction was largest, the last time
                direction = np.sign(self._past[-1].force)
                self._begin = max(reversed(self._past), key=lambda old: float(direction * old.force))
                self._energy = 0.0
            self._energy = max(self._energy, kinetic_energy)
            if fast:
                self._end, self._energy_at_end = row, self._energy
            elif self._begin is not None and self._end is not None and time - self._end.time >= self.quiet:
                found, self._begin = self.so_far, None
                self._past.clear()
        self._past.append(row)
        while self._past[0].time < time - self.look_back:
            self._past.popleft()
        return found


def find_slips(
    time: ArrayLike,
    force: ArrayLike,
    displacement: ArrayLike,
    kinetic_energy: ArrayLike,
    velocity: float,
    period: float,
) -> tuple[list[Slip], Slip | None]:
    """Find the slips in the series of a driven run, with the fastest velocity of the far end and the period of the
    layer on the spring: those that have ended, and the one that is under way at the end, as far as it has come."""
    detector = SlipDetector(velocity, period)
    columns = [np.asarray(column, dtype=np.float64).tolist() for column in (time, force, displacement, kinetic_energy)]
    ended = [slip for row in zip(*columns, strict=True) if (slip := detector.add(*row)) is not None]
    return ended, detector.so_far


@dataclass(frozen=True)
class DrivenFriction:
    """Friction F/F_y of a layer that sticks and slips: the `largest` of the run, and the `mean` over time from the
    first slip on, or over the whole run without slips; `before` and `after` are the means over the slips of the
    friction before and after them, None without slips."""

    largest: float
    mean: float
    before: float | None
    after: float | None


def friction_of(time: Floats, force: Floats, slips: list[Slip], fy: float) -> DrivenFriction:
    """Friction in a driven run; series of shape (S,), the load F_y on each disk of the layer."""
    from scipy.integrate import trapezoid

    late = time >= (slips[0].begins if slips else time[0])
    mean = trapezoid(force[late], time[late]) / np.ptp(time[late]) if late.sum() > 1 else force[-1]
    ends = np.mean([(slip.force_before, slip.force_after) for slip in slips], axis=0) / fy if slips else (None, None)
    before, after = (None if each is None else float(each) for each in ends)
    return DrivenFriction(float(np.abs(force).max() / fy), float(mean / fy), before, after)
