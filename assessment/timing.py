"""Comparable times: jobs run in turn, over several turns.

Jobs to be compared run in turn and not one after the other, so that other load of the machine affects all of them
alike. Every other turn begins with the last job.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import numpy as np

from ..analysis.arrays import Floats

T = TypeVar("T")
Progress = Callable[[Sequence[Any]], Iterable[Any]]


def in_turns(
    jobs: Sequence[Callable[[], T]],
    turns: int,
    clock: Callable[[], float] = time.perf_counter,
    progress: Progress = iter,
) -> tuple[list[T], Floats]:
    """Run every job several times.

    Parameters
    ----------
    jobs : sequence of callable
        Each computes the same result each time it is called.
    turns : int
        How often, at least once.
    clock : callable
        The wall's, or the processor's: ``time.process_time`` leaves out the pauses that others make a process take.
    progress : callable
        Wraps the list of runs.

    Returns
    -------
    results : list
        Of each job.
    seconds : ndarray, shape (turns, jobs)
        Of each turn.
    """
    seconds = np.empty((turns, len(jobs)))
    results: dict[int, T] = {}
    places = range(len(jobs))
    order = [(turn, k) for turn in range(turns) for k in (places[::-1] if turn % 2 else places)]
    for turn, k in progress(order):
        begin = clock()
        results[k] = jobs[k]()
        seconds[turn, k] = clock() - begin
    return [results[k] for k in places], seconds
