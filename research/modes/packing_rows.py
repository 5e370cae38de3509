"""The tables of the study: a line for each packing, with its loads."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from faultgouge.analysis import Floats
from faultgouge.studies.sweep import read_results
from research.tables import SWEEP_ROWS, read_rows

TABLE_SUFFIX = ".jsonl"

DIGITS = 7
"""Of the numbers in a table."""

LEFT_OUT = ("frequencies",)
"""What a line of a table lacks of a result: as long as the spectrum itself."""


class Table(NamedTuple):
    """One set of packings.

    Attributes
    ----------
    name : str
        Of the set, such as "force 100".
    rows : tuple of dict
        A packing each, by seed.
    """

    name: str
    rows: tuple[dict[str, Any], ...]

    @property
    def disks(self) -> int:
        """Disks of each packing."""
        words = self.name.split()
        return int(words[-1]) if words[-1].isdecimal() else 100

    @property
    def loads(self) -> list[float]:
        """F_x/F_y that some packing has borne."""
        return sorted({load["fx_over_fy"] for row in self.rows for load in row.get("loads", ())})

    def borne(self, fx_over_fy: float) -> list[dict[str, Any]]:
        """The rows of a load, for every packing that has borne it."""
        return [load for row in self.rows for load in row.get("loads", ()) if load["fx_over_fy"] == fx_over_fy]

    def at(self, fx_over_fy: float, key: str) -> Floats:
        """A number of every packing that has borne a load, shape (n,): least Q is inf where there is no pair."""
        return np.array([np.inf if load[key] is None else load[key] for load in self.borne(fx_over_fy)], dtype=float)


def condense(results: Path, tables: Path) -> None:
    """Add what the sweeps have left, a folder a set, to the tables; a packing that is in both is the new one.

    Parameters
    ----------
    results : Path
        With a folder for each set.
    tables : Path
        The folder of the tables.
    """
    tables.mkdir(parents=True, exist_ok=True)
    for folder in sorted(path for path in results.iterdir() if (path / SWEEP_ROWS).exists()):
        rows = read_known(tables, folder.name) | {
            row["seed"]: row for row in map(_line, read_results(folder / SWEEP_ROWS).values())
        }
        table_of(tables, folder.name).write_text("".join(json.dumps(rows[seed]) + "\n" for seed in sorted(rows)))


def table_of(tables: Path, name: str) -> Path:
    """The file of a set's table."""
    return tables / f"{name.replace(' ', '_')}{TABLE_SUFFIX}"


def read_known(tables: Path, name: str) -> dict[int, dict[str, Any]]:
    """The rows of a set's table by seed; none where there is no table."""
    path = table_of(tables, name)
    return {row["seed"]: row for row in read_rows(path)} if path.exists() else {}


def computed_again(results: Path, tables: Path) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Packings that sweeps have computed again: set and seed, the new row, and the row of the table."""
    again = results / "tables"
    condense(results, again)
    for path in sorted(again.glob(f"*{TABLE_SUFFIX}")):
        before = read_known(tables, path.stem)
        for seed, row in read_known(again, path.stem).items():
            yield f"{path.stem}, seed {seed}", row, before[seed]


def _line(row: dict[str, Any]) -> dict[str, Any]:
    result = row["result"]
    loads = [_round_numbers({k: v for k, v in load.items() if k not in LEFT_OUT}) for load in result.get("loads", [])]
    line = {"seed": row["values"]["packing.seed"], "says": row["says"], "cpu_seconds": row["cpu_seconds"]}
    return line | result | {"loads": loads}


def _round_numbers(value: Any) -> Any:
    """Numbers to the digits that a table keeps."""
    if isinstance(value, dict):
        return {key: _round_numbers(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_round_numbers(each) for each in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def read_tables(folder: Path) -> dict[str, Table]:
    """The tables of a folder by name; packings that failed are left out, and counted by `failures`."""
    found = {}
    for path in sorted(folder.glob(f"*{TABLE_SUFFIX}")):
        name = path.stem.replace("_", " ")
        found[name] = Table(name, tuple(row for row in read_rows(path) if row["says"] is None))
    return found
