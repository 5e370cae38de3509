"""The loading path of a scene: each equilibrium follows from another one by the scene's method, in LAMMPS.

All functions are collective over the ranks of the engine.
"""

from __future__ import annotations

from types import SimpleNamespace

from ...analysis import NoEquilibriumError
from ..equilibria.quasistatic import Equilibrium, equilibrate, rounding_floor
from ..lammps.engine import Engine
from ..load_path import LoadPath
from ..scenes.scene import Scene
from ..scenes.validation import require_section


def next_equilibrium(
    engine: Engine, last: Equilibrium, fx: float, scene: Scene, beside: Equilibrium | None = None, onward: bool = True
) -> Equilibrium:
    """The equilibrium at fx, from the last one by the scene's method; `beside` and `onward` as in `equilibrate`."""
    settings = require_section(scene.ramp, "ramp")
    if settings.method == "newton":
        return equilibrate(engine, last, fx, settings.force_tolerance, beside, onward)
    tolerance = settings.force_tolerance
    tolerance = 1.5 * rounding_floor(last.packing) if tolerance is None else tolerance
    engine.restore(last.packing)
    engine.set_fx(fx)
    relaxation = engine.relax(tolerance, scene.relax.damping, scene.relax.time_step)
    if relaxation.status == "no":
        says = f"the relaxation at F_x = {fx:.10g} did not come to rest in {relaxation.steps} steps"
        feels = f"(a disk feels {relaxation.residual:.2g})"
        raise NoEquilibriumError(f"{says} {feels}; the last equilibrium is at F_x = {last.fx:.10g}")
    packing = engine.packing
    return Equilibrium(packing, relaxation.residual, rounding_floor(packing), relaxation.steps)


def scene_path(engine: Engine, start: Equilibrium, scene: Scene, *, onward: bool = False) -> LoadPath[Equilibrium]:
    """The path of a scene from a settled packing on.

    Parameters
    ----------
    engine : Engine
        LAMMPS with the packing of `start`; the caller closes it.
    start : Equilibrium
        Where the path begins.
    scene : Scene
        With a section [ramp], for its method and force tolerance.
    onward : bool
        Whether the path goes on by other ways where Newton's branch of equilibria ends, as in `ramp`.

    Returns
    -------
    LoadPath
        F_x -> the packing in equilibrium.
    """

    def solve(load: float, below: Equilibrium | None, beside: Equilibrium | None, ahead: bool) -> Equilibrium:
        return next_equilibrium(engine, below or start, load, scene, beside, onward and ahead)

    return LoadPath(SimpleNamespace(solve=solve, close=lambda: None), [start])
