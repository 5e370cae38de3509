"""Undamped runs that differ in one feature, and what each of them holds in LAMMPS."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike

from ...analysis import Contacts, Packing, touching
from ...analysis.motion.signals import Signal
from ...pywrap import Engine
from ...pywrap.lammps.dynamics import Dynamics, Weakening

QUIET_SHARE = 1e-4
"""Time step of the runs, in units of the decks': a packing that has lost its floor or its sides stays what it is while
it is timed. The time that a step takes does not depend on it."""

OWN_COMPUTES = {"thermo_temp", "thermo_press", "thermo_pe"}
"""Computes that LAMMPS makes in every instance. No deck asks for their values, except relaxations for the energy."""

UNREACHABLE_VELOCITY = 1e6
"""A threshold v_0 that no layer reaches: friction that could weaken, and does not."""


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
        instance = engine.lammps
        instance.command("log none")
        fixes = tuple(instance.available_ids("fix"))
        periodic = instance.extract_box()[5]
        settings = [f"periodic {axis}" for axis, flag in zip("xy", periodic, strict=False) if flag]
        if instance.extract_setting("ghost_velocity"):
            settings.append("velocities of ghosts")
        return cls(
            parts=tuple(dict.fromkeys(re.findall(r"^include\s.*?(\w+\.in)", log.read_text(), re.MULTILINE))),
            fixes=fixes,
            computes=tuple(each for each in instance.available_ids("compute") if each not in OWN_COMPUTES),
            dumps=tuple(instance.available_ids("dump")),
            variables=tuple(instance.available_ids("variable")),
            arrays=tuple(_arrays(instance, fixes)),
            settings=tuple(settings),
        )

    @property
    def everything(self) -> tuple[str, ...]:
        """All in one, as "fix slips" and so on; variables belong to the deck parts and are left out."""
        kinds = {"part": "parts", "fix": "fixes", "compute": "computes", "dump": "dumps", "array": "arrays"}
        return *(f"{kind} {name}" for kind, names in kinds.items() for name in getattr(self, names)), *self.settings

    def beyond(self, other: InstanceContents) -> tuple[str, ...]:
        """The contents of this instance that another one does not have."""
        return tuple(each for each in self.everything if each not in other.everything)


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
        stiffness = self.packing.law.stiffness_scale(10 * self.packing.fy)
        step = QUIET_SHARE * 0.2 / np.sqrt(12 * stiffness)
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

    def of(self, **changes: Any) -> UndampedRun:
        """The run of a packing that differs in these arguments."""
        return replace(self, packing=replace(self.packing, **changes))

    def moved_by(self, *names: str, otherwise: dict[str, Any]) -> tuple[dict[str, Any], ArrayLike]:
        """The fixes that move the disks, by their names in `motion`, or would move them otherwise; and the disks."""
        own = {key: value for key, value in self.motion.items() if key in (*names, "target")}
        what = own if names[0] in own else otherwise
        return what, what.get("target", np.flatnonzero(self.packing.top))


@dataclass(frozen=True, eq=False)
class Feature:
    """One feature of a run, and the two runs that differ in it.

    Attributes
    ----------
    name, reason : str
        Its name, and why the scene has it or not.
    without, with_it : Run
        The two.
    touched : array_like of int
        The disks on which it acts from the first moment.
    moves : bool
        Whether it changes the motion.
    """

    name: str
    reason: str
    without: UndampedRun
    with_it: UndampedRun
    touched: ArrayLike = ()
    moves: bool = True


def features(run: UndampedRun) -> Iterator[Feature]:
    """The features of a run, each with two runs that differ in it and have no push, signal or weakening else."""
    bare = replace(run, motion={})
    law = run.packing.law
    rough = bare.of(law=law if law.frictional else replace(law, kt=2 / 7 * law.kn, mu=1.0))
    yield from _of_contacts(bare, rough)
    weakening, reason = run.motion.get("weakening"), "section [friction]; tried below its threshold"
    if weakening is None:
        weakening, reason = (
            Weakening(B=0.2, w=0.4, mu_ss=0.8, v0=UNREACHABLE_VELOCITY, v_ss=1.0),
            "no section [friction]",
        )
    weakens = replace(rough, motion={"weakening": weakening})
    yield Feature("dynamic friction", reason, rough, weakens, moves=False)
    yield from _of_damping(bare)
    yield from _of_motion(run, bare)
    packing, reason = run.packing, f'precision = "{"compensated" if run.packing.compensated else "double"}"'
    plain = bare.of(position_low=None, contacts=replace(packing.contacts, slip_low=None))
    low = bare if packing.compensated else bare.of(position_low=np.zeros_like(packing.position))
    yield Feature("compensated coordinates", reason, plain, low)


def _of_contacts(bare: UndampedRun, rough: UndampedRun) -> Iterator[Feature]:
    """Floor, friction and period."""
    packing, law, box = bare.packing, bare.packing.law, bare.packing.box_length
    on_floor = np.unique(packing.contacts.i[packing.contacts.floor])
    reason = f"{len(on_floor)} of {len(packing)} disks rest on it, and nothing else bears the load"
    yield Feature("floor", reason, replace(bare, floor=False), bare, on_floor)
    reason = f"mu = {law.mu:g}, kt = {law.kt:g}" + ("" if law.frictional else ": no tangential force")
    # zero slips in both, so that friction alone differs
    unslipped = touching(packing.position, packing.radius, box)
    smooth = bare.of(contacts=unslipped, law=replace(law, mu=0.0))
    yield Feature("tangential history", reason, smooth, rough.of(contacts=unslipped))
    opened, closed, across = _opened_and_closed(bare)
    reason = "the sides are open" if box is None else f"x has the period {box:g}"
    yield Feature("periodicity", reason, opened, closed, across)


def _of_damping(bare: UndampedRun) -> Iterator[Feature]:
    """Dashpots and drag, each with the scene's value or else a hundredth of the critical value of one contact."""
    packing, law, tau = bare.packing, bare.packing.law, bare.packing.drag_time
    rate = np.sqrt(law.stiffness_scale(packing.fy) / packing.mass.mean())
    dashpot = float(0.01 * packing.mass.mean() * rate / law.growth(np.array(law.overlap_of_force(packing.fy))))
    reason = f"cn = {law.cn:g}, ct = {law.ct:g}" if law.damped else "no cn or ct in [damping]"
    damped = law if law.damped else replace(law, cn=dashpot, ct=dashpot)
    yield Feature("dashpots", reason, bare.of(law=replace(law, cn=0.0, ct=0.0)), bare.of(law=damped))
    reason = "no tau in [damping]" if tau is None else f"tau = {tau:g}"
    yield Feature("drag", reason, bare.of(drag_time=None), bare.of(drag_time=tau or 100 / rate))


def _of_motion(run: UndampedRun, bare: UndampedRun) -> Iterator[Feature]:
    """The forces that push the disks, and the spring that draws the layer."""
    push, pushed = run.moved_by("amplitude", "omega", otherwise={"amplitude": 1e-9, "omega": 0.01})
    reason = f"amplitude {push['amplitude']:g}" if "amplitude" in run.motion else "no amplitude in [perturb]"
    yield Feature("perturbation", reason, bare, replace(bare, motion=push), pushed)
    constant = Signal(np.array([0.0, 1e6]), np.array([1e-9, 1e-9]))
    sent, moved = run.moved_by("signal", "on", otherwise={"signal": constant, "on": "layer"})
    reason = f"{len(sent['signal'])} rows, on the {sent['on']}" if "signal" in run.motion else "no signal in [perturb]"
    everything = np.arange(len(run.packing))
    yield Feature("signal", reason, bare, replace(bare, motion=sent), everything if sent["on"] == "floor" else moved)
    soft = {"spring": float(run.packing.fy / run.packing.radius.mean()), "stages": ((1e-9, np.inf),)}
    drawn, layer = run.moved_by("spring", "stages", otherwise=soft)
    reason = f"stiffness {drawn['spring']}" if "spring" in run.motion else "no section [drive]"
    yield Feature("spring", reason, bare, replace(bare, motion=drawn), layer)


def _arrays(instance: Any, fixes: tuple[str, ...]) -> Iterator[str]:
    """Per-atom arrays of fixes, and the angles if disks have them."""
    from lammps import LMP_SIZE_COLS, LMP_STYLE_ATOM

    for name in fixes:
        with suppress(Exception):  # the LAMMPS module raises plain Exception for a fix without
            yield f"f_{name} ({instance.extract_fix(name, LMP_STYLE_ATOM, LMP_SIZE_COLS)} columns)"
    if instance.extract_atom_datatype("d_theta") > 0:
        yield "d_theta"


def _opened_and_closed(bare: UndampedRun) -> tuple[UndampedRun, UndampedRun, ArrayLike]:
    """The run with open sides and with a period, and the disks with a contact across it."""
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
    return opened, bare.of(position=position, box_length=length), np.concatenate([i[beyond], j[beyond]])
