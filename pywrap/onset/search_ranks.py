"""A search that all ranks share."""

from __future__ import annotations

import os

from mpi4py import MPI

from ...analysis.onset import Ranks


def search_ranks() -> Ranks:
    """All ranks as those of one search; the cores of a machine are shared evenly. Collective."""
    world = MPI.COMM_WORLD
    if world.size == 1:
        return Ranks()
    own = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))
    mine = MPI.Get_processor_name(), own
    beside = world.allgather(mine).count(mine)  # a launcher that binds ranks to cores leaves each its own
    return Ranks(world.rank, world.size, world.allgather, max(1, len(mine[1]) // beside))
