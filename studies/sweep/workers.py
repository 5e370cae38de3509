"""Distribution of the points of a sweep to workers: this process, further processes, ranks of mpiexec, or an executor
of the user's.

Points that settle to the same packing share it: the first point is distributed alone, and the others with the packing
that the first has returned. The packing is bitwise the same wherever it was settled, so that no row depends on the
workers. Each point gives a row, even if it fails.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
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
from ...pywrap import Equilibrium, SceneError, settle
from ...pywrap.settling.settle import settle_bed
from ..result_rows import Row
from .sweep_plan import SweepPoint
from .user_function import UserFunctionError, user_function

FINAL_ERRORS = (NoEquilibriumError, OnsetError, SceneError)
"""Errors that the same scene has again, to the bit: it has no equilibrium or no onset, or it is refused. Others may
have passed, as a lack of memory or a full disk does, and a sweep that goes on tries such scenes again."""

FAILURES = (FaultgougeError, ValueError, ArithmeticError, ArpackError, MemoryError)
"""Errors of a single scene: those of the package, of LAPACK, of ARPACK, and of a packing that is too large."""


@contextmanager
def open_executor(workers: int | None, executor: Executor | None = None) -> Iterator[Executor | None]:
    """An executor; None if this process computes by itself, or has worked for another rank.

    The workers are processes of this machine, one for each core if `workers` is None. Under mpiexec its ranks replace
    the processes. An executor that is given replaces both, and is not shut down.
    """
    if executor is not None:
        yield executor
    elif MPI.COMM_WORLD.size > 1:
        ranks: Any
        with MPICommExecutor(MPI.COMM_WORLD) as ranks:
            yield ranks
    elif (number := cores() if workers is None else workers) < 2:
        yield None
    else:
        # the tracker would warn of semaphores where this process is killed; it frees them all the same
        sys.warnoptions.append("ignore:resource_tracker:UserWarning")
        resource_tracker.ensure_running()
        sys.warnoptions.pop()
        # no fork: MPI and LAMMPS do not survive one
        pool = ProcessPoolExecutor(number, get_context("spawn"), initializer=_begin, initargs=(os.getpid(),))
        try:
            yield pool
            pool.shutdown()  # or Python, at its own end, may write to a pipe that is closed by then
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _begin(parent: int) -> None:
    """A process ends with the one that has started it, which alone takes Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with(parent)


def compute_points(pool: Executor | None, task: str, points: Sequence[SweepPoint]) -> Generator[Row, None, None]:
    """The rows of points as they end, BrokenExecutor if a worker was killed; closing the generator takes back those
    that no worker has begun."""
    groups: dict[str, list[SweepPoint]] = defaultdict(list)
    for point in points:
        groups[point.settling_key].append(point)
    if pool is None or len(points) < 2:
        for group in groups.values():
            bed = None
            for point in group:
                row, bed = compute_point(task, point, bed)
                yield row
        return
    running: dict[Future[Any], Sequence[SweepPoint]] = {}
    try:
        for first, *others in groups.values():
            running[pool.submit(compute_point, task, first, None)] = others
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                (row, bed), waiting = future.result(), running.pop(future)
                running |= {pool.submit(compute_point, task, each, bed): () for each in waiting}
                yield row
    finally:
        for future in running:
            future.cancel()


def compute_point(task: str, point: SweepPoint, bed: Packing | None) -> tuple[Row, Packing | None]:
    """One point: its row, and the packing as it settled, if it has.

    What goes wrong with a point is in its row under "says"; "final" says whether that is an answer to the scene.
    """
    wall, processor = time.perf_counter(), time.process_time()
    beds = [] if bed is None else [bed]
    row: Row = {"key": point.key, "version": version("faultgouge"), "values": point.values}
    row |= {"result": {}, "says": point.says, "final": True}
    if (scene := point.scene) is not None:

        def start(mu: float) -> Equilibrium:
            """The settled packing for a friction coefficient, from what has settled before if that is the same."""
            if scene.packing.model_dump().get("settle_friction", False) and mu != scene.law.mus[0]:
                return settle(scene, mu, MPI.COMM_SELF)
            if not beds:
                beds.append(settle_bed(scene, mu, MPI.COMM_SELF))
            return settle(scene, mu, MPI.COMM_SELF, bed=beds[0])

        with threadpool_limits(1):
            try:
                run = user_function(task).run if ":" in task else registered.study_of(task).row
                row["result"] = run(scene, start)
                row["says"] = row["result"].pop("says", None)
            except FAILURES as error:
                says = str(error) or type(error).__name__
                row["says"] = f"scene {point.number}: {says}" if isinstance(error, UserFunctionError) else says
                row["final"] = isinstance(error, FINAL_ERRORS)
    row["seconds"] = round(time.perf_counter() - wall, 3)
    row["cpu_seconds"] = round(time.process_time() - processor, 3)
    return row, beds[0] if beds else None
