"""The tasks of a sweep by name: what is done with each scene.

A task takes the scene and a function that gives its settled packing for a friction coefficient, and returns one row:
numbers, words, lists and dicts of these. A task that settles by itself leaves the function alone. What one task costs
is a power of the number of disks (`Cost`), measured, for `sweep --dry-run`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ...pywrap import Scene
from ...pywrap.scenes.study_sections import Modes
from ..genericity.levels import growth, levels
from ..genericity.surrogates import surrogates
from ..modes.compute import modes
from ..modes.loss import loss
from ..modes.lossy_runs import lossy_runs
from ..modes.random_matrices import random_matrices
from ..packings import Start
from ..yielding.compute import yielding
from .events import eruptions, trigger
from .onset import onset
from .triggering import triggering

Run = Callable[[Scene, Start], dict[str, Any]]


@dataclass(frozen=True)
class Task:
    """A task.

    Attributes
    ----------
    run : callable
        Scene and settled packing -> row.
    seconds : callable
        Scene -> CPU seconds that it will take, about.
    """

    run: Run
    seconds: Callable[[Scene], float]


def onset_seconds(scene: Scene) -> float:
    """CPU seconds of an onset, settling left aside.

    Measured with 50 to 1,000 disks up to F_x = 0.01 F_y: 1 s for 100 disks and 30 increments, of which an increment
    costs as the number of disks to the power of 1.6 (docs/benchmarks.md has exponents from 1.1 to 1.7).
    """
    return 0.03 * increments(scene) * (disks_of(scene) / 100) ** 1.6


def triggering_seconds(scene: Scene) -> float:
    """CPU seconds of the onsets for all friction coefficients, and of four undamped runs: 8 s for 100 disks and t =
    200."""
    runs = 0.0 if scene.perturb is None else 8.0 * scene.perturb.time / 200 * disks_of(scene) / 100
    return (len(scene.law.mus) + 1) * onset_seconds(scene) + 4 * runs


def dense_seconds(scene: Scene) -> float:
    """CPU seconds of a dense decomposition: 0.1 s for 100 disks, growing as their cube."""
    return 0.1 * (disks_of(scene) / 100) ** 3


def trigger_seconds(scene: Scene) -> float:
    """CPU seconds of a map: the onset, two ramps, and a guess of 12 s for each bisection of 100 disks over t = 20."""
    runs = 12 if scene.trigger is None else scene.trigger.runs
    time = 20.0 if scene.trigger is None else scene.trigger.time
    return 3 * onset_seconds(scene) + 12.0 * runs * time / 20 * disks_of(scene) / 100


def eruptions_seconds(scene: Scene) -> float:
    """CPU seconds of the ramp and of all runs, none of which is over early: a guess of 40 s for 100 disks and t =
    1000."""
    runs, time = (0, 0.0) if scene.eruptions is None else (len(scene.eruptions.load), scene.eruptions.time)
    return onset_seconds(scene) + 40.0 * runs * time / 1000 * disks_of(scene) / 100


def increments(scene: Scene) -> float:
    """Increments of the scene's ramp."""
    return 1.0 if scene.ramp is None else scene.ramp.until / scene.ramp.step


def settling_seconds(scene: Scene) -> float:
    """CPU seconds of a settling: 0.3 s for 100 disks, growing as the number of disks to the power of 1.3."""
    return 0.3 * (disks_of(scene) / 100) ** 1.3


def modes_seconds(scene: Scene) -> float:
    """CPU seconds of the complex pairs along a ramp: 2 s for 100 disks and 12 loads, 100 s for 1,000."""
    loads = len((scene.modes or Modes()).fx_over_fy)
    return 0.02 * loads * (disks_of(scene) / 100) ** 2.7 + 3e-3 * increments(scene) * disks_of(scene) / 100


def loss_seconds(scene: Scene) -> float:
    """CPU seconds of the pencils along a ramp: 8 s for 100 disks and 5 loads, growing as the disks to the power 2.3."""
    loads = len((scene.modes or Modes()).fx_over_fy)
    return 1.6 * loads * (disks_of(scene) / 100) ** 2.3


def yield_seconds(scene: Scene) -> float:
    """CPU seconds of the path to static yield, fifteen runs from equilibria and four with a load that rises: 60 s for
    100 disks."""
    return 60.0 * disks_of(scene) / 100


def disks_of(scene: Scene) -> int:
    """Number of disks, of a stored packing as many as in the paper's."""
    return int(getattr(scene.packing, "disks", 100))


TASKS: Mapping[str, Task] = {
    "onset": Task(onset, onset_seconds),
    "triggering": Task(triggering, triggering_seconds),
    "trigger": Task(trigger, trigger_seconds),
    "eruptions": Task(eruptions, eruptions_seconds),
    "modes": Task(modes, modes_seconds),
    "loss": Task(loss, loss_seconds),
    "lossy runs": Task(lossy_runs, loss_seconds),
    "random matrices": Task(random_matrices, lambda scene: 3 * modes_seconds(scene)),
    "yield": Task(yielding, yield_seconds),
    "levels": Task(levels, dense_seconds),
    "growth": Task(growth, lambda scene: increments(scene) * dense_seconds(scene)),
    "surrogates": Task(surrogates, lambda scene: 3 * onset_seconds(scene)),
}
