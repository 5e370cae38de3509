"""The tasks of a sweep by name; a task is applied to each scene.

A task takes the scene and a function that returns the settled packing for a friction coefficient. The task returns one
row: numbers, strings, lists and dicts of these. A task that settles by itself does not call the function. For `sweep
--dry-run`, the cost of a task is a measured power of the number of disks. A task may also be a function of the user
(:mod:`.user_function`); its cost is estimated from existing rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from ...pywrap import Scene
from ...pywrap.scenes.study_sections import ModesSection
from ..eruptions.study import eruptions_of
from ..modes.count_pairs import modes
from ..packing_tools import Start
from ..trigger.compute import settings
from ..trigger.study import trigger
from .onset import onset
from .sweep_plan import SweepPoint
from .table import Row
from .triggering import triggering
from .user_function import UserFunction, is_user_function, user_function


@dataclass(frozen=True)
class Task:
    """What is done with a scene, given its settled packings, and how many CPU seconds that takes, about."""

    run: Callable[[Scene, Start], dict[str, Any]]
    seconds: Callable[[Scene], float]


def _disks(scene: Scene) -> float:
    """Hundreds of disks; of a stored packing as many as in the paper's."""
    return float(getattr(scene.packing, "disks", 100)) / 100


def _increments(scene: Scene) -> float:
    return 1.0 if scene.ramp is None else abs(scene.ramp.first) / scene.ramp.step


def _onset(scene: Scene) -> float:
    """An onset, measured with 50 to 1,000 disks up to F_x = 0.01 F_y.

    1 s for 100 disks and 30 increments, of which an increment costs as the number of disks to the power of 1.6
    (measured exponents go from 1.1 to 1.7).
    """
    return 0.03 * _increments(scene) * _disks(scene) ** 1.6


def _estimate_triggering(scene: Scene) -> float:
    """The onsets for all friction coefficients, and four undamped runs of 8 s for 100 disks and t = 200."""
    runs = 0.0 if scene.perturb is None else 8.0 * scene.perturb.time / 200 * _disks(scene)
    return (len(scene.law.mus) + 1) * _onset(scene) + 4 * runs


def _trigger(scene: Scene) -> float:
    """The onset, two ramps, and a guess of 12 s for each bisection of 100 disks over t = 20."""
    map_of = settings(scene)
    return 3 * _onset(scene) + 12.0 * map_of.runs * map_of.time / 20 * _disks(scene)


def _eruptions(scene: Scene) -> float:
    """The ramp and all runs, none of which is over early: a guess of 40 s for 100 disks and t = 1000."""
    runs, time = (0, 0.0) if scene.eruptions is None else (len(scene.eruptions.load), scene.eruptions.time)
    return _onset(scene) + 40.0 * runs * time / 1000 * _disks(scene)


def _loads(scene: Scene) -> int:
    return len((scene.modes or ModesSection()).fx_over_fy)


def _modes(scene: Scene) -> float:
    """Complex pairs along a ramp: 2 s for 100 disks and 12 loads, 100 s for 1,000."""
    return 0.02 * _loads(scene) * _disks(scene) ** 2.7 + 3e-3 * _increments(scene) * _disks(scene)


TASKS: Mapping[str, Task] = {
    "onset": Task(onset, _onset),
    "triggering": Task(triggering, _estimate_triggering),
    "trigger": Task(trigger, _trigger),
    "eruptions": Task(eruptions_of, _eruptions),
    "modes": Task(modes, _modes),
}


def task_of(name: str) -> Task | UserFunction:
    """A task by its name, or the function of the user's that has this located name."""
    return user_function(name) if is_user_function(name) else TASKS[name]


def estimate(task: str, points: Sequence[SweepPoint], known: Iterable[Row] = ()) -> list[str]:
    """The cost of points that are not known yet, in plain words: CPU time of the task, and of settling packings.

    Of a function of the user's, the known rows tell it.
    """
    scenes = [point.scene for point in points if point.scene is not None]
    settlings = {point.settling_key: point.scene for point in points if point.scene is not None}
    refused = len(points) - len(scenes)
    return [
        f"{len(scenes)} scenes to compute, {len(settlings)} packings to settle",
        *([f"{refused} points make no scene, and will say why"] if refused else []),
        _expected_of_rows([row["cpu_seconds"] for row in known if row["says"] is None], len(scenes))
        if is_user_function(task)
        else _expected_time(TASKS[task], scenes, settlings.values()),
    ]


def _expected_time(task: Task, scenes: Sequence[Scene], settled: Iterable[Scene]) -> str:
    seconds = [task.seconds(scene) for scene in scenes]
    settling = sum(0.3 * _disks(scene) ** 1.3 for scene in settled)  # 0.3 s for 100 disks
    return (
        f"about {_span(sum(seconds) + settling)} of one core, {_span(settling)} of it for settling; the longest scene "
        f"takes about {_span(max(seconds, default=0.0))} (from 100 disks and measured exponents: right within a factor "
        "of three)"
    )


def _expected_of_rows(seconds: Sequence[float], missing: int) -> str:
    if not seconds:
        return "how long a scene takes is not known before the first of them: begin, and ask again"
    return (
        f"about {_span(median(seconds) * missing)} of one core, if a scene takes {_span(median(seconds))} as in the "
        f"{len(seconds)} rows that are there"
    )


def _span(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
