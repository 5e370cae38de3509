"""Run a sweep: each point is a line of results.jsonl as soon as it ends, and results.csv is the table of all.

`merge` joins the shards of a sweep, each with its own folder. The table does not depend on the number of workers, on
shards, or on interruptions.

A folder contains sweep.json (the request, with the version of the program and the keys of the points), results.jsonl
and results.csv. Points with a line in results.jsonl are not computed again, but for those that failed for a reason that
may have passed (:data:`.workers.FINAL_ERRORS`). Of several rows of a point a good one counts. No line is ever taken
out: rows of other scenes, of other code or of another version stay in results.jsonl, and are not in the table.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import closing
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mpi4py import MPI

from ...analysis import FaultgougeError
from ...analysis.files.atomic_write import (
    FORMAT,
    FORMAT_KEY,
    check_format,
    lock_output,
    make_folder,
    read_plain_text,
    write_json,
)
from ...pywrap import SceneError
from ..result_rows import Row, append_row, check_table, read_keyed_rows, write_tables
from ..study import Progress, Say
from .sweep_plan import Sweep, points_of
from .user_function import locate
from .workers import compute_points, open_executor

RESULTS_FILE, REQUEST_FILE = "results.jsonl", "sweep.json"


class WorkerError(FaultgougeError):
    """Workers are killed before they have a row, or end as they start."""


class FailedSweepError(FaultgougeError):
    """Every scene of a sweep has failed; rank 0 alone has the rows, and knows."""

    one_rank = True


def sweep(
    request: str | Path | Mapping[str, Any],
    output: str | Path,
    workers: int | None = 1,
    executor: Executor | None = None,
    say: Say = print,
) -> list[Row]:
    """Run a sweep, or continue one: what the command `faultgouge sweep` does.

    Parameters
    ----------
    request : str, Path or mapping
        SWEEP.toml, or what it would hold.
    output : str or Path
        The folder of the rows, and of their table.
    workers, executor, say
        As of :func:`run_sweep`, which also says what is returned and raised.

    Raises
    ------
    SceneError
        If the request is neither path nor mapping, or describes no sweep.

    Examples
    --------

    >>> layer = {"disks": 3, "radii": [0.5], "top": 1, "width": 2.8}
    >>> scene = {"packing": layer, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
    >>> scene |= {"ramp": {"step": 0.1, "until": 2.4}}
    >>> request = {"task": "onset", "sweep": {"law.mu": [1.0, 0.8]}, "scene": scene}
    >>> rows = faultgouge.sweep(request, "onsets", say=lambda line: None)
    >>> [round(row["result"]["fx_c"], 6) for row in rows]
    [1.935965, 1.672051]
    """
    if not isinstance(request, str | Path | Mapping):
        wrong = type(request).__name__
        raise SceneError(f"sweep takes the path of a SWEEP.toml, or a mapping as in it, and no {wrong}.")
    wanted = Sweep.from_mapping(request) if isinstance(request, Mapping) else Sweep.from_toml(request)
    return run_sweep(wanted, Path(output), workers=workers, executor=executor, say=say)


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
        If a worker is killed before any row of this call is known; else the sweep goes on with new workers.
    """
    points, new = points_of(sweep.points, part), list[Row]()
    try:
        with open_executor(workers, executor) as pool:
            if MPI.COMM_WORLD.rank != 0:
                return []
            make_folder(output, REQUEST_FILE)
            check_table(sweep.names, output)
            with lock_output(output):
                known = read_results(output / RESULTS_FILE)
                answered = {key for key, row in known.items() if row["says"] is None or row["final"]}
                missing = [point for point in points if point.key not in answered]
                # the keys recognise the rows wherever the files of the scenes and of the task are
                keys = [point.key for point in sweep.points]
                about = {"version": version("faultgouge"), "keys": keys, "shard": list(part)}
                write_json(output / REQUEST_FILE, sweep.as_dict() | about)
                if len(missing) < len(points):
                    say(f"{len(points) - len(missing)} of {len(points)} points are in {output / RESULTS_FILE} already")
                if others := known.keys() - set(keys):
                    say(f"{len(others)} rows there are of other scenes, code or versions, and are not in the table")
                with closing(compute_points(pool, locate(sweep.task, sweep.folder), missing)) as ended:
                    for row in progress(ended, len(missing)):
                        append_row(output / RESULTS_FILE, {FORMAT_KEY: FORMAT, **row})
                        known[row["key"]] = row
                        new.append(row)
                table = [known[point.key] for point in points]
                write_tables(table, sweep.names, output)
        return table
    except BrokenExecutor:
        if not new:
            raise WorkerError(
                "a worker was killed, possibly for lack of memory: give fewer --workers, and the same command "
                "continues. Workers also end as they start where a script calls run_sweep above the line `if __name__ "
                '== "__main__":`, since each of them reads the script anew'
            ) from None
        say("a worker was killed, possibly for lack of memory: the sweep goes on with new ones")
        return run_sweep(sweep, output, part, say, progress, workers, executor)


def require_result(rows: Sequence[Row]) -> None:
    """Raise FailedSweepError if there are rows, and each row is a failure."""
    if rows and all(row["says"] is not None for row in rows):
        raise FailedSweepError(f"none of the {len(rows)} scenes has a result; the first says: {rows[0]['says']}")


def read_results(*paths: Path) -> dict[str, Row]:
    """Read the rows of one or several results.jsonl.

    Parameters
    ----------
    *paths : Path
        The files.

    Returns
    -------
    dict
        Key of a scene -> its row; of several rows with one key a row without an error, else the last row.

    Raises
    ------
    SceneError
        If a line is no row, or two good rows of a key have different results.
    """
    rows, places = dict[str, Row](), dict[str, Path]()
    for path in paths:
        for row in read_keyed_rows(path, ("key", "values", "says", "final", "result"), "a sweep"):
            key, known = row["key"], rows.get(row["key"])
            if known is None or known["says"] is not None:
                rows[key], places[key] = row, path
            elif row["says"] is None and _as_text(row["result"]) != _as_text(known["result"]):
                values = ", ".join(f"{name} = {value}" for name, value in row["values"].items())
                two = f"{places[key]} and {path} have different results of one scene ({values}; key {key})"
                raise SceneError(f"{two}: take the line of the wrong one out")
    return rows


def _as_text(value: Row | None) -> str:
    """A row, or its result, as text, in which nan equals nan."""
    return json.dumps(value, sort_keys=True)


def merge(parts: Sequence[Path], output: Path, say: Say = print) -> tuple[Sweep, list[Row]]:
    """Merge the folders of shards into one. The shards may still be running; their files are only read.

    Parameters
    ----------
    parts : sequence of Path
        Folders written by `sweep`.
    output : Path
        The folder, made if need be. The rows that it has are kept: it is new, or of the same sweep.
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
        If the parts, and what the folder has, do not belong together, or are not parts of a sweep.
    """
    request = _common_request(parts)
    make_folder(output, REQUEST_FILE)
    file = output / RESULTS_FILE
    with lock_output(output):
        if (output / REQUEST_FILE).exists() or file.exists():
            _common_request([*parts, output])
        kept = read_results(file)
        known = read_results(file, *(part / RESULTS_FILE for part in parts))
        table = [known[key] for key in request["keys"] if key in known]
        write_json(output / REQUEST_FILE, request | {"shard": [1, 1]})
        for row in table:
            if _as_text(kept.get(row["key"])) != _as_text(row):
                append_row(file, {FORMAT_KEY: FORMAT, **row})
        sweep = Sweep(request["task"], request["sweep"], request["scene"])
        write_tables(table, sweep.names, output)
    count, missing = len(request["keys"]), len(request["keys"]) - len(table)
    says = f"{len(table)} of {count} scenes from {len(parts)} folders; written: {output}/results.csv"
    say(f"{says}\nthe other {missing} are in none of them: `faultgouge sweep` goes on from here" if missing else says)
    return sweep, table


def _common_request(folders: Sequence[Path]) -> dict[str, Any]:
    """What sweep.json holds in the folders of one sweep, whose shards may differ."""
    first: dict[str, Any] | None = None
    for folder in folders:
        path = folder / REQUEST_FILE
        try:
            request = dict(json.loads(read_plain_text(path)))
            check_format(request.pop(FORMAT_KEY, None), path)
            same = {name: request[name] for name in ("version", "task", "sweep", "keys")}
            first = first or same | {"scene": request["scene"]} | request
        except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
            says = f"{folder} is no folder of a sweep, or of version 1.0.0 or before ({type(error).__name__}: {error})"
            raise SceneError(f"{says}: give folders of `faultgouge sweep`") from None
        for name, value in same.items():
            if value != first[name]:
                other = f"another sweep than {folders[0]}, of other scenes, other code or another version"
                cure = "merge parts of one sweep, into a new folder or one of this sweep"
                raise SceneError(f"{folder} is of {other} ({name} differs): {cure}")
    return first or {}
