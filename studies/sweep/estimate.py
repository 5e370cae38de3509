"""What a sweep will cost, from the exponents with which costs grow: `sweep --dry-run`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .points import Point
from .tasks import TASKS, settling_seconds


@dataclass(frozen=True)
class Estimate:
    """The cost of a sweep.

    Attributes
    ----------
    scenes, refused, settlings : int
        Points to compute, those whose values make no scene, and packings to settle.
    seconds, settling : float
        CPU seconds of the task and of settling.
    longest : float
        CPU seconds of the longest point: no number of workers is faster.
    """

    scenes: int
    refused: int
    settlings: int
    seconds: float
    settling: float
    longest: float

    def words(self) -> list[str]:
        """The estimate in plain words."""
        total = self.seconds + self.settling
        return [
            f"{self.scenes} scenes to compute, {self.settlings} packings to settle",
            *([f"{self.refused} points make no scene, and will say why"] if self.refused else []),
            f"about {_span(total)} of one core, {_span(self.settling)} of it for settling; the longest scene takes "
            f"about {_span(self.longest)} (from 100 disks and measured exponents: right within a factor of three)",
        ]


def estimate(task: str, points: Sequence[Point]) -> Estimate:
    """The cost of points that are not known yet."""
    scenes = [point.scene for point in points if point.scene is not None]
    seconds = [TASKS[task].seconds(scene) for scene in scenes]
    settlings = {point.settling: point.scene for point in points if point.scene is not None}
    return Estimate(
        scenes=len(scenes),
        refused=len(points) - len(scenes),
        settlings=len(settlings),
        seconds=sum(seconds),
        settling=sum(settling_seconds(scene) for scene in settlings.values()),
        longest=max(seconds, default=0.0),
    )


def _span(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
