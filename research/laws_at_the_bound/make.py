"""The tables of the study computed, and its page made from them.

python -m research.laws_at_the_bound.make compute FOLDER    what the tables lack, on one core, resumable
python -m research.laws_at_the_bound.make page              README.md from the tables
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.analysis.files.atomic_write import write_text
from faultgouge.figures.pages import render
from faultgouge.studies.statistics import interval, median, share
from faultgouge.studies.sweep.run_sweep import run_sweep
from research.laws_at_the_bound.compute import RESTITUTIONS
from research.laws_at_the_bound.sets import LOADS, sets

HERE = Path(__file__).parent
TABLES = HERE / "tables"

GROWS = 1e-5
"""Re s from which a motion grows, 1 / time, as in docs/modes."""


def compute(folder: Path) -> None:
    """Compute what a folder lacks, and write tables/SET.jsonl, a line a packing."""
    for name, sweep in sets().items():
        found = run_sweep(sweep, folder / _file(name), workers=1)
        write_text(TABLES / f"{_file(name)}.jsonl", "".join(json.dumps(_line(row)) + "\n" for row in found))


def _file(name: str) -> str:
    return name.replace(" = ", "_").replace(" ", "_")


def _line(row: dict[str, Any]) -> dict[str, Any]:
    plain = {"seed": row["values"]["packing.seed"], "says": row["says"], "cpu_seconds": row["cpu_seconds"]}
    return plain | _shorten(row["result"] or {})


def _shorten(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.7g}")
    if isinstance(value, list):
        return [_shorten(each) for each in value]
    return {name: _shorten(each) for name, each in value.items()} if isinstance(value, dict) else value


def write_page(folder: Path = HERE) -> Path:
    """Write README.md of a folder from the tables."""
    paths = {name: TABLES / f"{_file(name)}.jsonl" for name in sets()}
    there = {name: read_table(path) for name, path in paths.items() if path.exists()}
    shown = {name: {load: at_load(rows, load) for load in LOADS} for name, rows in there.items()}
    missing = [name for name in paths if name not in there]
    loads = [each for rows in there.values() for row in rows for each in row.get("loads", [])]
    rates = np.array([[rate[1] for rate in each["standard"]["shaken"]["damped"]] for each in loads])
    largest = dict(zip(RESTITUTIONS, rates.max(axis=0).tolist(), strict=True))
    names = {"sets": shown, "missing": missing, "largest": largest}
    write_text(folder / "README.md", render("research.laws_at_the_bound", "README.md.j2", **names))
    return folder / "README.md"


def read_table(path: Path) -> list[dict[str, Any]]:
    """The rows of a table."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def at_load(rows: list[dict[str, Any]], load: float) -> dict[str, Any]:
    """What the page says of a load."""
    found = [each for row in rows for each in row.get("loads", []) if each["fx_over_fy"] == load]
    laws = [[each["smooth"] for each in found], [each["standard"]["shaken"] for each in found]]
    lines = [
        ["complex pairs at all", *(_count([each["pairs"] > 0 for each in law]) for law in laws)],
        ["share of complex modes, median", *(_median([each["share"] for each in law]) for law in laws)],
        ["growth rate without loss, median", *(_median([each["growth_rate"] for each in law]) for law in laws)],
        ["least Q, median", *(_median([each["least_q"] or float("inf") for each in law]) for law in laws)],
        ["drag 1/tau that stops all, median", *(_median([each["drag_rate"] for each in law]) for law in laws)],
    ]
    for place, restitution in enumerate(RESTITUTIONS):
        grows = ([each["damped"][place][1] > GROWS for each in law] for law in laws)
        lines.append([f"motion grows with the restitution {restitution:g}", *map(_count, grows)])
    others = {
        name: _median([each["standard"][name]["growth_rate"] for each in found])
        for name in ("closing", "parting", "slides_on")
    }
    at_bound = _median([each["at_bound"] for each in found])
    return {"packings": len(found), "of": len(rows), "rows": lines, "at_bound": at_bound} | others


def _count(found: list[bool]) -> str:
    part = share(sum(found), len(found))
    return f"{part['count']} of {part['of']} ({100 * part['low']:.0f} to {100 * part['high']:.0f} %)"


def _median(values: list[float]) -> str:
    return interval(median(values), ".3g", "no bound")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute", folder]:
            compute(Path(folder))
        case ["page"]:
            print(write_page())
        case _:
            sys.exit(__doc__)
