"""Put together what was computed apart: shards of a sweep, or parts of the modes of `onset --modes`.

Parts of the modes have together the same first window as all modes: the merged F_x^c is the smallest one. An increment
in which a part was in doubt stays doubtful if it lies before that. A part without a window leaves no file, so gaps
between the parts are named.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...analysis.digits import with_uncertainty
from ...analysis.files.wholefile import make_folder, write_text
from ...pywrap import SceneError
from .compute import ASKED, LINES, Say, stored
from .points import Sweep
from .table import Row, write_tables
from .tasks import TASKS


def merge(parts: Sequence[Path], output: Path, say: Say = print) -> list[Row]:
    """Merge folders of sweeps into one, or JSON files of `onset --modes` into onset.json.

    Parameters
    ----------
    parts : sequence of Path
        Folders that `sweep` has left, or files that `onset` has; not both.
    output : Path
        The folder, made if need be.
    say : callable
        Takes a line of words.

    Returns
    -------
    list of dict
        The rows of a sweep; none of parts of an onset.

    Raises
    ------
    SceneError
        If the parts do not belong together, or are no parts.
    """
    if all((part / ASKED).is_file() for part in parts):
        return _merge_sweeps(parts, output, say)
    if all(part.is_file() for part in parts):
        _merge_modes(parts, output, say)
        return []
    wrong = next(part for part in parts if not (part / ASKED).is_file())
    raise SceneError(
        f"{wrong} is no folder of a sweep (it has no {ASKED}): give folders that `faultgouge sweep` has left, or "
        "JSON files of `faultgouge onset --modes` alone"
    )


def _merge_sweeps(parts: Sequence[Path], output: Path, say: Say) -> list[Row]:
    asked = [_read(part / ASKED) for part in parts]
    for part, each in zip(parts, asked, strict=True):
        each.pop("shard", None)
        if each != asked[0]:
            raise SceneError(f"{part} is of another sweep than {parts[0]}: merge parts of one sweep")
    sweep = Sweep.from_mapping(asked[0], TASKS, name=str(parts[0] / ASKED))
    known: dict[str, Any] = {}
    for part in parts:
        known |= stored(part / LINES)
    rows = [known[point.key] for point in sweep.points if point.key in known]
    make_folder(output)
    write_text(output / ASKED, json.dumps(sweep.as_dict() | {"shard": [1, 1]}, indent=1) + "\n")
    write_text(output / LINES, "".join(json.dumps(row) + "\n" for row in rows))
    write_tables(rows, sweep.names, output)
    say(f"{len(rows)} of {len(sweep.points)} scenes from {len(parts)} folders; written: {output}/results.csv")
    if len(rows) < len(sweep.points):
        say(f"the other {len(sweep.points) - len(rows)} are in none of them: `faultgouge sweep` goes on from here")
    return rows


def _merge_modes(parts: Sequence[Path], output: Path, say: Say) -> None:
    tables = [_read(part) for part in parts]
    for part, table in zip(parts, tables, strict=True):
        if not (isinstance(table.get("modes"), list) and len(table["modes"]) == 2 and "windows" in table):
            raise SceneError(
                f"{part} is no part of an onset: give JSON files of `faultgouge onset --modes FIRST:STOP -o`"
            )
    mus = [[each["mu"] for each in _of_each_mu(table)] for table in tables]
    if any(each != mus[0] for each in mus):
        raise SceneError(f"the parts have different friction coefficients, {mus}: merge parts of one scene")
    found = [_first([_of_each_mu(table)[k] for table in tables]) for k in range(len(mus[0]))]
    result = found[0] | ({"each_mu": found} if len(found) > 1 else {})
    make_folder(output)
    write_text(output / "onset.json", json.dumps(result, indent=1) + "\n")
    for each in found:
        say(
            f"mu = {each['mu']:g}: F_x^c = {with_uncertainty(each['fx_c'], each['error'])} among the modes of "
            f"{len(parts)} parts"
        )
    for first, stop in found[0]["missing"]:
        say(f"modes {first}:{stop} are in no part: either they were not searched, or they have no window")
    say(f"written: {output}/onset.json")


def _of_each_mu(table: dict[str, Any]) -> list[dict[str, Any]]:
    several: list[dict[str, Any]] = table.get("each_mu", [table])
    return several


def _first(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """The part with the first window, with the modes and the doubts of all."""
    first = min(parts, key=lambda part: part["fx_c"])
    doubtful = {tuple(each) for part in parts for each in part["doubtful"] if each[0] < first["fx_c"]}
    ranges = sorted(tuple(part["modes"]) for part in parts)
    missing, reached = [], ranges[0][0]
    for start, stop in ranges:
        if start > reached:
            missing.append([reached, start])
        reached = max(reached, stop)
    merged = {name: value for name, value in first.items() if name != "each_mu"}
    return merged | {
        "windows": sorted((w for part in parts for w in part["windows"]), key=lambda window: window["fx_onset"]),
        "doubtful": [list(each) for each in sorted(doubtful)],
        "modes": [ranges[0][0], reached],
        "missing": missing,
    }


def _read(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"{path} cannot be read ({error.strerror}): correct its path") from None
    except ValueError as error:
        raise SceneError(f"{path} is not valid JSON ({error}): give a file that faultgouge has written") from None
    if not isinstance(value, dict):
        raise SceneError(f"{path} is no result of faultgouge: give a file that it has written")
    return value
