"""The numbers of the study from its tables, each with its interval and the number of packings."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from faultgouge.analysis import Floats
from faultgouge.studies.modes import QUANTITIES, medians_over_load
from faultgouge.studies.statistics import median, share
from research.modes.loss import GROWS, RESTITUTIONS
from research.modes.packing_rows import Table
from research.statistics import exponent

DRAWS = 2000
"""Resamples of the packings for the interval of an exponent."""

QUALITIES = (10, 30, 100, 300, 1000)
"""Quality factors of structural losses."""

LEVELS = (0.1, 0.3)
"""Shares of complex modes whose loads are compared between sizes."""

NOT_COMPARED = ("random", "loss", "runs", "quartz", "thick")
"""Sets of other tasks than "modes"."""

COMPARISONS = (0.03, 0.1, 0.2)
"""F_x/F_y at which kinds of packings, checks and switches of b are compared."""

LAYERS = ("thick 50", "quartz 10 MPa", "thick 200", "thick 400")
"""Packings of one width under one pressure."""


def numbers(tables: Mapping[str, Table]) -> dict[str, Any]:
    """All numbers of the page.

    Returns
    -------
    dict
        sizes : by number of disks, medians of each quantity over the loads, and the load of the last equilibrium;
        powers : exponents of N at a fixed force on each disk of the layer; pressure_powers : at a fixed pressure;
        thickness_powers : of `LAYERS`; random : shares of random matrices beside those of the packings; loss : what
        stops the pairs, by number of disks; structural : share of packings that grow, for each quality factor;
        quartz : as loss, of the shipped scenes; runs : growth with dashpots in LAMMPS beside the pencil's; sets :
        medians at `COMPARISONS` of every set; switches : the same with b of some contacts; histories : with total slips
        and with rescaled ones.
    """
    by_size, randoms, lossy, runs = (_of_sizes(tables, kind) for kind in ("force", "random", "loss", "runs"))
    pressed = dict(sorted((_of_sizes(tables, "pressure") | {n: by_size[n] for n in by_size if n == 100}).items()))
    layers = {table.disks: table for name, table in tables.items() if name in LAYERS}
    quartz = {name: table for name, table in tables.items() if name.startswith(("quartz", "thick"))}
    counted = {name: table for name, table in tables.items() if name.split()[0] not in NOT_COMPARED}
    return {
        "sizes": {disks: to_the_end(table) for disks, table in by_size.items()},
        "powers": powers(by_size),
        "pressure_powers": powers(pressed),
        "thickness_powers": growth_powers(dict(sorted(layers.items()))),
        "sets": {name: compare_kinds(counted[name]) for name in sorted(counted, key=_place)},
        "random": {disks: against_random(table, by_size) for disks, table in randoms.items()},
        "loss": {disks: losses(table) for disks, table in lossy.items()},
        "structural": {disks: structural(table) for disks, table in by_size.items()},
        "quartz": {name: losses(quartz[name]) for name in sorted(quartz, key=_place)},
        "runs": {disks: measured_runs(table) for disks, table in runs.items()},
        "switches": switches(by_size[100]) if 100 in by_size else {},
        "histories": histories(tables),
        "packings": sum(len(table.rows) for table in tables.values()),
        "cpu_hours": sum(row["cpu_seconds"] for table in tables.values() for row in table.rows) / 3600,
    }


def _of_sizes(tables: Mapping[str, Table], kind: str) -> dict[int, Table]:
    """The sets of a kind by number of disks, smallest first."""
    found = {table.disks: table for name, table in tables.items() if name.split()[0] == kind}
    return dict(sorted(found.items()))


def _place(name: str) -> tuple[str, int]:
    """Sets by name, and by the number in it."""
    return name.rstrip("0123456789"), int("".join(filter(str.isdecimal, name)) or 0)


def to_the_end(table: Table) -> dict[str, Any]:
    """The same, and F_x/F_y at the last equilibrium with the share just before it."""
    found = medians_over_load(table.rows, (*QUANTITIES, "omega"))
    ended = [row for row in table.rows if row["ends"] != "until"]
    found["ended"] = len(ended)
    found["end"] = median(ends(table))
    found["last_share"] = median([row["loads"][-1]["share"] for row in ended if row["loads"]])
    return found


def losses(table: Table) -> dict[str, Any]:
    """Critical losses, which stop the pairs, and the share of packings in which motion grows for each restitution."""
    found = medians_over_load(table.rows, ("critical_restitution", "least_q", "drag_rate", "growth_rate"))
    if all("slowest" in load for row in table.rows for load in row["loads"]):
        found |= {name: medians_over_load(table.rows, (name,))[name] for name in ("omega", "slowest")}
    grows = {}
    for each in RESTITUTIONS:
        grows[f"{each:g}"] = [
            share(sum(rate > GROWS for row in rows for e, rate, _ in row["damped"] if e == each), len(rows))
            for rows in map(table.borne, table.loads)
        ]
    returns = sum(
        any(later[1] > GROWS >= earlier[1] for earlier, later in pairwise(load["damped"]))
        for row in table.rows
        for load in row["loads"]
    )
    return found | {"grows": grows, "returns": returns}


def structural(table: Table) -> dict[str, Any]:
    """Share of packings in which a pair grows in spite of a structural loss, for each quality factor and load."""
    least = {load: table.at(load, "least_q") for load in table.loads}
    return {f"{q}": [share(int(np.sum(each < q)), len(each)) for each in least.values()] for q in QUALITIES}


def measured_runs(table: Table) -> list[dict[str, Any]]:
    """The runs of a set, with seed, load and contacts at the bound."""
    return [
        {"seed": row["seed"], "fx_over_fy": load["fx_over_fy"], "sliding": load["sliding"]} | run
        for row in table.rows
        for load in row["loads"]
        for run in load["runs"]
    ]


def ends(table: Table) -> Floats:
    """F_x/F_y of the last equilibrium of each packing; inf of those that were not taken to their end."""
    fy = [load["fx"] / load["fx_over_fy"] for row in table.rows for load in row["loads"][:1]]
    return np.array([row["reach"] / fy[0] if row["ends"] != "until" else np.inf for row in table.rows])


def load_of_crossing(row: Mapping[str, Any], level: float) -> float:
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
        samples = {n: np.array([load_of_crossing(row, level) for row in table.rows]) for n, table in by_size.items()}
        samples = {n: each[np.isfinite(each)] for n, each in samples.items()}
        known = {n: each for n, each in samples.items() if len(each) >= max(2, len(by_size[n].rows) // 2)}
        medians = {n: median(each) for n, each in known.items()}
        found[f"load of share {level:g}"] = {"by_size": medians, "power": _power(known)}
    return found | growth_powers(by_size)


def _power(samples: Mapping[int, Floats]) -> list[float] | None:
    """Exponent p of medians that go as N^p, with its interval; None of a single size."""
    if len(samples) < 2:
        return None
    return [*exponent(list(samples), list(samples.values()), lambda each: np.log(np.median(each)), DRAWS).values()]


def growth_powers(by_size: Mapping[int, Table]) -> dict[str, Any]:
    """How growth rates and least Q go with the number of disks."""
    found: dict[str, Any] = {}
    for load in COMPARISONS:
        for name in ("growth_rate", "least_q"):
            samples = {n: table.at(load, name) for n, table in by_size.items()}
            # a median needs more than half of the packings, and a pair in more than half of these
            known = {
                n: np.where(np.isfinite(each), each, 1e9)
                for n, each in samples.items()
                if 2 * len(each) > len(by_size[n].rows) and np.median(each) not in (0.0, np.inf)
            }
            medians = {n: median(samples[n]) for n in known}
            found[f"{name} at {load:g}"] = {"by_size": medians, "power": _power(known)}
    return found


def compare_kinds(table: Table) -> dict[str, Any]:
    """Medians with intervals at a few loads."""
    found: dict[str, Any] = {"packings": len(table.rows), "end": median(ends(table)) if table.rows else None}
    for load in COMPARISONS:
        found[f"{load:g}"] = {name: median(table.at(load, name)) for name in QUANTITIES}
        found[f"{load:g}"]["count"] = len(table.at(load, "share"))
    return found


def switches(table: Table) -> dict[str, Any]:
    """Share of complex modes, least Q and share of packings with a pair, with b of some contacts alone."""
    found: dict[str, Any] = {}
    for load in table.loads:
        rows = table.borne(load)
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


HISTORIES = {"total": "force 100", "rescaled": "rescaled history"}
"""The set of each history of the slip."""


def _of_seeds(table: Table, seeds: Collection[int]) -> Table:
    """The packings of these seeds."""
    return Table(table.name, tuple(row for row in table.rows if row["seed"] in seeds))


def histories(tables: Mapping[str, Table]) -> dict[str, Any]:
    """Packings of the same seeds with total and with rescaled slips, at each load; nothing where a set is missing."""
    if not all(name in tables for name in HISTORIES.values()):
        return {}
    seeds = set.intersection(*({row["seed"] for row in tables[name].rows} for name in HISTORIES.values()))
    matched = {law: _of_seeds(tables[name], seeds) for law, name in HISTORIES.items()}
    return {
        law: medians_over_load(table.rows, ("share", "least_q"))
        | {"with_pairs": [int(np.sum(table.at(load, "pairs") > 0)) for load in table.loads]}
        for law, table in matched.items()
    }


def against_random(table: Table, by_size: Mapping[int, Table]) -> dict[str, Any]:
    """Shares of complex modes: measured, of random matrices, and by the formula, of the same packings at each load."""
    own = _of_seeds(by_size[table.disks], {row["seed"] for row in table.rows})
    return {
        "packings": len(table.rows),
        "loads": table.loads,
        "measured": [median(own.at(load, "share")) for load in table.loads],
        "random": [median(table.at(load, "share")) for load in table.loads],
        "formula": [median(table.at(load, "weak")) for load in table.loads],
        "coupling": [median(table.at(load, "coupling")) for load in table.loads],
    }
