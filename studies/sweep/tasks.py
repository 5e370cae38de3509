"""The tasks of a sweep by name; a task is applied to each scene.

A task takes the scene and a function that returns the settled packing for a friction coefficient. The task returns one
row: numbers, strings, lists and dicts of these. A task that settles by itself does not call the function. A task may
also be a function of the user (:mod:`.user_function`). The rows that are there tell how long scenes take.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from ...pywrap import Scene
from ..eruptions.study import eruptions_of
from ..modes.count_pairs import modes
from ..packing_tools import Start
from .onset import onset
from .sweep_plan import SweepPoint
from .table import Row
from .trigger import trigger
from .triggering import triggering
from .user_function import is_user_function, user_function

TASKS: Mapping[str, Callable[[Scene, Start], dict[str, Any]]] = {
    "onset": onset,
    "triggering": triggering,
    "trigger": trigger,
    "eruptions": eruptions_of,
    "modes": modes,
}


def task_of(name: str) -> Callable[[Scene, Start], dict[str, Any]]:
    """A task by its name, or the function of the user's that has this located name."""
    return user_function(name).run if is_user_function(name) else TASKS[name]


def remaining_work(points: Sequence[SweepPoint], known: Iterable[Row] = ()) -> list[str]:
    """Lines about the points that are not known yet: how many, and how long they take if the known rows are typical."""
    scenes = [point.scene for point in points if point.scene is not None]
    settlings = {point.settling_key for point in points if point.scene is not None}
    refused = len(points) - len(scenes)
    return [
        f"{len(scenes)} scenes to compute, {len(settlings)} packings to settle",
        *([f"{refused} points make no scene, and will say why"] if refused else []),
        _expected_time([row["cpu_seconds"] for row in known if row["says"] is None], len(scenes)),
    ]


def _expected_time(seconds: Sequence[float], missing: int) -> str:
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
