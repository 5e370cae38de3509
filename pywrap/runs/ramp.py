"""The ramp of a scene: its equilibria one after the other, as run.h5 stores them.

All functions are collective over the ranks of the communicator.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mpi4py import MPI

from ..equilibria.quasistatic import Equilibrium
from ..lammps.engine import Engine
from ..scenes.scene import Scene, scene_of
from ..scenes.sections import Ramp
from ..scenes.validation import require_section
from ..settling.settle import settle
from .ramp_loads import all_loads, way_to
from .scene_path import next_equilibrium


def ramp(
    scene: Scene | str | Path,
    start: Equilibrium | None = None,
    communicator: MPI.Comm | None = None,
    dumps: Path | None = None,
    behind: int | None = None,
) -> Iterator[Equilibrium]:
    """Compute equilibria at F_x = step, 2 step, ... up to the scene's ramp.until, or through its turning points.

    Parameters
    ----------
    scene : Scene, str or Path
        With a section [ramp]; or its file.
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

    Raises
    ------
    SceneError
        If the scene has no section [ramp].
    NoEquilibriumError
        If the packing flows.

    Examples
    --------

    The ramp proceeds as it is consumed:

    >>> for equilibrium in faultgouge.ramp("three_disks.toml"):
    ...     if faultgouge.stability(equilibrium.packing).stable is False:
    ...         break
    >>> print(f"{equilibrium.fx:.3f}")
    1.950
    """
    scene = scene_of(scene, "ramp")
    settings = require_section(scene.ramp, "ramp")
    if start is None:
        start = settle(scene, communicator=communicator)
        yield start
    with Engine(start.packing, communicator) as engine:
        wanted = all_loads(settings)
        if behind is None:
            behind = int(np.sum(np.abs(way_to(0.0, settings.first, settings.step)) <= abs(start.fx)))
        for k, fx in enumerate(wanted[behind:].tolist(), behind):
            start = next_equilibrium(engine, start, fx, scene)
            if dumps is not None:
                engine.restore(start.packing)  # the equilibrium, and not the last trial
                engine.dump(Path(f"{dumps}.{k}"))
            yield start


def reach(scene: Scene, fx: float, communicator: MPI.Comm | None = None) -> Iterator[Equilibrium]:
    """Compute the equilibria up to and including fx, in steps of the scene's ramp or, without a ramp, of F_y/3000.

    Parameters
    ----------
    scene : Scene
        Its section [ramp] is optional.
    fx : float
        The last F_x, force on each disk of the upper layer.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.

    Raises
    ------
    NoEquilibriumError
        If the packing flows.
    """
    step = min(step_of(scene), fx) or step_of(scene)  # one increment, where the first one of the ramp were too large
    settings = scene.ramp or Ramp(step=step, until=step)
    settings = settings.model_copy(update={"step": step, "until": fx or step})
    scene = scene.model_copy(update={"ramp": settings})
    for last in ramp(scene, communicator=communicator):
        yield last
        if last.fx >= fx:
            return
    with Engine(last.packing, communicator) as engine:  # the last multiple of the step is below fx, by rounding
        yield next_equilibrium(engine, last, fx, scene)


def step_of(scene: Scene) -> float:
    """Increment of F_x on the way to an undamped run, force."""
    return scene.ramp.step if scene.ramp else scene.load.fy / 3000
