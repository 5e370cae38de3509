"""Packings with contacts at the bound as they are, under a load that is held and one that rises: tables and page.

python -m research.rising.make layers    what the table of layers lacks, on one core, resumable; an hour
python -m research.rising.make poured    what the table of poured spheres lacks; ten minutes
python -m research.rising.make page      README.md from the tables
python -m research.rising.make check     the first seed of the layers once more, compared

From the folder of the repository.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.analysis.files.atomic_write import write_text
from faultgouge.figures.pages import render
from faultgouge.studies.statistics import share
from research.rising.compute import (
    COMPARED,
    HISTORIES,
    LOADS,
    POURED_LAWS,
    POURED_SEEDS,
    RATES,
    RESTITUTIONS,
    SEEDS,
    SLOPES,
    STIFFNESSES,
    compute_poured,
    layers,
    read,
)
from research.tables import add_seeds

HERE = Path(__file__).parent
LAYERS, POURED = (HERE / "tables" / f"{name}.jsonl" for name in ("layers", "poured"))

VIBRATES = 0.05
"""Vibration over drift of a layer that is said to vibrate; what a start leaves is a hundredth at the most."""

NEAR = 1.25
"""Ratio of two vibrations that are said to be the same: both are measured over two windows of an uneven motion."""

GROWS = 1e-4
"""Growth rate of D, 1 / time, from which linear motion is said to grow: fifty times the rounding of eigenvalues."""

AGREES = 1e-3
"""Relative difference of rates that are computed again: those of motions repeat to the last digits on one machine."""

Row = dict[str, Any]


def outcomes(rows: list[Row]) -> dict[str, Any]:
    """How many packings do what, with contacts at the bound stuck, sliding on, and as they are."""
    found: dict[str, Any] = {
        "packings": len(rows),
        "bound": sum(row["at_bound"] > 0 for row in rows),
        "sticking": share(sum(row["sticking"] > GROWS for row in rows), len(rows)),
        "sliding": share(sum(row["sliding"] > GROWS for row in rows), len(rows)),
    }
    for name, stable in (("rests", True), ("grows", False), ("unknown", None)):
        found[name] = share(sum(row["stable"] is stable for row in rows), len(rows))
    sizes = [row["one_sided"]["amplification"] for row in rows if row["one_sided"] and row["stable"]]
    found["amplification"] = [float(np.median(sizes)), max(sizes)] if sizes else None
    return found


def under_the_load(rows: list[Row]) -> dict[str, Any]:
    """How many layers vibrate under a load that rises, and how much."""
    known = [row["rising"] for row in rows if row["rising"]]
    ratio = [each["vibration"] / each["drift"] for each in known]
    steady = [r for r, each in zip(ratio, known, strict=True) if each["steady"] and r > VIBRATES]
    return {
        "asked": len(known),
        "vibrate": share(len(steady), len(known)),
        "follow": share(
            sum(each["steady"] and r <= VIBRATES for r, each in zip(ratio, known, strict=True)), len(known)
        ),
        "open": sum(not each["steady"] for each in known),
        "ratio": [float(np.median(steady)), min(steady), max(steady)] if steady else None,
    }


def beside_lammps(rows: list[Row]) -> dict[str, Any]:
    """Each layer that LAMMPS integrates, and the differences at the smallest rate."""
    slow = str(min(RATES))
    shown = [row | {"ratio": row["rising"]["vibration"] / row["rising"]["drift"]} for row in rows if "lammps" in row]
    both = [row for row in shown if row["rising"]["steady"] and row["ratio"] > VIBRATES]
    vibrates = [row["lammps"][slow]["vibration"] > VIBRATES * row["lammps"][slow]["drift"] for row in shown]
    near = [row["lammps"][slow]["vibration"] / row["rising"]["vibration"] for row in both]
    apart = [(row["seed"], ratio) for row, ratio in zip(both, near, strict=True) if not 1 / NEAR < ratio < NEAR]
    return {
        "rows": shown,
        "compared": len(shown),
        "vibrate": sum(vibrates),
        "control": sum(row["control"]["vibration"] > VIBRATES * row["control"]["drift"] for row in shown),
        "near": [float(np.median(near)), min(near), max(near)] if near else None,
        "both": len(both),
        "apart": apart,
    }


def numbers(tables: tuple[Path, Path] = (LAYERS, POURED)) -> dict[str, Any]:
    """All numbers of the page."""
    every, spheres = (read(table) for table in tables)
    rows = [row for row in every if "stable" in row]
    cells = []
    for load in LOADS:
        for law in HISTORIES:
            for restitution in RESTITUTIONS:
                key = (law, load, restitution)
                own = [row for row in rows if (row["law"], row["fx_over_fy"], row["restitution"]) == key]
                cells.append(dict(zip(("law", "load", "restitution"), key, strict=True)) | outcomes(own))
                if law == "coulomb":
                    cells[-1]["rising"] = under_the_load(own)
    poured = []
    for law in POURED_LAWS:
        for kn in STIFFNESSES:
            for slope in SLOPES:
                tried = [row for row in spheres if (row["law"], row["kn"], row["slope"]) == (law, kn, slope)]
                good = [row for row in tried if row["rests"]]
                cell: Row = {"law": law, "kn": kn, "slope": slope, "tried": len(tried)} | outcomes(good)
                cell["overlap"] = float(np.median([row["overlap"] for row in good])) if good else None
                cell["pairs"] = sum(row["pairs"] > 0 for row in good)
                poured.append(cell)
    return {
        "cells": cells,
        "usual": {cell["load"]: cell for cell in cells if (cell["law"], cell["restitution"]) == ("coulomb", 0.9)},
        "smoothed": {cell["load"]: cell for cell in cells if (cell["law"], cell["restitution"]) == ("total", 0.9)},
        "seeds": max((row["seed"] for row in every), default=0),
        "asked": SEEDS,
        "ended": [row for row in every if "stable" not in row],
        "lammps": beside_lammps(rows),
        "rates": RATES,
        "poured": poured,
        "poured_seeds": max((row["seed"] for row in spheres), default=0),
        "poured_rows": len(spheres),
        "poured_asked": POURED_SEEDS * len(POURED_LAWS) * len(STIFFNESSES) * len(SLOPES),
    }


def count(value: dict[str, Any]) -> str:
    """A count of so many."""
    return f"{value['count']} of {value['of']}"


def spread(value: list[float] | None, digits: str = ".2g") -> str:
    """A median with its range; or a median with the largest."""
    if value is None:
        return "-"
    middle, *ends = (format(each, digits) for each in value)
    return f"{middle} ({' to '.join(ends)})" if len(ends) > 1 else f"{middle} ({ends[0]})"


def write_page(folder: Path = HERE) -> Path:
    """Write README.md of a folder from the tables."""
    text = render("research.rising", "README.md.j2", **numbers(), count=count, spread=spread, at=COMPARED)
    write_text(folder / "README.md", text)
    return folder / "README.md"


def check() -> list[str]:
    """The rows of the first seed computed again that differ from the table."""
    names = ("law", "fx_over_fy", "restitution")
    known = {tuple(row[name] for name in names): row for row in read(LAYERS) if row["seed"] == 1 and "stable" in row}
    wrong = []
    for row in layers(1):
        key = tuple(row[name] for name in names)
        same = row["stable"] is known[key]["stable"] and np.isclose(
            row["sticking"], known[key]["sticking"], rtol=AGREES
        )
        if not same:
            wrong.append(f"{key}: {row['stable']}, {row['sticking']:.6g}; before {known[key]['stable']}")
    return wrong


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["layers"]:
            add_seeds(LAYERS, range(1, SEEDS + 1), layers)
        case ["poured"]:
            compute_poured(POURED)
        case ["page"]:
            print(write_page())
        case ["check"]:
            print(check() or "the same")
        case _:
            sys.exit(__doc__)
