r"""Refuse scenes that no computation can complete, before any work starts.

`refuse_impossible` finds impossible numbers in a scene: overlaps beyond the contact law, forces below the rounding of
the coordinates, a settling that never ends. `refuse_endless` finds a command that would take years, more memory than
there is, or a file that no disk holds. The progress line of a command tells how long it takes.

A contact that carries the force f has :math:`\delta = (f/k_n)^{1/p}` and the stiffness :math:`k = p\, k_n
\delta^{p-1}`, with p = 3/2 for Hertz. A time step is a share of :math:`(m/k)^{1/2}`, a disk falls under :math:`F_y`
through the medium at the speed :math:`(F_y d/m)^{1/2}`, d its diameter. The number of steps of a settling is
proportional to their ratio, :math:`(k_n d^{3/2}/F_y)^{1/3}` for Hertz.
"""

from __future__ import annotations

import math
import os
from typing import Literal, TypeAlias

from ...analysis import MindlinLaw
from .packing_section import GeneratedPacking, SettlingLoad
from .scene_keys import SceneKeys
from .validation import SceneError

Task: TypeAlias = Literal["settle", "ramp", "perturb", "onset", "reproduce"]

DOUBLE_ROUNDING = 2.3e-16
"""Relative rounding of a double, rounded up."""

FORCE_CHAINS = 10.0
"""The largest contact force, in units of F_y, for which LAMMPS's time steps are made."""

STEPS_OF_A_YEAR = 1e13
"""A year of LAMMPS's steps: 2e-6 s each and more, on a core of 2020."""
LARGEST_FILE = 1e13
"""10 TB."""
BYTES_IN_MEMORY = 4000
"""Bytes for each disk, at the least: LAMMPS, the matrices and their factors."""
BYTES_WRITTEN = 150
"""Bytes of one equilibrium in run.h5, for each disk."""

SETTLING_STEPS = 100.0
"""Steps to rest, in units of the time step that F_y's own time has: 26,000 at k_n = 2e5, F_y = 3, as many for 30 disks
as for 100, and growing with (k_n/F_y)^(1/3) from 26,000 to 665,000."""
SETTLING_WITH_FRICTION = 25.0
"""Steps to rest with packing.settle_friction, in units of the overdamped time step: between 11 and 33 for 30 disks,
Hertz with k_n = 2e5 and 2e6 and harmonic with 2e4."""
OVERDAMPED_STEPS = 16_000
"""Steps of the default length in one increment of overdamped dynamics."""
STAGED_DISKS = 300
"""Disks beyond which a packing settles in stages."""
STEPS_TO_REST = 10_000_000
"""Steps after which the decks give up on a packing of up to `STAGED_DISKS` disks: 10,000 looks of 1000 steps."""
SINKING_STEPS = 400_000
"""Steps after which they give up on a stage of a larger one."""
LEAST_SETTLING_SHARE = 0.4
"""Share of `SETTLING_STEPS`, or `SETTLING_WITH_FRICTION`, that the first stage of a larger packing takes at least."""
ROUNDING_LIMIT = 5e-5
"""Rounding of a force, in units of F_y, beyond which a bed never comes to the 1e-3 F_y that the first stage asks."""


def refuse_endless(scene: SceneKeys, task: Task) -> None:
    """Refuse a scene with which a command would not come to an end.

    Parameters
    ----------
    scene : Scene
        What is wanted.
    task : {"settle", "ramp", "perturb", "onset", "reproduce"}
        The command.

    Raises
    ------
    SceneError
        If it takes a year, more memory than there is, or a file of more than `LARGEST_FILE`.
    """
    disks, ramp, perturb = scene.packing.disks, scene.ramp, scene.perturb
    equilibria = 1.0 + (ramp.length / ramp.step if ramp is not None and task not in ("settle", "perturb") else 0.0)
    steps = 0.0
    if perturb is not None and task in ("perturb", "reproduce"):
        steps = perturb.time / (perturb.time_step or _undamped_step(scene))
    memory, written = disks * BYTES_IN_MEMORY, disks * BYTES_WRITTEN * equilibria
    if steps > STEPS_OF_A_YEAR:
        found = f"{steps:.2g} time steps, a year and more: lower perturb.time, or raise perturb.time_step"
    elif memory > _installed_memory():
        found = (
            f"{memory / 1e9:.2g} GB of memory, and this machine has {_installed_memory() / 1e9:.2g}: take fewer disks"
        )
    elif task == "ramp" and written > LARGEST_FILE:
        found = f"a file of {written / 1e12:.2g} TB: take a larger ramp.step, or fewer disks"
    else:
        return
    raise SceneError(f"the scene asks {task} for {found}")


def refuse_impossible(scene: SceneKeys) -> tuple[str, str] | None:
    """The key whose number no packing can bear, and the rest of the sentence; None if there is no such key."""
    packing, law, fy = scene.packing, scene.law, scene.load.fy
    if not isinstance(packing, GeneratedPacking):
        return None
    if packing.settle_at is not None:
        cannot = refuse_impossible(_at_settling(scene, packing.settle_at))
        if cannot is not None:
            return "packing.settle_at", f"does not settle, since {' '.join(cannot)}"
    overlap = _law(scene).overlap_of_force(fy)
    smallest = min(packing.radii)
    if not overlap < smallest:
        return "load.fy", (
            f"= {fy:g} presses two disks {overlap:.2g} into each other, deeper than the smallest radius {smallest:g}, "
            f"where the contact law does not hold: lower it, or raise law.kn = {law.kn:g}"
        )
    rounding = DOUBLE_ROUNDING * packing.width * _stiffness(scene, fy) / fy
    if not rounding < ROUNDING_LIMIT:
        return "law.kn", (
            f"= {law.kn:g} is too stiff for load.fy = {fy:g}: the last digit of a coordinate is {rounding:.1g} of F_y, "
            "and no packing comes to rest: lower it, or raise load.fy"
        )
    return _refuse_long_settling(scene, packing) or _refuse_long_ramp(scene)


def _refuse_long_settling(scene: SceneKeys, packing: GeneratedPacking) -> tuple[str, str] | None:
    steps = _settling_steps(scene)
    if packing.settle_friction:
        ends = LEAST_SETTLING_SHARE * steps < STEPS_TO_REST
    else:
        ends = steps < STEPS_TO_REST if packing.disks <= STAGED_DISKS else LEAST_SETTLING_SHARE * steps < SINKING_STEPS
    if ends:
        return None
    return "law.kn", (
        f"= {scene.law.kn:g} is too stiff for load.fy = {scene.load.fy:g}: settling takes about {_count(steps)} time "
        "steps, more than are made: lower it, or raise load.fy"
    )


def _refuse_long_ramp(scene: SceneKeys) -> tuple[str, str] | None:
    if scene.ramp is None or scene.ramp.method != "overdamped":
        return None
    steps = _overdamped_steps(scene)
    if steps < STEPS_TO_REST:
        return None
    return "relax.time_step", (
        f"= {scene.relax.time_step:g} needs about {_count(steps)} steps to an equilibrium, more than are made: "
        f"raise it, or leave it out for {_overdamped_step(scene):.2g}"
    )


def _at_settling(scene: SceneKeys, at: SettlingLoad) -> SceneKeys:
    """The scene with the load and the stiffness under which its packing settles."""
    law = scene.law.model_copy(update={"kn": at.kn or scene.law.kn})
    load = scene.load.model_copy(update={"fy": at.fy or scene.load.fy})
    packing = scene.packing.model_copy(update={"settle_at": None})
    return scene.model_copy(update={"law": law, "load": load, "packing": packing, "ramp": None})


def _stiffness(scene: SceneKeys, force: float) -> float:
    law = _law(scene)
    return float(law.normal_stiffness(law.overlap_of_force(force)))


def _law(scene: SceneKeys) -> MindlinLaw:
    """The repulsion alone."""
    return MindlinLaw(scene.law.kn, kt=0.0, mu=0.0, exponent=scene.law.exponent)


def _settling_steps(scene: SceneKeys) -> float:
    assert isinstance(scene.packing, GeneratedPacking)
    stiff = _stiffness(scene, FORCE_CHAINS * scene.load.fy) * 2 * min(scene.packing.radii) / scene.load.fy
    if scene.packing.settle_friction:
        return SETTLING_WITH_FRICTION * 4 * stiff  # overdamped
    return SETTLING_STEPS * math.sqrt(8 * stiff) / 0.8


def _overdamped_step(scene: SceneKeys) -> float:
    return scene.relax.damping / (4 * _stiffness(scene, FORCE_CHAINS * scene.load.fy))


def _overdamped_steps(scene: SceneKeys) -> float:
    step = scene.relax.time_step
    return OVERDAMPED_STEPS if step is None else OVERDAMPED_STEPS * _overdamped_step(scene) / step


def _undamped_step(scene: SceneKeys) -> float:
    packing = scene.packing
    lightest = min(1.0, scene.inertia_factor) * ((isinstance(packing, GeneratedPacking) and packing.mass) or 1.0)
    return 0.1 * math.sqrt(lightest / (6 * _stiffness(scene, scene.load.fy)))


def _installed_memory() -> float:
    return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")


def _count(number: float) -> str:
    return f"{number:.2g}" if number >= 1e5 else f"{number:.0f}"
