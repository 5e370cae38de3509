"""The packing of a scene in equilibrium at F_x = 0: generated and settled, or read from a file.

All functions are collective over the ranks of the communicator.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from ...analysis import MindlinLaw, NoEquilibriumError, Packing
from ..equilibria.quasistatic import Equilibrium, equilibrate, rounding_floor
from ..equilibria.rattlers import clear_rattlers
from ..exchange import packing_of
from ..lammps.engine import Engine
from ..scenes.packing_section import GeneratedPacking
from ..scenes.refusals import SceneError
from ..scenes.scene import Scene
from .settling import Watch, settled

OUT_OF_BALANCE = 1e-3
"""Residual of a stored packing, in units of F_y, above which it counts as not settled: the packing would
rearrange rather than relax."""

STARTS = 5
"""Loose starts of a seed that settle one after the other, until a layer stays on top. Of 100 disks under the paper's
load it sinks from one start in a hundred."""


def settle(
    scene: Scene,
    mu: float | None = None,
    communicator: MPI.Comm | None = None,
    watch: Watch = lambda says: None,
    bed: Packing | None = None,
) -> Equilibrium:
    """The packing of a scene in equilibrium at F_x = 0.

    A generated packing settles without friction, and friction begins with zero slips (or settles with
    friction, if the scene says so); a stored one is taken as it is. Both are brought to the rounding floor. Where the
    upper layer sinks through the bed, the next loose start of the seed is settled, up to `STARTS` of them.

    Settling is chaotic: two arithmetics would end in two packings. It takes doubles in either arithmetic, so that a
    seed is one packing, and compensated arithmetic begins where the settled packing is brought to its own floor.

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
    bed : Packing, optional
        What `settled_bed` gives for a scene that settles as this one does: it is then not settled again, and the
        equilibrium is the same to the bit.

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
    packing = (
        settled_bed(scene, mu, communicator, watch)
        if bed is None
        else replace(bed, law=law_of(scene, scene.law.mus[0] if mu is None else mu))
    )
    packing = _in_arithmetic(packing, scene.precision)
    with Engine(packing, communicator) as engine:
        try:
            return equilibrate(engine, Equilibrium.of(packing), packing.fx)
        except NoEquilibriumError as error:
            raise NoEquilibriumError(
                f"the packing does not come to rest (a disk feels {packing.residual:.2g}): put more disks into the "
                "upper layer (leave packing.top out for as many as it takes), or try another seed"
            ) from error


def settled_bed(
    scene: Scene,
    mu: float | None = None,
    communicator: MPI.Comm | None = None,
    watch: Watch = lambda says: None,
) -> Packing:
    """The packing of a scene as it has settled, not yet balanced to the rounding floor; arguments as of `settle`.

    Scenes that settle without friction, and differ only in friction and in what follows, share it.
    """
    law = law_of(scene, scene.law.mus[0] if mu is None else mu)
    generated = isinstance(scene.packing, GeneratedPacking)
    return _settled(scene, law, communicator, watch) if generated else _stored(scene, law)


def shared_bed(scene: Scene, watch: Watch = lambda says: None) -> Packing | None:
    """The bed that all friction coefficients of a scene begin from; None if each has its own, or there is one alone."""
    alone = len(scene.law.mus) == 1
    own = isinstance(scene.packing, GeneratedPacking) and scene.packing.settle_friction
    return None if alone or own else settled_bed(scene, watch=watch)


def law_of(scene: Scene, mu: float) -> MindlinLaw:
    cn, ct = (scene.damping.cn, scene.damping.ct) if scene.damping else (0.0, 0.0)
    rescaled = scene.law.history == "rescaled"
    return MindlinLaw(scene.law.kn, scene.law.kt, mu, scene.law.exponent, cn, ct, rescaled)


def load_of(scene: Scene) -> dict[str, Any]:
    """What packings of the scene have beside disks and law."""
    drag_time = scene.damping.tau if scene.damping else None
    return {"fy": scene.load.fy, "inertia_factor": scene.inertia_factor, "drag_time": drag_time}


def _settled(scene: Scene, law: MindlinLaw, communicator: MPI.Comm | None, watch: Watch) -> Packing:
    """The first of the seed's loose starts whose upper layer stays on top, settled."""
    assert isinstance(scene.packing, GeneratedPacking)
    settling_law = law if scene.packing.settle_friction else replace(law, mu=0.0)
    for draw in range(STARTS):
        if draw:
            watch(f"the upper layer sank through the bed: loose start {draw + 1} of {STARTS}")
        start = scene.packing.start(draw)
        assert start.top is not None
        loose = packing_of(start, settling_law, start.top, **load_of(scene))
        with Engine(loose, communicator) as engine:
            packing = settled(engine, loose, watch)
        idle = len(packing.loaded(rounding_floor(packing)).rattlers)
        if idle <= 0.5 * len(packing):
            break
    else:
        raise NoEquilibriumError(
            f"the upper layer sank through the bed from each of {STARTS} loose starts, and {idle} of {len(packing)} "
            "disks carry nothing: without friction only a layer that closes the box stays on top, so put more disks "
            "into it (leave packing.top out for as many as it takes)"
        )
    # where disks rest does not depend on their masses
    packing = replace(packing, mass=scene.packing.mass_of(packing.radius))
    if scene.packing.settle_friction:
        return packing
    packing = clear_rattlers(packing, rounding_floor(packing))
    return replace(packing, law=law, angle=np.zeros(len(packing)))


def _in_arithmetic(packing: Packing, precision: str) -> Packing:
    """The packing with low parts of its coordinates, or without."""
    if precision == "double":
        return replace(packing, position_low=None)
    return packing if packing.compensated else replace(packing, position_low=np.zeros_like(packing.position))


def _stored(scene: Scene, law: MindlinLaw) -> Packing:
    assert not isinstance(scene.packing, GeneratedPacking)
    packing = _in_arithmetic(scene.packing.packing(law, **load_of(scene)), scene.precision)
    if packing.residual > OUT_OF_BALANCE * scene.load.fy:
        raise SceneError(
            f"{scene.packing.file}: the packing is not in balance, a disk feels {packing.residual:.3g} under "
            f"fy = {scene.load.fy:g}: check law and load against those it was settled with, or bring it to rest by "
            "`faultgouge import --relax`"
        )
    return packing
