r"""Driven runs: a spring draws the upper layer of a settled packing, which sticks and slips.

The run starts at rest, in equilibrium at F_x = 0, with the spring relaxed. In time steps of the deck part undamped.in
LAMMPS follows the motion of all disks with the damping of the scene (deck parts spring.in, dashpots.in, drag.in). A
part of the run ends after each of the scene's `drive.states`; there the run resumes its own state, as the deck drive.in
sets LAMMPS up anew, so that a run that is continued, and the deck, are bitwise the same.

Driving is *slow* if the spring loads the layer to mu F_y in many periods of the slowest vibration of the packing,

.. math:: \mu F_y/(k V) \gg 2\pi/\omega_1 ,

and stick-slip is expected of springs softer than the layer, :math:`k < k_l = f/u`, u the mean displacement of the layer
under the force f on each of its disks. All functions are collective over the ranks of the communicator.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from warnings import warn

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ...analysis import (
    Contacts,
    FaultgougeError,
    Packing,
    dynamical_matrix,
    layer_force,
    nearest_modes,
    stable_timestep,
)
from ...analysis.arrays import Floats
from ...analysis.factors.sparse_lu import general_lu
from ...analysis.motion.signals import Signal
from ...analysis.motion.slips import Slip, SlipDetector
from ...analysis.progress import Watch
from ..lammps.dynamics import Dynamics
from ..lammps.engine import Engine
from ..scenes.drive_section import Drive
from ..scenes.packing_section import GeneratedPacking
from ..scenes.scene import Scene
from ..scenes.validation import SceneError, require_section
from ..settling.settle import law_of, settle, settle_bed
from .run_iterator import run_of_scene
from .undamped import Checkpoint

LOADED_SHARE, MOVED_DIAMETERS = 0.016, 0.01
"""Where a scene does not say when states are stored: share of mu F_y by which the spring loads a layer that sticks from
one to the next, and way of a rigid drive in smallest diameters. The length of the run has no part in it, so that a run
is the same up to the end of a shorter one."""

SAMPLES_A_PERIOD, SAMPLES_A_PART = 20, 10
"""Rows of the series: so many in a period of the layer on the spring, and at least so many in a part of the run."""

LEAST_LOADING_PERIODS, REFUSED_LOADING_PERIODS = 100.0, 10.0
"""Periods of the slowest vibration in which the spring loads the layer to mu F_y: below the first a run is warned, and
below the second refused."""

STEPS_A_PULSE = 10
"""Time steps in a period of a pulse: velocity Verlet then samples it to some per cent."""

DILATION_LIMIT = 1.5
"""Height of the layer, in units of that at the beginning, above which it has left the bed."""


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
        """The plan of a run from an equilibrium with a time step."""
        length = settings.length(strength(start))
        part = math.ceil((settings.states or _between_states(settings, start)) / dt)
        period = layer_period(settings, start)
        most = max(1, part // SAMPLES_A_PART)
        every = most if period is None else min(most, max(1, int(period / SAMPLES_A_PERIOD / dt)))
        return cls(dt, part, every, math.ceil(length / dt))

    def steps(self, after: int) -> list[int]:
        """Steps at which the run is sampled, after a step."""
        all_steps = {*range(self.every, self.total, self.every), *range(self.part, self.total, self.part), self.total}
        return sorted(step for step in all_steps if step > after)


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


def settle_for_drive(scene: Scene, communicator: MPI.Comm | None = None, watch: Watch | None = None) -> Packing:
    """Settle the packing of a scene at F_x = 0, where its slips begin at zero.

    Friction bears nothing in a packing that has settled without friction: its slips and the low parts of its
    coordinates are rounding. They are left out, so that a data file describes the packing for the deck drive.in. A
    stored packing is taken as it is, to the bit, with its slips, as the deck takes the packing of a data file: to
    balance a packing more closely would move it, any distance along x if only friction holds it.

    Parameters
    ----------
    scene : Scene
        Its sections [packing], [law] and [load] count.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.
    watch : callable, optional
        Told in words what is under way.

    Returns
    -------
    Packing

    Raises
    ------
    NoEquilibriumError
        If the packing does not settle.
    """
    section = scene.packing
    if isinstance(section, GeneratedPacking) and section.settle_friction:
        return settle(scene, communicator=communicator, watch=watch).packing
    if isinstance(section, GeneratedPacking):
        packing = settle(scene.model_copy(update={"precision": "double"}), 0.0, communicator, watch).packing
        contacts = Contacts(packing.contacts.i, packing.contacts.j, np.zeros(len(packing.contacts)))
        packing = replace(packing, law=law_of(scene, scene.law.mus[0]), contacts=contacts)
    else:
        packing = settle_bed(scene)
    if scene.precision == "double":
        return packing
    contacts = packing.contacts
    if contacts.slip_low is None:
        contacts = replace(contacts, slip_low=np.zeros(len(contacts)))
    low = np.zeros_like(packing.position) if packing.position_low is None else packing.position_low
    return replace(packing, contacts=contacts, position_low=low)


def check_drive(scene: Scene, start: Packing, communicator: MPI.Comm | None = None) -> list[str]:
    """Warnings about a drive that may not stick and slip.

    Raises
    ------
    SceneError
        If the drive is not slow against the vibrations of the layer, or time steps do not follow it.
    """
    settings, warnings = require_section(scene.drive, "drive"), list[str]()
    with _driven(settings, start, communicator):
        pass
    if settings.spring == "rigid":
        return warnings
    matrix, active = dynamical_matrix(start)
    slowest = nearest_modes(start, 0.0, 1).values.real.min()
    period = 2 * math.pi / math.sqrt(max(slowest, np.finfo(float).tiny))
    loading = strength(start) / (settings.spring * settings.fastest)
    says = (
        f"drive.velocity = {settings.fastest:g} loads the layer to mu F_y in {loading:.3g}, which is "
        f"{loading / period:.2g} periods of its slowest vibration"
    )
    if loading < REFUSED_LOADING_PERIODS * period:
        raise SceneError(
            f"{says}, and slow driving takes {LEAST_LOADING_PERIODS:g} or more: lower it to "
            f"{settings.fastest * loading / (LEAST_LOADING_PERIODS * period):.1g}, or take a softer spring"
        )
    if loading < LEAST_LOADING_PERIODS * period:
        warnings.append(f"{says}: slow driving takes {LEAST_LOADING_PERIODS:g} or more")
    unit = (layer_force(start, 1.0) / start.coordinate_mass)[active]
    moved = np.zeros(start.coordinates)
    moved[active] = general_lu(matrix.tocsc()).solve(unit)
    stiffness = 1 / moved[: len(start)][start.top].mean()
    if settings.spring > stiffness:
        warnings.append(
            f"drive.spring = {settings.spring:g} is stiffer than the layer, which has {stiffness:.3g} for each disk at "
            "rest: the layer may slide without sticking"
        )
    return warnings


@run_of_scene
def drive(
    scene: Scene,
    start: Packing | None = None,
    known: Sequence[DriveSample] = (),
    resume: Checkpoint | None = None,
    keep: Callable[[Checkpoint], None] | None = None,
    communicator: MPI.Comm | None = None,
) -> Iterator[DriveStep]:
    """Draw the upper layer of a packing with the scene's spring.

    Parameters
    ----------
    scene : Scene, str or Path
        With a section [drive]; or its file.
    start : Packing, optional
        The equilibrium at F_x = 0; by default that of `settle_for_drive`.
    known : sequence of DriveSample
        Rows of the series up to the checkpoint.
    resume : Checkpoint, optional
        Continue from this checkpoint: bitwise the same.
    keep : callable, optional
        Called with a checkpoint after every part of the run, after the rows before it have been consumed.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.

    Yields
    ------
    DriveStep

    Warns
    -----
    UserWarning
        If the drive of a packing that settles here may not stick and slip.

    Raises
    ------
    SceneError
        If the time step of the deck is not stable for the packing, or the drive of a packing that settles here is not
        slow.
    DilationError
        If the layer leaves the bed.
    """
    settings = require_section(scene.drive, "drive")
    if start is None:
        start = settle_for_drive(scene, communicator)
        for warning in check_drive(scene, start, communicator):
            warn(warning, stacklevel=2)
    with _driven(settings, start, communicator) as (engine, dynamics):
        plan = Plan.of(settings, start, dynamics.time_step)
        detector = slip_detector(settings, start)
        slips = sum(detector.add(*_of_detector(row)) is not None for row in known) if detector else 0
        last, recent = 0, _RecentStates(detector, known[-1].time if known else 0.0)  # at the end of a part
        if resume is not None:
            last = resume.step
            dynamics.resume(last, resume.state)
        for step in plan.steps(last):
            sample, state = _advance(engine, dynamics, step - last, step * plan.dt, start)
            last = step
            slip = detector.add(*_of_detector(sample)) if detector else None
            slips += slip is not None
            ends_part = step % plan.part == 0 or step == plan.total
            yield DriveStep(sample, slip, recent.take(state, slip, ends_part))
            if settings.slips is not None and slips == settings.slips:
                return
            if ends_part and step < plan.total:
                dynamics.stop_strays()
                reached = dynamics.state()
                dynamics.resume(step, reached)  # as a run does that is continued from here
                if keep is not None:
                    keep(Checkpoint(step, reached))


class _RecentStates:
    """States of a run from which a slip may have begun, and the choice of those that are stored.

    Parameters
    ----------
    detector : SlipDetector, optional
        The detector of the run; None of a rigid drive, whose layer has no slips.
    stored : float
        Time of the last state that is stored already.
    """

    def __init__(self, detector: SlipDetector | None, stored: float) -> None:
        self._detector, self._stored = detector, stored
        self._states = deque[DriveState]()

    def take(self, state: DriveState, slip: Slip | None, ends_part: bool) -> tuple[DriveState, ...]:
        """Take the next state, and the slip that ends with it; give the states that are to be stored, by time."""
        detector, now = self._detector, state.time
        self._states.append(state)
        wanted = set() if slip is None else {slip.begins, now}
        if ends_part:
            # the state with which a slip begins that is not yet known to be one
            wanted |= {detector.largest if detector else now, now}
        chosen = tuple(each for each in self._states if each.time in wanted and each.time > self._stored)
        self._stored = max([self._stored, *(each.time for each in chosen)])
        oldest = min(detector.largest, now - detector.look_back) if detector else np.inf
        while self._states and self._states[0].time < oldest:
            self._states.popleft()
        return chosen


@contextmanager
def _driven(settings: Drive, start: Packing, communicator: MPI.Comm | None = None) -> Iterator[tuple[Engine, Dynamics]]:
    """LAMMPS with the drive, at its beginning; refused if its time steps do not follow signal, spring and dashpots."""
    signal = settings.forcing()
    with (
        Engine(start, communicator) as engine,
        engine.driven(settings.spring, settings.stages, signal, settings.on) as dynamics,
    ):
        if signal is not None:
            _check_signal(settings, signal, dynamics.time_step)
        _check_time_step(settings, start, dynamics.time_step)
        yield engine, dynamics


def _check_time_step(settings: Drive, start: Packing, dt: float) -> None:
    """Refuse a spring or dashpots with which the time step of the deck would blow up, and a layer that leaps."""
    leap = settings.fastest * dt
    if settings.spring == "rigid" and leap > start.radius.min():
        raise SceneError(
            f"the layer moves at {settings.fastest:g} by {leap:.3g} in a time step of {dt:.3g}, farther than the "
            f"smallest radius {start.radius.min():g}: lower drive.velocity"
        )
    drawn = start if settings.spring == "rigid" else replace(start, spring=settings.spring)
    limit = float(stable_timestep(drawn))
    if dt >= limit:
        lower = "damping.cn and damping.ct" if dt >= float(stable_timestep(start)) else "drive.spring"
        raise SceneError(
            f"the time step of the run is {dt:.3g}, and the limit {limit:.3g}, above which every run of this packing "
            f"blows up: lower {lower}"
        )


def _check_signal(settings: Drive, signal: Signal, dt: float) -> None:
    """Refuse a signal that time steps would not follow."""
    says = f"and the time step is {dt:.3g}: the run would not follow it, so give a slower signal"
    if settings.omega is not None and 2 * math.pi / settings.omega < STEPS_A_PULSE * dt:
        raise SceneError(f"drive.omega = {settings.omega:g} has a period of {2 * math.pi / settings.omega:.3g}, {says}")
    if settings.signal != "pulse" and signal.shortest < dt:
        raise SceneError(f"drive.signal has rows that are {signal.shortest:.3g} apart, {says}")


def strays(packing: Packing, start: Packing) -> NDArray[np.bool_]:
    """Disks of the bed that were squeezed out above the layer, shape (N,); LAMMPS stops them (deck part stray.in)."""
    ceiling = start.position[:, 1].max() + 4 * start.radius.min()
    out: NDArray[np.bool_] = ~packing.top & (packing.position[:, 1] > ceiling)
    return out


class DilationError(FaultgougeError):
    """The layer has left the bed."""


def _advance(
    engine: Engine, dynamics: Dynamics, steps: int, time: float, start: Packing
) -> tuple[DriveSample, DriveState]:
    motion = dynamics.advance(steps)
    force, displacement = dynamics.drawn
    packing = replace(engine.packing, fx=force)
    sample = DriveSample(
        time=time,
        force=force,
        displacement=displacement,
        thickness=_height(packing),
        kinetic_energy=motion.kinetic_energy(start),
        at_bound=int(np.count_nonzero(packing.sliding)),
    )
    if sample.thickness > DILATION_LIMIT * _height(start):
        raise DilationError(
            f"the upper layer has left the bed at t = {time:g}: its mean height is {sample.thickness:.3g}, and was "
            f"{_height(start):.3g}; take a slower drive, a softer spring or a larger load.fy"
        )
    return sample, DriveState(time, displacement, packing)


def _height(packing: Packing) -> float:
    height: Floats = packing.position[packing.top, 1]
    return float(height.mean())


def _of_detector(sample: DriveSample) -> tuple[float, float, float, float]:
    return sample.time, sample.force, sample.displacement, sample.kinetic_energy
