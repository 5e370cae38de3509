"""The tables of the study as arrays: columns of results.csv by name."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.analysis import Floats
from faultgouge.studies.statistics import Bools


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of a sweep that has run.

    Attributes
    ----------
    rows : tuple of dict
        Cells by column: numbers, words and lists; None where there is nothing.
    """

    rows: tuple[dict[str, Any], ...] = ()

    @classmethod
    def read(cls, path: Path) -> Table:
        """The table of a file."""
        with path.open(newline="") as file:
            return cls(tuple({name: _cell(text) for name, text in row.items()} for row in csv.DictReader(file)))

    def __len__(self) -> int:
        return len(self.rows)

    def where(self, **values: Any) -> Table:
        """The rows with these values; `packing_disks` stands for packing.disks."""
        wanted = {name.replace("_", ".", 1): value for name, value in values.items()}
        return Table(tuple(row for row in self.rows if all(row[name] == value for name, value in wanted.items())))

    def where_known(self, name: str) -> Table:
        """The rows with something in a column."""
        return Table(tuple(row for row in self.rows if row.get(name) is not None))

    def beside(self, other: Table, *names: str) -> list[tuple[dict[str, Any], dict[str, Any]]]:
        """Rows of this and of the other table that have the same cells in these columns, in the order of the other."""
        own = {tuple(row[name] for name in names): row for row in self.rows}
        keys = [tuple(row[name] for name in names) for row in other.rows]
        return [(own[key], row) for key, row in zip(keys, other.rows, strict=True) if key in own]

    def column(self, name: str) -> list[Any]:
        """A column, None where there is nothing."""
        return [row.get(name) for row in self.rows]

    def numbers(self, name: str) -> Floats:
        """A column of numbers, nan where there is none."""
        return np.array(self.column(name), dtype=np.float64)

    @cached_property
    def at_rest(self) -> Table:
        """The rows that have a result."""
        return self.where_known("ends" if self.rows and "ends" in self.rows[0] else "modes")

    @property
    def reach(self) -> Floats:
        """The onset, or the largest F_x up to which there is none."""
        return self.numbers("reach")

    @property
    def found(self) -> Bools:
        """Whether that is the onset."""
        return np.array([end == "onset" for end in self.column("ends")], dtype=bool)


def _cell(text: str) -> Any:
    """The content of a cell: JSON, else a word."""
    try:
        return json.loads(text) if text else None
    except ValueError:
        return text
