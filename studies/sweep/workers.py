"""Distribution of the points of a sweep to workers.

Points that settle to the same packing share it: the first point is distributed alone, and the others with the packing
that the first has returned. The packing is bitwise the same wherever it was settled, so that no row depends on the
workers. If a worker is killed, nothing is lost: its points are distributed again.

Each point gives a row, even if it fails.
"""

from __future__ import annotations

import time
from collections import defaultdict, deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from importlib.metadata import version
from typing import Any

from mpi4py import MPI
from scipy.sparse.linalg import ArpackError
from threadpoolctl import threadpool_limits

from ... import registered
from ...analysis import FaultgougeError, NoEquilibriumError, Packing
from ...pywrap import Equilibrium, Scene, SceneError, settle
from ...pywrap.settling.settle import settle_bed
from ..executors import Processes
from ..packing_tools import Start
from ..result_rows import Row
from .sweep_plan import SweepPoint
from .user_function import UserFunctionError, is_user_function, user_function

TRIES = 3
"""Number of successive worker deaths after which the point is considered the cause."""

FINAL_ERRORS = (NoEquilibriumError, SceneError)
"""Errors that the same scene has again, to the bit: it has no equilibrium, or it is refused. Others may have passed, as
a lack of memory or a full disk does, and a sweep that goes on tries such scenes again."""

FAILURES = (FaultgougeError, ValueError, ArithmeticError, ArpackError, MemoryError)
"""Errors of a single scene: those of the package, of LAPACK, of ARPACK, and of a packing that is too large."""


class WorkerError(FaultgougeError):
    """Workers are killed again and again, or end as they start."""


def compute_points(pool: Executor | None, task: str, points: Sequence[SweepPoint]) -> Generator[Row, None, None]:
    """The rows of points as they end; closing the generator takes back those that no worker has begun."""
    groups: dict[str, deque[SweepPoint]] = defaultdict(deque)
    for point in points:
        groups[point.settling_key].append(point)
    if pool is not None and len(points) > 1:
        yield from PointQueue(pool, task).rows(groups.values())
        return
    for group in groups.values():
        bed = None
        for number, point in enumerate(group):
            row, bed = compute_point(task, point, bed, number + 1 < len(group))
            yield row


class PointQueue:
    """Points that are in the hands of workers."""

    def __init__(self, pool: Executor, task: str) -> None:
        self._pool, self._task = pool, task
        self._running: dict[Future[Any], tuple[SweepPoint, Packing | None, deque[SweepPoint]]] = {}
        self._lost: list[tuple[SweepPoint, Packing | None, deque[SweepPoint]]] = []

    def rows(self, groups: Iterable[deque[SweepPoint]]) -> Iterator[Row]:
        """Rows as they end; the first point of a group is submitted before the others."""
        deaths = 0
        for group in groups:
            self.submit(group.popleft(), None, group)
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
                        self.submit(group.popleft(), bed, deque())
                    yield row
                if self._lost and not self._running:
                    deaths += 1
                    self.resubmit_lost(deaths)
        finally:
            for future in self._running:
                future.cancel()

    def submit(self, point: SweepPoint, bed: Packing | None, group: deque[SweepPoint]) -> None:
        """Give a worker a point, with its packing if that is known; a group is the points that wait for its packing."""
        try:
            future = self._pool.submit(compute_point, self._task, point, bed, bool(group))
        except BrokenExecutor:
            self._lost.append((point, bed, group))
        else:
            self._running[future] = point, bed, group

    def resubmit_lost(self, deaths: int) -> None:
        """Submit the points of killed workers again."""
        if isinstance(self._pool, Processes) and not self._pool.began:
            raise WorkerError(
                "the workers end as they start; each reads a script anew that calls run_sweep with several workers, "
                'and the call stands below the line `if __name__ == "__main__":`'
            )
        if deaths > TRIES or not isinstance(self._pool, Processes):
            raise WorkerError(
                "a worker was killed, possibly for lack of memory: give fewer --workers; the same command continues"
            )
        self._pool.renew()
        lost, self._lost = self._lost, []
        for point, bed, group in lost:
            self.submit(point, bed, group)


def compute_point(task: str, point: SweepPoint, bed: Packing | None, keep: bool) -> tuple[Row, Packing | None]:
    """One point: its row, and if it is to be kept the packing as it settled.

    What goes wrong with a point is in its row under "says"; "final" says whether that is an answer to the scene.
    """
    begin = time.perf_counter(), time.process_time()
    beds = [] if bed is None else [bed]
    row: Row = {
        "key": point.key,
        "version": version("faultgouge"),
        "values": point.values,
        "result": {},
        "says": point.says,
        "final": True,
    }
    if point.scene is not None:
        with threadpool_limits(1):
            try:
                run = user_function(task).run if is_user_function(task) else registered.study_of(task).row
                row["result"] = run(point.scene, _starter(point.scene, beds))
                row["says"] = row["result"].pop("says", None)
            except FAILURES as error:
                says = str(error) or type(error).__name__
                row["says"] = f"scene {point.number}: {says}" if isinstance(error, UserFunctionError) else says
                row["final"] = isinstance(error, FINAL_ERRORS)
    row["seconds"] = round(time.perf_counter() - begin[0], 3)
    row["cpu_seconds"] = round(time.process_time() - begin[1], 3)
    return row, (beds[0] if keep and beds else bed if keep else None)


def _starter(scene: Scene, beds: list[Packing]) -> Start:
    """The settled packing for a friction coefficient, from `beds`, or settled now and added to `beds`."""

    def start(mu: float) -> Equilibrium:
        if scene.packing.model_dump().get("settle_friction", False) and mu != scene.law.mus[0]:
            return settle(scene, mu, MPI.COMM_SELF)
        if not beds:
            beds.append(settle_bed(scene, mu, MPI.COMM_SELF))
        return settle(scene, mu, MPI.COMM_SELF, bed=beds[0])

    return start
