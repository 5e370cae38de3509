"""Write the run.h5 of a scene: a new file, or the file of an interrupted run."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from mpi4py import MPI

from ...analysis import RunFile, solid_fraction
from ...analysis.arrays import Floats, Indices
from ...analysis.files.atomic_write import check_output, lock_output
from ..equilibria.quasistatic import Equilibrium
from ..lammps.dynamics import MotionState, Weakening
from ..scenes.command_sections import COMMANDS
from ..scenes.scene import SECTIONS, Scene
from ..scenes.validation import SceneError
from .undamped import Checkpoint, Sample, perturb, sample_steps

R = TypeVar("R", bound="Record")
S = TypeVar("S")
T = TypeVar("T")
Task = Literal["ramp", "perturb", "drive"]

STATES_OF_FILM, DISKS_OF_FILM = 300, 1000
"""Positions of an undamped run that a file stores unasked, at equal intervals of time, and of how many disks at the
most: seven megabytes."""


class Record:
    """The run.h5 of a scene, created or continued after an interruption.

    Parameters
    ----------
    path : Path
        The file.
    scene : Scene
        The scene; a file of another scene is refused.
    communicator : mpi4py.MPI.Comm, optional
        Rank 0 writes; all by default.
    task : {"ramp", "perturb"}
        Purpose of the file: a settled packing and its ramp, or an undamped run. A file of the other kind is refused.
    saved : callable, optional
        Called with a description of the contents and the path, each time the file has been saved.

    Attributes
    ----------
    last : Equilibrium or None
        The last equilibrium in the file.
    remark : str
        On rank 0 what is not known of a file of an older version, in a sentence; empty for nothing.

    Raises
    ------
    SceneError
        If the file contains another scene, or is for another task.
    OutputError
        If the file cannot be written, or another run is writing it.
    """

    TASK: Task = "ramp"

    def __init__(
        self,
        path: Path,
        scene: Scene,
        communicator: MPI.Comm | None = None,
        task: Task | None = None,
        saved: Callable[[str, Path], object] = lambda words, path: None,
    ) -> None:
        self.path, self.scene, self.task = path, scene, task or self.TASK
        self.communicator = communicator or MPI.COMM_WORLD
        self.remark = ""
        self._file: RunFile | None = None
        self._said = saved
        self._alone = ExitStack()
        try:
            self.last: Equilibrium | None = raise_on_all_ranks(self.communicator, self._resume)
        except BaseException:
            self._alone.close()
            raise

    def _resume(self) -> Equilibrium | None:
        check_output(self.path)
        self._alone.enter_context(lock_output(self.path))
        if not self.path.exists():
            return None
        file = RunFile(self.path, "a")
        stored, files = (json.loads(file.attributes.get(name, "{}")) for name in ("scene", "files"))
        difference = _difference(stored, self.scene.resolved(), self.task) or self._other_files(files)
        if difference:
            raise SceneError(
                f"{self.path} holds a run of another scene ({difference}): give another name with -o, or delete it"
            )
        task = file.attributes.get("task", "ramp")
        if task != self.task:
            raise SceneError(f"{self.path} is a file of the command {task}: give another name with -o, or delete it")
        if len(file) == 0:
            return None
        self._file = file
        self._say_saved()
        return self._stored_equilibrium(file)

    def _other_files(self, stored: dict[str, str]) -> str:
        """The first file of the scene whose content is not that from which the run was made; empty if all are."""
        for key, content in self.scene.digests().items():
            names = " and ".join(path.name for path in self.scene.files[key])
            if key not in stored:
                self.remark = f"{self.path} does not say what {names} held ({key}) when it was begun: it may be another"
            elif stored[key] != content:
                return f"{key}, {names}, has another content now"
        return ""

    def _stored_equilibrium(self, file: RunFile) -> Equilibrium:
        """The equilibrium from which the run goes on: the last one."""
        row = {name: file.observable(name)[-1] for name in ("residual", "floor", "evaluations")}
        way = fallbacks(file).get(len(file) - 1)
        return Equilibrium(file.packing(), float(row["residual"]), float(row["floor"]), int(row["evaluations"]), way)

    @property
    def forces(self) -> Floats:
        """F_x of the equilibria in the file, force; the same on all ranks."""
        return raise_on_all_ranks(self.communicator, lambda: np.zeros(0) if self._file is None else self._file.fx)

    @property
    def complete(self) -> bool:
        """Whether the run is complete; the same on all ranks."""
        return bool(raise_on_all_ranks(self.communicator, lambda: self._file is not None and self._file.complete))

    def finish(self) -> None:
        """Mark the run as complete."""
        if self._file is not None:
            with self._file.change():
                self._file.put_checkpoint()
                self._file.complete = True
            self._file.save()
            self._say_saved()

    def append(self, equilibrium: Equilibrium) -> None:
        """Write one equilibrium."""
        if self.communicator.rank == 0:
            if self._file is None:
                attributes = self._attributes() | {"solid_fraction": solid_fraction(equilibrium.packing)}
                self._file = RunFile.create(self.path, equilibrium.packing, attributes)
            file = self._file
            with file.change():
                file.complete = False
                scene = json.dumps(json.loads(file.attributes.get("scene", "{}")) | self.scene.resolved())
                if scene != file.attributes.get("scene"):  # a ramp goes on from a file of `settle`, or further
                    file.put_attribute("scene", scene)
                    known = json.loads(file.attributes.get("files", "{}"))
                    file.put_attribute("files", json.dumps(self.scene.digests() | known))
                file.append(equilibrium.packing, floor=equilibrium.floor, evaluations=equilibrium.evaluations)
                if equilibrium.way is not None:
                    file.put_attribute("ways", json.dumps(fallbacks(file) | {len(file) - 1: equilibrium.way}))
            self._say_saved()
        self.last = equilibrium

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
        assert scene.perturb is not None
        dt, steps = sample_steps(scene.perturb, start.packing)
        known, checkpoint = raise_on_all_ranks(self.communicator, lambda: self._known(name, Sample))
        yield from known
        if len(known) == len(steps):
            return
        stored = _stored_steps(scene, len(start.packing), steps) if name == "undamped" else steps[:0]
        shown = {step * dt for step in stored.tolist()}
        samples: list[Sample] = []
        motions: list[tuple[float, MotionState]] = []

        run = perturb(
            scene,
            start,
            communicator=self.communicator,
            weakening=weakening,
            watch=lambda time, motion: motions.append((time, motion)) if time in shown else None,
            keep=lambda reached: self._keep(name, samples, motions, reached),
            resume=checkpoint,
        )
        for sample in run:
            samples.append(sample)
            yield sample
        self._keep(name, samples, motions, None)

    def _known(self, name: str, kind: Callable[..., S]) -> tuple[list[S], Checkpoint | None]:
        """Lines of a series so far, and the state after them."""
        if self._file is None or name not in self._file.names_of_series:
            return [], None
        columns = self._file.series(name)
        rows = zip(*(columns[key].tolist() for key in columns), strict=True)
        samples = [kind(**dict(zip(columns, row, strict=True))) for row in rows]
        state = self._file.checkpoint
        return samples, Checkpoint(int(state.pop("step")), state) if state else None

    def _keep(
        self, name: str, samples: list[Any], motions: list[tuple[float, MotionState]], reached: Checkpoint | None
    ) -> None:
        """Write the samples and motions since the last checkpoint, together with this checkpoint."""
        if self._file is not None and (samples or reached):
            with self._file.change():
                self._file.complete = False
                if samples:
                    columns = {key: [getattr(sample, key) for sample in samples] for key in vars(samples[0])}
                    self._file.append_series(name, **columns)
                if motions:
                    low = [motion.position_low for _, motion in motions if motion.position_low is not None]
                    times, positions = [time for time, _ in motions], [motion.position for _, motion in motions]
                    self._file.append_trajectory(times, positions, low or None)
                state: dict[str, Any] = {} if reached is None else {"step": reached.step, **reached.state}
                self._file.put_checkpoint(**state)
            self._say_saved(f", and the series {name}" + (f" up to t = {samples[-1].time:g}" if samples else ""))
        samples.clear()
        motions.clear()

    def _say_saved(self, more: str = "") -> None:
        """Say what the stored file contains, if nothing is still to be written."""
        file = self._file
        if file is None or not file.saved or len(file) == 0:
            return
        goes_on = ", and is complete" if file.complete else "; the same command continues from there"
        self._said(f"{self.path} holds {self._contents(file)}{more}{goes_on}", self.path)

    def _contents(self, file: RunFile) -> str:
        """The contents of the file, in words."""
        return f"{len(file)} equilibri{'um' if len(file) == 1 else 'a'}, the last at F_x = {file.fx[-1]:g}"

    def _attributes(self) -> dict[str, str | int | float]:
        return {
            "task": self.task,
            "scene": json.dumps(self.scene.resolved()),
            "files": json.dumps(self.scene.digests()),
            "seed": getattr(self.scene.packing, "seed", -1),
            "ranks": self.communicator.size,
            **{f"version_{name}": version(name) for name in ("faultgouge", "lammps", "numpy", "scipy", "h5py")},
        }

    def __enter__(self: R) -> R:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.save()
            self._say_saved()
            self._file.close()
        self._alone.close()


def _stored_steps(scene: Scene, disks: int, steps: Indices) -> Indices:
    """The steps at which an undamped run stores positions: some of the steps of its samples."""
    wanted = None if scene.output is None else scene.output.trajectory
    if wanted or wanted is False or disks > DISKS_OF_FILM:
        return steps if wanted else steps[:0]
    times = np.linspace(0, steps[-1], STATES_OF_FILM + 1)[1:]
    return np.unique(steps[np.searchsorted(steps, times)])


def fallbacks(file: RunFile) -> dict[int, str]:
    """Numbers of the equilibria that were not reached by halved increments, and the fallback of each."""
    return {int(number): way for number, way in json.loads(file.attributes.get("ways", "{}")).items()}


def raise_on_all_ranks(communicator: MPI.Comm, work: Callable[[], T]) -> T:
    """The result of rank 0, on all ranks; an error on rank 0 is raised on all ranks."""
    result: tuple[T | None, Exception | None] = (None, None)
    if communicator.rank == 0:
        try:
            result = work(), None
        except Exception as error:  # of whatever kind: the other ranks wait for it
            result = None, error
    value, failure = communicator.bcast(result)
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
        here, there = stored.get(section), wanted.get(section)
        if section in may_lack and (here is None or there is None):
            continue
        if isinstance(here, dict) and isinstance(there, dict):
            fields = {key: field for model in SECTIONS.get(section, ()) for key, field in model.model_fields.items()}
            usual = {key: field.default for key, field in fields.items() if not field.is_required()}
            for key in sorted(here.keys() | there.keys()):
                old, new = (each.get(key, usual.get(key)) for each in (here, there))
                if (section, key) != ("ramp", "until") and old != new:
                    return f"{section}.{key} is {old} there and {new} here"
        elif here != there:
            return f"{section} is {'there' if here is not None else 'missing there'}"
    return ""
