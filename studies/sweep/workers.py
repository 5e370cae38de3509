"""Distribution of the points of a sweep to workers: this process, further processes, ranks of mpiexec, or an executor
of the user's.

Points that settle to the same packing share it: the first point is distributed alone, and the others with the packing
that the first has returned. The packing is bitwise the same wherever it was settled, so that no row depends on the
workers. If a process is killed, nothing is lost: its point is computed again.

Each point gives a row, even if it fails.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from multiprocessing import get_context, resource_tracker
from typing import Any

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor
from scipy.sparse.linalg import ArpackError
from threadpoolctl import threadpool_limits

from ... import registered
from ...analysis import FaultgougeError, NoEquilibriumError, OnsetError, Packing
from ...analysis.windows.slices import cores
from ...parent_death import end_with
from ...pywrap import Equilibrium, Scene, SceneError, settle
from ...pywrap.settling.settle import settle_bed
from ..result_rows import Row
from .sweep_plan import SweepPoint
from .user_function import UserFunctionError, user_function

TRIES = 3
"""How often a point is tried again whose worker was killed."""

FINAL_ERRORS = (NoEquilibriumError, OnsetError, SceneError)
"""Errors that the same scene has again, to the bit: it has no equilibrium or no onset, or it is refused. Others may
have passed, as a lack of memory or a full disk does, and a sweep that goes on tries such scenes again."""

FAILURES = (FaultgougeError, ValueError, ArithmeticError, ArpackError, MemoryError)
"""Errors of a single scene: those of the package, of LAPACK, of ARPACK, and of a packing that is too large."""


class WorkerError(FaultgougeError):
    """Workers are killed again and again, or end as they start."""


class Processes(Executor):
    """Processes of this machine, each with its own interpreter; all of them end with this process.

    A thread has one process, so that one that is killed costs the work that it had, and nothing of the others; the
    thread gives this work to another one.
    """

    def __init__(self, number: int) -> None:
        # the tracker would warn of semaphores where this process is killed; it frees them all the same
        sys.warnoptions.append("ignore:resource_tracker:UserWarning")
        resource_tracker.ensure_running()
        sys.warnoptions.pop()
        # Ctrl-C is for the main thread alone, with which the processes end: they inherit a blocked SIGINT
        block = signal.SIG_BLOCK, [signal.SIGINT]
        self._threads = ThreadPoolExecutor(number, initializer=signal.pthread_sigmask, initargs=block)
        self._pools: dict[int, ProcessPoolExecutor] = {}

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._threads.submit(self._run, partial(fn, *args, **kwargs))

    def _run(self, work: Callable[[], Any]) -> Any:
        """The result of the work in the process of this thread, or in the next one where it is killed."""
        here = threading.get_ident()
        for _ in range(1 + TRIES):
            if here not in self._pools:
                # no fork: MPI and LAMMPS do not survive one
                pool = ProcessPoolExecutor(1, get_context("spawn"), initializer=end_with, initargs=(os.getpid(),))
                try:
                    pool.submit(os.getpid).result()
                except BrokenExecutor:
                    raise WorkerError(
                        "the workers end as they start; each reads a script anew that calls run_sweep with several "
                        'workers, and the call stands below the line `if __name__ == "__main__":`'
                    ) from None
                self._pools[here] = pool
            try:
                return self._pools[here].submit(work).result()
            except BrokenExecutor:
                self._pools.pop(here).shutdown(wait=False)
        raise BrokenExecutor

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        for pool in list(self._pools.values()):
            pool.shutdown(wait, cancel_futures=cancel_futures)


@contextmanager
def open_executor(workers: int | None, executor: Executor | None = None) -> Iterator[Executor | None]:
    """An executor; None if this process computes by itself, or has worked for another rank.

    The workers are processes, one for each core if `workers` is None. Under mpiexec its ranks replace the processes. An
    executor that is given replaces both, and is not shut down.
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


def compute_points(pool: Executor | None, task: str, points: Sequence[SweepPoint]) -> Generator[Row, None, None]:
    """The rows of points as they end; closing the generator takes back those that no worker has begun."""
    groups: dict[str, list[SweepPoint]] = defaultdict(list)
    for point in points:
        groups[point.settling_key].append(point)
    if pool is None or len(points) < 2:
        for group in groups.values():
            bed = None
            for point in group:
                row, bed = compute_point(task, point, bed, point is not group[-1])
                yield row
        return
    running: dict[Future[Any], Sequence[SweepPoint]] = {}

    def submit(point: SweepPoint, bed: Packing | None, waiting: Sequence[SweepPoint]) -> None:
        """Give a worker a point, with its packing if that is known, and the points that wait for the packing."""
        running[pool.submit(compute_point, task, point, bed, bool(waiting))] = waiting

    try:
        for group in groups.values():
            submit(group[0], None, group[1:])
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                waiting = running.pop(future)
                try:
                    row, bed = future.result()
                except BrokenExecutor:
                    raise WorkerError(
                        "a worker was killed, possibly for lack of memory: give fewer --workers; the same command "
                        "continues"
                    ) from None
                for each in waiting:
                    submit(each, bed, ())
                yield row
    finally:
        for future in running:
            future.cancel()


def compute_point(task: str, point: SweepPoint, bed: Packing | None, keep: bool) -> tuple[Row, Packing | None]:
    """One point: its row, and if it is to be kept the packing as it settled.

    What goes wrong with a point is in its row under "says"; "final" says whether that is an answer to the scene.
    """
    wall, processor = time.perf_counter(), time.process_time()
    beds = [] if bed is None else [bed]
    row: Row = {"key": point.key, "version": version("faultgouge"), "values": point.values}
    row |= {"result": {}, "says": point.says, "final": True}
    if (scene := point.scene) is not None:
        with threadpool_limits(1):
            try:
                run = user_function(task).run if ":" in task else registered.study_of(task).row
                row["result"] = run(scene, lambda mu: _start(scene, mu, beds))
                row["says"] = row["result"].pop("says", None)
            except FAILURES as error:
                says = str(error) or type(error).__name__
                row["says"] = f"scene {point.number}: {says}" if isinstance(error, UserFunctionError) else says
                row["final"] = isinstance(error, FINAL_ERRORS)
    row["seconds"] = round(time.perf_counter() - wall, 3)
    row["cpu_seconds"] = round(time.process_time() - processor, 3)
    return row, beds[0] if keep and beds else None


def _start(scene: Scene, mu: float, beds: list[Packing]) -> Equilibrium:
    """The settled packing for a friction coefficient, from `beds`, or settled now and added to `beds`."""
    if scene.packing.model_dump().get("settle_friction", False) and mu != scene.law.mus[0]:
        return settle(scene, mu, MPI.COMM_SELF)
    if not beds:
        beds.append(settle_bed(scene, mu, MPI.COMM_SELF))
    return settle(scene, mu, MPI.COMM_SELF, bed=beds[0])
