"""The page of the study: its template filled with what the tables hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.figures import render
from faultgouge.studies.statistics import median, share
from research.laws.both_laws import BRANCHES, RESTITUTIONS
from research.laws.sets import sets as all_sets
from research.modes.loss import GROWS
from research.modes.page import finite, part
from research.statistics import interval, median_interval
from research.tables import read_rows, write_json
from research.yielding.page import SEEN_GROWTH, UNREST, rows_of

Row = dict[str, Any]

HERE = Path(__file__).parent
YIELDING = HERE.parent / "yielding" / "tables"

WORDS = {"smooth": "smoothed", "same": "standard, same equilibria", "loaded": "standard, own ramp"}
STATES = tuple(WORDS)

STOCK = {"granular": "stock LAMMPS", "coulomb": "this program, standard law", "smooth": "this program, smoothed law"}

LOSS = 0.9
"""Restitution of the lossy layers that noise may set flowing."""

DRAG = 2.0
"""1/tau of a drag that is strong for a deck that loads with it: pairs beyond it grow all the same."""

FAST = 0.5
"""Rate of D, 1 / time, beyond which a run of 50 units shows growth: nine decades need 0.41, and noise has only a part
of the motion that grows."""

MEDIANS = ("share", "growth_rate", "least_q", "drag_rate")


def write_page(tables: Path, folder: Path) -> Path:
    """Write README.md and laws.json from the tables of a folder; the path of the page."""
    found = numbers(
        {path.stem: [row for row in read_rows(path) if row["says"] is None] for path in tables.glob("*.jsonl")}
    )
    found["stock"] = stock(read_rows(HERE / "stock_lammps.jsonl"))
    found["response"] = responses(read_rows(HERE / "sensitivity.jsonl"))
    found["yielding"] = yields(read_rows(YIELDING / "standard_100.jsonl"))
    smoothed, _ = rows_of(YIELDING / "quartz_100.jsonl")
    found["yielding"]["smoothed"] = yields(smoothed)
    write_json(folder / "laws.json", finite(found))
    formats = {"middle": interval, "quality": partial(interval, digits=".3g"), "part": part, "across": across}
    formats |= {"restitutions": RESTITUTIONS, "words": WORDS, "stock_words": STOCK, "asked": packings_by_set()}
    (folder / "README.md").write_text(render("research.laws", "README.md.j2", **found, **formats))
    return folder / "README.md"


def across(at: dict[str, Any], name: str, told: Callable[[Any], str] = str, restitution: float | None = None) -> str:
    """The cells of a row: one quantity of the three states, of one restitution if one is given."""
    found = [at[state][name] for state in STATES]
    return " | ".join(told(each if restitution is None else each[restitution]) for each in found)


def numbers(tables: dict[str, list[Row]]) -> dict[str, Any]:
    """Numbers of the page: sets of equilibria by name and load, runs by state and restitution, first windows by law.

    "exceptions" are the sets and loads in which motion grows with the standard law, own ramp, in spite of `LOSS`.
    """
    sets = {
        name.replace("_", " "): by_load(rows)
        for name, rows in sorted(tables.items())
        if name.split("_")[0] in ("force", "quartz")
    }
    growth = tables.get("growth_100", [])
    onsets = {name.split("_")[1]: first_windows(rows) for name, rows in tables.items() if name.startswith("onset_")}
    packings = {name.replace("_", " "): len(rows) for name, rows in tables.items()}
    exceptions = [
        {"set": name, "load": load, "grows": at["loaded"]["grows"][LOSS], "rate": at["loaded"]["fastest_lossy"]}
        for name, loads in sets.items()
        for load, at in loads.items()
        if at["loaded"]["grows"][LOSS]["count"]
    ]
    return {
        "sets": sets,
        "exceptions": exceptions,
        "packings": packings,
        "runs": runs(growth),
        "grown": len(growth),
        "onsets": onsets,
    }


def by_load(rows: Sequence[Row]) -> dict[float, dict[str, Any]]:
    """Of each load the numbers of each state; `branches` has those of K of the slider at the same equilibria."""
    loads = sorted({load["fx_over_fy"] for row in rows for load in row["loads"]})
    found = {}
    for fx in loads:
        at = [load for row in rows for load in row["loads"] if load["fx_over_fy"] == fx]
        seen = {name: [load[name] for load in at if name in load] for name in STATES}
        found[fx] = {name: describe_states(each) for name, each in seen.items()} | {
            "branches": {branch: median([each[branch] for each in seen["same"]]) for branch in BRANCHES}
        }
    return found


def describe_states(states: Sequence[Row]) -> dict[str, Any]:
    """Counts and medians of one state at one load."""
    found: dict[str, Any] = {"packings": len(states), "with_pairs": count_true(each["pairs"] > 0 for each in states)}
    found["moved"] = sum(each["moved"] > 0 for each in states)
    found |= {name: median([np.inf if each[name] is None else each[name] for each in states]) for name in MEDIANS}
    found["lowest_q"] = min((each["least_q"] for each in states if each["least_q"] is not None), default=None)
    damped = [dict(map(tuple, each["damped"])) for each in states]
    found["grows"] = {e: count_true(each[e] > GROWS for each in damped if e in each) for e in RESTITUTIONS}
    found["fastest_lossy"] = 2 * max((each[LOSS] for each in damped if LOSS in each), default=0.0)
    found["beyond_drag"] = sum(each["drag_rate"] > DRAG for each in states)
    alone = [each["normal_dashpots"] for each in states if "normal_dashpots" in each]
    found["fastest_normal_alone"] = 2 * max(alone, default=0.0)
    found["normal_alone"] = count_true(each > GROWS for each in alone)
    return found


def count_true(which: Iterable[bool]) -> dict[str, Any]:
    """How many, with Wilson's interval of the share."""
    told = list(which)
    return share(sum(told), len(told))


def runs(rows: Sequence[Row]) -> dict[str, dict[float, dict[str, Any]]]:
    """By state and restitution: packings whose motion grows in all draws and in any, and how K's rate compares."""
    found: dict[str, dict[float, dict[str, Any]]] = {}
    for name in STATES:
        each = [run for row in rows for load in row["loads"] for run in load.get(name, {"runs": []})["runs"]]
        for e in sorted({run["restitution"] for run in each}, reverse=True):
            chosen = [run for run in each if run["restitution"] == e]
            rates = [[draw["rate"] is not None for draw in run["draws"]] for run in chosen]
            ratios = [
                draw["rate"] / run["predicted"] for run in chosen for draw in run["draws"] if draw["rate"] is not None
            ]
            found.setdefault(name, {})[e] = {
                "predicted": count_true(run["predicted"] > 2 * GROWS for run in chosen),
                "fast": count_true(run["predicted"] > FAST for run in chosen),
                "always": count_true(map(all, rates)),
                "ever": count_true(map(any, rates)),
                "ratio": [float(np.median(ratios)), min(ratios), max(ratios)] if ratios else None,
                "most": max(draw["last_over_first"] for run in chosen for draw in run["draws"] if draw["rate"] is None)
                if not all(map(all, rates))
                else None,
            }
    return found


def first_windows(rows: Sequence[Row]) -> dict[str, Any]:
    """How many packings have a first window up to the end of the ramp, and the median of F_x^c."""
    reach, found = [row["reach"] for row in rows], [row["ends"] == "onset" for row in rows]
    return {"windows": count_true(found), "median": median_interval(reach, found)}


def stock(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """By law: packings in which the spectrum and LAMMPS have growth, the ratio of rates, and how far D rises else."""
    found = {}
    for law in STOCK:
        each = [row for row in rows if row["law"] == law]
        grown = [[draw["rate"] is not None for draw in row["draws"]] for row in each]
        draws = [(row, draw) for row in each for draw in row["draws"]]
        ratios = sorted(draw["rate"] / row["predicted"] for row, draw in draws if draw["rate"] is not None)
        found[law] = {
            "packings": len(each),
            "undamped": median([row["undamped"] for row in each]),
            "predicted": count_true(row["predicted"] > 2 * GROWS for row in each),
            "always": count_true(map(all, grown)),
            "ever": count_true(map(any, grown)),
            "ratio": [float(np.median(ratios)), ratios[0], ratios[-1]] if ratios else None,
            "most": max((draw["last_over_first"] for _, draw in draws if draw["rate"] is None), default=None),
            "unseen": max(
                (row["predicted"] for row, grows in zip(each, grown, strict=True) if not any(grows)), default=0.0
            ),
            "moved": max(row["moved"] for row in each),
            "bound": max(row["at_bound"] for row in each),
        }
    return found


def yields(rows: Sequence[Row]) -> dict[str, Any]:
    """Layers of one law at shares of their static yield: those that end in each way from any load, by loss."""
    found: dict[str, Any] = {"packings": len(rows), "static": median([row["static"] for row in rows])}
    for name, loss in (("undamped", 1.0), ("lossy", LOSS)):
        runs = [[run for run in row["dynamic"] if run["restitution"] == loss] for row in rows]
        found[name] = {kind: count_true(any(run["ends"] == kind for run in each) for each in runs) for kind in UNREST}
        found[name]["grows"] = count_true(any(run["rate"] > 2 * GROWS for run in each) for each in runs)
        found[name]["moves"] = count_true(
            any(run["rate"] <= 2 * GROWS and run["largest_D"] > SEEN_GROWTH for run in each) for each in runs
        )
    return found


def responses(rows: Sequence[Row]) -> dict[str, Any]:
    """By law: packings with an onset, those with a fitted exponent, its median, and the largest amplitude's median."""
    found = {}
    for history in ("total", "coulomb"):
        onsets = [row for row in rows if row["history"] == history]
        fits = [row for row in onsets if row["exponent"] is not None]
        found[history] = {
            "onsets": len(onsets),
            "fits": len(fits),
            "exponent": median([row["exponent"] for row in fits]),
            "furthest": max((row["exponent"] for row in fits), key=lambda each: abs(each + 0.5)),
            "amplitude": float(np.median([row["amplitudes"][1] for row in fits])),
        }
    return found


def packings_by_set() -> dict[str, int]:
    """How many packings of each set were asked for."""
    return {name: len(sweep.points) for name, sweep in all_sets().items()}
