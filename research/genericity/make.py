"""The tables of the study computed, its page made from them, or a tenth of them computed again.

python -m research.genericity.make compute [SHARE]    what the tables lack, on all cores, resumable; an hour or two
python -m research.genericity.make page               README.md, genericity.json and the pictures, from the tables
python -m research.genericity.make check FOLDER       one packing in ten once more, compared with the tables

From the folder of the repository. SHARE is that of the packings of each set.
"""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.figures import render
from faultgouge.studies.sweep import read_results, run_sweep
from research.genericity.draw import mechanism_figure, modes_figure, onsets_figure, size_figure
from research.genericity.numbers import LOADS, numbers, read_tables
from research.genericity.sets import PACKINGS, SHARES, SIZES, sets
from research.genericity.table import Table
from research.pictures import draw_all
from research.statistics import interval
from research.tables import SWEEP_ROWS, write_json

HERE = Path(__file__).parent
TABLES = HERE / "tables"


def compute(folder: Path, share: float = 1.0) -> None:
    """Compute what a folder lacks of all sets, round by round, each in a folder of its own."""
    for part in [*(each for each in SHARES if each < share), share]:
        for name, sweep in sets(part).items():
            print(f"{name}: {100 * part:.3g} % of the packings", flush=True)
            run_sweep(sweep, folder / name.replace(" ", "_"), workers=None)
    record_cost(folder)


def record_cost(folder: Path) -> None:
    """made.json: with which version and at which commits the tables were made, and what they cost."""
    rows = [row for path in folder.glob(f"*/{SWEEP_ROWS}") for row in read_results(path).values()]
    path = folder / "made.json"
    before = json.loads(path.read_text()) if path.exists() else {}
    if len(rows) == before.get("rows"):
        return
    describe = ["git", "-C", str(HERE), "describe", "--always", "--dirty"]
    commit = subprocess.run(describe, capture_output=True, text=True, timeout=20, check=True).stdout.strip()
    made = {
        "version": version("faultgouge"),
        "commits": list(dict.fromkeys([*before.get("commits", []), commit])),
        "rows": len(rows),
        "cpu_seconds": round(sum(row["cpu_seconds"] for row in rows)),
    }
    write_json(path, made)


def write_page(folder: Path = HERE, tables: Path = TABLES) -> Path:
    """Write README.md, genericity.json and the pictures of a folder from tables, SET/results.csv."""
    sets_of = read_tables(tables)
    found = numbers(sets_of)
    onsets, levels = sets_of.get("onsets", Table()), found["levels"]
    predicted = 3.0 * np.array(levels["f0"])[np.array(levels["disks"]) == 100]
    figures = {
        "onsets": lambda: onsets_figure(onsets, predicted),
        "modes": lambda: modes_figure(onsets),
        "size": lambda: size_figure(found),
        "mechanism": lambda: mechanism_figure(found["surrogates"]),
    }
    names = {
        "loads": LOADS,
        "made": json.loads((tables / "made.json").read_text()),
        "planned": PACKINGS,
        "planned_sizes": SIZES,
        "predicted_share": [float(np.mean(1 - np.exp(-((load / predicted) ** 2)))) for load in LOADS],
    }
    formats = {"percent": percent, "median": median, "between": format_interval, "mean": mean}
    write_json(folder / "genericity.json", found)
    (folder / "pictures").mkdir(exist_ok=True)
    draw_all(figures, folder / "pictures")
    (folder / "README.md").write_text(render("research.genericity", "README.md.j2", **found, **names, **formats))
    return folder / "README.md"


def check(folder: Path) -> None:
    """A tenth of the packings of each set once more: how many rows there are, and which differ from the tables.

    Of packings that settle as they did: another build of libraries may settle a seed to another packing.
    """
    known = read_tables(TABLES)
    for name, sweep in sets(0.1).items():
        rows = run_sweep(sweep, folder / name.replace(" ", "_"), workers=None)
        print(name, compare(rows, known[name]), flush=True)


def compare(rows: list[dict[str, Any]], table: Table) -> dict[str, int]:
    """Rows of a sweep against those of a table: how many settled alike, and how many of these are the same."""
    before = {tuple(str(row[name]) for name in rows[0]["values"]): row for row in table.rows}
    pairs = [(row["result"], before[tuple(map(str, row["values"].values()))]) for row in rows]
    alike = [pair for pair in pairs if all(pair[0].get(name) == pair[1].get(name) for name in ("contacts", "rattlers"))]
    same = [pair for pair in alike if all(_same(name, value, pair[1].get(name)) for name, value in pair[0].items())]
    return {"rows": len(rows), "settled alike": len(alike), "the same": len(same)}


LOOSE = {"layer": 1e-3, "participation": 1e-3, "rotation": 1e-3}
"""Relative differences of what is said of the mode at the onset. Two modes merge there, and the merged mode is known to
the size of the overlap y^H x at the load where rounding ends the search, some 1e-4."""

APART = ("error", "error_of_path", "overlap")
"""What is not compared. The overlap is that rounding, and the error of these tables lacks the part of the path."""


def _same(name: str, one: Any, other: Any) -> bool:
    if name in APART:
        return True
    if isinstance(one, int | float) and isinstance(other, int | float):
        return bool(np.isclose(one, other, rtol=LOOSE.get(name, 1e-6), atol=0))
    return one is None or isinstance(one, list | dict) or one == other


def percent(found: dict[str, Any]) -> str:
    """A share with its interval: "62 % (55 to 69 %; 124 of 200)"."""
    if not found["of"]:
        return "none yet"
    low, high = 100 * found["low"], 100 * found["high"]
    return f"{100 * found['share']:.0f} % ({low:.0f} to {high:.0f} %; {found['count']} of {found['of']})"


def median(value: list[float | None], digits: str = ".3g") -> str:
    """A median with its interval."""
    return interval(value, digits, "beyond reach")


def format_interval(value: dict[str, float] | None) -> str:
    """A fitted number with its interval."""
    return "not known" if value is None else interval([*value.values()], ".2f")


def mean(value: dict[str, float | None]) -> str:
    """A mean with half of its interval."""
    error = "" if value["error"] is None else f" ± {value['error']:.1g}"
    return f"{value['value']:.3g}{error}"


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute", *share]:
            compute(TABLES, *map(float, share))
        case ["page"]:
            print(write_page())
        case ["check", folder]:
            check(Path(folder))
        case _:
            sys.exit(__doc__)
