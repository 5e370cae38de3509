"""The table of a sweep, one row for each scene in the order of the sweep: results.csv, and results.parquet with pandas.

Columns are the swept keys, the keys of the result (nested keys joined by dots), and the error sentence. Numbers have
all their digits, so that two runs of one sweep write the same file; wall times are only in results.jsonl.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any

from ...analysis.files.atomic_write import FORMAT, FORMAT_KEY, check_own, replace_whole, write_text

Row = dict[str, Any]


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
    """Refuse a results.csv and a results.parquet of others, before work begins."""
    check_own(folder / "results.csv", ",".join(names) + ",")
    check_own(folder / "results.parquet")


def write_tables(rows: list[Row], names: list[str], folder: Path) -> None:
    """Write rows in the order of the table, with the swept keys by name: results.csv, results.parquet if it can be."""
    found = dict.fromkeys([*names, *(name for row in rows for name in flat(row["result"]))])
    columns = [*(name for name in found if name != "says"), "says"]
    table = [row["values"] | flat(row["result"]) | {"says": row["says"]} for row in rows]
    write_csv(folder / "results.csv", columns, table, len(names))
    if find_spec("pandas") and find_spec("pyarrow"):
        import pandas as pd

        frame = pd.DataFrame([{column: _plain(row.get(column)) for column in columns} for row in table])
        frame.attrs[FORMAT_KEY] = FORMAT
        with replace_whole(folder / "results.parquet") as new:
            frame.to_parquet(new)


def write_csv(path: Path, columns: Sequence[str], table: Iterable[Row], known_by: int | None = None) -> None:
    """Write some columns of rows; the file is replaced as a whole, if its first columns are the same, `known_by` many.

    All columns by default.
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_cell(row.get(column)) for column in columns] for row in table)
    write_text(path, text.getvalue(), head=",".join(columns[:known_by]))


def _cell(value: Any) -> Any:
    """A value as CSV holds it: all digits of a number, lists as JSON, nothing for None."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value) if isinstance(value, (list, tuple)) else repr(value) if isinstance(value, float) else value


def _plain(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, (list, tuple)) else value
