r"""Driven runs: a spring draws the upper layer of a settled packing, which sticks and slips; drive.h5 stores the run.

The run starts at rest, in equilibrium at F_x = 0, with the spring relaxed. In time steps of the deck part undamped.in
LAMMPS follows the motion of all disks with the damping of the scene (deck parts spring.in, dashpots.in, drag.in). A
part of the run ends after each of the scene's `drive.states`; there the run resumes its own state, as the deck drive.in
sets LAMMPS up anew, so that a run that is continued, and the deck, are bitwise the same. The length of a run has no
part in this: a run is the same up to the end of a shorter one. All functions are collective over the ranks of the
communicator.

**Slow.** Driving is slow if the spring loads the layer to mu F_y in many periods of the slowest vibration of the
packing, :math:`\mu F_y/(k V) \gg 2\pi/\omega_1` (:func:`check_drive`).

**States.** Stored are the states at the ends of the parts (even ones), and those at both ends of each slip. A slip is
found some time after it has begun (:mod:`faultgouge.analysis.responses.slips`), and its end after it has ended. States
at which a slip may yet be found to begin or to end are pending: they are frames behind the decided ones, and the next
part replaces them by those that are stored in the end.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple
from warnings import warn

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.special import stdtrit

from ...analysis import FaultgougeError, Packing, RunFile, nearest_modes, stable_timestep
from ...analysis.progress import Watch
from ...analysis.responses.slips import Slip, SlipDetector, find_slips
from ..lammps.engine import Engine
from ..lammps.instance import EngineError
from ..scenes.packing_section import GeneratedPacking
from ..scenes.run_sections import Drive
from ..scenes.scene import Scene, scene_of
from ..scenes.validation import SceneError, require_section
from ..settling.settle import law_of, settle, settle_bed
from .undamped import Checkpoint

LOADED_SHARE, MOVED_DIAMETERS = 0.016, 0.01
"""Where a scene does not say when states are stored: share of mu F_y by which the spring loads a layer that sticks from
one to the next, and way of a rigid drive in smallest diameters."""

SAMPLES_A_PERIOD, SAMPLES_A_PART = 20, 10
"""Rows of the series: so many in a period of the layer on the spring, and at least so many in a part of the run."""

MOST_STEPS_OF_RUN = 2**31 - 1
"""Time steps of one command `run` of LAMMPS at the most."""

LEAST_LOADING_PERIODS, REFUSED_LOADING_PERIODS = 100.0, 10.0
"""Periods of the slowest vibration in which the spring loads the layer to mu F_y: below the first a run is warned, and
below the second refused."""

SERIES = "drive"
"""Name of the series in the file."""

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
    """A packing on the way, whose F_x is the force of the spring at that moment; without velocities."""

    time: float
    displacement: float
    packing: Packing


class DriveStep(NamedTuple):
    """What a driven run hands out with each row of its series: the row, the slip that has ended, if any, and the states
    to be stored, by time, later than all before."""

    sample: DriveSample
    slip: Slip | None
    states: tuple[DriveState, ...]


@dataclass(frozen=True, eq=False)
class DriveCheckpoint(Checkpoint):
    """A driven run that is under way; `pending` are the states, by time, that are not decided yet."""

    pending: tuple[DriveState, ...] = ()


def layer_period(settings: Drive, packing: Packing) -> float | None:
    """Period of the layer on the spring, time; None of a rigid drive."""
    mass, spring = packing.mass[packing.top].mean(), settings.spring
    return None if spring == "rigid" else float(2 * math.pi * np.sqrt(mass / spring))


def steps_of(settings: Drive, start: Packing, dt: float) -> tuple[int, int, int]:
    """Time steps between two stored states, between two rows, and of the whole run, from an equilibrium."""
    bears, period = start.law.mu * start.fy, layer_period(settings, start)
    if settings.spring == "rigid":
        between = float(MOVED_DIAMETERS * 2 * start.radius.min() / settings.fastest)
    else:
        between = LOADED_SHARE * bears / (settings.spring * settings.fastest)
    part = math.ceil((settings.states or between) / dt)
    most = max(1, min(part // SAMPLES_A_PART, MOST_STEPS_OF_RUN))
    every = most if period is None else min(most, max(1, int(period / SAMPLES_A_PERIOD / dt)))
    return part, every, math.ceil(settings.length(bears) / dt)


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
    if not isinstance(section, GeneratedPacking):
        packing = settle_bed(scene)
    elif section.settle_friction:
        return settle(scene, communicator=communicator, watch=watch).packing
    else:
        packing = settle(scene.model_copy(update={"precision": "double"}), 0.0, communicator, watch).packing
        contacts = packing.contacts.slipped(np.zeros(len(packing.contacts)))
        packing = replace(packing, law=law_of(scene), contacts=contacts)
    if scene.precision == "double":
        return packing
    contacts, low = packing.contacts, packing.position_low
    slip_low = np.zeros(len(contacts)) if contacts.slip_low is None else contacts.slip_low
    low = np.zeros_like(packing.position) if low is None else low
    return replace(packing, contacts=contacts.slipped(contacts.slip, slip_low), position_low=low)


def check_drive(scene: Scene, start: Packing, communicator: MPI.Comm | None = None) -> list[str]:
    """Warnings about a drive that may not stick and slip.

    Raises SceneError if the drive is not slow against the vibrations of the layer, or the time steps of the deck do not
    follow signal, spring and dashpots.
    """
    settings, bears = require_section(scene.drive, "drive"), start.law.mu * start.fy
    fastest, spring, omega = settings.fastest, settings.spring, settings.omega
    with Engine(start, communicator) as engine, engine.undamped(spring=spring, stages=settings.stages) as dynamics:
        dt = dynamics.time_step
    signal = None if settings.signal == "pulse" else settings.forcing()
    shortest, period = math.inf if signal is None else signal.shortest, 2 * math.pi / omega if omega else math.inf
    limit = float(stable_timestep(start if spring == "rigid" else replace(start, spring=spring)))
    follows = f"and the time step is {dt:.3g}: the run would not follow it, so give a slower signal"
    refusals = {
        f"drive.omega = {omega} has a period of {period:.3g}, {follows}": period < 10 * dt,  # sampled to some per cent
        f"drive.signal has rows that are {shortest:.3g} apart, {follows}": shortest < dt,
        f"the time step of the run is {dt:.3g}, and the limit {limit:.3g}, above which every run of this packing blows "
        "up: lower damping.cn and damping.ct, or drive.spring": dt >= limit,
    }
    for says, bad in refusals.items():
        if bad:
            raise SceneError(says)
    if spring == "rigid":
        return []
    slowest = nearest_modes(start, 0.0, 1).values.real.min()
    loading = bears / (spring * fastest)
    periods = loading * math.sqrt(max(slowest, np.finfo(float).tiny)) / (2 * math.pi)
    within = f"{loading:.3g}, which is {periods:.2g} periods of its slowest vibration"
    says = f"drive.velocity = {fastest:g} loads the layer to mu F_y in {within}"
    needs = f"slow driving takes {LEAST_LOADING_PERIODS:g} or more"
    if periods < REFUSED_LOADING_PERIODS:
        slow = fastest * periods / LEAST_LOADING_PERIODS
        raise SceneError(f"{says}, and {needs}: lower it to {slow:.1g}, or take a softer spring")
    return [f"{says}: {needs}"] * (periods < LEAST_LOADING_PERIODS)


def drive(
    scene: Scene | str | Path,
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
        As of `check_drive`, of a packing that settles here.
    FaultgougeError
        If the layer leaves the bed, or, an EngineError, disks move through one another.

    Examples
    --------

    >>> scene = {"packing": {"disks": 8, "radii": [0.5], "width": 3.0}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
    >>> scene |= {"drive": {"spring": 20.0, "velocity": 1e-4, "until": 1.0}, "damping": {"cn": 1.0}}
    >>> *_, last = faultgouge.drive(faultgouge.Scene.from_mapping(scene))
    >>> print(f"{last.sample.force:.4f} after a displacement of {last.sample.displacement:.2e}")
    0.0019 after a displacement of 3.63e-06
    """
    scene = scene_of(scene, "drive")
    settings = require_section(scene.drive, "drive")
    if start is None:
        start = settle_for_drive(scene, communicator)
        for warning in check_drive(scene, start, communicator):
            warn(warning, stacklevel=2)
    height, period = float(start.position[start.top, 1].mean()), layer_period(settings, start)
    detector = None if period is None else SlipDetector(settings.fastest, period)

    def ended(row: DriveSample) -> Slip | None:
        """The slip that a row ends; a rigid layer never sticks, and has none."""
        return detector.add(row.time, row.force, row.displacement, row.kinetic_energy) if detector else None

    slips, last, pending = sum(ended(row) is not None for row in known), 0, resume.pending if resume else ()
    forces: dict[str, Any] = {"stages": settings.stages, "signal": settings.forcing(), "on": settings.on}
    with Engine(start, communicator) as engine, engine.undamped(spring=settings.spring, **forces) as dynamics:
        dt = dynamics.time_step
        part, every, total = steps_of(settings, start, dt)
        wanted = {state.time for state in pending if round(state.time / dt) % part == 0}  # times of stored states
        if resume is not None:
            last = resume.step
            dynamics.resume(last, resume.state)
        while last < total:
            step = min(total, last - last % every + every, last - last % part + part)
            time = step * dt
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
            if thickness > 1.5 * height:
                left = f"the upper layer has left the bed at t = {time:g}"
                rise = f"its mean height is {thickness:.3g}, and was {height:.3g}"
                raise FaultgougeError(f"{left}: {rise}; take a slower drive, a softer spring or a larger load.fy")
            slip = ended(sample)
            under_way = detector.so_far if detector else None
            slips += slip is not None
            is_over, ends_part = step == total or slips == settings.slips, step % part == 0
            wanted |= {slip.begins, slip.ends} if slip else set()
            wanted |= {under_way.begins} if under_way else set()
            wanted |= {time} if is_over or ends_part else set()
            undecided = detector.undecided if detector and not is_over else set()
            states = [*pending, DriveState(time, displacement, packing)]
            states = [each for each in states if each.time in wanted | undecided]
            decided = next((k for k, each in enumerate(states) if each.time not in wanted), len(states))
            pending = tuple(states[decided:])
            yield DriveStep(sample, slip, tuple(states[:decided]))
            if is_over:
                return
            if ends_part:
                engine.include("stray.in")
                reached = dynamics.state()
                dynamics.resume(step, reached)  # as a run does that is continued from here
                if keep is not None:
                    keep(DriveCheckpoint(step, reached, pending))


def strays(packing: Packing, start: Packing) -> NDArray[np.bool_]:
    """Disks of the bed that were squeezed out above the layer, shape (N,); LAMMPS stops them (deck part stray.in)."""
    ceiling = start.position[:, 1].max() + 4 * start.radius.min()
    out: NDArray[np.bool_] = ~packing.top & (packing.position[:, 1] > ceiling)
    return out


def drive_of(file: RunFile) -> Drive | None:
    """The section [drive] of the scene of a drive.h5; None of another file."""
    if file.attributes.get("task") != "drive":
        return None
    return Drive.model_validate(json.loads(file.attributes["scene"])["drive"])


def slips_in(file: RunFile) -> tuple[list[Slip], Slip | None]:
    """The slips in the series of a drive.h5 that have ended, and the slip that is under way at its end."""
    settings = drive_of(file)
    period = None if settings is None else layer_period(settings, file.packing(0))
    if settings is None or period is None or SERIES not in file.names_of_series:
        return [], None
    of = file.series(SERIES)
    return find_slips(of["time"], of["force"], of["displacement"], of["kinetic_energy"], settings.fastest, period)


def clock_advance(path: Path, other: Path) -> float | None:
    """How much earlier the next slip after a signal begins, in the drive.h5 `path`, than in that of the same scene
    without the signal, `other`; None if one of the two has no slip after the signal has begun.

    Slips whose force drop is below `COMPARABLE` of that of the next slip without the signal are left out: a strong
    signal makes small slips at once, which leave the next large one where it was.
    """
    with RunFile(path) as with_signal, RunFile(other) as without:
        settings = drive_of(with_signal)
        assert settings is not None
        return advance_of(slips_in(with_signal)[0], slips_in(without)[0], settings.at or 0.0)


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
    anew for each run. So the error is that of one more draw, by Student's distribution. `noise` are the advances by
    noise, None where no slip follows, as is the error then; `row` is the time between two rows of a series, which no
    advance is better than.
    """
    known = [each for each in noise if each is not None]
    if len(known) < len(noise) or not known:
        return None
    quantile = float(stdtrit(len(known), 0.5 + CONFIDENCE / 2))
    return max(row, quantile * float(np.sqrt(np.mean(np.square(known)))))
