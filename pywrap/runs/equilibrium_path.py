"""The path of equilibria of a scene: a ramp of F_x in steps, or the equilibrium at any given F_x.

All functions are collective over the ranks of the communicator.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from mpi4py import MPI

from ...analysis import NoEquilibriumError, Packing
from ...analysis.arrays import Floats
from ..equilibria.quasistatic import Equilibrium, equilibrate, rounding_floor
from ..lammps.engine import Engine
from ..scenes.scene import Scene
from ..scenes.sections import Ramp
from ..scenes.validation import SceneError, require_section
from ..settling.settle import settle


def ramp(
    scene: Scene,
    start: Equilibrium | None = None,
    communicator: MPI.Comm | None = None,
    dumps: Path | None = None,
    behind: int | None = None,
) -> Iterator[Equilibrium]:
    """Compute equilibria at F_x = step, 2 step, ... up to the scene's ramp.until, or through its turning points.

    Parameters
    ----------
    scene : Scene
        With a section [ramp].
    start : Equilibrium, optional
        An equilibrium of a ramp of this scene from which to start. By default the scene is settled, and the settled
        packing is yielded first.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.
    dumps : Path, optional
        Stem of LAMMPS dumps of each equilibrium k, the first of the ramp being 1: STEM.k.disks and the others of
        write.in. None by default.
    behind : int, optional
        Number of loads of the ramp, the first of them 0, before `start`, see `count_behind`; by default the loads up to
        its F_x on the way to the first turning point.

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
    settings = require_section(scene.ramp, "ramp")
    if start is None:
        start = settle(scene, communicator=communicator)
        yield start
    with Engine(start.packing, communicator) as engine:
        wanted = all_loads(settings)
        if behind is None:
            behind = int(np.sum(np.abs(_way_to(0.0, settings.first, settings.step)) <= abs(start.fx)))
        for k, fx in enumerate(wanted[behind:].tolist(), behind):
            start = next_equilibrium(engine, start, fx, scene)
            if dumps is not None:
                engine.restore(start.packing)  # what was found, and not what was tried last
                engine.dump(Path(f"{dumps}.{k}"))
            yield start


def reach(scene: Scene, fx: float, communicator: MPI.Comm | None = None) -> Iterator[Equilibrium]:
    """Compute the equilibria up to and including fx, in steps of the scene's ramp or, without a ramp, of F_y/3000.

    The ranks of the communicator share the packing; all by default.
    """
    step = step_of(scene)
    step = min(step, fx) or step  # one increment, where the first one of the ramp were too large
    settings = scene.ramp or Ramp(step=step, until=step)
    settings = settings.model_copy(update={"step": step, "until": max(fx, step)})
    bounded = scene.model_copy(update={"ramp": settings})
    for last in ramp(bounded, communicator=communicator):
        yield last
        if last.fx >= fx:
            return
    with Engine(last.packing, communicator) as engine:
        yield next_equilibrium(engine, last, fx, bounded)


def step_of(scene: Scene) -> float:
    """Increment of F_x on the way to an undamped run, force."""
    return scene.ramp.step if scene.ramp else scene.load.fy / 3000


def loads(settings: Ramp) -> Floats:
    """F_x of the equilibria up to the first turning point of a ramp, force, from 0: where onsets are sought.

    Raises
    ------
    SceneError
        If F_x goes below 0 first.
    """
    if settings.first < 0:
        raise SceneError(
            f"ramp.until goes to F_x = {settings.first:g} first, and onsets are sought above 0: give a first turning "
            "point above 0"
        )
    return _way_to(0.0, settings.first, settings.step)


def all_loads(settings: Ramp) -> Floats:
    """F_x of all equilibria of a ramp, force, from 0 through its turning points: multiples of the step in between, the
    same to the bit on each way."""
    way = _way_to(0.0, settings.first, settings.step)
    for point in settings.turning_points[1:]:
        way = np.append(way, _way_to(float(way[-1]), point, settings.step)[1:])
    return way


def _way_to(begin: float, end: float, step: float) -> Floats:
    """From one load to another, force: multiples of the step, to the bit, between both."""
    # half a step in a million is far above the rounding of end/step, and far below a step
    rounding = 5e-7 * max(abs(begin), abs(end)) / step
    sign = 1.0 if end > begin else -1.0
    first, last = (math.floor(sign * load / step + rounding) for load in (begin, end))
    # adding 0 makes 0 of -0
    way = np.append(begin, sign * np.arange(first + 1, last + 1, dtype=np.float64) * step + 0.0)
    return np.append(way, end) if sign * (end - way[-1]) > rounding * step else way


def count_behind(settings: Ramp, reached: Floats) -> int:
    """How many loads of a ramp lie behind a run that reached these; F_x of its equilibria, force.

    Raises
    ------
    SceneError
        If the run went another way.
    """
    wanted = all_loads(settings)
    count = min(len(wanted), len(reached))
    same = wanted[:count] == reached[:count]
    if same.all():
        return count
    k = int(np.argmin(same))
    # `until` of one of the two is no multiple of the step, and the other one goes on from there
    if k == len(reached) - 1 and k > 0 and _between(reached[k], wanted[k - 1], wanted[k]):
        return k
    if k == len(wanted) - 1 and k > 0 and _between(wanted[k], reached[k - 1], reached[k]):
        return len(wanted)
    raise SceneError(
        f"the run has gone to F_x = {reached[k]:g} where ramp.until leads to F_x = {wanted[k]:g}: give another name "
        "with -o, or delete it"
    )


def _between(load: float, one: float, other: float) -> bool:
    return bool(min(one, other) < load < max(one, other))


def next_equilibrium(
    engine: Engine,
    last: Equilibrium,
    fx: float,
    scene: Scene,
    beside: Equilibrium | None = None,
    onward: bool = True,
) -> Equilibrium:
    """The equilibrium at fx that follows from the last one, by the scene's method; the others as in `equilibrate`."""
    settings = require_section(scene.ramp, "ramp")
    if settings.method == "newton":
        return equilibrate(engine, last, fx, settings.force_tolerance, beside, onward)
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
    further : sequence of Equilibrium
        Those of the path that are known already, by increasing F_x.
    onward : bool
        Whether the ramp is continued by other ways where Newton's branch of equilibria ends, as in `ramp`.
    """

    def __init__(
        self,
        engine: Engine,
        start: Equilibrium,
        scene: Scene,
        further: Sequence[Equilibrium] = (),
        onward: bool = False,
    ) -> None:
        self.engine, self.scene, self._onward = engine, scene, onward
        self.equilibria = [start, *further]
        self._beside: tuple[Equilibrium, Equilibrium] | None = None  # a kept one, and the last one found above it

    def __call__(self, fx: float) -> Packing:
        """The packing in equilibrium at fx."""
        below = next((each for each in reversed(self.equilibria) if each.fx <= fx), self.equilibria[0])
        if below.fx == fx:
            return below.packing
        if fx > self.equilibria[-1].fx:
            # from the ramp alone, so that it does not depend on what is asked for in between
            beside = self.equilibria[-2] if len(self.equilibria) > 1 else None
            found = next_equilibrium(self.engine, below, fx, self.scene, beside, self._onward)
            self.equilibria.append(found)
            return found.packing
        beside = self._beside[1] if self._beside and self._beside[0] is below else None
        found = next_equilibrium(self.engine, below, fx, self.scene, beside, onward=False)
        self._beside = below, found
        return found.packing

    def climb(self, forces: Floats) -> Iterator[Equilibrium]:
        """The equilibria at increasing forces, up to the last one that the packing bears."""
        for fx in forces:
            try:
                self(float(fx))
            except NoEquilibriumError:
                if len(self.equilibria) < 2:
                    raise
                return
            yield self.equilibria[-1]
