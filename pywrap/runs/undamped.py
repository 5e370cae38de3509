"""Undamped runs from an equilibrium: their time step, their perturbation and their time series.

A run yields each sample as soon as it is computed. The run resumes its own state after every part, so that a run
continued from a checkpoint is bitwise the same. All functions are collective over the ranks of the communicator.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from ...analysis import Packing, largest_frequency, mean_square_displacement, stable_timestep
from ...analysis.arrays import Floats, Indices
from ..equilibria.quasistatic import Equilibrium
from ..lammps.dynamics import MotionState, Weakening
from ..lammps.engine import Engine
from ..scenes.run_sections import Perturb
from ..scenes.scene import Scene, scene_of
from ..scenes.sections import Friction
from ..scenes.validation import SceneError, require_section
from .ramp import reach

ACCURATE_SHARE = 0.05
"""Time step of undamped runs in units of the stability limit, 2/omega_max without dashpots: the fastest mode is then
resolved by 60 steps a period, and the dispersion of all others is smaller. A growth rate is right to 5e-5, a fit of
D(t) to some 4e-4; with 0.2 of the limit the rate would be off by 9e-4, which the fit shows."""

SHORTEST_PART, MOST_PARTS = 10_000, 100
"""Steps after which an undamped run resumes its own state, and may be continued from there: at least so many, and at
most so many parts a run. The setup of a part takes about as long as a hundred steps."""


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


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """An undamped run that is under way.

    Attributes
    ----------
    step : int
        Time steps so far.
    state : dict of ndarray
        The disks, as of :meth:`~faultgouge.pywrap.lammps.dynamics.Dynamics.state`.
    """

    step: int
    state: dict[str, Floats]


def time_step(packing: Packing, wanted: float | None = None) -> float:
    """Time step of an undamped run from an equilibrium.

    Parameters
    ----------
    packing : Packing
        The equilibrium.
    wanted : float, optional
        A step of the user's; by default `ACCURATE_SHARE` of the limit
        (:func:`~faultgouge.analysis.stable_timestep`), which is 2/omega_max without dashpots.

    Returns
    -------
    float
        The step, time.

    Raises
    ------
    SceneError
        If the step wanted is not below the limit: velocity Verlet would blow up.
    """
    # the frequency of a small packing is right to the last digit
    limit = float(stable_timestep(packing if packing.law.damped else largest_frequency(packing)))
    if wanted is not None and wanted >= limit:
        name = "with these dashpots" if packing.law.damped else "2/omega_max"
        says = f"perturb.time_step = {wanted:g} is over the limit {name} = {limit:.4g} of this packing"
        cure = f"lower it, to {ACCURATE_SHARE * limit:.2g} for an accurate run"
        raise SceneError(f"{says}, above which every run blows up: {cure}")
    return ACCURATE_SHARE * limit if wanted is None else wanted


def perturb(
    scene: Scene | str | Path,
    start: Equilibrium | None = None,
    samples: int = 2000,
    early: int = 200,
    communicator: MPI.Comm | None = None,
    weakening: Weakening | None = None,
    watch: Callable[[float, MotionState], None] | None = None,
    keep: Callable[[Checkpoint], None] | None = None,
    resume: Checkpoint | None = None,
) -> Iterator[Sample]:
    """Run the undamped dynamics from rest at an equilibrium, with the perturbation of the scene, if any.

    Parameters
    ----------
    scene : Scene, str or Path
        With a section [perturb]; or its file.
    start : Equilibrium, optional
        The equilibrium at the scene's perturb.fx; by default the packing settles and goes there first.
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
    keep : callable, optional
        Called with a checkpoint after every part of the run, see `SHORTEST_PART`, after the samples before it have been
        consumed.
    resume : Checkpoint, optional
        Continue from this checkpoint, and yield the samples that follow: bitwise the same.

    Returns
    -------
    iterator of Sample
        The run proceeds as it is consumed.

    Raises
    ------
    SceneError
        Immediately, if the scene has no section [perturb], its time step is above the limit, or its time is shorter
        than one step; or, without `start`, if it has no perturb.fx.

    Examples
    --------

    Beyond F_x^c = 1.936 the mean square displacement D grows as exp(7.07 t), from what rounding has left:

    >>> layer = {"disks": 3, "radii": [0.5], "top": 1, "width": 2.8}
    >>> scene = {"packing": layer, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
    >>> scene = faultgouge.Scene.from_mapping(scene | {"perturb": {"fx": 2.4, "time": 4.0}})
    >>> samples = list(faultgouge.perturb(scene, samples=8, early=0))
    >>> rate = np.log(samples[-1].msd / samples[3].msd) / (samples[-1].time - samples[3].time)
    >>> bool(6 < rate < 8)
    True
    """
    scene = scene_of(scene, "perturb")
    settings = require_section(scene.perturb, "perturb")
    if start is None:
        if settings.fx is None:
            raise SceneError("perturb.fx is missing: give the load of the run, or the equilibrium from which it starts")
        *_, start = reach(scene, settings.fx, communicator)
    packing = start.packing
    dt, steps = sample_steps(settings, packing, samples, early)
    target = {"top": None, "all": range(len(packing))}.get(str(settings.target), settings.target)
    forces = *settings.cosine, target, weakening, settings.forcing(), settings.on or "layer"
    part = max(SHORTEST_PART, -(-int(settings.time / dt) // MOST_PARTS))  # by the length of the run alone
    ends, sampled = range(part, int(steps[-1]), part), set(steps.tolist())

    def run() -> Iterator[Sample]:
        with Engine(packing, communicator) as engine, engine.undamped(dt, *forces) as dynamics:
            last = 0
            if resume is not None:
                last = resume.step
                dynamics.resume(last, resume.state)
            for step in sorted(each for each in sampled.union(ends) if each > last):
                motion, last = dynamics.advance(step - last), step
                if step in sampled:
                    if watch is not None:
                        watch(step * dt, motion)
                    low = motion.position_low, packing.position_low
                    moved = mean_square_displacement(motion.position, packing.position, packing.box_length, *low)
                    energy, layer = motion.kinetic_energy(packing), motion.velocity[packing.top, 0].mean()
                    yield Sample(step * dt, float(moved), energy, float(layer), motion.friction)
                if step in ends:
                    state = dynamics.state()
                    dynamics.resume(step, state)  # as a run does that is continued from here
                    if keep is not None:
                        keep(Checkpoint(step, state))

    return run()


def sample_steps(settings: Perturb, packing: Packing, samples: int = 2000, early: int = 200) -> tuple[float, Indices]:
    """Time step of an undamped run, and the steps at which it is sampled; parameters and errors as of `perturb`."""
    dt = time_step(packing, settings.time_step)
    settings.check_samples(dt)
    if settings.time < dt:
        raise SceneError(f"perturb.time = {settings.time:g} is shorter than one step, {dt:.4g}: run longer")
    every = max(1, int(settings.time / dt / samples))
    steps = every * np.arange(1, int(settings.time / dt / every) + 1)
    if early:
        steps = np.union1d(steps, np.geomspace(1, steps[-1], early).astype(np.int64))
    return dt, steps


def without_perturbation(scene: Scene) -> Scene:
    """The scene without its perturbation: the run that calibrates v_0."""
    settings = require_section(scene.perturb, "perturb")
    return scene.model_copy(update={"perturb": settings.model_copy(update={"amplitude": 0.0, "signal": None})})


def weakening_of(friction: Friction, v0: float) -> Weakening:
    """The scene's mu(v) for a threshold v_0, length / time."""
    return Weakening(B=friction.B, w=friction.w, mu_ss=friction.mu_ss, v0=v0, v_ss=friction.velocity_scale(v0))
