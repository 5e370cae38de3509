"""The sweeps of the study, with the rule by which packings are chosen.

**The rule.** Packings are those of the seeds 1, 2, ..., 20, all of them, of the sets "loss 100", "quartz 10 MPa" and
"quartz 1 MPa" of docs/modes: the same scenes, paths and increments. A packing whose branch of equilibria ends before a
load has no row of that load.
"""

from typing import Any

from faultgouge.studies.sweep.sweep_plan import Sweep
from faultgouge.studies.sweep.tasks import TASKS
from research.modes.sets import STANDARD, WIDTH, quartz

SEEDS = "1:20"
LOADS = [0.2, 0.3]
TASK = "research.laws_at_the_bound.compute:both_laws"


def sets(seeds: str = SEEDS) -> dict[str, Sweep]:
    """The sweeps by name."""
    plain: dict[str, Any] = {"packing": {"disks": 100, "width": WIDTH}, **STANDARD}
    scenes = {"mu = 1": plain, "quartz 10 MPa": quartz("10 MPa"), "quartz 1 MPa": quartz("1 MPa")}
    return {name: _sweep(scene, seeds) for name, scene in scenes.items()}


def _sweep(scene: dict[str, Any], seeds: str) -> Sweep:
    asked = {"task": TASK, "sweep": {"packing.seed": seeds}, "scene": scene | {"modes": {"fx_over_fy": LOADS}}}
    return Sweep.from_mapping(asked, TASKS)
