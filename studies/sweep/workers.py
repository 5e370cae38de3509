"""Who computes the points of a sweep: this process, processes beside it, ranks of mpiexec, or anybody's executor.

Points that settle alike share the settled packing: the first of them is handed out alone, and the others with the
packing that it brought back. As the packing is the same to the bit wherever it was settled, no row depends on the
workers. A worker that is killed takes nothing with it: what it had in hand is handed out again.
"""

from __future__ import annotations

import os
import signal
import sys
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import get_context, resource_tracker
from typing import Any

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor

from ...analysis import FaultgougeError, Packing
from ...analysis.onset.ranks import cores
from ...parent import end_with
from .examine import Row, examined
from .points import Point

TRIES = 3
"""Deaths of workers, without a point that ends in between, after which a point and not an accident is to blame."""


class WorkerError(FaultgougeError):
    """Workers are killed again and again."""


class Processes(Executor):
    """Processes of this machine, each with an interpreter of its own; all of them end with this process.

    Parameters
    ----------
    number : int
        Of processes.
    """

    def __init__(self, number: int) -> None:
        self._number = number
        self._pool = self._started()

    def _started(self) -> ProcessPoolExecutor:
        # the tracker would warn of semaphores where this process is killed; it frees them all the same
        sys.warnoptions.append("ignore:resource_tracker:UserWarning")
        resource_tracker.ensure_running()
        sys.warnoptions.pop()
        # no fork: MPI and LAMMPS do not survive one
        pool = ProcessPoolExecutor(self._number, get_context("spawn"), initializer=end_with, initargs=(os.getpid(),))
        # Ctrl-C is for this process alone, with which the others end: they inherit that SIGINT is blocked
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        pool.submit(os.getpid)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return pool

    def renew(self) -> None:
        """Start other processes in place of these, of which one has been killed."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = self._started()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._pool.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._pool.shutdown(wait, cancel_futures=cancel_futures)


@contextmanager
def hands(workers: int | None, executor: Executor | None) -> Iterator[Executor | None]:
    """An executor for the points of a sweep; None where this process computes by itself, or works for another rank.

    Parameters
    ----------
    workers : int or None
        Processes; None: as many as there are cores. Ranks of mpiexec take their place.
    executor : Executor or None
        In place of all of these. It is not shut down.
    """
    number = cores() if workers is None else workers
    if executor is not None:
        yield executor
    elif MPI.COMM_WORLD.size > 1:
        ranks: Any
        with MPICommExecutor(MPI.COMM_WORLD) as ranks:
            yield ranks
    elif number < 2:
        yield None
    else:
        processes = Processes(number)
        try:
            yield processes
        finally:
            processes.shutdown(wait=False, cancel_futures=True)


def computed(pool: Executor | None, task: str, points: Sequence[Point]) -> Generator[Row, None, None]:
    """The rows of points as they end; closing the generator takes back those that no worker has begun."""
    groups: dict[str, deque[Point]] = defaultdict(deque)
    for point in points:
        groups[point.settling].append(point)
    if pool is not None and len(points) > 1:
        yield from _Shared(pool, task).rows(groups.values())
        return
    for group in groups.values():
        bed = None
        for number, point in enumerate(group):
            row, bed = examined(task, point, bed, number + 1 < len(group))
            yield row


class _Shared:
    """Points that are in the hands of workers."""

    def __init__(self, pool: Executor, task: str) -> None:
        self._pool, self._task = pool, task
        self._running: dict[Future[Any], tuple[Point, Packing | None, deque[Point]]] = {}
        self._lost: list[tuple[Point, Packing | None, deque[Point]]] = []

    def rows(self, groups: Any) -> Iterator[Row]:
        """Rows as they end; the first point of a group is handed out before the others."""
        deaths = 0
        for group in groups:
            self._hand_out(group.popleft(), None, group)
        try:
            while self._running or self._lost:
                for future in wait(self._running, return_when=FIRST_COMPLETED).done:
                    point, bed, group = self._running.pop(future)
                    try:
                        row, bed = future.result()
                    except BrokenExecutor:
                        self._lost.append((point, bed, group))
                        continue
                    deaths = 0
                    while group:
                        self._hand_out(group.popleft(), bed, deque())
                    yield row
                if self._lost and not self._running:
                    deaths += 1
                    self._again(deaths)
        finally:
            for future in self._running:
                future.cancel()

    def _hand_out(self, point: Point, bed: Packing | None, group: deque[Point]) -> None:
        try:
            future = self._pool.submit(examined, self._task, point, bed, bool(group))
        except BrokenExecutor:
            self._lost.append((point, bed, group))
        else:
            self._running[future] = point, bed, group

    def _again(self, deaths: int) -> None:
        """Hand out again what killed workers had in hand."""
        if deaths > TRIES or not isinstance(self._pool, Processes):
            raise WorkerError(
                "a worker was killed, for want of memory perhaps: give fewer --workers; the same command goes on"
            )
        self._pool.renew()
        lost, self._lost = self._lost, []
        for point, bed, group in lost:
            self._hand_out(point, bed, group)
