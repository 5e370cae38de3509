"""Particles of a LAMMPS instance on one rank as arrays."""

from typing import Any

import numpy as np

from ...analysis import Configuration
from ...analysis.arrays import Floats, Indices
from .granular_commands import BODIES, NotTakenError
from .look_in_a_copy import styles_of

STILL_STEP = 1e-12
"""A step in which nothing moves, as a share of the others."""


def owned_array(lmp: Any, name: str) -> Floats:
    """An array of the particles, as LAMMPS has it."""
    values = lmp.numpy.extract_atom(name)
    return np.zeros((0, 3)) if values is None else values[: lmp.extract_setting("nlocal")]


def by_id(lmp: Any, *names: str) -> list[Any]:
    """Copies of arrays, in the order of the particles' IDs."""
    order = np.argsort(owned_array(lmp, "id"))
    return [np.array(owned_array(lmp, name)[order]) for name in names]


def rows_of(lmp: Any, configuration: Configuration) -> Indices:
    """Rows of LAMMPS's arrays, in the order of the particles of a configuration."""
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


def has_bodies(lmp: Any) -> bool:
    """Whether a fix rigid moves particles."""
    return any(style.startswith(BODIES) for style in styles_of(lmp).fixes.values())


def set_up_run(lmp: Any) -> None:
    """Set up a run, which goes on without a set-up of its own. At a set-up fix rigid does not know what later fixes add
    to the forces, and pushes its bodies in the first step: in this step nothing moves."""
    if not has_bodies(lmp):
        lmp.command("run 0 post no")
        return
    timestep = float(lmp.extract_global("dt"))
    lmp.command(f"timestep {STILL_STEP * timestep:.17g}")
    try:
        lmp.command("run 1 post no")
    finally:
        lmp.command(f"timestep {timestep:.17g}")
