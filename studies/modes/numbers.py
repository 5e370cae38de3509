"""The numbers of the study from its tables, each with its interval and the number of packings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...analysis.packing.packing import Floats
from .tables import Table, median, power

QUANTITIES = ("share", "growth_rate", "least_q")

LEVELS = (0.1, 0.3)
"""Shares of complex modes whose loads are compared between sizes."""

COMPARED = (0.03, 0.1, 0.2)
"""F_x/F_y at which kinds of packings, checks and switches of b are compared."""


def numbers(tables: Mapping[str, Table]) -> dict[str, Any]:
    """All numbers of the page.

    Returns
    -------
    dict
        sizes : by number of disks, medians of each quantity over the loads, and the load of the last equilibrium;
        powers : exponents of N; random : shares of random matrices beside those of the packings; sets : medians at
        `COMPARED` of every set; switches : the same with b of some contacts.
    """
    by_size = {table.disks: table for name, table in sorted(tables.items()) if name.startswith("force ")}
    by_size = dict(sorted(by_size.items()))
    randoms = sorted((each for name, each in tables.items() if name.startswith("random ")), key=lambda each: each.disks)
    return {
        "sizes": {disks: along(table) for disks, table in by_size.items()},
        "powers": powers(by_size),
        "sets": {name: compared(table) for name, table in tables.items()},
        "random": {table.disks: against_random(table, by_size) for table in randoms},
        "switches": switches(by_size[100]) if 100 in by_size else {},
        "packings": sum(len(table.rows) for table in tables.values()),
        "cpu_hours": sum(row["cpu_seconds"] for table in tables.values() for row in table.rows) / 3600,
    }


def along(table: Table) -> dict[str, Any]:
    """Medians with intervals at each load, and of F_x/F_y at the last equilibrium."""
    found: dict[str, Any] = {"packings": len(table.rows), "loads": table.loads}
    found["count"] = [len(table.at(load, "share")) for load in table.loads]
    for name in QUANTITIES:
        found[name] = [median(table.at(load, name)) for load in table.loads]
    ended = [row for row in table.rows if row["ends"] != "until"]
    found["ended"] = len(ended)
    found["end"] = median(ends(table))
    found["last_share"] = median([row["loads"][-1]["share"] for row in ended if row["loads"]])
    return found


def ends(table: Table) -> Floats:
    """F_x/F_y of the last equilibrium of each packing; inf of those that were not taken to their end."""
    fy = [load["fx"] / load["fx_over_fy"] for row in table.rows for load in row["loads"][:1]]
    return np.array([row["reach"] / fy[0] if row["ends"] != "until" else np.inf for row in table.rows])


def crossing(row: Mapping[str, Any], level: float) -> float:
    """F_x/F_y at which the share of complex modes of a packing first exceeds a level; nan if it does not.

    Interpolated over the logarithm of the load.
    """
    before = None
    for load in row["loads"]:
        if load["share"] >= level:
            if before is None:
                return float(load["fx_over_fy"])
            part = (level - before["share"]) / (load["share"] - before["share"])
            return float(before["fx_over_fy"] ** (1 - part) * load["fx_over_fy"] ** part)
        before = load
    return float("nan")


def powers(by_size: Mapping[int, Table]) -> dict[str, Any]:
    """How loads of a share, growth rates and least Q go with the number of disks."""
    found: dict[str, Any] = {}
    for level in LEVELS:
        samples = {n: np.array([crossing(row, level) for row in table.rows]) for n, table in by_size.items()}
        samples = {n: each[np.isfinite(each)] for n, each in samples.items()}
        known = {n: each for n, each in samples.items() if len(each) >= max(2, len(by_size[n].rows) // 2)}
        found[f"load of share {level:g}"] = {
            "by_size": {n: median(each) for n, each in known.items()},
            "power": power(known, list(known.values())) if len(known) > 1 else None,
        }
    for load in COMPARED:
        for name in ("growth_rate", "least_q"):
            samples = {n: table.at(load, name) for n, table in by_size.items()}
            # a median needs more than half of the packings, and a pair in more than half of these
            known = {
                n: np.where(np.isfinite(each), each, 1e9)
                for n, each in samples.items()
                if 2 * len(each) > len(by_size[n].rows) and np.median(each) not in (0.0, np.inf)
            }
            found[f"{name} at {load:g}"] = {
                "by_size": {n: median(samples[n]) for n in known},
                "power": power(known, list(known.values())) if len(known) > 1 else None,
            }
    return found


def compared(table: Table) -> dict[str, Any]:
    """Medians with intervals at a few loads."""
    found: dict[str, Any] = {"packings": len(table.rows), "end": median(ends(table)) if table.rows else None}
    for load in COMPARED:
        found[f"{load:g}"] = {name: median(table.at(load, name)) for name in QUANTITIES}
        found[f"{load:g}"]["count"] = len(table.at(load, "share"))
    return found


def switches(table: Table) -> dict[str, Any]:
    """Share of complex modes, least Q and share of packings with a pair, with b of some contacts alone."""
    found: dict[str, Any] = {}
    for load in table.loads:
        rows = [each for row in table.rows for each in row["loads"] if each["fx_over_fy"] == load]
        found[f"{load:g}"] = {
            name: {
                "share": median([each["share"] for each in parts]),
                "least_q": median([np.inf if each["least_q"] is None else each["least_q"] for each in parts]),
                "with_pairs": sum(each["pairs"] > 0 for each in parts),
                "of": len(parts),
            }
            for name, parts in (
                ("all", rows),
                *((name, [row["b_of"][name] for row in rows]) for name in ("sticking", "sliding", "none")),
            )
        }
    return found


def against_random(table: Table, by_size: Mapping[int, Table]) -> dict[str, Any]:
    """Shares of complex modes: measured, of random matrices, and by the formula, of the same packings at each load."""
    seeds = {row["seed"] for row in table.rows}
    own = Table(table.name, tuple(row for row in by_size[table.disks].rows if row["seed"] in seeds))
    return {
        "packings": len(table.rows),
        "loads": table.loads,
        "measured": [median(own.at(load, "share")) for load in table.loads],
        "random": [median(table.at(load, "share")) for load in table.loads],
        "formula": [median(table.at(load, "weak")) for load in table.loads],
        "coupling": [median(table.at(load, "coupling")) for load in table.loads],
    }
