"""Driven runs: a spring draws the upper layer of a settled packing, which sticks and slips.

The run starts at rest, in equilibrium at F_x = 0, with the spring relaxed. In time steps of the deck part undamped.in
LAMMPS follows the motion of all disks with the damping of the scene (deck parts spring.in, dashpots.in, drag.in). A
part of the run ends after each of the scene's `drive.states`; there the run resumes its own state, as the deck drive.in
sets LAMMPS up anew, so that a run that is continued, and the deck, are bitwise the same. All functions are collective
over the ranks of the communicator.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from warnings import warn

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ...analysis import FaultgougeError, Packing
from ...analysis.arrays import Floats
from ..lammps.dynamics import Dynamics
from ..lammps.engine import Engine
from ..lammps.instance import EngineError
from ..scenes.scene import Scene
from ..scenes.validation import require_section
from .drive_plan import Plan, slip_detector
from .drive_setup import check_drive, driven, settle_for_drive
from .drive_states import DriveCheckpoint, DriveSample, DriveState, DriveStep, PendingStates
from .run_iterator import run_of_scene

DILATION_LIMIT = 1.5
"""Height of the layer, in units of that at the beginning, above which it has left the bed."""


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
    """
    settings = require_section(scene.drive, "drive")
    if start is None:
        start = settle_for_drive(scene, communicator)
        for warning in check_drive(scene, start, communicator):
            warn(warning, stacklevel=2)
    with driven(settings, start, communicator) as (engine, dynamics):
        plan = Plan.of(settings, start, dynamics.time_step)
        detector = slip_detector(settings, start)
        slips = sum(row.given_to(detector) is not None for row in known) if detector else 0
        pending, last = PendingStates(detector, plan.is_even, resume.pending if resume else ()), 0
        if resume is not None:
            last = resume.step
            dynamics.resume(last, resume.state)
        for step in plan.steps(last):
            sample, state = _advance(engine, dynamics, step - last, step * plan.dt, start)
            last = step
            slip = sample.given_to(detector) if detector else None
            slips += slip is not None
            is_over = step == plan.total or slips == settings.slips
            yield DriveStep(sample, slip, pending.take(state, slip, is_over))
            if is_over:
                return
            if step % plan.part == 0:
                dynamics.stop_strays()
                reached = dynamics.state()
                dynamics.resume(step, reached)  # as a run does that is continued from here
                if keep is not None:
                    keep(DriveCheckpoint(step, reached, pending.states))


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
    try:
        motion = dynamics.advance(steps)
    except EngineError as error:
        slower = "a slower drive, a softer spring or a smaller drive.scale"
        raise EngineError(f"the run has ended before t = {time:g}: take {slower}, as {error}") from error
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
