"""Write the drive.h5 of a scene: the states of a driven run, its series and its slips."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.special import stdtrit

from ...analysis import RunFile
from ...analysis.files.atomic_write import lock_output, replace_whole
from ...analysis.motion.slips import Slip, find_slips
from ..equilibria.quasistatic import Equilibrium
from ..scenes.drive_section import Drive
from ..scenes.scene import Scene
from .drive import drive
from .drive_plan import layer_period
from .drive_states import DriveCheckpoint, DriveSample, DriveState, DriveStep
from .run_recorder import Record, raise_on_all_ranks
from .undamped import Checkpoint

SERIES = "drive"
"""Name of the series in the file."""

PENDING = "pending"
"""Of a checkpoint in the file: how many of the last frames are pending states of the run, which the next part replaces
by those of them that are stored in the end."""

NOISES = 3
"""Runs with noise beside one with a signal. Of the advances by noise in research/cycle, the largest that one run has
covers 71 of 100 of the others of the same slip, and the error by three of them 96."""

CONFIDENCE = 0.95
"""Of the error of a clock advance."""

COMPARABLE = 0.5
"""Least force drop of a slip with a signal that is compared with one without, in units of the drop of the latter."""


class DriveRecord(Record):
    """The drive.h5 of a scene, created or continued after an interruption; parameters as of `Record`, on all ranks.

    Its frames are states of the run, with the observables `time` and `displacement`. F_x of a frame is the force of the
    spring.
    """

    def __init__(
        self,
        path: Path,
        scene: Scene,
        saved: Callable[[str, Path], object] = lambda words, path: None,
    ) -> None:
        super().__init__(path, scene, task="drive", saved=saved)
        self._others: Mapping[Path, Scene] = {}
        self._step, self._decided = 0, 1

    def _stored_equilibrium(self, file: RunFile) -> Equilibrium:
        return Equilibrium.of(file.packing(0))

    def _contents(self, file: RunFile) -> str:
        return f"{len(file)} state{'s' * (len(file) != 1)}, the last at t = {file.observable('time')[-1]:g}"

    def append(self, equilibrium: Equilibrium) -> None:
        """Write the packing from which the run starts."""
        if self.communicator.rank == 0:
            self._file = RunFile.create(self.path, equilibrium.packing, self._attributes())
            self._append_states([DriveState(0.0, 0.0, equilibrium.packing)])
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
        known, checkpoint = raise_on_all_ranks(self.communicator, self._reached)
        self._others, self._step = others or {}, 0 if checkpoint is None else checkpoint.step
        steps: list[DriveStep] = []
        run = drive(
            self.scene,
            self.last.packing,
            known,
            checkpoint,
            lambda reached: self._keep_steps(steps, reached),
            self.communicator,
        )
        for step in run:
            steps.append(step)
            yield step
        self._keep_steps(steps, None)

    def _reached(self) -> tuple[list[DriveSample], DriveCheckpoint | None]:
        """Rows of the series so far, and where the run goes on."""
        known, reached = self._known(SERIES, DriveSample)
        if self._file is None or reached is None:
            return known, None
        begin = len(self._file) - int(reached.state.pop(PENDING, 0))
        times, moved = (self._file.observable(name) for name in ("time", "displacement"))
        frames = range(begin, len(self._file))
        states = [DriveState(float(times[k]), float(moved[k]), self._file.packing(k)) for k in frames]
        self._decided = begin
        return known, DriveCheckpoint(reached.step, reached.state, tuple(states))

    def _keep_steps(self, steps: list[DriveStep], reached: DriveCheckpoint | None) -> None:
        if self._file is not None:
            decided = [state for step in steps for state in step.states]
            pending = () if reached is None else reached.pending
            with self._file.change():
                self._put_states([*decided, *pending])
                self._decided += len(decided)
                stored = reached and Checkpoint(reached.step, reached.state | {PENDING: np.array(len(pending))})
                self._keep(SERIES, [step.sample for step in steps], [], stored)
                self._file.complete = reached is None  # in one change with the last rows
            if reached is not None and self._others:
                self._divide(steps[-1].sample.time, reached.step)
        steps.clear()

    def _divide(self, time: float, step: int) -> None:
        """Make the files of the other scenes at the end of a part, if the signal begins in the next one."""
        assert self._file is not None
        assert self.scene.drive is not None
        part, self._step = time * (step - self._step) / step, step
        if not time <= (self.scene.drive.at or 0.0) < time + part:
            return
        self._file.save()
        for path, scene in self._others.items():
            with lock_output(path):
                if not path.exists():
                    with replace_whole(path) as new:
                        shutil.copyfile(self.path, new)
                        with RunFile(new, "a") as file:
                            file.put_attribute("scene", json.dumps(scene.resolved()))

    def _put_states(self, states: Sequence[DriveState]) -> None:
        """Write states behind the decided ones; those that are pending in the file already stay."""
        assert self._file is not None
        there = self._file.observable("time")[self._decided :]
        same = next((k for k, (time, state) in enumerate(zip(there, states, strict=False)) if time != state.time), None)
        kept = min(len(there), len(states)) if same is None else same
        self._file.cut(self._decided + kept)
        self._append_states(states[kept:])

    def _append_states(self, states: Iterable[DriveState]) -> None:
        assert self._file is not None
        for state in states:
            self._file.append(state.packing, time=state.time, displacement=state.displacement)


def drive_of(file: RunFile) -> Drive | None:
    """The section [drive] of the scene of a drive.h5; None of another file."""
    if file.attributes.get("task") != "drive":
        return None
    return Drive.model_validate(json.loads(file.attributes["scene"])["drive"])


def slips_in(file: RunFile) -> list[Slip]:
    """The slips in the series of a drive.h5 that have ended."""
    return all_slips_in(file)[0]


def all_slips_in(file: RunFile) -> tuple[list[Slip], Slip | None]:
    """The slips in the series of a drive.h5, with the slip that is under way at its end."""
    settings = drive_of(file)
    if settings is None:
        return [], None
    period = layer_period(settings, file.packing(0))
    if period is None or SERIES not in file.names_of_series:
        return [], None
    series = file.series(SERIES)
    return find_slips(
        series["time"],
        series["force"],
        series["displacement"],
        series["kinetic_energy"],
        settings.fastest,
        period,
    )


def clock_advance(path: Path, other: Path) -> float | None:
    """How much earlier the next slip after a signal begins than in another run without the signal, time.

    Slips whose force drop is below `COMPARABLE` of that of the next slip without the signal are left out: a strong
    signal makes small slips at once, which leave the next large one where it was.

    Parameters
    ----------
    path : Path
        A drive.h5 with a signal.
    other : Path
        The drive.h5 of the same scene without the signal.

    Returns
    -------
    float or None
        None if one of the two has no slip after the signal has begun.
    """
    with RunFile(path) as with_signal, RunFile(other) as without:
        settings = drive_of(with_signal)
        assert settings is not None
        return advance_of(slips_in(with_signal), slips_in(without), settings.at or 0.0)


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


def advance_of(slips: Sequence[Slip], without: Sequence[Slip], at: float) -> float | None:
    """The same of the slips of two runs, with a signal that begins at a time, and without."""
    due = next((slip for slip in without if slip.ends > at), None)
    if due is None:
        return None
    after = (slip for slip in slips if slip.ends > at)
    begins = (slip.begins for slip in after if abs(slip.force_drop) >= COMPARABLE * abs(due.force_drop))
    first = next(begins, None)
    return None if first is None else due.begins - first
