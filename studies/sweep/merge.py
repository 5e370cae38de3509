"""Put shards of a sweep together."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...analysis.files.wholefile import make_folder, write_json, write_text
from ...pywrap import SceneError
from ..hands import Say
from .compute import ASKED, LINES, stored
from .points import Sweep
from .table import Row, write_tables
from .tasks import TASKS


def merge(parts: Sequence[Path], output: Path, say: Say = print) -> list[Row]:
    """Merge folders of sweeps into one.

    Parameters
    ----------
    parts : sequence of Path
        Folders that `sweep` has left.
    output : Path
        The folder, made if need be.
    say : callable
        Takes a line of words.

    Returns
    -------
    list of dict
        The rows.

    Raises
    ------
    SceneError
        If the parts do not belong together, or are no parts.
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
    sweep = Sweep.from_mapping(asked[0], TASKS, name=str(parts[0] / ASKED))
    known: dict[str, Any] = {}
    for part in parts:
        known |= stored(part / LINES)
    rows = [known[point.key] for point in sweep.points if point.key in known]
    make_folder(output)
    write_json(output / ASKED, sweep.as_dict() | {"shard": [1, 1]})
    write_text(output / LINES, "".join(json.dumps(row) + "\n" for row in rows))
    write_tables(rows, sweep.names, output)
    say(f"{len(rows)} of {len(sweep.points)} scenes from {len(parts)} folders; written: {output}/results.csv")
    if len(rows) < len(sweep.points):
        say(f"the other {len(sweep.points) - len(rows)} are in none of them: `faultgouge sweep` goes on from here")
    return rows


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
