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
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.arrays import Floats
from ..analysis.files.atomic_write import FORMAT, FORMAT_KEY, check_format, check_own, read_plain, write_text
from ..pywrap import Scene, SceneError

Row = dict[str, Any]


def read_keyed_rows(path: Path, keys: Sequence[str], what: str) -> list[Row]:
    """The rows of a file, each with some keys, of which the first identifies it; none if there is no file.

    The file stays as it is. A last line without its end, which a kill has cut or another process is writing, is no row.
    Raises SceneError if a line is no such row.
    """
    try:
        data = read_plain(path) if path.exists() else b""
    except OSError as error:
        raise SceneError(f"{path} cannot be read ({error.strerror}): take it out, or give another folder") from None
    rows: list[Row] = []
    for number, line in enumerate(data[: data.rfind(b"\n") + 1].splitlines(), 1):
        try:
            row = json.loads(line)
            identity, *_ = [row[key] for key in keys]
            hash(identity)
            number_of_format = row.pop(FORMAT_KEY, None)
        except (ValueError, KeyError, TypeError, RecursionError):
            says = f"{path}: line {number} is no result of {what}: take it out, or give another folder"
            raise SceneError(says) from None
        check_format(number_of_format, f"{path}, line {number},")
        rows.append(row)
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
    """Rows of one source, a scene or a file, which a line in NAME.jsonl names; lines of others are left alone.

    Without a path nothing is known and nothing is stored.
    """

    def __init__(self, path: Path | None = None, source: str = "") -> None:
        self.path, self._source = path, source
        lines = [] if path is None else read_keyed_rows(path, ("scene",), "a study")
        self.rows = [row for row in lines if row["scene"] == source]

    def append(self, **row: Any) -> Row:
        """Write a line; it is in the file when this returns."""
        row = {"scene": self._source, "version": version("faultgouge")} | row
        if self.path is not None:
            append_row(self.path, {FORMAT_KEY: FORMAT, **row})
        self.rows.append(row)
        return row

    def find(self, **wanted: Any) -> Row | None:
        """The first line with these values, if there is one."""
        return next((row for row in self.rows if all(row.get(key) == value for key, value in wanted.items())), None)


def source_of(scene: Scene, beside: str = "") -> str:
    """Digits that stand for a scene with the contents of its files, but for the section `beside`."""
    whole = {name: keys for name, keys in scene.resolved().items() if name != beside}
    # a name alone does not say which packing it is
    return hashlib.sha256(json.dumps(whole | scene.digests(), sort_keys=True).encode()).hexdigest()[:12]


def flat(result: Mapping[str, Any], above: str = "") -> Row:
    """The result with dicts opened, their keys joined by dots; lists stay."""
    row: Row = {}
    for name, value in result.items():
        row |= flat(value, f"{above}{name}.") if isinstance(value, Mapping) else {above + name: value}
    return row


def check_table(names: Sequence[str], folder: Path) -> str:
    """Refuse a results.csv of others; returns how ours begins.

    A table begins with the swept keys; that of a scene, which has none, is known by the rows beside it.
    """
    file, head = folder / "results.csv", "".join(f"{name}," for name in names)
    if not names and file.is_file() and (folder / "results.jsonl").exists():
        head = file.read_text().partition("\n")[0]
    check_own(file, head)
    return head


def write_tables(rows: Iterable[Row], names: Sequence[str], folder: Path) -> None:
    """Write rows in the order of the table, with the swept keys by name: results.csv."""
    table = [row["values"] | flat(row["result"]) | {"says": row["says"]} for row in rows]
    columns = dict.fromkeys([*names, *(name for row in table for name in row if name != "says"), "says"])
    write_csv(folder / "results.csv", [*columns], table, check_table(names, folder))


def write_csv(path: Path, columns: Sequence[str], table: Iterable[Row], head: str | None = None) -> None:
    """Write some columns of rows; the file is replaced as a whole, if it begins with `head`: by default all columns.

    Numbers have all digits, lists are JSON, and nothing stands for None.
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in table:
        cells = [row.get(column) for column in columns]
        writer.writerow([json.dumps(cell) if isinstance(cell, bool | list | tuple) else cell for cell in cells])
    write_text(path, text.getvalue(), head=",".join(columns) if head is None else head)
