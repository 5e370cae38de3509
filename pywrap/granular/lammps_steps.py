"""Steps of LAMMPS itself from small velocities, and its forces after a displacement, in copies of the process.

Drag is left out, and fixes that write are closed; all other fixes of the instance act.
"""

from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...analysis import Configuration
from ...analysis.arrays import Floats
from .acting_fixes import acting_fixes
from .granular_commands import BODIES
from .instance_queries import styles_of
from .lammps_arrays import owned_array, rows_of, set_velocity
from .look_in_a_copy import in_a_copy, quieten

COMMON_MULTIPLE = 2**12 * 5**9 * 3**4 * 7 * 11 * 13
"""A time step that is a multiple of the intervals that people write: some fixes act every so many steps alone."""

STILL_STEP = 1e-12
"""A step in which nothing moves, as a share of the others."""


class Steps(NamedTuple):
    """The end of some steps of LAMMPS.

    `velocity` has the velocities of the coordinates, shape (axes N,); `force_change` by how much a common displacement
    of all particles changes each force (F, T/R) at rest, shape (axes N,), or None if none was asked for. It is the
    smaller change of the displacements of both signs, one of which may bring particles to walls.
    """

    velocity: Floats
    force_change: Floats | None


def steps_in_a_copy(
    lmp: Any,
    configuration: Configuration,
    velocity: Floats,
    timestep: float,
    steps: int,
    *,
    displacement: Floats | None = None,
    without: tuple[str, ...] = (),
) -> Steps:
    """Some steps of LAMMPS from velocities of the coordinates.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance.
    configuration : Configuration
        Its packing.
    velocity : ndarray, shape (axes N,)
        Length / time.
    timestep : float
        Of LAMMPS.
    steps : int
        Their number.
    displacement : ndarray, shape (3,), optional
        A displacement of all particles after the steps.
    without : tuple of str
        IDs of fixes that are left out, besides drag and what writes.
    """
    return in_a_copy(partial(_take_steps, lmp, configuration, velocity, timestep, steps, displacement, without))


def set_up_run(lmp: Any) -> None:
    """Set up a run, which goes on without a set-up of its own.

    At a set-up fix rigid does not know what later fixes add to the forces, and pushes its bodies in the first step: in
    this step nothing moves.
    """
    if not any(style.startswith(BODIES) for style in styles_of(lmp).fixes.values()):
        lmp.command("run 0 post no")
        return
    timestep = float(lmp.extract_global("dt"))
    lmp.command(f"timestep {STILL_STEP * timestep:.17g}")
    try:
        lmp.command("run 1 post no")
    finally:
        lmp.command(f"timestep {timestep:.17g}")


def _take_steps(
    lmp: Any,
    configuration: Configuration,
    velocity: Floats,
    timestep: float,
    steps: int,
    displacement: Floats | None,
    without: tuple[str, ...],
) -> Steps:
    _leave_out(lmp, configuration, without)
    if acting_fixes(styles_of(lmp).fixes):
        with suppress(Exception):  # where the load depends on the time
            lmp.command(f"reset_timestep {COMMON_MULTIPLE - steps // 2}")
    set_velocity(lmp, configuration, velocity)
    lmp.command(f"timestep {timestep:.17g}")
    set_up_run(lmp)
    lmp.command(f"run {steps} pre no post no")
    rows = rows_of(lmp, configuration)
    rotation = owned_array(lmp, "omega")[rows] * configuration.radius[:, None]
    end = configuration.join_vectors(owned_array(lmp, "v")[rows], rotation)
    if displacement is None:
        return Steps(end, None)
    set_velocity(lmp, configuration, np.zeros(configuration.coordinates))
    lmp.command(f"timestep {STILL_STEP * timestep:.17g}")
    before = _forces_after(lmp, configuration, "run 0 post no")
    # within one run: a spring of fix smd begins where a run begins
    changes = []
    for way in (displacement, -2 * displacement):
        owned_array(lmp, "x")[:] += way
        changes.append(np.abs(_forces_after(lmp, configuration, "run 1 pre no post no") - before))
    return Steps(end, np.minimum(*changes))


def _forces_after(lmp: Any, configuration: Configuration, run: str) -> Floats:
    """Forces (F, T/R) on the coordinates at the end of a run, shape (axes N,)."""
    lmp.command(run)
    rows = rows_of(lmp, configuration)
    torque = owned_array(lmp, "torque")[rows] / configuration.radius[:, None]
    return configuration.join_vectors(owned_array(lmp, "f")[rows], torque)


def _leave_out(lmp: Any, configuration: Configuration, without: tuple[str, ...]) -> None:
    """Close the log and all that writes, and leave out drag and some fixes; what moves particles by drag alone moves
    them by their inertia."""
    lmp.command("log none")
    styles = styles_of(lmp)
    quieten(lmp, drag=True)
    factor = (configuration.inertia / (configuration.mass * configuration.radius**2))[configuration.free].mean()
    for name, style in styles.fixes.items():
        if style == "overdamped/disc":
            lmp.command(f"fix {name} {styles.groups[name]} nve/disc {factor:.17g}")
    for name in without:
        lmp.command(f"unfix {name}")
