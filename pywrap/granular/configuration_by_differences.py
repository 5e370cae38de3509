"""A Configuration whose K and C are differences of LAMMPS's own forces, whatever exerts them."""

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from ...analysis import Configuration, LinearisedContacts
from ...analysis.arrays import Floats, derive_frozen
from .balance import TWICE, force_scale, touch_twice
from .configuration_by_laws import OneLaw, contacts_of_pairs
from .force_differences import measure_operators
from .granular_commands import BODIES, OWN, Commands, NotTakenError, without_suffix
from .instance_queries import open_files
from .lammps_arrays import Arrays
from .look_in_a_copy import in_a_copy
from .looks import box_of, look, members_of, particles_of
from .mobility import mobility

NORMAL_PART = 1e-6
"""Part of a tangential force along the normal, as a share of all that is handed out: rounding leaves 1e-10 or less."""


class Still(NamedTuple):
    """Particles as they stand, without K and C: both are empty.

    `constraint` is P of q = P Q, which the configuration has only where P says more than which particles are free.
    `commands` and `fixes` are those of the instance, and so are `velocity` and `rotation`, shape (N, 3).
    """

    configuration: Configuration
    constraint: csr_array
    commands: Commands
    fixes: dict[str, str]
    velocity: Floats
    rotation: Floats


def configuration_by_differences(lmp: Any, still: Still) -> Configuration:
    """The configuration with K and C, of an instance on one rank.

    Its contacts are those of pairs that touch, with their forces as far as LAMMPS hands them out.
    """
    made, lines = still.configuration, still.commands.fixes
    bodies = tuple(lines[name] for name, style in still.fixes.items() if without_suffix(style) in BODIES)
    measured = measure_operators(lmp, made, still.constraint, bodies, force_scale(made) or None)
    return derive_frozen(
        made,
        stiffness=measured.stiffness,
        damping=measured.damping,
        operator_error=measured.error,
        jump=measured.jump,
    )


def still_particles(lmp: Any, given: Commands | None) -> Still:
    """The particles of an instance, and what moves or holds them."""
    files = open_files()
    columns = ["dx dy dz force p1 p2 p3", "dx dy dz force", "dx dy dz"]
    while True:  # not every pair style hands all of these out
        try:
            commands, fixes, found = in_a_copy(partial(look, lmp, given, files, columns[0]))
            break
        except NotTakenError:
            columns.pop(0)
            if not columns:
                raise
    count, dimension = len(found["id"]), lmp.extract_setting("dimension")
    if count == 0:
        raise NotTakenError("This LAMMPS has no particles.")
    members = members_of(found)
    lines = {name: line for name, line in commands.fixes.items() if name in members}
    moved = mobility(lines, members, found["rmass"], dimension)
    empty = csr_array(moved.constraint.shape)
    made = Configuration(
        **particles_of(lmp, found, moved.free, moved.factor),
        contacts=_forces_of_pairs(found, box_of(lmp)[0], commands.style),
        stiffness=empty,
        damping=empty,
        wall_force=found["at walls"],
        constraint=moved.needed,
    )
    total = np.stack([found["f"], found["torque"]], axis=1)
    load = np.where(made.free[:, None, None], total, 0.0) - made.contact_force
    return Still(derive_frozen(made, load=load), moved.constraint, commands, fixes, found["v"], found["omega"])


def _forces_of_pairs(found: Arrays, box: Floats, style: str) -> LinearisedContacts:
    """Pairs that touch, with their forces alone: derivatives are zero, and no bound is known."""
    pairs = contacts_of_pairs(found, box)
    count, columns = pairs.forces.shape
    if columns == 0:
        pairs = OneLaw(pairs.who, {name: values[:0] for name, values in pairs.geometry.items()}, np.zeros((0, 4)))
        count = 0
    none, still = np.zeros(count), np.zeros((count, 3))
    tangential = pairs.forces[:, 1:4] if columns >= 4 else still
    along = np.abs(np.einsum("ca,ca->c", tangential, pairs.geometry["normal"]))
    if np.any(along > NORMAL_PART * np.abs(pairs.forces).sum(axis=1)):
        if touch_twice(pairs.geometry["i"], pairs.geometry["j"]):
            raise NotTakenError(f"The packing cannot rest: {TWICE}.")
        tangential = still  # this pair style hands out something else
    made = LinearisedContacts(
        **pairs.geometry, lever_arm=pairs.geometry["slip_arm"], lever_slope=none, normal_force=pairs.forces[:, 0],
        tangential_force=tangential, normal_stiffness=none, tangential_stiffness=none, closing=still, parting=still,
        friction=np.full(count, np.inf), sliding=np.zeros(count, bool), normal_dashpot=none, tangential_dashpot=none,
        viscous_slider=np.full(count, style != OWN),
    )  # fmt: skip
    return made.chosen(made.normal_force != 0)
