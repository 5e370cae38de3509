"""The table of velocity steps and holds computed, the page made from the table, or a seed computed again and compared.

python -m research.protocols.make compute SEEDS   the seeds 1 to SEEDS that the table lacks; half a minute a seed
python -m research.protocols.make page            README.md from the table
python -m research.protocols.make check           the first seed computed again, and compared

From the folder of the repository.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import t as student

from faultgouge.figures import render
from research.protocols.compute import (
    EDGES,
    ENDS,
    FACTORS,
    HOLDS,
    LAST,
    VELOCITY,
    WEAKER,
    rows_of,
    weak_rows_of,
)
from research.statistics import interval
from research.tables import add_seeds, differing, read_rows

HERE = Path(__file__).parent
TABLE, WEAK = "protocols.jsonl", "dashpots.jsonl"

AGREES = 1e-6
"""Relative difference of numbers that are computed again on the same machine."""

Row = dict[str, Any]


def mean(values: ArrayLike) -> list[float]:
    """Mean over seeds with Student's 95 % interval."""
    found = np.asarray(values, dtype=float)
    middle = float(found.mean())
    half = float(student.ppf(0.975, len(found) - 1) * found.std(ddof=1) / np.sqrt(len(found)))
    return [middle, middle - half, middle + half]


def of_kind(rows: Sequence[Row], kind: str, **key: float) -> dict[int, Row]:
    """Rows of one kind by their seeds."""
    return {row["seed"]: row for row in rows if row["kind"] == kind and all(row[k] == v for k, v in key.items())}


def steps(rows: Sequence[Row]) -> list[Row]:
    """Change of friction by each velocity step, beside the control, in each bin of displacement."""
    control = of_kind(rows, "control")
    found = []
    for factor in FACTORS:
        stepped = of_kind(rows, "step", factor=factor)
        bins = EDGES.index(ENDS[factor])
        change = [np.subtract(stepped[seed]["mean"][:bins], control[seed]["mean"][:bins]) for seed in control]
        over_log = np.array(change) / np.log(factor)
        found.append(
            {
                "factor": factor,
                "change": [mean(each) for each in np.transpose(change)],
                "direct": mean(over_log[:, 0]),
                "last": mean(over_log[:, -1]),
            }
        )
    return found


def holds(rows: Sequence[Row]) -> list[Row]:
    """Peak after each hold over that of the control, friction at the end of the hold, and how much the layer sank."""
    control, before = of_kind(rows, "control"), of_kind(rows, "before")
    bins = EDGES.index(ENDS["hold"])
    found = []
    for hold in HOLDS:
        held = of_kind(rows, "hold", hold=hold)
        peak = [max(held[seed]["largest"][:bins]) - max(control[seed]["largest"][:bins]) for seed in control]
        relaxed = [held[seed]["held"] - before[seed]["friction"] for seed in control]
        sunk = [held[seed]["compaction"] for seed in control]
        found.append({"hold": hold, "peak": peak, "relaxed": relaxed, "sunk": sunk})
    return found


def by_decade(values: Sequence[Sequence[float]]) -> list[float]:
    """Slope over the decimal logarithm of the hold time, of each seed by itself; mean over seeds with its interval."""
    return mean(np.polyfit(np.log10(HOLDS), np.array(values), 1)[0])


def weak_dashpots(rows: Sequence[Row]) -> list[float]:
    """Change of friction in the first bin after the largest step, beside the control, with weaker dashpots in both."""
    control, stepped = of_kind(rows, "weak control"), of_kind(rows, "weak step")
    return mean([stepped[seed]["mean"][0] - control[seed]["mean"][0] for seed in control])


def numbers(rows: Sequence[Row], weak: Sequence[Row]) -> Row:
    """All numbers of the page."""
    held, stepped = holds(rows), steps(rows)
    names = ("peak", "relaxed", "sunk")
    before = of_kind(rows, "before")
    return {
        "seeds": sorted(before),
        "friction": mean([row["friction"] for row in before.values()]),
        "bins": [f"{low:g} to {high:g}" for low, high in pairwise(EDGES)],
        "steps": stepped,
        "holds": [{"hold": each["hold"]} | {name: mean(each[name]) for name in names} for each in held],
        "slope": {name: by_decade([each[name] for each in held]) for name in names},
        "weak": weak_dashpots(weak),
        "weaker": WEAKER,
        "velocity": VELOCITY,
        "reslide": ENDS["hold"],
        "last": LAST,
    }


def write_page(folder: Path = HERE) -> Path:
    """Write README.md of a folder from its table."""
    found = numbers(*(read_rows(folder / "tables" / name) for name in (TABLE, WEAK)))
    (folder / "README.md").write_text(render("research.protocols", "README.md.j2", **found, interval=interval))
    return folder / "README.md"


def check() -> list[str]:
    """Rows of the first seed computed again that differ from the table."""
    known = [row for row in read_rows(HERE / "tables" / TABLE) if row["seed"] == 1]
    names = ("mean", "largest", "held", "compaction", "friction")
    return [
        f"{old['kind']}: {each}"
        for old, new in zip(known, rows_of(1), strict=True)
        for each in differing(old, new, names, AGREES)
    ]


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute", seeds]:
            for table, rows in ((TABLE, rows_of), (WEAK, weak_rows_of)):
                add_seeds(HERE / "tables" / table, range(1, int(seeds) + 1), rows)
        case ["page"]:
            print(write_page())
        case ["check"]:
            print(check() or "the same")
        case _:
            sys.exit(__doc__)
