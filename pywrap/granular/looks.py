"""Particles, contacts and fixes of a LAMMPS instance, read in a copy of the process if there can be one."""

import re
from contextlib import nullcontext, suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...analysis.arrays import Floats
from .balance import moving_region
from .granular_commands import (
    BODIES,
    GIVE_LINE,
    GIVE_LINES,
    HOLDS,
    MOBILE,
    MOVES,
    OWN,
    WALLS,
    Commands,
    NotLinearisedError,
    NotTakenError,
    check_fixes,
    check_pair,
    read_commands,
    rolls,
    without_suffix,
)
from .lammps_arrays import Arrays, arrays_at_rest, forces_in_order, given_back
from .look_in_a_copy import OpenFile, Styles, can_copy, communicator, log_of, only_log, quieten, said, styles_of
from .mobility import translating_bodies

BY_CONTACT = ("contacts", "partners")
"""Arrays with a row for each contact; all others have one for each particle."""

STILL = (
    *WALLS, *MOBILE, "gravity", "viscous", "enforce2d", "slip/history", "low/parts", "dashpot/velocities", "store",
    "keep/histories", "property/atom", "addforce", "spring", "indent", "halt", "adapt", "restrain", "NEIGH_HISTORY",
    "DUMMY", "OMP",
)  # fmt: skip
"""Fixes, by the beginnings of their styles, to which zero steps without velocities do nothing that lasts."""

SETTING = ("setforce", "aveforce", "lineforce", "planeforce")
"""Fixes that set forces, of which the force of a wall is then no difference."""


def look(
    lmp: Any, given: Commands | None, files: dict[int, OpenFile], columns: str = ""
) -> tuple[Commands, dict[str, str], Arrays]:
    """The commands, the styles of fixes, and the arrays of all ranks in the order of the particles' IDs; in a copy if
    there can be one.

    With `columns` of compute pair/local, whatever exerts forces is taken: contacts with walls are not looked at one by
    one, and "at walls" has the sizes of the forces of all walls on each particle, shape (N,).
    """
    world, copied = communicator(lmp), can_copy(lmp)
    if given is None:
        lines = log_of(lmp, files) if copied else world.bcast(only_log() if world.rank == 0 else None, root=0)
        if lines is None:
            raise NotTakenError(f"This LAMMPS has no log to read its commands from: {GIVE_LINES}.")
        given = read_commands(lines, log=True)
    elif copied:
        lmp.command("log none")
    styles = styles_of(lmp)
    with suppress(NotLinearisedError) if columns else nullcontext():
        check_instance(lmp, styles, given)
    plain = {name: without_suffix(style) for name, style in styles.fixes.items()}
    if columns:
        _check_motion(lmp, plain, given)
    mobile = {name: given.fixes[name] for name, style in plain.items() if style in MOBILE}
    groups = {name: line.split()[2] for name, line in mobile.items()}
    for name in [name for name in mobile if plain[name] in BODIES]:
        bodies = translating_bodies(mobile[name], lmp.extract_setting("dimension"))
        groups |= {f"{name} {body.group}": body.group for body in bodies}
    if copied:
        quieten(lmp, drag=True)
    else:
        _refuse_changes(lmp, styles, given)
    walls = [name for name, style in plain.items() if (style.startswith("wall/gran") if columns else style in WALLS)]
    silent = _silent_walls(walls, given)
    usual = "dx dy dz force p3" if given.style == OWN else "dx dy dz force p1 p2 p3"
    if any(map(rolls, given.pair)):
        usual += " p5 p6 p7"
    with nullcontext() if copied else given_back(lmp):
        mine = arrays_at_rest(lmp, groups, [name for name in walls if name not in silent], columns or usual)
    for name in walls:
        if name not in silent and plain[name].startswith("wall/gran"):
            mine[f"wall {name}"] = mine[f"wall {name}"][:, 1:4]
    # what a wall exerts is what is missing without the wall, and without fixes that set forces
    apart = [name for name in walls if name in silent or (not columns and rolls(given.fixes[name]))]
    acts = {each: mine[each] for each in ("f", "torque")}
    for name in [*(name for name in plain if apart and plain[name] in SETTING), *apart]:
        lmp.command(f"unfix {name}")
        lmp.command("run 0 post no")
        now = {each: forces_in_order(lmp, mine["id"], each) for each in acts}
        if name in apart:
            mine[f"wall {name}"] = acts["f"] - now["f"] if name in silent else mine[f"wall {name}"]
            mine[f"torque {name}"] = acts["torque"] - now["torque"]
        acts = now
    if columns:
        forces = [mine.pop(f"wall {name}") for name in walls]
        mine["at walls"] = np.linalg.norm(sum(forces, np.zeros_like(mine["f"])), axis=1)
    every = world.allgather(mine)
    found = {}
    for name in mine:  # the array of a rank without rows may have another number of columns
        parts = [each[name] for each in every]
        found[name] = np.concatenate([part for part in parts if len(part)] or parts[:1])
    order = np.argsort(found["id"], kind="stable")
    return given, styles.fixes, {name: rows if name in BY_CONTACT else rows[order] for name, rows in found.items()}


def _check_motion(lmp: Any, plain: dict[str, str], given: Commands) -> None:
    """Refuse fixes that move or hold particles in a way that is not known, and walls that move."""
    for name, style in plain.items():
        if not style.startswith((*MOVES, *HOLDS)):
            continue
        if style not in MOBILE:
            raise NotTakenError(
                f"fix {name} {style} moves or holds particles in a way that is not known here: unfix it."
            )
        if name not in given.fixes or without_suffix(given.fixes[name].split()[3]) != style:
            raise NotTakenError(f"The commands have no line of fix {name} {style}: {GIVE_LINE}.")
    if moves := moving_region(lmp, given):
        raise NotTakenError(moves)


def members_of(found: Arrays) -> dict[str, NDArray[np.bool_]]:
    """Who is in the group of each fix that moves or holds particles, and in the bodies of a fix rigid."""
    return {name.removeprefix("group "): each for name, each in found.items() if name.startswith("group ")}


def _refuse_changes(lmp: Any, styles: Styles, commands: Commands) -> None:
    """Refuse a look by zero steps of the instance itself where they would change what is not given back: before any."""
    cold = [name for name, line in commands.fixes.items() if set(line.split()[4:6]) <= {"0", "0.0"}]
    changes = [
        f"fix {name} {style}"
        for name, style in styles.fixes.items()
        if not without_suffix(style).startswith(STILL) and not (style.startswith("langevin") and name in cold)
    ]
    variables = re.findall(r"(?m)^Variable\[ *\d+\]: *(\w+),.*\b(?:random|normal)\(", said(lmp, "variables"))
    if changes := [*changes, *(f"variable {name}" for name in variables)]:
        raise NotTakenError(
            "On several ranks or with threads a look runs zero steps of LAMMPS itself, by which "
            f"{' and '.join(changes)} may write, count or draw random numbers, so that the next run would be another "
            "one: take one rank and one thread, where the look is in a copy, or unfix or delete what is named."
        )


def check_instance(lmp: Any, styles: Styles, commands: Commands) -> None:
    """Refuse styles of an instance that are not linearised here."""
    if without_suffix(styles.pair) != commands.style:
        raise NotTakenError(
            f"The commands have pair_style {commands.style}, and the instance has {styles.pair}: {GIVE_LINES}."
        )
    if not lmp.extract_setting("radius_flag") or any(word in styles.atom for word in ("body", "ellipsoid", "bpm")):
        raise NotTakenError(f"atom_style {styles.atom} has no disks and spheres alone: use atom_style sphere.")
    if lmp.extract_global("ftm2v") != 1.0:
        units = lmp.extract_global("units")
        raise NotTakenError(f"In units {units} force is not mass times acceleration: use lj, si, cgs, micro or nano.")
    for name, style in styles.fixes.items():
        if style.startswith("rigid") and name in commands.fixes:
            translating_bodies(commands.fixes[name], lmp.extract_setting("dimension"))
    check_fixes(styles.fixes, commands)
    if lmp.extract_setting("molecule_flag") and lmp.extract_global("nbonds"):
        raise NotLinearisedError("Bonds hold particles together: take them out.")
    check_pair(commands, lmp.available_styles("pair"))
    walls = [name for name, style in styles.fixes.items() if without_suffix(style) == "wall/gran"]
    silent = _silent_walls(walls, commands)
    rolling = [name for name in walls if rolls(commands.fixes[name])]
    if (silent or rolling) and not can_copy(lmp):
        what = "its contacts: write contacts at its end" if silent else "its rolling friction"
        raise NotTakenError(
            f"fix {(silent or rolling)[0]} wall/gran does not hand out {what}; or take one rank and one thread, where "
            "it is found without the wall."
        )


def _silent_walls(walls: list[str], commands: Commands) -> list[str]:
    """IDs of walls that hand out no contacts."""
    lines = {name: commands.fixes.get(name, "") for name in walls}
    return [name for name, line in lines.items() if OWN not in line and "contacts" not in line.split()]


def box_of(lmp: Any) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Edges of the box in rows, its lower corner, and along which edges it is periodic."""
    low, high, xy, yz, xz, periodic, _ = lmp.extract_box()
    size = np.subtract(high, low)
    edges = np.array([[size[0], 0, 0], [xy, size[1], 0], [xz, yz, size[2]]])
    return edges, np.array(low), np.array(periodic, dtype=np.bool_)


def particles_of(lmp: Any, found: Arrays, free: NDArray[np.bool_], factor: Floats) -> dict[str, Any]:
    """Fields of a Configuration that concern particles and box, without the load.

    `free` says which particles move, shape (N,), and `factor` is the moment of inertia over m R^2, shape (N,).
    """
    dimension = lmp.extract_setting("dimension")
    box, origin, periodic = box_of(lmp)
    return {
        "dimension": dimension,
        "position": found["x"][:, :dimension],
        "radius": found["radius"],
        "mass": found["rmass"],
        "inertia": factor * found["rmass"] * found["radius"] ** 2,
        "box": box,
        "origin": origin,
        "periodic": periodic,
        "load": np.zeros((len(found["id"]), 2, 3)),
        "free": free,
        "ids": found["id"].astype(np.int64),
        "kind": found["type"].astype(np.int64),
    }
