"""Write the run.h5 of a scene: a new file, or the file of an interrupted run."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from mpi4py import MPI

from ...analysis import RunFile, solid_fraction
from ...analysis.arrays import Floats
from ...analysis.counted import counted
from ...analysis.files.atomic_write import check_output, lock_output, replace_whole
from ..equilibria.quasistatic import Equilibrium
from ..lammps.dynamics import MotionState, Weakening
from ..scenes.command_sections import COMMANDS
from ..scenes.scene import SECTIONS, Scene
from ..scenes.validation import SceneError, require_section
from .drive import SERIES, DriveCheckpoint, DriveSample, DriveState, DriveStep, drive, slips_in
from .undamped import Checkpoint, Sample, perturb, sample_steps

S = TypeVar("S")
T = TypeVar("T")
Task = Literal["ramp", "perturb", "drive"]

STATES_OF_FILM, DISKS_OF_FILM = 300, 1000
"""Positions of an undamped run that a file stores unasked, at equal intervals of time, and of how many disks at the
most: seven megabytes."""

PENDING = "pending"
"""Of the checkpoint of a driven run: how many of the last frames are pending states."""


class Record:
    """The run.h5 of a scene, created or continued after an interruption.

    Frames are equilibria, or the states of a driven run with the observables `time` and `displacement`, whose F_x is
    the force of the spring.

    Parameters
    ----------
    path : Path
        The file.
    scene : Scene
        The scene; a file of another scene is refused.
    communicator : mpi4py.MPI.Comm, optional
        Rank 0 writes; all by default.
    task : {"ramp", "perturb", "drive"}
        Purpose of the file: a settled packing and its ramp, an undamped run, or a driven run. A file of another kind is
        refused.
    saved : callable, optional
        Called with a description of the contents and the path, each time the file has been saved.

    Attributes
    ----------
    last : Equilibrium or None
        The equilibrium from which the run goes on: the last one in the file, or the first state of a driven run.

    Raises
    ------
    SceneError
        If the file contains another scene, or is for another task.
    OutputError
        If the file cannot be written, or another run is writing it.
    """

    def __init__(
        self,
        path: Path,
        scene: Scene,
        communicator: MPI.Comm | None = None,
        task: Task = "ramp",
        saved: Callable[[str, Path], object] = lambda words, path: None,
    ) -> None:
        self.path, self.scene, self.task, self._said = path, scene, task, saved
        self.communicator = communicator or MPI.COMM_WORLD
        self._file: RunFile | None = None
        self._decided = 1  # frames of a driven run that are not pending
        with ExitStack() as alone:  # until the file is closed; at once after an error
            self.last: Equilibrium | None = raise_on_all_ranks(self.communicator, lambda: self._resume(alone))
            self._alone = alone.pop_all()

    def _resume(self, alone: ExitStack) -> Equilibrium | None:
        """Open the file, if it is there and of this scene and task; the equilibrium from which the run goes on."""
        check_output(self.path)
        alone.enter_context(lock_output(self.path))
        if not self.path.exists():
            return None
        file = RunFile(self.path, "a")
        stored, files = (json.loads(file.attributes.get(name, "{}")) for name in ("scene", "files"))
        task, cure = file.attributes.get("task", "ramp"), "give another name with -o, or delete it"
        difference = _difference(stored, self.scene.resolved(), self.task)
        for key, content in ({} if difference else self.scene.digests()).items():
            if files.get(key, content) != content:  # an older version kept none
                names = " and ".join(path.name for path in self.scene.files[key])
                difference = difference or f"{key}, {names}, has another content now"
        if difference:
            raise SceneError(f"{self.path} holds a run of another scene ({difference}): {cure}")
        if task != self.task:
            raise SceneError(f"{self.path} is a file of the command {task}: {cure}")
        if len(file) == 0:
            return None
        self._file = file
        self._say_saved()
        if task == "drive":
            return Equilibrium.of(file.packing(0))
        residual, floor, evaluations = (file.observable(name)[-1] for name in ("residual", "floor", "evaluations"))
        way = fallbacks(file).get(len(file) - 1)
        return Equilibrium(file.packing(), float(residual), float(floor), int(evaluations), way)

    @property
    def forces(self) -> Floats:
        """F_x of the equilibria in the file, force; the same on all ranks."""
        return raise_on_all_ranks(self.communicator, lambda: np.zeros(0) if self._file is None else self._file.fx)

    @property
    def complete(self) -> bool:
        """Whether the run is complete; the same on all ranks."""
        return bool(raise_on_all_ranks(self.communicator, lambda: self._file is not None and self._file.complete))

    @property
    def slips(self) -> int:
        """Slips of a driven run in the file so far; 0 on ranks that do not write."""
        return 0 if self._file is None else len(slips_in(self._file)[0])

    def finish(self) -> None:
        """Mark the run as complete."""
        if self._file is not None:
            with self._file.change():
                self._file.put_checkpoint()
                self._file.complete = True
            self._file.save()
            self._say_saved()

    def append(self, equilibrium: Equilibrium) -> None:
        """Write one equilibrium, or the packing from which a driven run starts."""
        self.last, packing = equilibrium, equilibrium.packing
        if self.communicator.rank != 0:
            return
        scene, files = self.scene.resolved(), self.scene.digests()
        if self._file is None:
            attributes: dict[str, str | int | float] = {
                "task": self.task,
                "scene": json.dumps(scene),
                "files": json.dumps(files),
                "seed": getattr(self.scene.packing, "seed", -1),
                "ranks": self.communicator.size,
                "solid_fraction": solid_fraction(packing),
                **{f"version_{name}": version(name) for name in ("faultgouge", "lammps", "numpy", "scipy", "h5py")},
            }
            self._file = RunFile.create(self.path, packing, attributes)
        file = self._file
        with file.change():
            file.complete = False
            known = {name: json.loads(file.attributes.get(name, "{}")) for name in ("scene", "files")}
            if (whole := json.dumps(known["scene"] | scene)) != file.attributes.get("scene"):
                file.put_attribute("scene", whole)  # a ramp goes on from a file of `settle`, or further
                file.put_attribute("files", json.dumps(files | known["files"]))
            if self.task == "drive":
                file.append(packing, time=0.0, displacement=0.0)
            else:
                file.append(packing, floor=equilibrium.floor, evaluations=equilibrium.evaluations)
            if equilibrium.way is not None:
                file.put_attribute("ways", json.dumps(fallbacks(file) | {len(file) - 1: equilibrium.way}))
        self._say_saved()

    def undamped(
        self, scene: Scene, start: Equilibrium, name: str = "undamped", weakening: Weakening | None = None
    ) -> Iterator[Sample]:
        """Run the undamped dynamics and write its samples to a time series; an interrupted run continues.

        Parameters
        ----------
        scene : Scene
            With a section [perturb].
        start : Equilibrium
            Where the run begins.
        name : str
            Name of the series.
        weakening : Weakening, optional
            As in `perturb`.

        Yields
        ------
        Sample
            First the samples that are already in the file.
        """
        dt, steps = sample_steps(require_section(scene.perturb, "perturb"), start.packing)
        known, checkpoint = raise_on_all_ranks(self.communicator, lambda: self._known(name, Sample))
        yield from known
        if len(known) == len(steps):
            return
        wanted, filmed = None if scene.output is None else scene.output.trajectory, steps
        if wanted is None:  # a film
            filmed = np.unique(steps[np.searchsorted(steps, np.linspace(0, steps[-1], STATES_OF_FILM + 1)[1:])])
            wanted = len(start.packing) <= DISKS_OF_FILM
        shown = {step * dt for step in filmed.tolist()} if wanted and name == "undamped" else set()
        samples, motions = list[Sample](), list[tuple[float, MotionState]]()

        def watch(time: float, motion: MotionState) -> None:
            motions.extend([(time, motion)] * (time in shown))

        def keep(reached: Checkpoint | None) -> None:
            self._keep(name, samples, reached, motions)
            samples.clear()
            motions.clear()

        options: dict[str, Any] = {"watch": watch, "keep": keep, "resume": checkpoint}
        for sample in perturb(scene, start, communicator=self.communicator, weakening=weakening, **options):
            samples.append(sample)
            yield sample
        keep(None)

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
        known, resume = raise_on_all_ranks(self.communicator, self._reached_in_drive)
        begins, time = require_section(self.scene.drive, "drive").at or 0.0, known[-1].time if resume else 0.0
        steps: list[DriveStep] = []

        def keep(reached: DriveCheckpoint | None) -> None:
            nonlocal time
            before, time = time, steps[-1].sample.time if steps else time
            if others and self._file is not None and before <= begins < time:  # in the part that is written now
                self._file.save()
                for path, scene in others.items():
                    with lock_output(path):
                        if not path.exists():
                            with replace_whole(path) as new:
                                shutil.copyfile(self.path, new)
                                with RunFile(new, "a") as other:
                                    other.put_attribute("scene", json.dumps(scene.resolved()))
            states, pending = [state for step in steps for state in step.states], reached.pending if reached else ()
            state = reached and Checkpoint(reached.step, reached.state | {PENDING: np.array(len(pending))})
            self._keep(SERIES, [step.sample for step in steps], state, states=[*states, *pending])
            self._decided += len(states)
            steps.clear()

        for step in drive(self.scene, self.last.packing, known, resume, keep, self.communicator):
            steps.append(step)
            yield step
        keep(None)

    def _reached_in_drive(self) -> tuple[list[DriveSample], DriveCheckpoint | None]:
        """Rows of the series so far, and where the driven run goes on."""
        known, reached = self._known(SERIES, DriveSample)
        if self._file is None or reached is None:
            return known, None
        self._decided = len(self._file) - int(reached.state.pop(PENDING, 0))
        times, moved = (self._file.observable(name).tolist() for name in ("time", "displacement"))
        frames = range(self._decided, len(self._file))
        states = tuple(DriveState(times[k], moved[k], self._file.packing(k)) for k in frames)
        return known, DriveCheckpoint(reached.step, reached.state, states)

    def _known(self, name: str, kind: Callable[..., S]) -> tuple[list[S], Checkpoint | None]:
        """Lines of a series so far, and the state after them."""
        if self._file is None or name not in self._file.names_of_series:
            return [], None
        columns, state = self._file.series(name), self._file.checkpoint
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        samples = [kind(**dict(zip(columns, row, strict=True))) for row in rows]
        return samples, Checkpoint(int(state.pop("step")), state) if state else None

    def _keep(
        self,
        name: str,
        samples: Sequence[Any],
        reached: Checkpoint | None,
        motions: Sequence[tuple[float, MotionState]] = (),
        states: Sequence[DriveState] | None = None,
    ) -> None:
        """Write what came since the last checkpoint together with this checkpoint: lines of a series, frames of a
        film, and states of a driven run in place of the pending ones."""
        file = self._file
        if file is None or not (samples or reached):
            return
        with file.change():
            file.complete = states is not None and reached is None
            if states is not None:
                file.cut(self._decided)
                for state in states:
                    file.append(state.packing, time=state.time, displacement=state.displacement)
            if samples:
                file.append_series(name, **{key: [vars(each)[key] for each in samples] for key in vars(samples[0])})
            if motions:
                times, seen = zip(*motions, strict=True)
                low = [motion.position_low for motion in seen if motion.position_low is not None]
                file.append_trajectory(times, [motion.position for motion in seen], low or None)
            if reached is None:
                file.put_checkpoint()
            else:
                file.put_checkpoint(step=reached.step, **reached.state)
        self._say_saved(f", and the series {name}" + (f" up to t = {samples[-1].time:g}" if samples else ""))

    def _say_saved(self, more: str = "") -> None:
        """Say what the stored file contains, if nothing is still to be written."""
        file = self._file
        if file is None or not file.saved or len(file) == 0:
            return
        if self.task == "drive":
            what = f"{counted(len(file), 'state')}, the last at t = {file.observable('time')[-1]:g}"
        else:
            what = f"{counted(len(file), 'equilibrium', 'equilibria')}, the last at F_x = {file.fx[-1]:g}"
        goes_on = ", and is complete" if file.complete else "; the same command continues from there"
        self._said(f"{self.path} holds {what}{more}{goes_on}", self.path)

    def __enter__(self) -> Record:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.save()
            self._say_saved()
            self._file.close()
        self._alone.close()


def fallbacks(file: RunFile) -> dict[int, str]:
    """Numbers of the equilibria that were not reached by halved increments, and the fallback of each."""
    return {int(number): way for number, way in json.loads(file.attributes.get("ways", "{}")).items()}


def raise_on_all_ranks(communicator: MPI.Comm, work: Callable[[], T]) -> T:
    """The result of rank 0, on all ranks; an error on rank 0 is raised on all ranks."""
    value, failure = None, None
    if communicator.rank == 0:
        try:
            value = work()
        except Exception as error:  # of whatever kind: the other ranks wait for it
            failure = error
    value, failure = communicator.bcast((value, failure))
    if failure is not None:
        raise failure
    return value


def _difference(stored: dict[str, Any], wanted: dict[str, Any], task: Task) -> str:
    """The first key in which two resolved scenes differ, ramp.until left aside: a ramp may be prolonged.

    Sections that the command of the file does not read are left aside, too, and those that a settled packing does not
    need and one of the two does not have, since a ramp goes on from a file of `settle`. A key that a file does not have
    because the file is older than the key has its default.
    """
    stored, wanted = COMMANDS[task].part(stored), COMMANDS[task].part(wanted)
    may_lack = {"relax", "ramp", "output"} if task == "ramp" else set()
    for section in sorted(stored.keys() | wanted.keys()):
        here, there = wanted.get(section), stored.get(section)
        if isinstance(here, dict) and isinstance(there, dict):
            fields = {key: field for model in SECTIONS.get(section, ()) for key, field in model.model_fields.items()}
            usual = {key: None if field.is_required() else field.default for key, field in fields.items()}
            for key in sorted((here.keys() | there.keys()) - ({"until"} if section == "ramp" else set())):
                old, new = (each.get(key, usual.get(key)) for each in (there, here))
                if old != new:
                    return f"{section}.{key} is {old} there and {new} here"
        elif here != there and not (section in may_lack and None in (here, there)):
            return f"{section} is {'there' if there is not None else 'missing there'}"
    return ""
