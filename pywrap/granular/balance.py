"""Is a packing at rest? Forces that are out of balance, and the reasons if nothing moves all the same."""

import numpy as np

from ...analysis import BadInputError, Configuration, LinearisedContacts
from ...analysis.arrays import Floats, Indices
from ...analysis.counted import counted
from .granular_commands import Commands, NotTakenError

BALANCE = 1e-4
"""Share of the mean contact force that may be out of balance. Beyond, the packing moves to another place of rest."""

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
        "bring it to rest by faultgouge.relax(lmp), in a command --relax, or a longer run with drag (fix viscous), or "
        "allow more by from_lammps(lmp, balance=...), in a command --balance"
    )
    share = f"{size[worst] / force if force else np.inf:.3g} of the mean contact force, and {balance:g} is allowed"
    raise NotTakenError(f"The packing moves: the residual of {who} is {share}{also}; {advice}.")


def motion_remarks(
    configuration: Configuration, velocity: Floats, rotation: Floats, timestep: float
) -> tuple[str, ...]:
    """Sentences on velocities and rotations, shape (N, 3), which are zero in a packing at rest.

    LAMMPS's contacts feel those of particles that no fix moves, as `fix freeze` leaves them. Those of particles that
    move are told if v (k m)^(1/2), with the largest entry k of K at a particle, is more than a force that may be out of
    balance. Their rotations do not count, as spheres may spin on a plane.
    """
    c, says, speed = configuration, [], np.linalg.norm(velocity, axis=1)
    surface = np.maximum(speed, c.radius * np.linalg.norm(rotation, axis=1))
    drives = ~c.free & (surface * timestep > HELD_SPEED * c.radius)
    if count := int(drives.sum()):
        have = "have" if count > 1 else "has"
        drive = f"up to {surface[drives].max():.3g} at the surface, which drive contacts in LAMMPS, and are zero here"
        still = f"{counted(count, 'particle')} that no fix moves {have} velocities or rotations, {drive}"
        says.append(f"{still}: give them `velocity GROUP set 0 0 0` and `set group GROUP omega 0 0 0`")
    stiffest = abs(c.assembled_stiffness()).max(axis=1).toarray().ravel()
    stiffest = (stiffest if c.constraint is None else (c.constraint != 0) @ stiffest).reshape(c.axes, -1).max(axis=0)
    moves = c.free & (speed * np.sqrt(stiffest * c.mass) > BALANCE * force_scale(c))
    moves[c.rattlers] = False
    if moves.any():
        says.append(f"particles move by up to {speed[moves].max():.3g} (length / time): this is said of them at rest")
    return tuple(says)


LOST = (
    "have no tangential force, as where histories are lost: a wall or a pair style that is defined anew has none yet; "
    "write_restart, rerun, reset_atoms, and delete_atoms without `compress no`, lose them after the last run; and "
    "LAMMPS reads none if another granular instance was there before in the process; run on with drag until it rests"
)

TWICE = "particles touch each other twice, of which LAMMPS mixes the histories: take a box that is wider"


def touch_twice(i: Indices, j: Indices) -> bool:
    """Whether two particles, of all pairs that touch, touch each other through two periodic images."""
    pairs = np.sort(np.column_stack([i, j]), axis=1)
    return len(np.unique(pairs, axis=0)) < len(pairs)


def keeps_moving(commands: Commands) -> str:
    """What is said of a command that keeps particles from resting; empty if there is none."""
    lines = " ".join(commands.pair)
    for name, line in commands.fixes.items():
        words = line.split()
        if words[3].startswith("langevin") and set(words[4:6]) - {"0", "0.0"}:
            return f"fix {name} langevin shakes the particles by its temperature: unfix it, or give it 0.0"
        lines += f" {line}" * words[3].startswith("wall/gran")
    for style in ("linear_nohistory", "gran/hooke", "wall/gran hooke"):
        if f" {style} " in lines:
            creep = "bears no force at rest, so that slopes and heaps creep without end: "
            creep += "take linear_history, or hooke/history"
            return f"the friction of {style} opposes velocities alone and {creep}"
    return ""


def known_cause(commands: Commands, contacts: LinearisedContacts, residual: Floats | None = None) -> str:
    """Why forces are out of balance though the packing may be at rest; empty if no cause is known.

    Histories may be lost where friction can bear the residual force on the particle that has most, shape (N,).
    """
    c = contacts.touching
    if says := keeps_moving(commands) or (TWICE if touch_twice(c.i[~c.wall], c.j[~c.wall]) else ""):
        return says
    has_friction = (c.friction > 0) & np.isfinite(c.friction)  # infinite where no law is known
    if residual is not None:
        at = (c.i == np.argmax(residual)) | (c.j == np.argmax(residual))
        has_friction &= bool(c.friction[at].sum() >= residual.max())
    lost = np.count_nonzero(has_friction & ~c.tangential_force.any(axis=1))
    return f"{lost} of {len(c)} contacts {LOST}" if lost else ""
