"""The page on layers that are left to themselves, from its tables: which rest, with which history of the slip."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scipy.stats import binomtest

from ...figures.pages import render
from ..modes.tables import median
from ..statistics import interval, share
from .compute import LOSSES, SHARES
from .page import FLOWING, of_runs, percent, read_rows

Row = dict[str, Any]

LASTS = 0.5
"""Share of its early kinetic energy from which on a layer vibrates without slowing down; the others lose 57 % and more
in the same time."""


def write_lasting(folder: Path) -> Path:
    """further.md of a folder with tables/lasting.jsonl, quartz_100.jsonl and quartz_400.jsonl."""
    tables = folder / "tables"
    rows, large = (read_rows(tables / f"{name}.jsonl") for name in ("lasting", "quartz_400"))
    lossy = [row for row in rows if row["restitution"] < 1]
    page = render(
        __package__,
        "further.md.j2",
        percent=percent,
        lossy=lossy,
        **_lasting(lossy),
        free=_without_loss(rows, tables / "quartz_100.jsonl"),
        large=[of_runs(large, load, loss) for load in SHARES for loss in LOSSES],
        large_flow=[_flowing(large, loss) for loss in LOSSES],
        large_static=interval(median([row["static"] for row in large])),
    )
    (folder / "further.md").write_text(page)
    return folder / "further.md"


def lasts(row: Row) -> bool:
    """Whether a layer vibrates without slowing down."""
    return bool(row["late"] > LASTS * row["early"])


def _lasting(lossy: list[Row]) -> Row:
    """Who vibrates with either history, and the test of signs of the packings in which the histories differ."""
    most = {
        history: {row["seed"]: lasts(row) for row in lossy if (row["history"], row["restitution"]) == (history, 0.9)}
        for history in ("total", "rescaled")
    }
    differ = [total for seed, total in most["total"].items() if total != most["rescaled"][seed]]
    vibrating = [row for row in lossy if lasts(row)]
    return {
        **{history: share(sum(found.values()), len(found)) for history, found in most.items()},
        "chance": binomtest(sum(differ), len(differ)).pvalue,
        "seeds": sorted({row["seed"] for row in vibrating}),
        "energies": sorted(row["late"] for row in vibrating),
        "moves": max(row["moves"] for row in vibrating),
        "quiet": max(row["late"] for row in lossy if row["history"] == "rescaled"),
        "slowest": max((row for row in lossy if not lasts(row)), key=lambda row: row["late"] / row["early"]),
    }


def _without_loss(rows: list[Row], table: Path) -> Row:
    """Runs without loss, those with total slips and with rescaled ones from the same states, and how many flow."""
    total = {
        (row["values"]["packing.seed"], run["share"]): run
        for row in read_rows(table)
        if row["result"]
        for run in row["result"]["dynamic"]
        if run["restitution"] == 1
    }
    runs = [row | {"total": total[row["seed"], row["share"]]} for row in rows if row["restitution"] == 1]
    flow = {}
    for load in (0.97, 0.9):
        here = [row for row in runs if row["share"] == load]
        flow[load] = [
            share(sum(each["ends"] in FLOWING for each in ends), len(ends))
            for ends in ([row["total"] for row in here], here)
        ]
    return {"runs": runs, "flow": flow}


def _flowing(large: list[Row], restitution: float) -> Row:
    """Packings that flow at a load below their static yield."""
    flow = [any(run["ends"] in FLOWING for run in row["dynamic"] if run["restitution"] == restitution) for row in large]
    return share(sum(flow), len(flow))
