"""Wall times that can be compared: one thread, every job in turn, the median of several rounds.

Jobs that are compared are run in turn and not one after the other, so that whatever else the machine does meets all of
them alike.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from statistics import median
from typing import TypeVar

from threadpoolctl import threadpool_limits

from .study import Point, Progress, Settings

T = TypeVar("T")

Run = tuple[str, float | None, Callable[[], tuple[T, int | None]]]
"""A method, its parameter, and what it computes: a result, and the evaluations that it took."""


def timed(
    jobs: Sequence[Callable[[], T]], repeats: int, progress: Progress = lambda items: items
) -> list[tuple[T, float]]:
    """Run every job several times.

    Parameters
    ----------
    jobs : sequence of callable
        Each computes the same result each time it is called.
    repeats : int
        How often, at least once.
    progress : callable
        Wraps the list of runs.

    Returns
    -------
    list of tuple
        Of each job its result and the median of its times, seconds.
    """
    results: dict[int, T] = {}
    seconds: list[list[float]] = [[] for _ in jobs]
    with threadpool_limits(1):
        for k in progress([*range(len(jobs))] * repeats):
            begin = time.perf_counter()
            results[k] = jobs[k]()
            seconds[k].append(time.perf_counter() - begin)
    return [(results[k], median(seconds[k])) for k in range(len(jobs))]


def timed_points(runs: Sequence[Run[T]], settings: Settings, error: Callable[[T], float]) -> tuple[Point, ...]:
    """The points of runs, each with the error of its result."""
    results = timed([run for *_, run in runs], settings.repeats, settings.progress)
    return tuple(
        Point(method, parameter, error(found), seconds, evaluations)
        for (method, parameter, _), ((found, evaluations), seconds) in zip(runs, results, strict=True)
    )
