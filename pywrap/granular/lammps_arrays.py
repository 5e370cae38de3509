"""Particles, forces and contacts of a LAMMPS instance as arrays.

On several ranks, or with threads, the process cannot be copied, and LAMMPS itself runs the zero steps in which contacts
are handed out. These may move particles to other ranks, wrap or round coordinates, and change histories. `given_back`
restores coordinates, velocities and forces to the bit, and by fix keep/histories of the plugin the histories, too.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...analysis import Configuration
from ...analysis.arrays import Floats, Indices
from ..lammps.instance import load_plugin
from .granular_commands import BODIES, NotTakenError
from .look_in_a_copy import communicator, styles_of

Arrays = dict[str, Any]

ATOM_ARRAYS = ("x", "image", "v", "omega", "f", "torque")
"""Arrays that `given_back` restores."""

NO_FORCE = 1.2345678e300
"""A number that is no force."""

STILL_STEP = 1e-12
"""A step in which nothing moves, as a share of the others."""


def owned_array(lmp: Any, name: str) -> Floats:
    """An array of the particles of this rank, as LAMMPS has it."""
    count = lmp.extract_setting("nlocal")
    values = lmp.numpy.extract_atom(name)
    return np.zeros((0, 3)) if values is None else values[:count]


def rows_of(lmp: Any, configuration: Configuration) -> Indices:
    """Rows of LAMMPS's arrays on one rank, in the order of the particles of a configuration."""
    ids = owned_array(lmp, "id")
    rows = np.argsort(ids)
    if not np.array_equal(ids[rows], configuration.ids):
        raise NotTakenError("The instance has other particles than the configuration: take a new one.")
    return rows


def set_velocity(lmp: Any, configuration: Configuration, velocity: Floats) -> None:
    """Give the particles the velocities of their coordinates, shape (axes N,)."""
    rows = rows_of(lmp, configuration)
    translation, rotation = configuration.vectors(velocity)
    owned_array(lmp, "v")[rows] = translation
    owned_array(lmp, "omega")[rows] = rotation / configuration.radius[:, None]


def on_coordinates(lmp: Any, c: Configuration, along: str, around: str) -> Floats:
    """Two arrays of LAMMPS on the coordinates, shape (axes N,): v and R omega, or F and T/R."""
    rows = rows_of(lmp, c)
    turns = owned_array(lmp, around)[rows]
    turns = turns * c.radius[:, None] if around == "omega" else turns / c.radius[:, None]
    return c.join_vectors(owned_array(lmp, along)[rows], turns)


def set_up_run(lmp: Any) -> None:
    """Set up a run, which goes on without a set-up of its own.

    At a set-up fix rigid does not know what later fixes add to the forces, and pushes its bodies in the first step: in
    this step nothing moves.
    """
    if not has_bodies(lmp):
        lmp.command("run 0 post no")
        return
    timestep = float(lmp.extract_global("dt"))
    lmp.command(f"timestep {STILL_STEP * timestep:.17g}")
    try:
        lmp.command("run 1 post no")
    finally:
        lmp.command(f"timestep {timestep:.17g}")


def has_bodies(lmp: Any) -> bool:
    """Whether a fix rigid moves particles."""
    return any(style.startswith(BODIES) for style in styles_of(lmp).fixes.values())


def arrays_at_rest(lmp: Any, groups: dict[str, str], walls: list[str], columns: str) -> Arrays:
    """Particles, forces and contacts of this rank after zero steps at rest; who is in the groups of some fixes, and the
    columns that walls hand out. `v` and `omega` are the velocities before."""
    moves = {name: np.array(owned_array(lmp, name)) for name in ("v", "omega")}
    for name in moves:
        owned_array(lmp, name)[:] = 0.0
    lmp.command(f"compute faultgouge_c all pair/local {columns} cutoff radius")
    lmp.command("compute faultgouge_i all property/local patom1 patom2 cutoff radius")
    try:
        _run_zero_steps(lmp)
        names = ("id", "type", "x", "f", "torque", "radius", "rmass")
        found: Arrays = moves | {name: np.array(owned_array(lmp, name)) for name in names}
        for name, key in (("c", "contacts"), ("i", "partners")):
            local = lmp.numpy.extract_compute(f"faultgouge_{name}", 2, 2)
            found[key] = np.zeros((0, 1)) if local is None else np.array(local)
        count = len(found["id"])
        for fix, group in groups.items():
            lmp.command(f"variable faultgouge_g atom gmask({group})")
            found[f"group {fix}"] = np.array(lmp.numpy.extract_variable("faultgouge_g", "all", 1))[:count] > 0
            lmp.command("variable faultgouge_g delete")
        for wall in walls:
            rows = lmp.numpy.extract_fix(wall, 1, 2)
            found[f"wall {wall}"] = np.zeros((0, 8)) if count == 0 else np.array(rows)[:count]
        return found
    finally:
        for name in ("faultgouge_c", "faultgouge_i"):
            lmp.command(f"uncompute {name}")


def forces_in_order(lmp: Any, ids: Indices, name: str = "f") -> Floats:
    """Forces, or torques, on the particles of these IDs, all that there are on this rank."""
    order = np.argsort(owned_array(lmp, "id"))[np.argsort(np.argsort(ids))]
    return np.array(owned_array(lmp, name)[order])


def _run_zero_steps(lmp: Any) -> None:
    """Run zero steps, even where LAMMPS skips runs without a word, since fix halt or timer timeout has ended one.

    The forces tell whether LAMMPS has run.
    """
    owned_array(lmp, "f")[:] = NO_FORCE
    lmp.command("run 0 post no")
    if communicator(lmp).allreduce(int(np.any(owned_array(lmp, "f") == NO_FORCE))) == 0:
        return
    lmp.command("timer timeout unlimited")
    try:
        lmp.command("run 0 post no")
    finally:
        lmp.command("timer timeout 0")


@contextmanager
def given_back(lmp: Any) -> Iterator[None]:
    """Give all that moves, and histories, back to the instance at the end of a with block."""
    load_plugin(lmp)
    kept = {name: np.array(owned_array(lmp, name)) for name in ("id", *ATOM_ARRAYS)}
    world = communicator(lmp)
    whole = {name: np.concatenate(world.allgather(values)) for name, values in kept.items()}
    order = np.argsort(whole["id"])
    lmp.command("fix faultgouge_h all keep/histories")
    try:
        yield
        # lists of neighbours as they were: where others were asked for since, write_restart forgets histories
        _run_zero_steps(lmp)
    finally:
        place = order[np.searchsorted(whole["id"][order], owned_array(lmp, "id"))] if len(order) else order
        for name in ATOM_ARRAYS:
            owned_array(lmp, name)[:] = whole[name][place]
        lmp.command("fix_modify faultgouge_h restore")
        lmp.command("unfix faultgouge_h")
