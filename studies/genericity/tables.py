"""The tables of the study as arrays: columns of results.csv by name."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.packing.packing import Floats
from ..statistics import Bools


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of a sweep that has run.

    Attributes
    ----------
    rows : tuple of dict
        Cells by column, as text; empty where there is none.
    """

    rows: tuple[dict[str, str], ...]

    @classmethod
    def read(cls, path: Path) -> Table:
        """The table of a file; without rows if there is no such file."""
        if not path.exists():
            return cls(())
        with path.open(newline="") as file:
            return cls(tuple(csv.DictReader(file)))

    def __len__(self) -> int:
        return len(self.rows)

    def where(self, **values: Any) -> Table:
        """The rows with these values; `packing_disks` stands for packing.disks."""
        wanted = {name.replace("_", ".", 1): value for name, value in values.items()}
        return Table(tuple(r for r in self.rows if all(_same(r[name], value) for name, value in wanted.items())))

    def numbers(self, name: str) -> Floats:
        """A column of numbers, nan where there is none."""
        return np.array([float(row[name]) if row.get(name) else np.nan for row in self.rows])

    def words(self, name: str) -> list[str]:
        """A column of words."""
        return [row.get(name, "") for row in self.rows]

    def lists(self, name: str) -> list[Any]:
        """A column of lists, None where there is none."""
        return [json.loads(row[name]) if row.get(name) else None for row in self.rows]

    @cached_property
    def settled(self) -> Table:
        """The rows that have a result."""
        return Table(tuple(row for row in self.rows if row.get("ends", row.get("modes", ""))))

    @property
    def failures(self) -> int:
        """Rows without a result."""
        return sum(bool(row["says"]) for row in self.rows)

    @property
    def reach(self) -> Floats:
        """The onset, or the largest F_x up to which there is none."""
        return self.numbers("reach")

    @property
    def found(self) -> Bools:
        """Whether that is the onset."""
        return np.array([end == "onset" for end in self.words("ends")], dtype=bool)


def _same(cell: str, value: Any) -> bool:
    try:
        return float(cell) == float(value)
    except ValueError:
        return cell == str(value)
