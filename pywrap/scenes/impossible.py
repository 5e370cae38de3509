"""Refuse scenes that no computation can complete, before any work starts.

`refuse_impossible` finds impossible numbers in a scene: overlaps beyond the contact law, forces near the rounding of
the coordinates. `refuse_endless` finds a command that would take years, more memory than there is, or a file that no
disk holds. The progress line of a command tells how long it takes.
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Literal, TypeAlias

from ...analysis import MindlinLaw
from .packing_section import GeneratedPacking, SettlingLoad
from .validation import SceneError

if TYPE_CHECKING:
    from .scene import Scene

Task: TypeAlias = Literal["settle", "ramp", "perturb", "onset", "reproduce"]

DOUBLE_ROUNDING = 2.3e-16
"""Relative rounding of a double, rounded up."""

STEPS_OF_A_YEAR = 1e13
"""A year of LAMMPS's steps: 2e-6 s each and more, on a core of 2020."""
LARGEST_FILE = 1e13
"""10 TB."""
BYTES_IN_MEMORY = 4000
"""Bytes for each disk, at the least: LAMMPS, the matrices and their factors."""
BYTES_WRITTEN = 150
"""Bytes of one equilibrium in run.h5, for each disk."""
ROUNDING_LIMIT = 1e-6
"""Rounding of a force, in units of F_y, beyond which no bed comes to rest: 30 disks do at 1e-7, and fly apart at
5e-7."""


def refuse_endless(scene: Scene, task: Task) -> None:
    """Refuse a scene with which a command would not come to an end.

    Raises SceneError if it takes a year, more memory than there is, or a file of more than `LARGEST_FILE`.
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


def refuse_impossible(scene: Scene) -> tuple[str, str] | None:
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
    return None


def _at_settling(scene: Scene, at: SettlingLoad) -> Scene:
    """The scene with the load and the stiffness under which its packing settles."""
    law = scene.law.model_copy(update={"kn": at.kn or scene.law.kn})
    load = scene.load.model_copy(update={"fy": at.fy or scene.load.fy})
    packing = scene.packing.model_copy(update={"settle_at": None})
    return scene.model_copy(update={"law": law, "load": load, "packing": packing, "ramp": None})


def _stiffness(scene: Scene, force: float) -> float:
    law = _law(scene)
    return float(law.normal_stiffness(law.overlap_of_force(force)))


def _law(scene: Scene) -> MindlinLaw:
    """The repulsion alone."""
    return MindlinLaw(scene.law.kn, kt=0.0, mu=0.0, exponent=scene.law.exponent)


def _undamped_step(scene: Scene) -> float:
    packing = scene.packing
    lightest = min(1.0, scene.inertia_factor) * ((isinstance(packing, GeneratedPacking) and packing.mass) or 1.0)
    return 0.1 * math.sqrt(lightest / (6 * _stiffness(scene, scene.load.fy)))


def _installed_memory() -> float:
    return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
