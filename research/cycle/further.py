"""Numbers of the page on other springs, verdicts at rest, and clock advances, from their tables."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.figures import render
from faultgouge.studies.statistics import share
from research.cycle import clock
from research.cycle.clock import FREQUENCIES, HEIGHTS, PHASES
from research.cycle.compute import LAWS
from research.cycle.springs import SHARES, SPRINGS, row_of
from research.rising.loaded import VIBRATES
from research.statistics import count_of, interval, middle
from research.tables import differing, read_rows

HERE = Path(__file__).parent
SPRINGS_TABLE, CLOCK_TABLE = "springs.jsonl", "clock.jsonl"

STAYS = 0.1
"""Share of the length of a slip by which a layer that comes to rest may move and be said to stay."""

ROW = 0.1
"""Time between two rows of a series, which no clock advance is better than; rounded up."""

LONG = 0.05
"""Length of a slip from which it is called long."""

AGREES = 1e-6
"""Relative difference of numbers that are computed again on the same machine."""

FULL, HALF = 0.9, 0.5
"""Clock advance over the wait that was left when the pulse began: of a full one the slip comes with the pulse."""

Row = dict[str, Any]


def sizes(rows: Sequence[Row]) -> list[Row]:
    """Slips of each spring and law: how many, and medians of force drop, slip and time between two beginnings."""
    found = []
    for spring in SPRINGS:
        for law in LAWS:
            own = [row for row in rows if (row["spring"], row["law"]) == (spring, law)]
            slips = [slip for row in own for slip in row["slips"]]
            begins = [[slip["begins"] for slip in row["slips"]] for row in own]
            apart = np.concatenate([np.diff(each) for each in begins]) if begins else np.zeros(0)
            found.append(
                {
                    "spring": spring,
                    "law": law,
                    "runs": len(own),
                    "slips": len(slips),
                    "without": sum(not row["slips"] for row in own),
                    "drop": middle([slip["force_before"] - slip["force_after"] for slip in slips]),
                    "slip": middle([slip["slip"] for slip in slips]),
                    "apart": middle(apart),
                }
            )
    return found


def verdicts(rows: Sequence[Row], springs: Sequence[float]) -> list[Row]:
    """Verdicts on the states of some springs at rest, by their place in the wait."""
    found = []
    for kind in SHARES:
        states = [
            (state, row["slips"][state["slip"]]["slip"])
            for row in rows
            if row["spring"] in springs
            for state in row["states"]
            if state["kind"] == kind
        ]
        rest = [(state["rest"], slip) for state, slip in states if state["rest"]["found"]]
        stays = [each for each, slip in rest if abs(each["moved"]) <= STAYS * abs(slip)]
        rising = [each["rising"] for each in stays if each["rising"]]
        unknown = sum(each["stable"] is None for each in stays)
        steady = [each["vibration"] > VIBRATES * each["drift"] for each in rising if each["steady"]]
        found.append(
            {
                "kind": kind,
                "states": len(states),
                "stays": share(len(stays), len(states)),
                "grows": share(sum(each["stable"] is False for each in stays), len(stays), unknown),
                "unknown": unknown,
                "bound": share(sum(each["at_bound"] > 0 for each in stays), len(stays)),
                "vibrates": share(sum(steady), len(rising), len(rising) - len(steady)),
                "open": len(rising) - len(steady),
            }
        )
    return found


def advances(rows: Sequence[Row]) -> Row:
    """Clock advances of pulses over phase, height and frequency, and of noise.

    The noise floor of a slip is the largest advance or delay by one of its pulses of noise.
    """
    noise = [row for row in rows if row["kind"] == "noise"]
    floor: dict[tuple[int, int], float] = {}
    for row in noise:
        key = row["seed"], row["slip"]
        moved_by = np.inf if row["advance"] is None else abs(row["advance"])
        floor[key] = max(floor.get(key, ROW), moved_by)
    pulses = [row | {"floor": floor[row["seed"], row["slip"]]} for row in rows if row["kind"] == "pulse"]
    groups = {"height": HEIGHTS, "omega": FREQUENCIES, "phase": PHASES}
    cells = [
        {"phase": phase, "height": height, "omega": omega}
        | moved([r for r in pulses if (r["phase"], r["height"], r["omega"]) == (phase, height, omega)])
        for phase, height, omega in product(PHASES, HEIGHTS, FREQUENCIES)
    ]
    return {
        "slips": sum(row["kind"] == "slip" for row in rows),
        "seeds": sorted({row["seed"] for row in rows}),
        "too_short": sum(row["kind"] == "too short" for row in rows),
        "noise": {
            "runs": len(noise),
            "median": float(np.median([abs(row["advance"]) for row in noise if row["advance"] is not None])),
            "floors": sorted(round(each, 2) for each in floor.values()),
        },
        "cells": cells,
        "by": [{"name": n, "value": v} | moved([r for r in pulses if r[n] == v]) for n in groups for v in groups[n]],
    }


def long_slips(rows: Sequence[Row]) -> list[Row]:
    """How many slips are long, of each spring."""
    found = []
    for spring in SPRINGS:
        slips = [slip["slip"] for row in rows if row["spring"] == spring for slip in row["slips"]]
        found.append({"spring": spring, "long": share(sum(each > LONG for each in slips), len(slips))})
    return found


def full_advances(rows: Sequence[Row]) -> list[Row]:
    """How many pulses of each height advance the slip by all, or by half, of the wait that was left."""
    begins = {(row["seed"], row["slip"]): row["begins"] for row in rows if row["kind"] == "slip"}
    found = []
    for height in HEIGHTS:
        own = [row for row in rows if row["kind"] == "pulse" and row["height"] == height]
        parts = [(row["advance"] or 0.0) / (begins[row["seed"], row["slip"]] - row["at"]) for row in own]
        counts = {name: share(sum(part > least for part in parts), len(own)) for name, least in
                  (("full", FULL), ("half", HALF))}  # fmt: skip
        found.append({"height": height, "largest": max(parts)} | counts)
    return found


def moved(rows: Sequence[Row]) -> Row:
    """By how many pulses the next slip comes earlier or later than by any noise, or not at all; the median of all."""
    known = [(row["advance"], row["floor"]) for row in rows if row["advance"] is not None]
    return {
        "pulses": len(rows),
        "earlier": share(sum(advance > floor for advance, floor in known), len(rows)),
        "later": share(sum(advance < -floor for advance, floor in known), len(rows)),
        "none": len(rows) - len(known),
        "median": middle([advance for advance, _ in known]),
    }


def numbers(folder: Path = HERE) -> Row:
    """All numbers of the page."""
    springs = read_rows(folder / "tables" / SPRINGS_TABLE)
    pulses = read_rows(folder / "tables" / CLOCK_TABLE)
    return {
        "sizes": sizes(springs),
        "long": long_slips(springs),
        "longer": LONG,
        "full": full_advances(pulses),
        "seeds": sorted({row["seed"] for row in springs}),
        "verdicts": {spring: verdicts(springs, [spring]) for spring in SPRINGS},
        "all": verdicts(springs, SPRINGS),
        "clock": advances(pulses),
        "stays": STAYS,
    }


def check() -> list[str]:
    """Differences from both tables, with the first run of a spring and the first twelfth of the pulses computed
    again."""
    springs_known, clock_known = (read_rows(HERE / "tables" / name) for name in (SPRINGS_TABLE, CLOCK_TABLE))
    run = springs_known[0]
    again = row_of(run["seed"], run["law"], run["spring"])
    pairs = [
        *((old, new, tuple(old)) for old, new in zip(run["slips"], again["slips"], strict=True)),
        *(
            (old, new, ("begins", "advance"))
            for old, new in zip(
                clock_known[: len(clock_known) // 12], clock.rows_of(clock_known[0]["seed"]), strict=False
            )
        ),
    ]
    return [each for old, new, names in pairs for each in differing(old, new, names, AGREES)]


def write_further(folder: Path = HERE) -> Path:
    """Write further.md of a folder from its tables."""
    found = numbers(folder)
    (folder / "further.md").write_text(
        render("research.cycle", "further.md.j2", **found, count=count_of, interval=interval)
    )
    return folder / "further.md"
