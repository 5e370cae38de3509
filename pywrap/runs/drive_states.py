"""Rows and states of a driven run, and which states are stored: even ones, and those at both ends of each slip.

A slip is found some time after it has begun (:mod:`faultgouge.analysis.motion.slips`), and its end after it has ended.
`PendingStates` keeps the states at which a slip may yet be found to begin or to end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ...analysis import Packing
from ...analysis.motion.slips import Slip, SlipDetector
from .undamped import Checkpoint


@dataclass(frozen=True)
class DriveSample:
    """One row of the series of a driven run.

    Attributes
    ----------
    time : float
        Since the beginning.
    force : float
        Of the spring on each disk of the upper layer; of a rigid drive the mean force per disk that moves the layer.
    displacement : float
        Mean displacement of the layer along x, length.
    thickness : float
        Mean height of the disks of the layer above the floor, length.
    kinetic_energy : float
        Of translation and rotation of all disks.
    at_bound : int
        Contacts at Coulomb's bound.
    """

    time: float
    force: float
    displacement: float
    thickness: float
    kinetic_energy: float
    at_bound: int

    def given_to(self, detector: SlipDetector) -> Slip | None:
        """Give the row to a detector; the slip that the row ends, if any."""
        return detector.add(self.time, self.force, self.displacement, self.kinetic_energy)


@dataclass(frozen=True, eq=False)
class DriveState:
    """A packing on the way, whose F_x is the force of the spring at that moment.

    Attributes
    ----------
    time : float
        Since the beginning.
    displacement : float
        Mean displacement of the layer along x, length.
    packing : Packing
        Positions, angles and slips; velocities are left out.
    """

    time: float
    displacement: float
    packing: Packing


@dataclass(frozen=True, eq=False)
class DriveStep:
    """State that a driven run hands out with each row of its series.

    Attributes
    ----------
    sample : DriveSample
        The row.
    slip : Slip or None
        The slip that has ended, if any.
    states : tuple of DriveState
        States to be stored, by time, later than all before.
    """

    sample: DriveSample
    slip: Slip | None
    states: tuple[DriveState, ...]


@dataclass(frozen=True, eq=False)
class DriveCheckpoint(Checkpoint):
    """A driven run that is under way.

    Attributes
    ----------
    pending : tuple of DriveState
        By time: states at which a slip may yet be found to begin or to end, and even states later than such a one.
    """

    pending: tuple[DriveState, ...] = ()


class PendingStates:
    """States of a run that are not handed out yet, and the choice of those that are stored.

    Parameters
    ----------
    detector : SlipDetector or None
        The detector of the run; None of a rigid drive, whose layer has no slips.
    is_even : callable
        Whether the state at a time is stored in any case.
    states : tuple of DriveState
        Those of the checkpoint from which the run continues.

    Attributes
    ----------
    states : tuple of DriveState
        By time: those of `DriveCheckpoint`.
    """

    def __init__(
        self, detector: SlipDetector | None, is_even: Callable[[float], bool], states: tuple[DriveState, ...] = ()
    ) -> None:
        self._detector, self._is_even, self.states = detector, is_even, states
        self._wanted = {state.time for state in states if is_even(state.time)}

    def take(self, state: DriveState, slip: Slip | None, is_over: bool) -> tuple[DriveState, ...]:
        """Take the next state of the run; give the states that are to be stored and that no other may precede.

        Parameters
        ----------
        state : DriveState
            At the row that the detector was given last.
        slip : Slip or None
            The slip that this row ends.
        """
        under_way = self._detector.so_far if self._detector else None
        self._wanted |= {slip.begins, slip.ends} if slip else set()
        self._wanted |= {under_way.begins} if under_way else set()
        self._wanted |= {state.time} if is_over or self._is_even(state.time) else set()
        undecided = self._detector.undecided if self._detector and not is_over else set()
        left = [each for each in (*self.states, state) if each.time in self._wanted | undecided]
        count = next((k for k, each in enumerate(left) if each.time not in self._wanted), len(left))
        self.states = tuple(left[count:])
        return tuple(left[:count])
