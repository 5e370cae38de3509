"""Run a sweep: each point is a line of results.jsonl as soon as it ends, and results.csv is the table of all.

`merge` joins the shards of a sweep, each with its own folder.

Points are distributed to workers (:mod:`.workers`), each with one thread. The table does not depend on the number of
workers, on shards, or on interruptions.

A folder contains sweep.json (the request), results.jsonl and results.csv. Points of this sweep with a line in
results.jsonl are not computed again. A last line that a kill has truncated is computed again.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import closing
from pathlib import Path
from typing import Any

from mpi4py import MPI

from ...analysis.files.atomic_write import lock_output, make_folder, write_json, write_text
from ...analysis.files.plain_file import read_plain_text
from ...pywrap import SceneError
from .. import result_rows
from ..executors import Progress, Say, open_executor
from .sweep_plan import Sweep, shard
from .table import Row, write_tables
from .tasks import TASKS
from .workers import compute_points

LINES, ASKED = "results.jsonl", "sweep.json"


def run_sweep(
    sweep: Sweep,
    output: Path,
    part: tuple[int, int] = (1, 1),
    say: Say = print,
    progress: Progress = lambda rows, _: rows,
    workers: int | None = 1,
    executor: Executor | None = None,
) -> list[Row]:
    """Compute the missing points of a sweep, and write its table.

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
        Called with the rows as they end and their number; it passes the rows on.
    workers : int or None
        Number of processes; None: the number of cores that this process may use. Ranks of mpiexec replace these
        processes. A script that asks for several makes this call below the line ``if __name__ == "__main__":``.
    executor : concurrent.futures.Executor, optional
        Replaces these processes, possibly on other machines. Its workers need faultgouge and one thread each: LAMMPS
        cannot run in several threads of a process.

    Returns
    -------
    list of dict
        The rows of this part in the order of the sweep; empty on ranks other than 0.

    Raises
    ------
    OutputError
        If another process writes to the folder.
    WorkerError
        If workers are killed repeatedly.
    """
    points = shard(sweep.points, part)
    with open_executor(workers, executor) as pool:
        if MPI.COMM_WORLD.rank != 0:
            return []
        make_folder(output)
        with lock_output(output):
            write_json(output / ASKED, sweep.as_dict() | {"shard": list(part)})
            known = read_results(output / LINES)
            missing = [point for point in points if point.key not in known]
            if len(missing) < len(points):
                say(f"{len(points) - len(missing)} of {len(points)} points are in {output / LINES} already")
            with closing(compute_points(pool, sweep.located_task, missing)) as ended:
                for row in progress(result_rows.keep_rows(output / LINES, ended), len(missing)):
                    known[row["key"]] = row
            table = [known[point.key] for point in points]
            write_tables(table, sweep.names, output)
    return table


def read_results(path: Path) -> dict[str, Row]:
    """The rows of results.jsonl by key."""
    return {row["key"]: row for row in result_rows.read_keyed_rows(path, "key", "a sweep")}


def merge(parts: Sequence[Path], output: Path, say: Say = print) -> tuple[Sweep, list[Row]]:
    """Merge the folders of shards into one.

    Parameters
    ----------
    parts : sequence of Path
        Folders written by `sweep`.
    output : Path
        The folder, made if need be.
    say : callable
        Takes a line of words.

    Returns
    -------
    sweep : Sweep
        The sweep of the parts.
    rows : list of dict

    Raises
    ------
    SceneError
        If the parts do not belong together, or are not parts of a sweep.
    """
    for part in parts:
        if not (part / ASKED).is_file():
            raise SceneError(
                f"{part} is no folder of a sweep (it has no {ASKED}): give folders that `faultgouge sweep` has left"
            )
    asked = [_read(part / ASKED) for part in parts]
    for part, each in zip(parts, asked, strict=True):
        each.pop("shard", None)
        if each != asked[0]:
            raise SceneError(f"{part} is of another sweep than {parts[0]}: merge parts of one sweep")
    code = asked[0].pop("code", "")
    sweep = Sweep.from_mapping(asked[0], TASKS, name=str(parts[0] / ASKED), code=code)
    known: dict[str, Row] = {}
    for part in parts:
        known |= read_results(part / LINES)
    table = [known[point.key] for point in sweep.points if point.key in known]
    make_folder(output)
    with lock_output(output):
        write_json(output / ASKED, sweep.as_dict() | {"shard": [1, 1]})
        write_text(output / LINES, "".join(json.dumps(row) + "\n" for row in table))
        write_tables(table, sweep.names, output)
    say(f"{len(table)} of {len(sweep.points)} scenes from {len(parts)} folders; written: {output}/results.csv")
    if len(table) < len(sweep.points):
        say(f"the other {len(sweep.points) - len(table)} are in none of them: `faultgouge sweep` goes on from here")
    return sweep, table


def _read(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(read_plain_text(path))
    except OSError as error:
        raise SceneError(f"{path} cannot be read ({error.strerror}): correct its path") from None
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{path} is not valid JSON ({error}): give a file that faultgouge has written") from None
    if not isinstance(value, dict):
        raise SceneError(f"{path} is no result of faultgouge: give a file that it has written")
    return value
