"""Work that is shared out over ranks.

Of several ranks one hands out independent pieces, and the others take them one by one (:func:`shared_out`). Or all take
their part of the same search (:func:`searching`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor

from ...analysis.onset import Ranks

Share = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]

Say = Callable[[str], None]
"""Takes a line of progress."""

Progress = Callable[[Iterable[Any], int], Iterable[Any]]
"""Takes results as they end and their number, and hands them on."""


@contextmanager
def shared_out() -> Iterator[Share | None]:
    """A function like `map`, whose results come as they end, in any order; None on the ranks that work for another."""
    if MPI.COMM_WORLD.size == 1:
        yield map
        return
    pool: Any
    with MPICommExecutor(MPI.COMM_WORLD) as pool:
        yield None if pool is None else partial(pool.map, unordered=True)


def searching() -> Ranks:
    """All ranks as those of one search; the cores of a machine are shared evenly. Collective."""
    world = MPI.COMM_WORLD
    if world.size == 1:
        return Ranks()
    own = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))
    mine = MPI.Get_processor_name(), own
    beside = world.allgather(mine).count(mine)  # a launcher that binds ranks to cores leaves each its own
    return Ranks(world.rank, world.size, world.allgather, max(1, len(mine[1]) // beside))
