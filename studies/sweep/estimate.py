"""What a sweep will cost, from the exponents with which costs grow: `sweep --dry-run`."""

from __future__ import annotations

from collections.abc import Sequence

from .points import Point
from .tasks import TASKS, settling_seconds


def estimate(task: str, points: Sequence[Point]) -> list[str]:
    """The cost of points that are not known yet, in plain words: CPU time of the task, and of settling packings."""
    scenes = [point.scene for point in points if point.scene is not None]
    seconds = [TASKS[task].seconds(scene) for scene in scenes]
    settlings = {point.settling: point.scene for point in points if point.scene is not None}
    settling = sum(settling_seconds(scene) for scene in settlings.values())
    refused = len(points) - len(scenes)
    return [
        f"{len(scenes)} scenes to compute, {len(settlings)} packings to settle",
        *([f"{refused} points make no scene, and will say why"] if refused else []),
        f"about {_span(sum(seconds) + settling)} of one core, {_span(settling)} of it for settling; the longest scene "
        f"takes about {_span(max(seconds, default=0.0))} (from 100 disks and measured exponents: right within a factor "
        "of three)",
    ]


def _span(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
