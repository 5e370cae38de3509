"""What a scene includes, what it leaves out, why, and, if wanted, what each part costs.

The features of a run are switched one at a time, in LAMMPS: an undamped run of the scene's packing is set up with a
feature and without it (`switches`).

- *Content*: the deck parts in the log, and the fixes, computes, dumps and per-atom arrays of LAMMPS, that only the
  instance with the feature has. A feature is in the scene if the scene's own run has this content.
- *Cost*: the ratio of the times per step of both instances, which run in turns. The costs of dumps, trajectories, ranks
  and threads are measured on the work that they belong to.
- *Check*: both instances agree to the bit in the forces on all disks that the feature does not act on; if the feature
  does not change the motion, in positions and velocities at the end.
"""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI
from pydantic import BaseModel

from ...analysis import Packing, RunFile
from ...analysis.motion.spectrum import dynamical_matrix
from ...pywrap import Engine, Equilibrium, Record, Scene
from ...pywrap.lammps.dynamics import Dynamics, Weakening
from ...pywrap.lammps.plain_file_names import temporary_folder
from ...pywrap.runs.ramp import step_of
from ...pywrap.runs.scene_path import next_equilibrium
from ...pywrap.scenes.packing_section import GeneratedPacking
from ...pywrap.scenes.sections import Ramp
from ...pywrap.scenes.units import real_units
from ...pywrap.settling.settle import settle
from .cost_comparison import FEW_TURNS, SECONDS_A_TURN, TURNS, Part, cost_of, same_motion
from .processors import ranks, threads
from .switches import UNREACHABLE_VELOCITY, Feature, InstanceContents, UndampedRun, features

SETTLED_DISKS = 400
"""Disks up to which a packing is settled to be explained: half a second. Of a larger one a strip of as many is, of the
same depth."""

HEAVY = ("lammps", "mpi4py", "scipy", "matplotlib", "MDAnalysis", "threadpoolctl")
"""Packages that take longer to import than all of the command's own; h5py comes with every file of results."""


@dataclass(frozen=True)
class Explanation:
    """The parts of a scene.

    Attributes
    ----------
    disks : int
        Of the packing that was measured.
    remark : str
        What that packing is.
    loaded : InstanceContents
        What the scene's undamped run has in LAMMPS.
    imported, left_out : tuple of str
        Heavy packages that this process has imported after that run, and those that it has not.
    parts : tuple of Part
    defaults : dict
        Keys that the scene leaves to their defaults, and those.
    units : dict or None
        What real units make of the scene: k_n, F_y and the overburden, and one unit of it in SI; None without [units].
    load_average : float
        Processes that wanted a core meanwhile, of the last minute.
    """

    disks: int
    remark: str
    loaded: InstanceContents
    imported: tuple[str, ...]
    left_out: tuple[str, ...]
    parts: tuple[Part, ...]
    defaults: dict[str, Any]
    units: dict[str, float] | None
    load_average: float

    @property
    def timed(self) -> bool:
        """Whether the parts have their costs."""
        return any(part.cost is not None for part in self.parts)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        parts = [part.as_dict() for part in self.parts]
        return vars(self) | {"loaded": vars(self.loaded), "parts": parts, "cores": os.cpu_count()}


UNTIMED_STEPS = 200
"""Steps of both runs if they are not timed: two outputs of each contact."""


def explain(scene: Scene, timed: bool = False) -> Explanation:
    """Set the scene's packing up, switch each feature, and compare.

    Parameters
    ----------
    timed : bool
        Whether to measure what each part costs, and whether two ranks move as one does: several times as long.

    Raises
    ------
    SceneError, NoEquilibriumError, EngineError
        If the packing cannot be settled.
    """
    defaults, units = _defaults(scene), _units(scene)
    scene, remark = _affordable(scene)
    start = settle(scene, communicator=MPI.COMM_SELF)
    run = _run_of(scene, start.packing)
    with temporary_folder() as name:
        folder = Path(name)
        with run.start(MPI.COMM_SELF, folder / "scene.log") as (engine, _):
            loaded = InstanceContents.of(engine, folder / "scene.log")
        imported = tuple(package for package in HEAVY if package in sys.modules)
        bare = replace(run, motion={})
        with bare.start(MPI.COMM_SELF) as (_, dynamics):
            steps = _steps(dynamics) if timed else UNTIMED_STEPS
        parts = [_run_feature(feature, loaded, steps, folder, timed) for feature in features(run)]
        parts += [_dumps(scene, start, folder, timed), _contact_output(scene, bare, loaded, steps, folder, timed)]
        parts += [_trajectory(scene, start, bare, steps, folder, timed)]
        parts += [ranks(bare, steps, folder, timed), threads(start.packing, timed)]
    return Explanation(
        disks=len(start.packing),
        remark=remark,
        loaded=loaded,
        imported=imported,
        left_out=tuple(package for package in HEAVY if package not in imported),
        parts=tuple(parts),
        defaults=defaults,
        units=units,
        load_average=os.getloadavg()[0],
    )


def _units(scene: Scene) -> dict[str, float] | None:
    real = real_units(scene)
    return None if real is None else {"kn": scene.law.kn, "fy": scene.load.fy} | real.as_dict()


def _run_feature(feature: Feature, scene: InstanceContents, steps: int, folder: Path, timed: bool) -> Part:
    """Run a scene with a feature and without it: what the feature loads, its cost, and whether both runs agree."""
    turns = TURNS if timed else 0
    with ExitStack() as both:
        logs = folder / "without.log", folder / "with.log"
        without, plain = both.enter_context(feature.without.start(MPI.COMM_SELF, logs[0]))
        with_it, switched = both.enter_context(feature.with_it.start(MPI.COMM_SELF, logs[1]))
        adds = InstanceContents.of(with_it, logs[1]).beyond(InstanceContents.of(without, logs[0]))
        others = ~np.isin(np.arange(len(feature.with_it.packing)), feature.touched)
        forces = without.net_force, with_it.net_force
        here, there = (force[: 2 * len(others)][np.tile(others, 2)] for force in forces)
        identical = np.array_equal(here, there)
        cost = cost_of("step", lambda: plain.advance(steps), lambda: switched.advance(steps), turns, steps)
        same = "forces at the start"
        if not others.all():
            same += f" on the {others.sum()} other disks"
        if not feature.moves:
            same = f"positions and velocities after {steps * (turns + 1) + 1} steps"
            identical &= same_motion(plain.advance(1), switched.advance(1))
    if feature.name == "compensated coordinates" and not identical:
        same += f" differ by {np.abs(forces[1] - forces[0]).max():.1g}, which doubles round away"
    included = bool(adds) and set(adds) <= set(scene.everything)
    if feature.name == "tangential history":
        adds += (f"{_rotations(feature.with_it.packing) - _rotations(feature.without.packing)} rotations in K",)
    return Part(feature.name, included, feature.reason, adds, cost, same, bool(identical))


def _dumps(scene: Scene, start: Equilibrium, folder: Path, timed: bool) -> Part:
    """An equilibrium of the ramp, with and without its dumps."""
    wanted = scene.output is not None and scene.output.dumps
    ramp = scene.ramp or Ramp(step=step_of(scene), until=step_of(scene))
    bounded = scene.model_copy(update={"ramp": ramp})
    # without friction a packing bears no force along the floor
    fx = ramp.step if start.packing.law.frictional else start.fx
    files = folder / "dumps"
    files.mkdir()
    reached: list[Packing] = []
    log = folder / "dumps.log"
    with Engine(start.packing, MPI.COMM_SELF, log) as engine:

        def reach(dumped: bool) -> None:
            reached.append(next_equilibrium(engine, start, fx, bounded).packing)
            if dumped:
                engine.restore(reached[-1])
                engine.dump(files / "run.1")

        # an equilibrium by damped dynamics takes half a second
        cost = cost_of("equilibrium", lambda: reach(False), lambda: reach(True), FEW_TURNS if timed else 0)
        parts = InstanceContents.of(engine, log).parts
    adds = [f"part {part}" for part in parts if part == "write.in"]
    adds += [f"file {path.name}" for path in sorted(files.iterdir())]
    identical = all(np.array_equal(each.position, reached[0].position) for each in reached)
    reason = "output.dumps" if wanted else "no output.dumps: nothing but the result is written"
    return Part("dumps", wanted, reason, tuple(adds), cost, "positions of the equilibrium", identical)


def _contact_output(
    scene: Scene, run: UndampedRun, loaded: InstanceContents, steps: int, folder: Path, timed: bool
) -> Part:
    """The forces of each contact, every 100 steps."""
    wanted = scene.output is not None and scene.output.dumps
    reason = "in the dumps" if wanted else "no output.dumps"
    watched = replace(run, contacts=folder / "contacts")
    feature = Feature("per-contact output", f"{reason}; tried every 100 steps", run, watched, moves=False)
    return replace(_run_feature(feature, loaded, steps, folder, timed), included=wanted)


def _trajectory(scene: Scene, start: Equilibrium, run: UndampedRun, steps: int, folder: Path, timed: bool) -> Part:
    """A sample of an undamped run, with and without its positions in run.h5."""
    wanted = scene.output is not None and bool(scene.output.trajectory)
    path = folder / "run.h5"
    with ExitStack() as stack:
        (_, plain), (_, watched) = (stack.enter_context(run.start(MPI.COMM_SELF)) for _ in range(2))
        record = stack.enter_context(Record(path, scene, MPI.COMM_SELF))
        record.append(start)
        cost = cost_of(
            f"sample of {steps} steps",
            lambda: plain.advance(steps),
            lambda: record.append_motions([(0.0, watched.advance(steps))]),
            TURNS if timed else 0,
        )
        identical = same_motion(plain.advance(1), watched.advance(1))
    with RunFile(path) as file:
        adds = tuple(f"dataset trajectory/{name}" for name in file.series("trajectory"))
    reason = "output.trajectory" if wanted else "no output.trajectory: 300 states of up to 1000 disks"
    return Part("trajectory", wanted, reason, adds, cost, "positions and velocities", identical)


def _affordable(scene: Scene) -> tuple[Scene, str]:
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


def _run_of(scene: Scene, packing: Packing) -> UndampedRun:
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


def _steps(dynamics: Dynamics) -> int:
    """Steps that take SECONDS_A_TURN of a second."""
    trial = 200
    dynamics.advance(trial)
    start = perf_counter()
    dynamics.advance(trial)
    return max(50, int(SECONDS_A_TURN * trial / (perf_counter() - start)))


def _defaults(scene: Scene) -> dict[str, Any]:
    """Keys that the scene leaves out, whose default is a value and not none."""
    resolved = scene.resolved()
    unused = {"relax"} if scene.ramp is None or scene.ramp.method == "newton" else set()
    return {
        f"{name}.{key}": value
        for name, section in scene
        if isinstance(section, BaseModel) and name not in unused
        for key, value in resolved[name].items()
        if key not in section.model_fields_set
    }


def _rotations(packing: Packing) -> int:
    """Coordinates of rotations that the stability operator knows."""
    return int(np.sum(dynamical_matrix(packing)[1] >= 2 * len(packing)))
