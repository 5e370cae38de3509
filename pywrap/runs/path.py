"""The path of equilibria of a scene: a ramp of F_x in steps, or the equilibrium at any F_x that is asked for.

All functions are collective over the ranks of the communicator.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from mpi4py import MPI

from ...analysis import NoEquilibriumError, Packing
from ...analysis.packing.arrays import Floats
from ..equilibria.quasistatic import Equilibrium, equilibrate, rounding_floor
from ..lammps.engine import Engine
from ..scenes.refusals import needed
from ..scenes.scene import Scene
from ..scenes.sections import Ramp
from ..settling.bed import settle


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
    settings = needed(scene.ramp, "ramp")
    if start is None:
        start = settle(scene, communicator=communicator)
        yield start
    with Engine(start.packing, communicator) as engine:
        for k, fx in enumerate(loads(settings)):
            if fx > start.fx:
                start = next_equilibrium(engine, start, fx, scene)
                if dumps is not None:
                    # in LAMMPS started anew, where contacts stand in an order that no earlier increment has a part in
                    with Engine(start.packing, communicator) as fresh:
                        fresh.dump(Path(f"{dumps}.{k}"))
                yield start


def reach(scene: Scene, fx: float) -> Iterator[Equilibrium]:
    """The equilibria of a ramp up to and with fx, by the steps of the scene's ramp or, without one, of 1e-3."""
    step = scene.ramp.step if scene.ramp else 1e-3
    step = min(step, fx) or step  # one increment, where the first one of the ramp were too large
    settings = (scene.ramp or Ramp(until=max(fx, step))).model_copy(update={"step": step, "until": max(fx, step)})
    bounded = scene.model_copy(update={"ramp": settings})
    for last in ramp(bounded):
        yield last
        if last.fx >= fx:
            return
    with Engine(last.packing) as engine:
        yield next_equilibrium(engine, last, fx, bounded)


def loads(settings: Ramp) -> Floats:
    """F_x of the equilibria of a ramp, force, from 0: multiples of the step, to the bit, and `until` in the end."""
    # half a step in a million is far above the rounding of until/step, and far below a step
    rounding = 5e-7
    multiples = np.arange(int(settings.until / settings.step * (1 + rounding)) + 1, dtype=np.float64) * settings.step
    left = settings.until - multiples[-1]
    return np.append(multiples, settings.until) if left > rounding * settings.until else multiples


def next_equilibrium(
    engine: Engine,
    last: Equilibrium,
    fx: float,
    scene: Scene,
    beside: Equilibrium | None = None,
    onward: bool = True,
) -> Equilibrium:
    """The equilibrium at fx that follows from the last one, by the scene's method; the others as in `equilibrate`."""
    settings = needed(scene.ramp, "ramp")
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
        self.kept = [start, *further]
        self._beside: tuple[Equilibrium, Equilibrium] | None = None  # a kept one, and the last one found above it

    def __call__(self, fx: float) -> Packing:
        """The packing in equilibrium at fx."""
        below = next((each for each in reversed(self.kept) if each.fx <= fx), self.kept[0])
        if below.fx == fx:
            return below.packing
        if fx > self.kept[-1].fx:
            # from the ramp alone, so that it does not depend on what is asked for in between
            beside = self.kept[-2] if len(self.kept) > 1 else None
            found = next_equilibrium(self.engine, below, fx, self.scene, beside, self._onward)
            self.kept.append(found)
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
                if len(self.kept) < 2:
                    raise
                return
            yield self.kept[-1]
