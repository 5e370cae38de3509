"""The stages of a run: settle, ramp, perturb. A scene in, equilibria and time series out.

Every stage yields what it has as soon as it has it; `record` keeps it in run.h5 and goes on where a run was
cut off. All functions are collective over the ranks of the communicator; rank 0 alone writes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..analysis import (
    MindlinLaw,
    Packing,
    PackingFileError,
    RunFile,
    largest_frequency,
    mean_square_displacement,
    read_packing,
    stable_timestep,
    touching,
)
from .engine import Engine, Motion, Weakening
from .quasistatic import Equilibrium, NoEquilibriumError, equilibrate, rounding_floor
from .rattlers import clear_rattlers
from .scene import Friction, GeneratedPacking, Perturb, Ramp, Scene, SceneError
from .settling import Watch, settled

ACCURATE_SHARE = 0.05
"""Time step of undamped runs in units of the stability limit 2/omega_max: the fastest mode is then resolved
by 60 steps a period, and the dispersion of all others is smaller."""

OUT_OF_BALANCE = 1e-3
"""Residual of a stored packing, in units of F_y, above which it counts as not settled: the packing would
rearrange rather than relax."""


def settle(
    scene: Scene,
    mu: float | None = None,
    communicator: MPI.Comm | None = None,
    watch: Watch = lambda says: None,
) -> Equilibrium:
    """The packing of a scene in equilibrium at F_x = 0.

    A generated packing settles without friction, and friction begins with zero slips (or settles with
    friction, if the scene says so); a stored one is taken as it is, and brought to the rounding floor.

    Parameters
    ----------
    scene : Scene
        What is wanted.
    mu : float, optional
        Friction coefficient; by default the scene's first.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.
    watch : callable, optional
        Told in words what begins, for a packing of more than 300 disks, which takes a while.

    Returns
    -------
    Equilibrium

    Raises
    ------
    SceneError
        If a stored packing is not in balance.
    NoEquilibriumError
        If the packing does not come to rest.
    """
    law = MindlinLaw(scene.law.kn, scene.law.kt, scene.law.mus[0] if mu is None else mu)
    generated = isinstance(scene.packing, GeneratedPacking)
    packing = _settled(scene, law, communicator, watch) if generated else _stored(scene, law)
    with Engine(packing, communicator) as engine:
        try:
            return equilibrate(engine, _unpolished(packing), packing.fx)
        except NoEquilibriumError as error:
            raise NoEquilibriumError(
                f"the packing does not come to rest (a disk feels {packing.residual:.2g}): put more disks into the "
                "upper layer (leave packing.top out for as many as it takes), or try another seed"
            ) from error


def ramp(
    scene: Scene,
    start: Equilibrium | None = None,
    communicator: MPI.Comm | None = None,
    dumps: Path | None = None,
) -> Iterator[Equilibrium]:
    """Equilibria at F_x = step, 2 step, ... up to the scene's ramp.until.

    Parameters
    ----------
    scene : Scene
        With a section [ramp].
    start : Equilibrium, optional
        Where to begin, one of a ramp of this scene; by default the scene is settled and the settled packing
        is the first to be yielded.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.
    dumps : Path, optional
        Stem of LAMMPS dumps of each equilibrium k, the first of the ramp being 1: STEM.k.disks and the others of
        write.in. None by default.

    Yields
    ------
    Equilibrium

    Raises
    ------
    SceneError
        If the scene has no section [ramp].
    NoEquilibriumError
        If the packing flows.
    """
    settings = _ramp_of(scene)
    if start is None:
        start = settle(scene, communicator=communicator)
        yield start
    with Engine(start.packing, communicator) as engine:
        for k, fx in enumerate(loads(settings)):
            if fx > start.fx:
                start = next_equilibrium(engine, start, fx, scene)
                if dumps is not None:
                    engine.restore(start.packing)
                    engine.dump(Path(f"{dumps}.{k}"))
                yield start


def loads(settings: Ramp) -> NDArray[np.float64]:
    """F_x of the equilibria of a ramp, force, from 0: multiples of the step, to the bit."""
    # half a step in a million is far above the rounding of until/step, and far below a step
    multiples = np.arange(int(settings.until / settings.step * (1 + 5e-7)) + 1, dtype=np.float64)
    return multiples * settings.step


def next_equilibrium(
    engine: Engine, last: Equilibrium, fx: float, scene: Scene, beside: Equilibrium | None = None
) -> Equilibrium:
    """The equilibrium at fx that follows from the last one, by the scene's method; `beside` as in `equilibrate`."""
    settings = _ramp_of(scene)
    if settings.method == "newton":
        return equilibrate(engine, last, fx, settings.force_tolerance, beside)
    floor = rounding_floor(last.packing)
    engine.restore(last.packing)
    engine.set_fx(fx)
    relaxation = engine.relax(
        settings.force_tolerance if settings.force_tolerance is not None else 1.5 * floor,
        scene.relax.damping,
        scene.relax.time_step,
    )
    if relaxation.status == "no":
        raise NoEquilibriumError(
            f"the relaxation at F_x = {fx:.10g} did not come to rest in {relaxation.steps} steps (a disk feels "
            f"{relaxation.residual:.2g}); the last equilibrium is at F_x = {last.fx:.10g}"
        )
    packing = engine.packing
    return Equilibrium(packing, relaxation.residual, rounding_floor(packing), relaxation.steps)


class EquilibriumPath:
    """Equilibria of a scene as a function of F_x, computed when they are asked for.

    Beyond the largest F_x so far the ramp is continued and the equilibrium kept; in between, the equilibrium
    follows from the kept one just below, and is not kept.

    Parameters
    ----------
    engine : Engine
        LAMMPS with the packing of `start`.
    start : Equilibrium
        Where the ramp begins.
    scene : Scene
        With a section [ramp], for its method and force tolerance.
    """

    def __init__(self, engine: Engine, start: Equilibrium, scene: Scene) -> None:
        self._engine, self._scene = engine, scene
        self.kept = [start]
        self._beside: tuple[Equilibrium, Equilibrium] | None = None  # an equilibrium, and another one near it

    def __call__(self, fx: float) -> Packing:
        """The packing in equilibrium at fx."""
        below = next((each for each in reversed(self.kept) if each.fx <= fx), self.kept[0])
        if below.fx == fx:
            return below.packing
        beside = self._beside[1] if self._beside and self._beside[0] is below else None
        found = next_equilibrium(self._engine, below, fx, self._scene, beside)
        if fx > self.kept[-1].fx:
            self.kept.append(found)
            self._beside = found, below
        else:
            self._beside = below, found
        return found.packing

    def climb(self, forces: NDArray[np.float64]) -> Iterator[Equilibrium]:
        """The equilibria at increasing forces, up to the last one that the packing bears."""
        for fx in forces:
            try:
                self(float(fx))
            except NoEquilibriumError:
                if len(self.kept) < 2:
                    raise
                return
            yield self.kept[-1]


@dataclass(frozen=True)
class Sample:
    """One line of the time series of an undamped run.

    Attributes
    ----------
    time : float
        Since the start of the run.
    msd : float
        D, mean square displacement from the equilibrium, length^2.
    kinetic_energy : float
        Of translation and rotation.
    layer_velocity : float
        Mean velocity of the upper layer along x.
    friction : float
        Friction coefficient at that moment.
    """

    time: float
    msd: float
    kinetic_energy: float
    layer_velocity: float
    friction: float


def time_step(packing: Packing, wanted: float | None = None) -> float:
    """Time step of an undamped run from an equilibrium.

    Parameters
    ----------
    packing : Packing
        The equilibrium.
    wanted : float, optional
        A step of the user's; by default `ACCURATE_SHARE` of the limit 2/omega_max.

    Raises
    ------
    SceneError
        If the step wanted is not below the limit: velocity Verlet would blow up.
    """
    limit = stable_timestep(largest_frequency(packing))
    if wanted is None:
        return ACCURATE_SHARE * limit
    if wanted >= limit:
        raise SceneError(
            f"perturb.time_step = {wanted:g} is over the limit 2/omega_max = {limit:.4g} of this packing, above which "
            f"every run blows up: lower it, to {ACCURATE_SHARE * limit:.2g} for an accurate run"
        )
    return wanted


def perturb(
    scene: Scene,
    start: Equilibrium,
    samples: int = 2000,
    early: int = 200,
    communicator: MPI.Comm | None = None,
    weakening: Weakening | None = None,
    watch: Callable[[float, Motion], None] | None = None,
) -> Iterator[Sample]:
    """An undamped run from rest at an equilibrium, with the scene's perturbation if it has one.

    Parameters
    ----------
    scene : Scene
        With a section [perturb].
    start : Equilibrium
        The equilibrium at the scene's perturb.fx.
    samples : int
        Lines of the time series, equally spaced; fewer if there are fewer steps.
    early : int
        Further lines, at times that grow geometrically from the first step on; 0 for none.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.
    weakening : Weakening, optional
        Friction that falls with the layer's velocity, see `weakening_of`; constant by default.
    watch : callable, optional
        Called with the time, and the positions and velocities, of each sample.

    Returns
    -------
    iterator of Sample
        The run proceeds as it is consumed.

    Raises
    ------
    SceneError
        At once, if the scene has no section [perturb], its time step is over the limit, or its time shorter than one
        step.
    """
    settings = scene.perturb
    if settings is None:
        raise SceneError("the scene has no section [perturb]: add it, with fx and time")
    packing = start.packing
    dt = time_step(packing, settings.time_step)
    if settings.time < dt:
        raise SceneError(f"perturb.time = {settings.time:g} is shorter than one step, {dt:.4g}: run longer")
    every = max(1, int(settings.time / dt / samples))
    steps = every * np.arange(1, int(settings.time / dt / every) + 1)
    if early:
        steps = np.union1d(steps, np.geomspace(1, steps[-1], early).astype(np.int64))
    return _undamped(settings, packing, dt, steps, communicator, weakening, watch)


def calibrated(scene: Scene, start: Equilibrium, communicator: MPI.Comm | None = None) -> float:
    """The threshold v_0: the largest |mean v_x| of the upper layer in an unforced undamped run of the scene's time."""
    if scene.perturb is None:
        raise SceneError("the scene has no section [perturb]: add it, with fx and time")
    quiet = scene.model_copy(update={"perturb": scene.perturb.model_copy(update={"amplitude": 0.0})})
    return max(abs(sample.layer_velocity) for sample in perturb(quiet, start, communicator=communicator))


def weakening_of(friction: Friction, v0: float) -> Weakening:
    """The scene's mu(v) for a threshold v_0, length / time."""
    return Weakening(B=friction.B, w=friction.w, mu_ss=friction.mu_ss, v0=v0, v_ss=friction.velocity_scale(v0))


def _undamped(
    settings: Perturb,
    packing: Packing,
    dt: float,
    steps: NDArray[np.int64],
    communicator: MPI.Comm | None,
    weakening: Weakening | None,
    watch: Callable[[float, Motion], None] | None,
) -> Iterator[Sample]:
    everyone = range(len(packing)) if settings.target == "all" else settings.target
    target = None if everyone == "top" else [int(disk) for disk in everyone]
    inertia = packing.inertia_factor * packing.mass * packing.radius**2
    with (
        Engine(packing, communicator) as engine,
        engine.undamped(dt, settings.amplitude, settings.omega or 0.0, target, weakening),
    ):
        for step, forward in zip(steps.tolist(), np.diff(steps, prepend=0).tolist(), strict=True):
            motion = engine.advance(forward)
            if watch is not None:
                watch(step * dt, motion)
            yield Sample(
                time=step * dt,
                msd=float(
                    mean_square_displacement(
                        motion.position, packing.position, packing.box_length, motion.position_low, packing.position_low
                    )
                ),
                kinetic_energy=float(
                    0.5 * (packing.mass @ np.sum(motion.velocity**2, axis=1) + inertia @ motion.spin**2)
                ),
                layer_velocity=float(motion.velocity[packing.top, 0].mean()),
                friction=motion.friction,
            )


def reach(scene: Scene, fx: float, communicator: MPI.Comm | None = None) -> Iterator[Equilibrium]:
    """The equilibria of a ramp up to and with fx, by the steps of the scene's ramp or, without one, of 1e-3."""
    step = scene.ramp.step if scene.ramp else 1e-3
    settings = (scene.ramp or Ramp(until=max(fx, step))).model_copy(update={"step": step, "until": max(fx, step)})
    bounded = scene.model_copy(update={"ramp": settings})
    last = None
    for last in ramp(bounded, communicator=communicator):
        if last.fx > fx:
            return
        yield last
    if last is not None and last.fx < fx:
        with Engine(last.packing, communicator) as engine:
            yield next_equilibrium(engine, last, fx, bounded)


class Record:
    """run.h5 of a scene: opened where it was cut off, or begun.

    Parameters
    ----------
    path : Path
        The file.
    scene : Scene
        The scene; a file of another scene is refused.
    communicator : mpi4py.MPI.Comm, optional
        Rank 0 writes; all by default.

    Raises
    ------
    SceneError
        If the file holds another scene.
    """

    def __init__(self, path: Path, scene: Scene, communicator: MPI.Comm | None = None) -> None:
        self.path, self.scene = path, scene
        self.communicator = communicator or MPI.COMM_WORLD
        self._file: RunFile | None = None
        self.last = self.communicator.bcast(self._resume() if self.communicator.rank == 0 else None)

    def _resume(self) -> Equilibrium | None:
        if not self.path.exists():
            return None
        with RunFile(self.path) as file:
            stored = json.loads(file.attributes.get("scene", "{}"))
            difference = _difference(stored, self.scene.resolved())
            if difference:
                raise SceneError(
                    f"{self.path} holds a run of another scene ({difference}): give another name with -o, or delete it"
                )
            if len(file) == 0:
                return None
            row = {name: file.observable(name)[-1] for name in ("residual", "floor", "evaluations")}
            return Equilibrium(file.packing(), float(row["residual"]), float(row["floor"]), int(row["evaluations"]))

    def append(self, equilibrium: Equilibrium) -> None:
        """Write one equilibrium; it is on the disk when this returns."""
        if self.communicator.rank == 0:
            self._open(equilibrium.packing).append(
                equilibrium.packing,
                floor=equilibrium.floor,
                evaluations=equilibrium.evaluations,
            )
        self.last = equilibrium

    def append_series(self, samples: list[Sample], name: str = "undamped") -> None:
        """Write lines of a time series."""
        if self.communicator.rank == 0 and self._file is not None and samples:
            columns = {key: [getattr(sample, key) for sample in samples] for key in vars(samples[0])}
            self._file.append_series(name, **columns)

    def append_motion(self, time: float, motion: Motion) -> None:
        """Write positions of an undamped run, series trajectory."""
        if self.communicator.rank == 0 and self._file is not None:
            low = {} if motion.position_low is None else {"position_low": [motion.position_low]}
            self._file.append_series("trajectory", time=[time], position=[motion.position], **low)

    def _open(self, packing: Packing) -> RunFile:
        if self._file is None:
            exists = self.path.exists() and self.last is not None
            self._file = RunFile(self.path, "a") if exists else RunFile.create(self.path, packing, self._attributes())
        return self._file

    def _attributes(self) -> dict[str, str | int]:
        return {
            "scene": json.dumps(self.scene.resolved()),
            "seed": getattr(self.scene.packing, "seed", -1),
            "ranks": self.communicator.size,
            **{f"version_{name}": version(name) for name in ("faultgouge", "lammps", "numpy", "scipy", "h5py")},
        }

    def __enter__(self) -> Record:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()


def _settled(scene: Scene, law: MindlinLaw, communicator: MPI.Comm | None, watch: Watch) -> Packing:
    assert isinstance(scene.packing, GeneratedPacking)
    start = scene.packing.start()
    settling = law if scene.packing.settle_friction else replace(law, mu=0.0)
    loose = Packing(
        position=start.position,
        radius=start.radius,
        top=start.top,
        box_length=start.box_length,
        inertia_factor=scene.inertia_factor,
        law=settling,
        contacts=touching(start.position, start.radius, start.box_length),
        fy=scene.load.fy,
        position_low=np.zeros_like(start.position) if scene.precision == "compensated" else None,
    )
    with Engine(loose, communicator) as engine:
        packing = settled(engine, loose, watch)
    idle = len(packing.loaded(rounding_floor(packing)).rattlers)
    if idle > 0.5 * len(packing):
        raise NoEquilibriumError(
            f"the upper layer sank through the bed, and {idle} of {len(packing)} disks carry nothing: without friction "
            "only a layer that closes the box stays on top, so put more disks into it (leave packing.top out for as "
            "many as it takes), or try another seed"
        )
    if scene.packing.settle_friction:
        return packing
    packing = clear_rattlers(packing, rounding_floor(packing))
    return replace(packing, law=law, angle=np.zeros(len(packing)))


def _unpolished(packing: Packing) -> Equilibrium:
    return Equilibrium(packing, packing.residual, rounding_floor(packing), 0)


def _stored(scene: Scene, law: MindlinLaw) -> Packing:
    assert not isinstance(scene.packing, GeneratedPacking)
    path = scene.packing.file
    if path.suffix == ".json":
        packing = read_packing(path, law, inertia_factor=scene.inertia_factor, fy=scene.load.fy)
    else:
        with RunFile(path) as file:
            if len(file) == 0:
                raise PackingFileError(f"{path} has no equilibrium in it")
            packing = replace(file.packing(0), law=law, inertia_factor=scene.inertia_factor, fy=scene.load.fy)
    if scene.precision == "double":
        packing = replace(packing, position_low=None)
    elif not packing.compensated:
        packing = replace(packing, position_low=np.zeros_like(packing.position))
    if packing.residual > OUT_OF_BALANCE * scene.load.fy:
        raise SceneError(
            f"{path}: the packing is not in balance, a disk feels {packing.residual:.3g} under fy = {scene.load.fy:g}: "
            "check law and load against those it was settled with, or let `faultgouge settle` make a packing"
        )
    return packing


def _ramp_of(scene: Scene) -> Ramp:
    if scene.ramp is None:
        raise SceneError("the scene has no section [ramp]: add it, with step and until")
    return scene.ramp


def _difference(stored: dict[str, Any], wanted: dict[str, Any]) -> str:
    """The first key in which two resolved scenes differ, ramp.until left aside: a ramp may be prolonged."""
    for section in sorted(stored.keys() | wanted.keys()):
        here, there = stored.get(section), wanted.get(section)
        if isinstance(here, dict) and isinstance(there, dict):
            for key in sorted(here.keys() | there.keys()):
                if (section, key) != ("ramp", "until") and here.get(key) != there.get(key):
                    return f"{section}.{key} is {here.get(key)} there and {there.get(key)} here"
        elif here != there:
            return f"{section} is {'there' if here is not None else 'missing there'}"
    return ""
