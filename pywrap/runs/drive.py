r"""Driven runs: a spring draws the upper layer of a settled packing, which sticks and slips; drive.h5 stores the run.

The run starts at rest, in equilibrium at F_x = 0, with the spring relaxed. In time steps of the deck part undamped.in
LAMMPS follows the motion of all disks with the damping of the scene (deck parts spring.in, dashpots.in, drag.in). A
part of the run ends after each of the scene's `drive.states`; there the run resumes its own state, as the deck drive.in
sets LAMMPS up anew, so that a run that is continued, and the deck, are bitwise the same. The length of a run has no
part in this: a run is the same up to the end of a shorter one. All functions are collective over the ranks of the
communicator.

**Slow.** Driving is slow if the spring loads the layer to mu F_y in many periods of the slowest vibration of the
packing, and stick-slip is expected of springs softer than the layer:

.. math:: \mu F_y/(k V) \gg 2\pi/\omega_1 , \qquad k < k_l = f/u,

u the mean displacement of the layer under the force f on each of its disks (:func:`check_drive`).

**States.** Stored are the states at the ends of the parts (even ones), and those at both ends of each slip. A slip is
found some time after it has begun (:mod:`faultgouge.analysis.responses.slips`), and its end after it has ended:
`PendingStates` keeps the states at which a slip may yet be found to begin or to end, also in the checkpoint.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple
from warnings import warn

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.special import stdtrit

from ...analysis import (
    Contacts,
    FaultgougeError,
    Packing,
    RunFile,
    dynamical_matrix,
    layer_force,
    nearest_modes,
    stable_timestep,
)
from ...analysis.factors.sparse_lu import general_lu
from ...analysis.files.atomic_write import lock_output, replace_whole
from ...analysis.progress import Watch
from ...analysis.responses.slips import Slip, SlipDetector, find_slips
from ..equilibria.quasistatic import Equilibrium
from ..lammps.dynamics import Dynamics
from ..lammps.engine import Engine
from ..lammps.instance import EngineError
from ..scenes.packing_section import GeneratedPacking
from ..scenes.scene import Scene
from ..scenes.sections import Drive
from ..scenes.validation import SceneError, require_section
from ..settling.settle import law_of, settle, settle_bed
from .ramp import run_of_scene
from .run_recorder import Record, raise_on_all_ranks
from .undamped import Checkpoint

LOADED_SHARE, MOVED_DIAMETERS = 0.016, 0.01
"""Where a scene does not say when states are stored: share of mu F_y by which the spring loads a layer that sticks from
one to the next, and way of a rigid drive in smallest diameters."""

SAMPLES_A_PERIOD, SAMPLES_A_PART = 20, 10
"""Rows of the series: so many in a period of the layer on the spring, and at least so many in a part of the run."""

MOST_STEPS, MOST_STEPS_OF_RUN = 2**53, 2**31 - 1
"""Time steps of a run at the most, which its time, a double, counts exactly; and of one command `run` of LAMMPS."""

DILATION_LIMIT = 1.5
"""Height of the layer, in units of that at the beginning, above which it has left the bed."""

LEAST_LOADING_PERIODS, REFUSED_LOADING_PERIODS = 100.0, 10.0
"""Periods of the slowest vibration in which the spring loads the layer to mu F_y: below the first a run is warned, and
below the second refused."""

STEPS_A_PULSE = 10
"""Time steps in a period of a pulse: velocity Verlet then samples it to some per cent."""

SERIES = "drive"
"""Name of the series in the file."""

PENDING = "pending"
"""Of a checkpoint in the file: how many of the last frames are pending states of the run, which the next part replaces
by those of them that are stored in the end."""

NOISES, CONFIDENCE = 3, 0.95
"""Runs with noise beside one with a signal, and the confidence of the error of a clock advance. Of the advances by
noise in research/cycle, the largest that one run has covers 71 of 100 of the others of the same slip, and the error by
three of them 96."""

COMPARABLE = 0.5
"""Least force drop of a slip with a signal that is compared with one without, in units of the drop of the latter."""


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
    """A packing on the way: time since the beginning, mean displacement of the layer along x, and the packing, whose
    F_x is the force of the spring at that moment; velocities are left out."""

    time: float
    displacement: float
    packing: Packing


class DriveStep(NamedTuple):
    """What a driven run hands out with each row of its series.

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
    """A driven run that is under way; `pending` are the states, by time, that are not decided yet."""

    pending: tuple[DriveState, ...] = ()


class DilationError(FaultgougeError):
    """The layer has left the bed."""


class Plan(NamedTuple):
    """Time step of a driven run, and steps between two stored states, between two rows, and of the run."""

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
        if settings.spring == "rigid":
            between = float(MOVED_DIAMETERS * 2 * start.radius.min() / settings.fastest)
        else:
            between = LOADED_SHARE * strength(start) / (settings.spring * settings.fastest)
        part, period = math.ceil(min((settings.states or between) / dt, MOST_STEPS)), layer_period(settings, start)
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


def layer_period(settings: Drive, packing: Packing) -> float | None:
    """Period of the layer on the spring, time; None of a rigid drive."""
    if settings.spring == "rigid":
        return None
    return float(2 * math.pi * np.sqrt(packing.mass[packing.top].mean() / settings.spring))


class PendingStates:
    """States of a run that are not handed out yet, and the choice of those that are stored.

    Parameters
    ----------
    detector : SlipDetector or None
        The detector of the run; None of a rigid drive, whose layer never sticks and has no slips.
    is_even : callable
        Whether the state at a time is stored in any case.
    states : tuple of DriveState
        By time: those of the checkpoint from which the run continues.
    """

    def __init__(
        self, detector: SlipDetector | None, is_even: Callable[[float], bool], states: tuple[DriveState, ...] = ()
    ) -> None:
        self.detector, self.is_even, self.states = detector, is_even, states
        self.wanted = {state.time for state in states if is_even(state.time)}

    def take(self, state: DriveState, slip: Slip | None, is_over: bool) -> tuple[DriveState, ...]:
        """Take the state at the row that the detector was given last, and the slip that this row ends, if any; give the
        states that are to be stored and that no other may precede."""
        under_way = self.detector.so_far if self.detector else None
        self.wanted |= {slip.begins, slip.ends} if slip else set()
        self.wanted |= {under_way.begins} if under_way else set()
        self.wanted |= {state.time} if is_over or self.is_even(state.time) else set()
        undecided = self.detector.undecided if self.detector and not is_over else set()
        left = [each for each in (*self.states, state) if each.time in self.wanted | undecided]
        count = next((k for k, each in enumerate(left) if each.time not in self.wanted), len(left))
        self.states = tuple(left[count:])
        return tuple(left[:count])


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


@contextmanager
def driven(settings: Drive, start: Packing, communicator: MPI.Comm | None = None) -> Iterator[tuple[Engine, Dynamics]]:
    """LAMMPS with the drive, at its beginning; refused if its time steps do not follow signal, spring and dashpots."""
    signal = settings.forcing()
    with (
        Engine(start, communicator) as engine,
        engine.undamped(spring=settings.spring, stages=settings.stages, signal=signal, on=settings.on) as dynamics,
    ):
        dt = dynamics.time_step
        says = f"and the time step is {dt:.3g}: the run would not follow it, so give a slower signal"
        if settings.omega is not None and 2 * math.pi / settings.omega < STEPS_A_PULSE * dt:
            period = 2 * math.pi / settings.omega
            raise SceneError(f"drive.omega = {settings.omega:g} has a period of {period:.3g}, {says}")
        if signal is not None and settings.signal != "pulse" and signal.shortest < dt:
            raise SceneError(f"drive.signal has rows that are {signal.shortest:.3g} apart, {says}")
        leap = settings.fastest * dt
        if settings.spring == "rigid" and leap > start.radius.min():
            raise SceneError(
                f"the layer moves at {settings.fastest:g} by {leap:.3g} in a time step of {dt:.3g}, farther than the "
                f"smallest radius {start.radius.min():g}: lower drive.velocity"
            )
        limit = float(stable_timestep(start if settings.spring == "rigid" else replace(start, spring=settings.spring)))
        if dt >= limit:
            lower = "damping.cn and damping.ct" if dt >= float(stable_timestep(start)) else "drive.spring"
            raise SceneError(
                f"the time step of the run is {dt:.3g}, and the limit {limit:.3g}, above which every run of this "
                f"packing blows up: lower {lower}"
            )
        yield engine, dynamics


def check_drive(scene: Scene, start: Packing, communicator: MPI.Comm | None = None) -> list[str]:
    """Warnings about a drive that may not stick and slip.

    Raises SceneError if the drive is not slow against the vibrations of the layer, or time steps do not follow it.
    """
    settings, warnings = require_section(scene.drive, "drive"), list[str]()
    with driven(settings, start, communicator) as (_, dynamics):
        Plan.of(settings, start, dynamics.time_step)
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
    resume: DriveCheckpoint | None = None,
    keep: Callable[[DriveCheckpoint], None] | None = None,
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
    resume : DriveCheckpoint, optional
        Continue from this checkpoint: bitwise the same.
    keep : callable, optional
        Called with a checkpoint after every part of the run, after the rows before it have been consumed.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.

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
    EngineError
        If disks move through one another.

    Examples
    --------

    >>> scene = {"packing": {"disks": 8, "radii": [0.5], "width": 3.0}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
    >>> scene |= {"drive": {"spring": 20.0, "velocity": 1e-4, "until": 1.0}, "damping": {"cn": 1.0}}
    >>> *_, last = faultgouge.drive(faultgouge.Scene.from_mapping(scene))
    >>> print(f"{last.sample.force:.4f} after a displacement of {last.sample.displacement:.2e}")
    0.0019 after a displacement of 3.63e-06
    """
    settings = require_section(scene.drive, "drive")
    if start is None:
        start = settle_for_drive(scene, communicator)
        for warning in check_drive(scene, start, communicator):
            warn(warning, stacklevel=2)
    height = float(start.position[start.top, 1].mean())
    period = layer_period(settings, start)
    detector = None if period is None else SlipDetector(settings.fastest, period)

    def ended(row: DriveSample) -> Slip | None:
        """The slip that a row ends."""
        return detector.add(row.time, row.force, row.displacement, row.kinetic_energy) if detector else None

    with driven(settings, start, communicator) as (engine, dynamics):
        plan = Plan.of(settings, start, dynamics.time_step)
        slips = sum(ended(row) is not None for row in known)
        pending, last = PendingStates(detector, plan.is_even, resume.pending if resume else ()), 0
        if resume is not None:
            last = resume.step
            dynamics.resume(last, resume.state)
        for step in plan.steps(last):
            time = step * plan.dt
            try:
                motion = dynamics.advance(step - last)
            except EngineError as error:
                slower = "a slower drive, a softer spring or a smaller drive.scale"
                raise EngineError(f"the run has ended before t = {time:g}: take {slower}, as {error}") from error
            (force, displacement), last = dynamics.drawn, step
            packing = replace(engine.packing, fx=force)
            thickness = float(packing.position[packing.top, 1].mean())
            energy, at_bound = motion.kinetic_energy(start), int(np.count_nonzero(packing.sliding))
            sample = DriveSample(time, force, displacement, thickness, energy, at_bound)
            if thickness > DILATION_LIMIT * height:
                raise DilationError(
                    f"the upper layer has left the bed at t = {time:g}: its mean height is {thickness:.3g}, and was "
                    f"{height:.3g}; take a slower drive, a softer spring or a larger load.fy"
                )
            slip = ended(sample)
            slips += slip is not None
            is_over = step == plan.total or slips == settings.slips
            yield DriveStep(sample, slip, pending.take(DriveState(time, displacement, packing), slip, is_over))
            if is_over:
                return
            if step % plan.part == 0:
                engine.include("stray.in")
                reached = dynamics.state()
                dynamics.resume(step, reached)  # as a run does that is continued from here
                if keep is not None:
                    keep(DriveCheckpoint(step, reached, pending.states))


def strays(packing: Packing, start: Packing) -> NDArray[np.bool_]:
    """Disks of the bed that were squeezed out above the layer, shape (N,); LAMMPS stops them (deck part stray.in)."""
    ceiling = start.position[:, 1].max() + 4 * start.radius.min()
    out: NDArray[np.bool_] = ~packing.top & (packing.position[:, 1] > ceiling)
    return out


class DriveRecord(Record):
    """The drive.h5 of a scene, created or continued after an interruption; parameters as of `Record`, on all ranks.

    Its frames are states of the run, with the observables `time` and `displacement`. F_x of a frame is the force of the
    spring.
    """

    TASK = "drive"
    _others: Mapping[Path, Scene] = {}  # replaced, and never changed
    _step, _decided = 0, 1

    def _stored_equilibrium(self, file: RunFile) -> Equilibrium:
        return Equilibrium.of(file.packing(0))

    def _contents(self, file: RunFile) -> str:
        return f"{len(file)} state{'s' * (len(file) != 1)}, the last at t = {file.observable('time')[-1]:g}"

    def append(self, equilibrium: Equilibrium) -> None:
        """Write the packing from which the run starts."""
        if self.communicator.rank == 0:
            self._file = RunFile.create(self.path, equilibrium.packing, self._attributes())
            self._file.append(equilibrium.packing, time=0.0, displacement=0.0)
            self._file.save()
        self.last = equilibrium

    @property
    def slips(self) -> int:
        """Slips in the file so far; 0 on ranks that do not write."""
        return 0 if self._file is None else len(slips_in(self._file))

    def drive(self, others: Mapping[Path, Scene] | None = None) -> Iterator[DriveStep]:
        """Run the scene's drive and write its rows and states; an interrupted run continues.

        Parameters
        ----------
        others : mapping of Path to Scene, optional
            Files of scenes that differ from this one in the signal alone, and have none or one that begins at the same
            time. A file that does not exist is made when this run comes to that time, so that the run of the other
            scene goes on from there, bitwise the same as from its beginning.

        Yields
        ------
        DriveStep
            Those that are not in the file yet.
        """
        assert self.last is not None
        if self.complete:
            return
        known, resume = raise_on_all_ranks(self.communicator, self._reached)
        self._others, self._step = others or {}, 0 if resume is None else resume.step
        steps: list[DriveStep] = []

        def keep(reached: DriveCheckpoint | None) -> None:
            self._keep_steps(steps, reached)

        for step in drive(self.scene, self.last.packing, known, resume, keep, self.communicator):
            steps.append(step)
            yield step
        keep(None)

    def _reached(self) -> tuple[list[DriveSample], DriveCheckpoint | None]:
        """Rows of the series so far, and where the run goes on."""
        known, reached = self._known(SERIES, DriveSample)
        if self._file is None or reached is None:
            return known, None
        self._decided = len(self._file) - int(reached.state.pop(PENDING, 0))
        times, moved = (self._file.observable(name).tolist() for name in ("time", "displacement"))
        frames = range(self._decided, len(self._file))
        states = tuple(DriveState(times[k], moved[k], self._file.packing(k)) for k in frames)
        return known, DriveCheckpoint(reached.step, reached.state, states)

    def _keep_steps(self, steps: list[DriveStep], reached: DriveCheckpoint | None) -> None:
        """Write rows, decided states and behind them the pending ones, with the checkpoint, in one change."""
        file = self._file
        if file is not None:
            with file.change():
                decided = [state for step in steps for state in step.states]
                states = [*decided, *(reached.pending if reached else ())]
                there = file.observable("time")[self._decided :].tolist()
                same = 0  # those that are pending in the file already stay
                while same < min(len(there), len(states)) and there[same] == states[same].time:
                    same += 1
                file.cut(self._decided + same)
                for state in states[same:]:
                    file.append(state.packing, time=state.time, displacement=state.displacement)
                self._decided += len(decided)
                count = {PENDING: np.array(len(states) - len(decided))}
                stored = None if reached is None else Checkpoint(reached.step, reached.state | count)
                self._keep(SERIES, [step.sample for step in steps], [], stored)
                file.complete = reached is None
            if reached is not None and self._others:
                self._divide(file, steps[-1].sample.time, reached.step)
        steps.clear()

    def _divide(self, file: RunFile, time: float, step: int) -> None:
        """Make the files of the other scenes at the end of a part, if the signal begins in the next one."""
        part, self._step = time * (step - self._step) / step, step
        if not time <= (require_section(self.scene.drive, "drive").at or 0.0) < time + part:
            return
        file.save()
        for path, scene in self._others.items():
            with lock_output(path):
                if not path.exists():
                    with replace_whole(path) as new:
                        shutil.copyfile(self.path, new)
                        with RunFile(new, "a") as other:
                            other.put_attribute("scene", json.dumps(scene.resolved()))


def drive_of(file: RunFile) -> Drive | None:
    """The section [drive] of the scene of a drive.h5; None of another file."""
    if file.attributes.get("task") != "drive":
        return None
    return Drive.model_validate(json.loads(file.attributes["scene"])["drive"])


def series_and_slips(file: RunFile) -> tuple[dict[str, NDArray[Any]], list[Slip]] | None:
    """The series of a drive.h5 and its slips that have ended; None of another file, or where the run has not begun."""
    begun = drive_of(file) is not None and SERIES in file.names_of_series
    return (file.series(SERIES), slips_in(file)) if begun else None


def slips_in(file: RunFile) -> list[Slip]:
    """The slips in the series of a drive.h5 that have ended."""
    return all_slips_in(file)[0]


def all_slips_in(file: RunFile) -> tuple[list[Slip], Slip | None]:
    """The slips in the series of a drive.h5, with the slip that is under way at its end."""
    settings = drive_of(file)
    period = None if settings is None else layer_period(settings, file.packing(0))
    if settings is None or period is None or SERIES not in file.names_of_series:
        return [], None
    series = file.series(SERIES)
    time, force, moved, energy = (series[name] for name in ("time", "force", "displacement", "kinetic_energy"))
    return find_slips(time, force, moved, energy, settings.fastest, period)


def clock_advance(path: Path, other: Path) -> float | None:
    """How much earlier the next slip after a signal begins than in another run without the signal, time.

    Slips whose force drop is below `COMPARABLE` of that of the next slip without the signal are left out: a strong
    signal makes small slips at once, which leave the next large one where it was.

    Parameters
    ----------
    path, other : Path
        A drive.h5 with a signal, and the drive.h5 of the same scene without the signal.

    Returns
    -------
    float or None
        None if one of the two has no slip after the signal has begun.
    """
    with RunFile(path) as with_signal, RunFile(other) as without:
        settings = drive_of(with_signal)
        assert settings is not None
        return advance_of(slips_in(with_signal), slips_in(without), settings.at or 0.0)


def advance_of(slips: Sequence[Slip], without: Sequence[Slip], at: float) -> float | None:
    """The same of the slips of two runs, with a signal that begins at a time, and without."""
    due = next((slip for slip in without if slip.ends > at), None)
    if due is None:
        return None
    after = (slip for slip in slips if slip.ends > at and abs(slip.force_drop) >= COMPARABLE * abs(due.force_drop))
    first = next(after, None)
    return None if first is None else due.begins - first.begins


def advance_error(noise: Sequence[float | None], row: float) -> float | None:
    """The error of a clock advance, time: `CONFIDENCE` of the advances by a signal that does nothing are within it.

    A signal as small as rounding moves the slip, too, and no run is the undisturbed one: what noise does is drawn
    anew for each run. So the error is that of one more draw, by Student's distribution.

    Parameters
    ----------
    noise : sequence of float or None
        Clock advances by noise; None where no slip follows.
    row : float
        Time between two rows of a series, which no advance is better than.

    Returns
    -------
    float or None
        None if no slip follows in one of the runs with noise.
    """
    known = [each for each in noise if each is not None]
    if len(known) < len(noise) or not known:
        return None
    quantile = float(stdtrit(len(known), 0.5 + CONFIDENCE / 2))
    return max(row, quantile * float(np.sqrt(np.mean(np.square(known)))))
