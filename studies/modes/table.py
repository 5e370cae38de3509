"""Table of loads for many packings: results at each load, and medians over the packings that bear it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...analysis.arrays import Floats
from ..statistics import median

QUANTITIES = ("share", "growth_rate", "least_q")


@dataclass(frozen=True)
class Table:
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


def medians_over_load(table: Table, names: Sequence[str] = QUANTITIES) -> dict[str, Any]:
    """Medians with intervals at each load, and how many packings bear it."""
    found: dict[str, Any] = {"packings": len(table.rows), "loads": table.loads}
    found["count"] = [len(table.at(load, names[0])) for load in table.loads]
    return found | {name: [median(table.at(load, name)) for load in table.loads] for name in names}
