"""Write the drive.h5 of a scene: the states of a driven run, its series and its slips."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from mpi4py import MPI

from ...analysis import RunFile
from ...analysis.motion.slips import Slip, find_slips
from ..equilibria.quasistatic import Equilibrium
from ..scenes.scene import Scene
from ..scenes.validation import require_section
from .drive import DriveSample, DriveState, DriveStep, drive, layer_period
from .run_recorder import Record, raise_on_all_ranks
from .undamped import Checkpoint

SERIES = "drive"
"""Name of the series in the file."""


class DriveRecord(Record):
    """The drive.h5 of a scene, created or continued after an interruption; parameters as of `Record`.

    Its frames are states of the run, with the observables `time` and `displacement`. F_x of a frame is the force of the
    spring.
    """

    def __init__(
        self,
        path: Path,
        scene: Scene,
        communicator: MPI.Comm | None = None,
        saved: Callable[[str, Path], object] = lambda words, path: None,
    ) -> None:
        super().__init__(path, scene, communicator, "drive", saved)

    def _stored_equilibrium(self, file: RunFile) -> Equilibrium:
        return Equilibrium.of(file.packing(0))

    def append(self, equilibrium: Equilibrium) -> None:
        """Write the packing from which the run starts."""
        if self.communicator.rank == 0:
            self._file = RunFile.create(self.path, equilibrium.packing, self._attributes())
            self._append_states([DriveState(0.0, 0.0, equilibrium.packing)])
            self._file.save()
        self.last = equilibrium

    def drive(self) -> Iterator[DriveStep]:
        """Run the scene's drive and write its rows and states; an interrupted run continues.

        Yields
        ------
        DriveStep
            Those that are not in the file yet.
        """
        assert self.last is not None
        if self.complete:
            return
        known, checkpoint = raise_on_all_ranks(self.communicator, lambda: self._known(SERIES, DriveSample))
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

    def _keep_steps(self, steps: list[DriveStep], reached: Checkpoint | None) -> None:
        if self._file is not None:
            with self._file.change():
                self._append_states([state for step in steps for state in step.states])
                self._keep(SERIES, [step.sample for step in steps], [], reached)
        steps.clear()

    def _append_states(self, states: list[DriveState]) -> None:
        assert self._file is not None
        for state in states:
            self._file.append(state.packing, time=state.time, displacement=state.displacement)


def slips_in(file: RunFile, scene: Scene) -> list[Slip]:
    """The slips in the series of a drive.h5 of a scene."""
    settings = require_section(scene.drive, "drive")
    period = layer_period(settings, file.packing(0))
    if period is None or SERIES not in file.names_of_series:
        return []
    series = file.series(SERIES)
    return find_slips(
        series["time"],
        series["force"],
        series["displacement"],
        series["kinetic_energy"],
        settings.fastest,
        period,
    )
