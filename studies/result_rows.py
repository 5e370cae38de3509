"""Rows of results: lines of JSON in a file from which an interrupted study continues, and tables of them.

A row is a dict of numbers, words, lists and dicts. A line is in its file as soon as the row is known. A table has one
row for each scene; its columns are the swept keys, the keys of the result (nested keys joined by dots), and the error
sentence. Numbers have all their digits, so that two runs write the same table; wall times are in the lines alone.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.arrays import Floats
from ..analysis.files.atomic_write import (
    FORMAT,
    FORMAT_KEY,
    check_format,
    check_own,
    read_plain,
    replace_whole,
    write_text,
)
from ..pywrap import Scene, SceneError

Row = dict[str, Any]


def read_keyed_rows(path: Path, key: str, what: str) -> list[dict[str, Any]]:
    """The rows of a file, each with a key; none if there is no file. The file stays as it is.

    A last line without its end, which a kill has cut or another process is writing, is no row. Raises SceneError if a
    line is no such row.
    """
    if not path.exists():
        return []
    try:
        data = read_plain(path)
    except OSError as error:
        raise SceneError(f"{path} cannot be read ({error.strerror}): take it out, or give another folder") from None
    rows = []
    for number, line in enumerate(data[: data.rfind(b"\n") + 1].splitlines(), 1):
        try:
            rows.append(json.loads(line))
            rows[-1][key]
            number_of_format = rows[-1].pop(FORMAT_KEY, None)
        except (ValueError, KeyError, TypeError, RecursionError):
            raise SceneError(
                f"{path}: line {number} is no result of {what}: take it out, or give another folder"
            ) from None
        check_format(number_of_format, f"{path}, line {number},")
    return rows


def row_columns(rows: Sequence[Mapping[str, Any]], *names: str) -> Floats:
    """Numbers of rows, shape (names, rows); nan where there is none."""
    return np.array([[row[name] for row in rows] for name in names], dtype=np.float64)


def append_row(path: Path, row: Mapping[str, Any]) -> None:
    """Write a row; it is in the file when this returns. A folder that is missing is made.

    A last line that a kill has cut is taken off first. One process writes at a time.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as file:
        size = file.tell()
        if size:
            file.seek(size - 1)
            if file.read(1) != b"\n":
                file.seek(0)
                file.truncate(file.read().rfind(b"\n") + 1)
        file.write(json.dumps(row).encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


class Rows:
    """Lines of one scene in a file, NAME.jsonl; lines of other scenes are left alone.

    The section `beside` of the scene may change while the lines remain valid.
    """

    def __init__(self, path: Path, scene: Scene, beside: str) -> None:
        self.path = path
        whole = {name: keys for name, keys in scene.resolved().items() if name != beside}
        resolved = whole | scene.digests()  # a name alone does not say which packing it is
        self._scene = hashlib.sha256(json.dumps(resolved, sort_keys=True).encode()).hexdigest()[:12]
        self.rows = [row for row in read_keyed_rows(path, "scene", "a study") if row["scene"] == self._scene]

    def append(self, **row: Any) -> dict[str, Any]:
        """Write a line; it is in the file when this returns."""
        row = {"scene": self._scene, "version": version("faultgouge")} | row
        append_row(self.path, {FORMAT_KEY: FORMAT, **row})
        self.rows.append(row)
        return row

    def find(self, **wanted: Any) -> dict[str, Any] | None:
        """The first line with these values, if there is one."""
        return next((row for row in self.rows if all(row.get(key) == value for key, value in wanted.items())), None)


def flat(result: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """The result with dicts opened, their keys joined by dots; lists stay."""
    row: dict[str, Any] = {}
    for name, value in result.items():
        if isinstance(value, Mapping):
            row |= flat(value, f"{above}{name}.")
        else:
            row[above + name] = value
    return row


def check_table(names: list[str], folder: Path) -> None:
    """Refuse a results.csv and a results.parquet of others, before work begins.

    A table begins with the swept keys; that of a scene, which has none, is known by the rows beside it.
    """
    if names or not (folder / "results.jsonl").exists():
        check_own(folder / "results.csv", ",".join(names) + ",")
    check_own(folder / "results.parquet")


def write_tables(rows: list[Row], names: list[str], folder: Path) -> None:
    """Write rows in the order of the table, with the swept keys by name: results.csv, results.parquet if it can be."""
    table = [row["values"] | flat(row["result"]) | {"says": row["says"]} for row in rows]
    columns = [name for name in dict.fromkeys([*names, *(name for row in table for name in row)]) if name != "says"]
    file = folder / "results.csv"
    stored = file.read_text().splitlines()[:1] if file.exists() and not names else []
    write_csv(file, [*columns, "says"], table, "".join(stored) or ",".join(names))
    if find_spec("pandas") and find_spec("pyarrow"):
        import pandas as pd

        frame = pd.DataFrame([{column: _plain(row.get(column)) for column in [*columns, "says"]} for row in table])
        frame.attrs[FORMAT_KEY] = FORMAT
        with replace_whole(folder / "results.parquet") as new:
            frame.to_parquet(new)


def write_csv(path: Path, columns: Sequence[str], table: Iterable[Row], head: str | None = None) -> None:
    """Write some columns of rows; the file is replaced as a whole, if it begins with `head`: by default all columns.

    Numbers have all digits, lists are JSON, and nothing stands for None.
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in table:
        cells = [_plain(row.get(column)) for column in columns]
        writer.writerow([str(cell).lower() if isinstance(cell, bool) else cell for cell in cells])
    write_text(path, text.getvalue(), head=",".join(columns) if head is None else head)


def _plain(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, list | tuple) else value
