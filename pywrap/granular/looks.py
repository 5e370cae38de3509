"""Particles, contacts and fixes of a LAMMPS instance, read in a copy of the process.

Contacts between particles are those of compute pair/local at rest. What a wall exerts is what is missing without it.

**Forces that follow the time.** Where nothing moves, no force of contacts changes. If forces change in some steps of
particles that stay, a load or a wall follows a variable, and no packing rests.
"""

import os
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .balance import TWICE, touch_twice
from .granular_commands import (
    BODIES,
    GIVE_LINES,
    HOLDS,
    MOBILE,
    MOVES,
    OWN,
    WALLS,
    Commands,
    Mobility,
    NotLinearisedError,
    NotTakenError,
    check_fixes,
    mobility,
    read_commands,
    translating_bodies,
    unmeasured_laws,
)
from .lammps_arrays import by_id, owned_array
from .look_in_a_copy import DRAG_STYLES, INSERTS, PER_STEP, OpenFile, log_file, quieten, styles_of

Arrays = dict[str, Any]

STILL_STEPS, FOLLOWS_TIME = 20, 1e-7
"""Steps in which particles that stay still feel the same forces, and the change, as a share of the largest force, from
which on a force follows the time. A model that acts one step late changes forces in the step before these."""

PASSIVE = (
    *WALLS, *PER_STEP, *DRAG_STYLES, *INSERTS, *MOBILE, "gravity", "enforce2d", "slip/history", "low/parts",
    "dashpot/velocities", "keep/histories", "store", "property/atom",
)  # fmt: skip
"""Fixes, by the beginnings of their styles, whose action is in K, or constant, or none. So are those that LAMMPS makes
for itself, in capitals, and `addforce` without a variable. The list only explains what the motion shows."""

COLUMNS = ["dx dy dz force p1 p2 p3", "dx dy dz force", "dx dy dz"]
"""What compute pair/local may hand out of contacts: branch vectors, and forces."""


class Looked(NamedTuple):
    """The commands of an instance, the styles of its fixes by ID, its arrays in the order of the particles' IDs, and
    what moves."""

    commands: Commands
    fixes: dict[str, str]
    found: Arrays
    moved: Mobility


def acting_fixes(styles: dict[str, str], commands: Commands) -> dict[str, str]:
    """The fixes, by ID and style, that may exert other forces than contacts do, and no constant ones."""
    return {
        name: style
        for name, style in styles.items()
        if not (style.startswith(PASSIVE) or style.isupper())
        and (style != "addforce" or "v_" in commands.fixes.get(name, "v_"))
    }


def may_act(fixes: dict[str, str]) -> str:
    """What is said of such fixes; empty if there are none."""
    says = "may act on particles as contacts do not tell: leave it out, or have it exert a constant force"
    return " and ".join(f"fix {name} {style}" for name, style in fixes.items()) + f" {says}" * bool(fixes)


def look(lmp: Any, given: Commands | None, files: dict[int, OpenFile], *, whole: bool = False) -> Looked:
    """Look at an instance that is a copy; `files` are the open files of the process.

    If it is `whole`, whatever exerts forces is taken. Otherwise contacts have laws that can be measured, or a
    NotLinearisedError says why not.
    """
    log = log_file(lmp, files)
    given = given or _commands_in(log)
    styles, dimension = styles_of(lmp), lmp.extract_setting("dimension")
    fixes = styles.fixes
    if styles.pair != given.style:
        two = f"The commands have pair_style {given.style}, and the instance has {styles.pair}"
        raise NotTakenError(f"{two}: {GIVE_LINES}.")
    if not lmp.extract_setting("radius_flag") or any(word in styles.atom for word in ("body", "ellipsoid", "bpm")):
        raise NotTakenError(f"atom_style {styles.atom} has no disks and spheres alone: use atom_style sphere.")
    if lmp.extract_global("ftm2v") != 1.0:
        units = lmp.extract_global("units")
        raise NotTakenError(f"In units {units} force is not mass times acceleration: use lj, si, cgs, micro or nano.")
    check_fixes(fixes, given)
    groups = {name: styles.groups[name] for name, style in fixes.items() if style.startswith((*WALLS, *MOBILE))}
    for name in [name for name, style in fixes.items() if style in BODIES]:
        groups |= {f"{name} {group}": group for group in translating_bodies(given.fixes[name], dimension)}
    if not len(owned_array(lmp, "id")):
        raise NotTakenError("This LAMMPS has no particles.")
    if not whole:
        bonds = lmp.extract_setting("molecule_flag") and lmp.extract_global("nbonds")
        if why := "Bonds hold particles together: take them out." if bonds else unmeasured_laws(fixes, given):
            raise NotLinearisedError(why)
    quieten(lmp, drag=True)
    usual = "dx dy dz force p3" if given.style == OWN else "dx dy dz force p1 p2 p3"
    rolling = " p5 p6 p7" if re.search(" rolling (?!none)", " ".join(given.pair)) else ""
    found = arrays_at_rest(lmp, groups, COLUMNS if whole else [usual + rolling])
    # the largest change of a force, or of a torque over the radius, though nothing moves
    hold_still(lmp, fixes, given.fixes)
    lmp.command("run 1 post no")
    before = by_id(lmp, "f", "torque")
    lmp.command(f"run {STILL_STEPS} post no")
    force, torque = (np.abs(a - b) for a, b in zip(before, by_id(lmp, "f", "torque"), strict=True))
    change = max(force.max(), (torque / found["radius"][:, None]).max())
    _add_walls(lmp, fixes, acting_fixes(fixes, given), found)
    walls = [each for name, each in found.items() if name.startswith("wall ")]
    forces = np.concatenate([each.ravel() for each in (found["f"], found["contacts"][:, 3:4], *walls)])
    if change > FOLLOWS_TIME * np.abs(forces).max():
        variable = "a load, a wall or a region follows a variable of the step or the time; give it a constant"
        says = TWICE if touch_twice(*found["partners"].T) else f"{variable}, and run on until the packing rests"
        raise NotTakenError(f"LAMMPS's forces change with the time, though nothing moves: {says}.")
    members = {name: found[f"group {name}"] for name in groups}
    lines = {name: line for name, line in given.fixes.items() if fixes.get(name) in MOBILE}
    return Looked(given, fixes, found, mobility(lines, members, found["rmass"], dimension))


def _commands_in(log: OpenFile | None) -> Commands:
    """The commands in a log."""
    if log is None:
        raise NotTakenError(f"This LAMMPS has no log to read its commands from: {GIVE_LINES}.")
    path, place = log
    text = Path(path).read_text(errors="replace")
    if "\0" in text or os.path.getsize(path) != place:
        cure = "give each LAMMPS a log of its own (-log FILE), or the lines as from_lammps(lmp, commands=[...])"
        raise NotTakenError(f"{path} is the log of another LAMMPS, too: {cure}.")
    return read_commands(text, log=True)


def arrays_at_rest(lmp: Any, groups: dict[str, str], columns: list[str]) -> Arrays:
    """Particles, forces and contacts after zero steps at rest, and who is in some groups; `v` and `omega` are the
    velocities before."""
    found: Arrays = dict(zip(("v", "omega"), by_id(lmp, "v", "omega"), strict=True))
    owned_array(lmp, "v")[:] = owned_array(lmp, "omega")[:] = 0.0
    lmp.command("compute faultgouge_i all property/local patom1 patom2 cutoff radius")
    for each in columns:  # not every pair style hands all of these out
        try:
            lmp.command(f"compute faultgouge_c all pair/local {each} cutoff radius")
            lmp.command("run 0 post no")
            break
        except Exception:
            if each == columns[-1]:
                raise
            lmp.command("uncompute faultgouge_c")
    names, order = ("id", "type", "x", "f", "torque", "radius", "rmass"), np.argsort(owned_array(lmp, "id"))
    found |= zip(names, by_id(lmp, *names), strict=True)
    for name, key in (("c", "contacts"), ("i", "partners")):
        local = lmp.numpy.extract_compute(f"faultgouge_{name}", 2, 2)
        found[key] = np.zeros((0, 10 if name == "c" else 2)) if local is None else np.array(local)
        lmp.command(f"uncompute faultgouge_{name}")
    for fix, group in groups.items():
        lmp.command(f"variable faultgouge_g atom gmask({group})")
        found[f"group {fix}"] = np.array(lmp.numpy.extract_variable("faultgouge_g", "all", 1))[order] > 0
        lmp.command("variable faultgouge_g delete")
    for name, style in styles_of(lmp).fixes.items():
        if style == "wall/mindlin/smooth":
            found[f"wall {name}"] = np.array(lmp.numpy.extract_fix(name, 1, 2))[order]
    low, high, xy, yz, xz, periodic, _ = lmp.extract_box()
    size = np.subtract(high, low)
    found["box"] = np.array([[size[0], 0, 0], [xy, size[1], 0], [xz, yz, size[2]]])
    return found | {"origin": np.array(low), "periodic": np.array(periodic, dtype=np.bool_)}


def _add_walls(lmp: Any, fixes: dict[str, str], others: dict[str, str], found: Arrays) -> None:
    """Add what each wall exerts, which is what is missing without it, and without fixes that depend on it; and "at
    walls", the size of the force of all of them, shape (N,)."""
    walls = [name for name, style in fixes.items() if style.startswith("wall/gran")]
    for name in [name for name, style in fixes.items() if style in HOLDS or name in others] if walls else ():
        lmp.command(f"unfix {name}")
    lmp.command("run 0 post no")
    all_forces, _ = force, torque = by_id(lmp, "f", "torque")
    for name in walls:
        lmp.command(f"unfix {name}")
        lmp.command("run 0 post no")
        now, turns = by_id(lmp, "f", "torque")
        found[f"wall {name}"], found[f"torque {name}"], force, torque = force - now, torque - turns, now, turns
    found["at walls"] = np.linalg.norm(all_forces - force, axis=1)


def hold_still(lmp: Any, fixes: dict[str, str], lines: dict[str, str]) -> None:
    """Have no fix move the particles of a copy; what has a velocity keeps it. Bodies stay, as dashpots feel their mass:
    a body takes its velocity from its particles where a run begins."""
    for name, style in fixes.items():
        if style in BODIES:
            lmp.command(f"{lines[name]} force * off off off torque * off off off")
        elif style.startswith(MOVES):
            lmp.command(f"unfix {name}")


def particles_of(lmp: Any, found: Arrays, moved: Mobility) -> dict[str, Any]:
    """Fields of a Configuration that concern particles, bodies and box, without the load."""
    dimension, mass = lmp.extract_setting("dimension"), found["rmass"]
    return {name: found[name] for name in ("radius", "box", "origin", "periodic")} | {
        "dimension": dimension, "position": found["x"][:, :dimension], "mass": mass, "free": moved.free,
        "inertia": moved.factor * mass * found["radius"] ** 2, "load": np.zeros((len(mass), 2, 3)),
        "constraint": moved.constraint, "ids": found["id"].astype(np.int64), "kind": found["type"].astype(np.int64),
    }  # fmt: skip
