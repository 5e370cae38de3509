"""Is a packing at rest? Forces that are out of balance, and the reasons if nothing moves all the same."""

from functools import partial
from typing import Any

import numpy as np

from ...analysis import BadInputError, Configuration, LinearisedContacts
from ...analysis.arrays import Floats, Indices
from ...analysis.counted import counted
from .granular_commands import OWN, Commands, NotTakenError, without_suffix
from .look_in_a_copy import in_a_copy, quieten

BALANCE = 1e-4
"""Share of the mean contact force that may be out of balance. Beyond, the packing moves to another place of rest, and K
says nothing of this motion."""


HELD_SPEED = 1e-12
"""Speed of a particle that nothing moves, in radii a time step, from which on its contacts are driven: in a million
steps they slip by a millionth of a radius, a hundredth of a small overlap."""


def check_balance(balance: float) -> None:
    """Refuse a residual that is no number from 0 on: every packing would be at rest, or none."""
    if not balance >= 0:
        raise BadInputError(f"balance = {balance:g} is refused: give a share of the mean contact force, from 0 on.")


def force_scale(configuration: Configuration) -> float:
    """The mean normal force of contacts, and of walls whose contacts are not known, by particle; where nothing is
    known, the force of an overlap of 1e-4 of a radius."""
    at_walls = configuration.wall_force
    forces = np.concatenate([np.abs(configuration.contacts.touching.normal_force), at_walls[at_walls > 0]])
    if len(forces):
        return float(forces.mean())
    if configuration.stiffness is None:
        return 0.0
    return 1e-4 * float(np.abs(configuration.stiffness.data).max(initial=0.0) * configuration.radius.mean())


def refuse_motion(configuration: Configuration, balance: float, commands: Commands) -> None:
    """Refuse a packing that moves, with the particle that is farthest from rest."""
    force = force_scale(configuration)
    if not configuration.residual > balance * force:  # an infinite balance allows no number where nothing touches
        return
    size = configuration.particle_residual
    worst = int(np.argmax(size))
    place = ", ".join(f"{x:.6g}" for x in configuration.position[worst])
    who = f"particle {configuration.ids[worst]} at ({place})"
    if configuration.constraint is not None and worst in configuration.joined:
        led = np.diff((configuration.constraint != 0).tocsc().indptr).reshape(configuration.axes, -1)[:, worst].max()
        who = f"the lid of {led} particles that move as one, with {who} among them,"
    others = int(np.sum(size > balance * force)) - 1
    also = f", and {others} more {'are' if others > 1 else 'is'} out of balance" if others else ""
    advice = known_cause(commands, configuration.contacts, size) or (
        "bring it to rest by faultgouge.relax(lmp), in a command --relax, or a longer run with drag (fix viscous, and "
        "fix viscous/sphere for rotation), or allow more by from_lammps(lmp, balance=...), in a command --balance"
    )
    raise NotTakenError(
        f"The packing moves: the residual of {who} is "
        f"{size[worst] / force:.3g} of the mean contact force, and {balance:g} is allowed{also}; {advice}."
    )


def held_remarks(configuration: Configuration, velocity: Floats, rotation: Floats, timestep: float) -> tuple[str, ...]:
    """A sentence on velocities of particles that no fix moves, as `fix freeze` leaves them; shape (N, 3) both. LAMMPS's
    contacts feel these velocities for ever, and they are zero here."""
    c = configuration
    speed = np.maximum(np.linalg.norm(velocity, axis=1), c.radius * np.linalg.norm(rotation, axis=1))
    drives = ~c.free & (speed * timestep > HELD_SPEED * c.radius)
    if not drives.any():
        return ()
    count = int(drives.sum())
    return (
        f"{counted(count, 'particle')} that no fix moves {'have' if count > 1 else 'has'} velocities or rotations, up "
        f"to {speed[drives].max():.3g} at the surface, which drive contacts in LAMMPS, and are zero here: give them "
        "`velocity GROUP set 0 0 0` and `set group GROUP omega 0 0 0`",
    )


def motion_remarks(configuration: Configuration, velocity: Floats) -> tuple[str, ...]:
    """A sentence on velocities, shape (N, 3), of particles that move, if these are more than what forces out of balance
    make: v (k m)^(1/2) is a force, with the largest entry k of K at a particle and its mass m. Rotations do not count,
    as spheres may spin on a plane."""
    c, speed = configuration, np.linalg.norm(velocity, axis=1)
    stiffest = abs(c.assembled_stiffness()).max(axis=1).toarray().ravel()
    stiffest = (stiffest if c.constraint is None else (c.constraint != 0) @ stiffest).reshape(c.axes, -1).max(axis=0)
    moves = c.free & (speed * np.sqrt(stiffest * c.mass) > BALANCE * force_scale(c))
    moves[c.rattlers] = False
    if not moves.any():
        return ()
    return (f"particles move by up to {speed[moves].max():.3g} (length / time): this is said of them at rest",)


LOST = (
    "have no tangential force, as where histories are lost: a wall or a pair style that is defined anew has none yet; "
    "and LAMMPS reads none from a restart file if another instance of a granular style was there before in the "
    "process, and not all across a periodic boundary or with newton off; read such a file in a process of its own, and "
    "run on with drag (fix viscous) until the packing rests"
)

TWICE = "particles touch each other twice, of which LAMMPS mixes the histories: take a box that is wider"


def touch_twice(i: Indices, j: Indices) -> bool:
    """Whether two particles, of all pairs that touch, touch each other through two periodic images."""
    pairs = np.sort(np.column_stack([i, j]), axis=1)
    return len(np.unique(pairs, axis=0)) < len(pairs)


def restless_fix(commands: Commands) -> str:
    """The sentence on a fix that keeps particles from resting; empty if there is none."""
    for name, line in commands.fixes.items():
        words = line.split()
        style = without_suffix(words[3])
        if style == "langevin" and set(words[4:6]) - {"0", "0.0"}:
            return (
                f"fix {name} langevin shakes the particles by its temperature: unfix it, or give it the temperature 0.0"
            )
        if style == "wall/reflect":
            return f"fix {name} wall/reflect turns velocities round, but bears no weight: use fix wall/gran"
    return ""


def creeping_law(commands: Commands) -> str:
    """What is said of friction that bears no force at rest; empty if there is none."""
    lines = [*commands.pair, *(line for line in commands.fixes.values() if "wall/gran" in line)]
    words = {without_suffix(word) for line in lines for word in line.split()}
    styles: list[str] = [style for style in ("linear_nohistory", "gran/hooke") if style in words]
    if "wall/gran" in words and "hooke" in words and not words & {"granular", "linear_nohistory"}:
        styles.append("wall/gran hooke")
    if not styles:
        return ""
    return (
        f"the friction of {styles[0]} opposes velocities alone and bears no force at rest, so that slopes and heaps "
        "creep without end: take linear_history, or hooke/history"
    )


LOSES = {
    "rerun": "puts the positions of a dump, which has no tangential histories: leave it out",
    "write_restart": "stands after the last run, where LAMMPS forgets tangential histories if its lists of neighbours "
    "have changed since: have the run itself write the restart, by `restart N FILE` before it",
} | dict.fromkeys(
    ("delete_atoms", "reset_atoms"),
    "after the last run gives particles other IDs, by which LAMMPS knows the tangential histories: leave reset_atoms "
    "out, write `compress no` behind delete_atoms, and run on until the packing rests",
)
"""Commands after the last run that take tangential histories away, and what is said of them."""


def lost_histories(commands: Commands) -> str:
    """What is said of a command after the last run that takes tangential histories away; empty if there is none."""
    name = commands.after_run.partition(" ")[0]
    return f"{commands.after_run!r} {LOSES[name]}" if name and (name, commands.style) != ("write_restart", OWN) else ""


def known_cause(commands: Commands, contacts: LinearisedContacts, residual: Floats | None = None) -> str:
    """Why forces are out of balance though the packing may be at rest; empty if no cause is known.

    Histories may be lost where friction can bear the residual force on the particle that has most, shape (N,).
    """
    contacts = contacts.touching
    if says := restless_fix(commands):
        return f"{says}, and run on"
    if says := creeping_law(commands):
        return says
    if touch_twice(contacts.i[~contacts.wall], contacts.j[~contacts.wall]):
        return TWICE
    if says := lost_histories(commands):
        return says
    has_friction = (contacts.friction > 0) & np.isfinite(contacts.friction)  # infinite where no law is known
    if residual is not None:
        at = (contacts.i == np.argmax(residual)) | (contacts.j == np.argmax(residual))
        has_friction &= bool(contacts.friction[at].sum() >= residual.max())
    lost = np.count_nonzero(has_friction & ~contacts.tangential_force.any(axis=1))
    return f"{lost} of {len(contacts)} contacts {LOST}" if lost else ""


def moving_region(lmp: Any, commands: Commands) -> str:
    """The sentence on a wall whose region moves; empty if none does.

    A region may have `move` and `rotate` with variables. Whether these change in time, or have come to a constant, is
    seen in a few steps of a copy.
    """
    found: dict[str, tuple[str, str]] = {}
    for name, line in commands.fixes.items():
        regions = [line.split()[line.split().index("region") + 1]] if " wall/gran/region" in line else []
        for region in regions:
            words = commands.regions.get(region, f"region {region} ?").split()
            if words[2] in ("union", "intersect"):
                regions += words[4 : 4 + int(words[3])]
            at = [k for k, word in enumerate(words) if word in ("move", "rotate")]
            moved = [word[2:] for k in at for word in words[k + 1 : k + 4] if word.startswith("v_")]
            found |= {variable: (region, name) for variable in moved}
    moving = in_a_copy(partial(_changing, lmp, list(found))) if found else []
    for variable in moving:
        region, name = found[variable]
        return (
            f"Region {region} of fix {name} moves with v_{variable}: give this variable a constant before the last "
            "run, and run on until the packing rests."
        )
    return ""


def _changing(lmp: Any, variables: list[str]) -> list[str]:
    """Variables that change in three steps, in a copy."""
    quieten(lmp)  # LAMMPS knows some variables during runs alone
    lmp.command(f"fix faultgouge_v all vector 1 {' '.join(f'v_{name}' for name in [*variables, variables[0]])}")
    lmp.command("run 3 post no")
    values = [[lmp.extract_fix("faultgouge_v", 0, 2, row, k) for row in (0, 3)] for k in range(len(variables))]
    return [name for name, (first, last) in zip(variables, values, strict=True) if first != last]
