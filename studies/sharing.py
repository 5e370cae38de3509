"""Work that is shared out over ranks: of several ranks one hands it out, and the others take it piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor

Share = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]


@contextmanager
def shared_out() -> Iterator[Share | None]:
    """A function like `map`, whose results come as they end, in any order; None on the ranks that work for another."""
    if MPI.COMM_WORLD.size == 1:
        yield map
        return
    pool: Any
    with MPICommExecutor(MPI.COMM_WORLD) as pool:
        yield None if pool is None else partial(pool.map, unordered=True)
