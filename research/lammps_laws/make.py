"""The tables of the page on LAMMPS's laws computed, the page made from them, or a packing in ten computed again.

python -m research.lammps_laws.make compute [COUNT SEEDS]    what the table lacks, on one core; 25 minutes
python -m research.lammps_laws.make page                     README.md from the tables
python -m research.lammps_laws.make check                    the first packing of each law once more, compared

From the folder of the repository.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from faultgouge.analysis.files.atomic_write import write_text
from faultgouge.figures.pages import render
from faultgouge.studies.statistics import median, share
from research.lammps_laws.compute import LAWS, TILTS, compute, read

HERE = Path(__file__).parent
TABLE = HERE / "tables" / "packings.jsonl"


def cell(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """What some packings say of one law at one tilt, with intervals that hold 95 %."""
    good = [row for row in rows if row["rests"]]
    least = [row["least_q"] for row in good if row["least_q"] is not None]
    return {
        "packings": len(good),
        "restless": len(rows) - len(good),
        "with_pairs": share(sum(row["pairs"] > 0 for row in good), len(good)),
        "share": median([row["share"] for row in good]) if good else None,
        "growth": median([row["growth_rate"] for row in good]) if good else None,
        "least_q": median(least) if len(least) > 1 else None,
        "bound": sum(row["at_bound"] > 0 for row in good),
        "negative": sum(row["negative"] > 0 for row in good),
    }


def numbers(table: Path = TABLE) -> dict[str, Any]:
    """All numbers of the page."""
    rows = read(table)
    cells = [
        {"law": law, "d": d, "tilt": tilt}
        | cell([row for row in rows if (row["law"], row["d"], row["tilt"]) == (law, d, tilt)])
        for d in (2, 3)
        for law in LAWS
        for tilt in TILTS
    ]
    by_law = []
    for d in (2, 3):
        for law in LAWS:
            own = [row for row in rows if (row["law"], row["d"]) == (law, d)]
            moved = [row["motion"] for row in own if "motion" in row]
            asked = [row["damping"] for row in own if row.get("growth_rate") and row.get("damping")]
            by_law.append(
                {
                    "law": law,
                    "d": d,
                    "compared": len(moved),
                    "motion": float(np.median(moved)) if moved else None,
                    "asked": len(asked),
                    "restitution": min((each["restitution"] for each in asked), default=None),
                }
            )
    return {
        "cells": cells,
        "laws": by_law,
        "seeds": max(row["seed"] for row in rows),
        "rows": len(rows),
        "restless": sum(not row["rests"] for row in rows),
        "wall": wall_alone(),
    }


def wall_alone() -> dict[str, Any]:
    """The deck of the page: two spheres on the wall of hooke/history, in LAMMPS, and with a stiffness that stays."""
    from mpi4py import MPI

    from faultgouge.analysis import spectrum
    from faultgouge.pywrap import from_lammps
    from faultgouge.pywrap.lammps.instance import lammps_instance

    with TemporaryDirectory() as folder:
        lmp = lammps_instance(MPI.COMM_SELF, Path(folder) / "log")
        deck = (HERE / "wall.in").read_text()
        for line in deck.splitlines():
            lmp.command(line)
        found = from_lammps(lmp)
        lmp.close()
    c, s = found.contacts, spectrum(found)
    b = np.linalg.norm(c.closing, axis=1)[c.wall] / np.linalg.norm(c.tangential_force, axis=1)[c.wall]
    return {
        "deck": deck.strip(),
        "power": float(np.mean(b * c.overlap[c.wall])),
        "pairs": len(s.pairs),
        "least_q": s.least_q if s.pairs else None,
        "growth": s.growth_rate(),
    }


def ranged(value: list[float] | None, digits: str = ".2g") -> str:
    """A median with its interval."""
    return "-" if value is None else "{} ({} to {})".format(*(format(each, digits) for each in value))


def write_page(folder: Path = HERE, table: Path = TABLE) -> Path:
    """Write README.md of a folder from a table."""
    text = render("research.lammps_laws", "README.md.j2", **numbers(table), ranged=ranged)
    write_text(folder / "README.md", text)
    return folder / "README.md"


def check() -> list[str]:
    """Cells of the first seed computed again that differ from the table by more than 1e-6."""
    with TemporaryDirectory() as folder:
        again = Path(folder) / "again.jsonl"
        compute(again, 50, range(1, 2))
        known = {(row["law"], row["d"], row["tilt"]): row for row in read(TABLE) if row["seed"] == 1}
        new = read(again)
    return [
        f"{row['law']}, d = {row['d']}, tilt {row['tilt']}"
        for row in new
        if not np.isclose(row["growth_rate"], known[row["law"], row["d"], row["tilt"]]["growth_rate"], rtol=1e-6)
    ]


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute", *given]:
            count, seeds = map(int, given or (50, 20))
            TABLE.parent.mkdir(exist_ok=True)
            compute(TABLE, count, range(1, seeds + 1))
        case ["page"]:
            print(write_page())
        case ["check"]:
            print(check() or "the same")
        case _:
            sys.exit(__doc__)
