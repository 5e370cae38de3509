"""LAMMPS's own granular decks: what comes of each, in a table, and the page made from the table.

python -m research.lammps_examples.make compute LAMMPS    what the table lacks, on one core, resumable; an hour
python -m research.lammps_examples.mode_growth LAMMPS     growth along a mode, over decades; a quarter of an hour
python -m research.lammps_examples.make page              README.md from the table

From the folder of the repository. LAMMPS is a folder with the `examples` and `bench` of LAMMPS's source.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.figures import render
from faultgouge.studies.result_rows import append_row
from research.lammps_examples.compute import DECKS, STEPS, compute
from research.lammps_examples.mode_growth import TABLE as GROWTH
from research.tables import known_rows

HERE = Path(__file__).parent
TABLE = HERE / "tables" / "decks.jsonl"


def add_rows(folder: Path) -> None:
    """Compute the rows that the table lacks."""
    known = {(row["deck"], row["change"]) for row in known_rows(TABLE)}
    for deck in DECKS:
        if (deck.file, deck.change) not in known:
            append_row(TABLE, row := compute(deck, folder))
            print(row, flush=True)


def in_order(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows in the order of the decks."""
    by_name = {(row["deck"], row["change"]): row for row in rows}
    names = [(deck.file, deck.change) for deck in DECKS]
    return [by_name[name] for name in names if name in by_name]


def page() -> str:
    """The page of the table."""
    rows = in_order(known_rows(TABLE))
    growth = [row for row in known_rows(GROWTH) if "2d" in row["deck"]]
    steps, rates = ([row[name] for row in growth] for name in ("time_step", "lammps"))
    numbers = {"growth": growth, "extrapolated": float(np.polyfit(steps, rates, 1)[1])}
    return render(
        "research.lammps_examples", "README.md.j2", rows=rows, lacks=len(DECKS) - len(rows), steps=STEPS, **numbers
    )


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute", folder]:
            add_rows(Path(folder))
        case ["page"]:
            (HERE / "README.md").write_text(page())
        case _:
            sys.exit(__doc__)
