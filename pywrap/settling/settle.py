"""The packing of a scene in equilibrium at F_x = 0: generated and settled, or read from a file.

All functions are collective over the ranks of the communicator.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ...analysis import MindlinLaw, NoEquilibriumError, Packing
from ...analysis.files.formats import packing_of
from ...analysis.progress import Watch, report_progress, show_progress
from ..equilibria.quasistatic import Equilibrium, equilibrate, idle_disks
from ..equilibria.rattlers import clear_rattlers
from ..lammps.engine import Engine
from ..scenes.packing_section import GeneratedPacking
from ..scenes.scene import Scene, scene_of
from ..scenes.validation import DIGITS, SceneError
from .change_load import change_load
from .minimize_energy import settle_loose

LARGEST_IMBALANCE = 1e-3
"""Residual of a stored packing, in units of F_y, above which it counts as not settled: the packing would
rearrange rather than relax."""

SETTLING_STIFFNESS = {1.5: 2e5, 1.0: 7e3}
"""k_n while a packing settles, by the exponent of the law (of others that of 3/2): the paper's, and of harmonic disks
the stiffness 3/2 k_n delta^(1/2) that a contact of the paper's law has under the paper's load."""

MORE_IN_LAYER = "put more disks into the upper layer (leave packing.top out for as many as it takes)"
CHECK_LOAD = "check law and load against those it was settled with, or bring it to rest by `faultgouge import --relax`"

STARTS = 5
"""Loose starts of a seed that settle one after the other, until a layer stays on top. Of 100 disks under the paper's
load it sinks from one start in a hundred."""


def settle(
    scene: Scene | str | Path,
    mu: float | None = None,
    communicator: MPI.Comm | None = None,
    watch: Watch | None = None,
    bed: Packing | None = None,
) -> Equilibrium:
    """Settle the packing of a scene to equilibrium at F_x = 0.

    A generated packing settles without friction, and friction then starts with zero slips (or it settles with friction,
    if the scene asks for this). A stored packing is used unchanged. Both are brought to the rounding floor. If the
    upper layer sinks through the bed, the next random packing of the seed is settled, up to `STARTS` of them.

    Settling is chaotic: two arithmetics would end in two packings. Settling therefore always uses doubles, so that a
    seed gives one packing. Compensated arithmetic begins when the settled packing is brought to its own floor.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or its file.
    mu : float, optional
        Friction coefficient; by default the scene's first.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that share the packing; all by default.
    watch : callable, optional
        Called with a description of each stage, for a packing of more than 300 disks, which takes some time.
    bed : Packing, optional
        Result of `settle_bed` for a scene that settles to the same packing. The packing is then not settled again, and
        the equilibrium is bitwise the same.

    Raises
    ------
    SceneError
        If a stored packing is not in balance.
    NoEquilibriumError
        If the packing does not come to rest.

    Examples
    --------

    >>> start = faultgouge.settle("three_disks.toml")
    >>> start.packing
    <Packing: 3 disks, 5 contacts, 1 in the upper layer, period 2.8, mu = 1, fx = 0, fy = 3>
    >>> start.packing.residual < 1e-11
    True
    """
    scene = scene_of(scene, "settle")
    with show_progress(watch):
        bed = settle_bed(scene, mu, communicator) if bed is None else bed
    packing = _in_arithmetic(replace(bed, law=law_of(scene, mu)), scene.precision)
    with Engine(packing, communicator) as engine:
        try:
            return equilibrate(engine, Equilibrium.of(packing), packing.fx)
        except NoEquilibriumError as error:
            cure = f"{MORE_IN_LAYER}, or try another seed"
            if not isinstance(scene.packing, GeneratedPacking):
                cure = f"no equilibrium lies near where {scene.packing.file} has its disks: {CHECK_LOAD}"
            says = f"the packing does not come to rest (a disk feels {packing.residual:.2g}): {cure}"
            raise NoEquilibriumError(says) from error


def settle_bed(scene: Scene, mu: float | None = None, communicator: MPI.Comm | None = None) -> Packing:
    """The settled packing of a scene, before its balance to the rounding floor; arguments as of `settle`.

    Scenes that settle without friction, and differ only in friction and in what follows, share it.
    """
    law, section = law_of(scene, mu), scene.packing
    if not isinstance(section, GeneratedPacking):
        packing = _in_arithmetic(section.packing(law, **load_of(scene)), scene.precision)
        if packing.residual > LARGEST_IMBALANCE * scene.load.fy:
            feels = f"a disk feels {packing.residual:.3g} under fy = {scene.load.fy:g}"
            raise SceneError(f"{section.file}: the packing is not in balance, {feels}: {CHECK_LOAD}")
        return packing
    kn, fy, at = law.kn, scene.load.fy, section.settle_at
    if at is not None:
        kn, fy = at.kn or kn, at.fy or fy
    own, settling_law, fy = own_units(section, replace(law, kn=kn, kt=law.kt * (kn / law.kn)), fy)
    settling_law = settling_law if own.settle_friction else replace(settling_law, mu=0.0)
    for draw in range(STARTS):  # the first of the seed's loose starts whose upper layer stays on top
        if draw:
            report_progress(f"the upper layer sank through the bed: loose start {draw + 1} of {STARTS}")
        start = own.start(draw)
        assert start.top is not None
        loose = packing_of(start, settling_law, start.top, **load_of(scene) | {"fy": fy})
        with Engine(loose, communicator) as engine:
            packing = settle_loose(engine, loose)
        idle = idle_disks(packing)
        if len(idle) <= 0.5 * len(packing):
            break
    else:
        sank = f"the upper layer sank through the bed from each of {STARTS} loose starts"
        why = "without friction only a layer that closes the box stays on top"
        sank += f", and {len(idle)} of {len(packing)} disks carry nothing"
        raise NoEquilibriumError(f"{sank}: {why}, so {MORE_IN_LAYER}")
    if not own.settle_friction:
        packing = replace(clear_rattlers(packing, idle), angle=np.zeros(len(packing)))
    wanted = own_units(section, law, scene.load.fy)[2]
    if at is not None and wanted != packing.fy:
        packing = change_load(packing, wanted, communicator)
        if not packing.law.frictional:
            # those that touch nothing stay where they were put at the load of settling
            touching = [*packing.contacts.i, *packing.contacts.j]
            packing = clear_rattlers(packing, np.intersect1d(idle_disks(packing), touching))
    # from the units of the packing to those of the scene; where disks rest does not depend on their masses
    length, radius = 2 * min(section.radii), section.start(draw).radius
    contacts, position = packing.contacts.slipped(length * packing.contacts.slip), length * packing.position
    box_length = None if packing.box_length is None else section.width
    found = replace(
        packing, position=position, radius=radius, contacts=contacts, mass=section.mass_of(radius), law=law,
        box_length=box_length, fy=scene.load.fy,
    )  # fmt: skip
    return found.loaded(0.0)  # a contact that carries next to nothing may open by rounding


def shared_bed(scene: Scene) -> Packing | None:
    """The bed that all friction coefficients of a scene share; None if each has its own bed, or there is only one."""
    own = isinstance(scene.packing, GeneratedPacking) and scene.packing.settle_friction
    return None if own or len(scene.law.mus) == 1 else settle_bed(scene)


def law_of(scene: Scene, mu: float | None = None) -> MindlinLaw:
    """The law of a scene, with its first friction coefficient unless another one is given."""
    law, damping, history = scene.law, scene.damping, scene.law.history
    cn, ct = (damping.cn, damping.ct) if damping else (0.0, 0.0)
    memory = {"rescaled": history == "rescaled", "coulomb": history == "coulomb"}
    return MindlinLaw(law.kn, law.kt, law.mus[0] if mu is None else mu, law.exponent, cn, ct, **memory)


def load_of(scene: Scene) -> dict[str, Any]:
    """Load and other properties of the packings of a scene, besides disks and law."""
    drag_time = scene.damping.tau if scene.damping else None
    return {"fy": scene.load.fy, "inertia_factor": scene.inertia_factor, "drag_time": drag_time}


def own_units(packing: GeneratedPacking, law: MindlinLaw, fy: float) -> tuple[GeneratedPacking, MindlinLaw, float]:
    """The scene in the units of its packing: the smallest diameter is the length, and k_n is `SETTLING_STIFFNESS`.

    Settling is chaotic, and amplifies the last digit of any number. A seed is one packing all the same, whatever units
    the scene has: radii, width and F_y are rounded to `DIGITS` when they are converted, so that two scenes that differ
    in their units alone settle the same numbers. A scene that has these units already settles its numbers as they are.
    Numbers of more than `DIGITS` digits, such as a width of sqrt(2), therefore settle otherwise in other units.
    Dashpots are left out: settling has a damping of its own.
    """
    length, stiffness = 2 * min(packing.radii), SETTLING_STIFFNESS.get(law.exponent, SETTLING_STIFFNESS[1.5])
    undamped = replace(law, cn=0.0, ct=0.0)
    if length == 1.0 and law.kn == stiffness:
        return packing, undamped, fy

    def rounded(number: float) -> float:
        return float(f"{number:.{DIGITS}g}")

    radii = tuple(rounded(radius / length) for radius in packing.radii)
    section = packing.model_copy(update={"radii": radii, "width": rounded(packing.width / length)})
    tangential = Fraction(law.kt / law.kn).limit_denominator(1000)  # a share such as 2/7, to the bit
    kt = tangential.numerator * stiffness / tangential.denominator
    if not np.isclose(kt, law.kt / law.kn * stiffness, rtol=10.0**-DIGITS, atol=0.0):
        kt = rounded(law.kt / law.kn * stiffness)
    own_fy = rounded(fy / (law.kn * length**law.exponent) * stiffness)
    return section, replace(undamped, kn=stiffness, kt=kt), own_fy


def _in_arithmetic(packing: Packing, precision: str) -> Packing:
    """The packing with low parts of its coordinates, or without."""
    if precision == "double":
        return replace(packing, position_low=None)
    return packing if packing.compensated else replace(packing, position_low=np.zeros_like(packing.position))
