"""Run a sweep: every point is a line of results.jsonl as soon as it has ended, and results.csv the table of all.

Points are handed out to the ranks of `mpiexec` by mpi4py.futures; without it they are run one after the other. Each
has one thread. Points that settle alike share the settled packing: the first of them is handed out alone, and the
others with the packing that it brought back. As the packing is the same to the bit wherever it was settled, the table
does not depend on the number of workers, on shards, or on where a run was cut off.

A folder holds sweep.json (what was asked for), results.jsonl and results.csv. Lines of results.jsonl that are of a
point of this sweep are not computed again. A last line that a kill has cut is computed again.
"""

from __future__ import annotations

import fcntl
import json
import time
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor
from scipy.sparse.linalg import ArpackError
from threadpoolctl import threadpool_limits

from ...analysis import FaultgougeError, Packing
from ...analysis.files.wholefile import make_folder, write_text
from ...pywrap import Equilibrium, Scene, SceneError, settle
from ...pywrap.settling.bed import settled_bed
from .points import Point, Sweep, shard
from .table import write_tables
from .tasks import TASKS

Say = Callable[[str], None]
Row = dict[str, Any]
Progress = Callable[[Iterator[Row], int], Iterable[Row]]

FAILURES = (FaultgougeError, ValueError, ArithmeticError, ArpackError, MemoryError)
"""What may go wrong with one scene: of the package, of LAPACK, of ARPACK, and of a packing that is too large."""

LINES, ASKED, LOCK = "results.jsonl", "sweep.json", "sweep.lock"


def run_sweep(
    sweep: Sweep,
    output: Path,
    part: tuple[int, int] = (1, 1),
    say: Say = print,
    progress: Progress = lambda rows, _: rows,
) -> list[Row]:
    """Compute what is missing of a sweep, and write its table.

    Parameters
    ----------
    sweep : Sweep
        What is wanted.
    output : Path
        The folder, made if need be.
    part : tuple of (int, int)
        K and N: part K of N, counted from 1.
    say : callable
        Takes a line of words.
    progress : callable
        Takes the rows that end and their number, and hands the rows on.

    Returns
    -------
    list of dict
        The rows of this part in the order of the sweep; empty on ranks other than 0.

    Raises
    ------
    SceneError
        If another process writes to the folder.
    """
    points = shard(sweep.points, part)
    workers: AbstractContextManager[Any] = (
        nullcontext() if MPI.COMM_WORLD.size == 1 else MPICommExecutor(MPI.COMM_WORLD)
    )
    with workers as pool:
        if MPI.COMM_WORLD.rank != 0:
            return []
        make_folder(output)
        with _alone(output):
            write_text(output / ASKED, json.dumps(sweep.as_dict() | {"shard": list(part)}, indent=1) + "\n")
            known = stored(output / LINES)
            missing = [point for point in points if point.key not in known]
            if len(missing) < len(points):
                say(f"{len(points) - len(missing)} of {len(points)} points are in {output / LINES} already")
            with (output / LINES).open("a") as file, closing(computed(pool, sweep.task, missing)) as rows:
                for row in progress(_kept(rows, file), len(missing)):
                    known[row["key"]] = row
            table = [known[point.key] for point in points]
            write_tables(table, sweep.names, output)
    return table


def _kept(rows: Iterable[Row], file: IO[str]) -> Iterator[Row]:
    """The rows, each in the file before it is handed on."""
    for row in rows:
        file.write(json.dumps(row) + "\n")
        file.flush()
        yield row


def computed(pool: Executor | None, task: str, points: Sequence[Point]) -> Generator[Row, None, None]:
    """The rows of points as they end; closing the generator takes back those that no worker has begun."""
    groups: dict[str, deque[Point]] = defaultdict(deque)
    for point in points:
        groups[point.key if point.scene is None else point.settling].append(point)
    if pool is None:
        for group in groups.values():
            bed = None
            for number, point in enumerate(group):
                row, bed = examined(task, point, bed, number + 1 < len(group))
                yield row
        return
    running: dict[Future[tuple[Row, Packing | None]], deque[Point]] = {}
    for group in groups.values():
        point = group.popleft()
        running[pool.submit(examined, task, point, None, bool(group))] = group
    try:
        while running:
            ended, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in ended:
                group = running.pop(future)
                row, bed = future.result()
                while group:
                    running[pool.submit(examined, task, group.popleft(), bed, False)] = deque()
                yield row
    finally:
        for future in running:
            future.cancel()


def examined(task: str, point: Point, bed: Packing | None, keep: bool) -> tuple[Row, Packing | None]:
    """One point: its row, and if it is to be kept the packing as it settled.

    What goes wrong with a point is in its row under "says".
    """
    begin = time.perf_counter(), time.process_time()
    beds = [] if bed is None else [bed]
    row: Row = {
        "key": point.key,
        "version": version("faultgouge"),
        "values": point.values,
        "result": {},
        "says": point.says,
    }
    if point.scene is not None:
        with threadpool_limits(1):
            try:
                row["result"] = TASKS[task].run(point.scene, _starter(point.scene, beds))
                row["says"] = row["result"].pop("says", None)
            except FAILURES as error:
                row["says"] = str(error) or type(error).__name__
    row["seconds"] = round(time.perf_counter() - begin[0], 3)
    row["cpu_seconds"] = round(time.process_time() - begin[1], 3)
    return row, (beds[0] if keep and beds else bed if keep else None)


def _starter(scene: Scene, beds: list[Packing]) -> Callable[[float], Equilibrium]:
    """The settled packing for a friction coefficient; what settles goes to `beds`, and is taken from there."""

    def start(mu: float) -> Equilibrium:
        if scene.packing.model_dump().get("settle_friction", False) and mu != scene.law.mus[0]:
            return settle(scene, mu, MPI.COMM_SELF)
        if not beds:
            beds.append(settled_bed(scene, mu, MPI.COMM_SELF))
        return settle(scene, mu, MPI.COMM_SELF, bed=beds[0])

    return start


def stored(path: Path) -> dict[str, Row]:
    """The rows of results.jsonl by key. A last line that a kill has cut short is taken off the file."""
    if not path.exists():
        return {}
    data = path.read_bytes()
    complete = data[: data.rfind(b"\n") + 1]
    if complete != data:
        with path.open("r+b") as file:
            file.truncate(len(complete))
    rows = {}
    for number, line in enumerate(complete.splitlines(), 1):
        try:
            row = json.loads(line)
            rows[row["key"]] = row
        except (ValueError, KeyError, TypeError):
            raise SceneError(
                f"{path}: line {number} is no result of a sweep: take it out, or give another folder"
            ) from None
    return rows


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keep other processes out of a folder; the lock goes with the process."""
    with (folder / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise SceneError(
                f"{folder}: another process writes to this folder: wait for its end, or give every shard its own folder"
            ) from None
        yield
