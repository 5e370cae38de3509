"""The pages of the study of yield, from its tables: numbers with intervals, the picture, the texts.

README.md is on static and dynamic yield. further.md is on layers that are left to themselves: which rest, with which
history of the slip.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import binomtest

from faultgouge.analysis import Floats
from faultgouge.figures import INK, render, save, styled
from faultgouge.studies.result_rows import row_columns
from faultgouge.studies.statistics import median, share
from research.modes.loss import GROWS
from research.statistics import count_of, interval
from research.tables import read_rows
from research.yielding.compute import CONTROLLED_RATE, LOADINGS, LOSSES, SHARES, TIME

UNREST = ("flows", "bursts", "fails at rest")
"""How a run ends after which the layer does not rest: it flows in the run; it throws a disk out of the box; or it finds
no equilibrium once drag is switched on, after it may have moved by a hundredth of a diameter alone. The first alone is
flow."""

ELSEWHERE = 1e-8
"""D beyond which the layer rests in another equilibrium: a ten-thousandth of a small disk's diameter, squared."""

QUIET = 1e-18
"""Kinetic energy at the end, force length, below which nothing moves: noise of 1e-12 begins with some 1e-20."""

SEEN_GROWTH = 1e-15
"""D in a run beyond which the layer has moved by itself. Contacts that yield to noise and rest move by up to 1e-16."""

ROUNDED_RATE = 2 * GROWS
"""Rate of D, 1 / time, below which the spectrum has no growth but a rounded eigenvalue of zero: a disk that rolls."""

LASTS = 0.5
"""Share of its early kinetic energy from which on a layer vibrates without slowing down; the others lose 57 % and more
in the same time."""


def rows_of(table: Path) -> tuple[list[dict[str, Any]], int]:
    """The results of the packings that settled, and how many did not."""
    rows = read_rows(table)
    good = [row["result"] for row in rows if row["result"]]
    return good, len(rows) - len(good)


def numbers(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians of static yield, shares of the dynamic runs, loads at which the path is left."""
    return {
        "newton": median([row["newton"] for row in rows]),
        "static": median([row["static"] for row in rows]),
        "dynamic": [of_runs(rows, load, loss) for load in SHARES for loss in LOSSES],
        "yields": [yields(rows, loss) for loss in LOSSES],
        "worst": worst_ends(rows, 1.0),
        "spread": median([np.ptp([row["static"], *(each[1] for each in row["static_by_increment"])]) for row in rows]),
        "loading": [_rising_loads(rows, *each) for each in LOADINGS],
    }


def yields(rows: list[dict[str, Any]], loss: float) -> dict[str, Any]:
    """The dynamic yield with a loss, medians with intervals: the least load of `SHARES` from which a packing
    does not come to rest.

    A packing that rests from all of them has its static yield. "least" is F_x/F_y, "share" over the static yield.
    """
    shares = []
    for row in rows:
        restless = [run["share"] for run in row["dynamic"] if run["restitution"] == loss and run["ends"] in UNREST]
        shares.append(min(restless, default=1.0))
    static = np.array([row["static"] for row in rows])
    return {
        "restitution": loss,
        "least": median(shares * static),
        "share": median(shares),
        "unrest": int(np.sum(np.less(shares, 1))),
    }


def worst_ends(rows: list[dict[str, Any]], loss: float) -> dict[str, Any]:
    """How many packings flow at some load of `SHARES`; of the others burst; of the others fail at rest.

    With the least and the largest slip of the layer, in diameters, of runs that fail at rest, and how many packings
    have a static yield by other increments that is below the largest of these loads.
    """
    ends = [[run["ends"] for run in row["dynamic"] if run["restitution"] == loss] for row in rows]
    worst = [next((kind for kind in UNREST if kind in each), "rests") for each in ends]
    slips = [
        abs(run["slip"])
        for row in rows
        for run in row["dynamic"]
        if run["restitution"] == loss and run["ends"] == "fails at rest"
    ]
    yields = [(row["static"], [each[1] for each in row.get("static_by_increment", ())]) for row in rows]
    exceeded = [max(SHARES) * static > min(others, default=static) for static, others in yields]
    counts = {kind: share(worst.count(kind), len(rows)) for kind in UNREST}
    return {"counts": counts, "slips": [min(slips), max(slips)] if slips else None, "exceeded": sum(exceeded)}


def static_and_dynamic(rows: list[dict[str, Any]]) -> tuple[list[float], Floats]:
    """Medians of F_x/F_y with intervals: the static yield, and the dynamic one for each of `LOSSES`, shape (3, 3)."""
    return median([row["static"] for row in rows]), np.array([yields(rows, loss)["least"] for loss in LOSSES])


def of_runs(rows: list[dict[str, Any]], load: float, loss: float) -> dict[str, Any]:
    """How the dynamic runs at a share of the static yield end with a restitution."""
    runs = [run for row in rows for run in row["dynamic"] if (run["share"], run["restitution"]) == (load, loss)]
    rest = [run for run in runs if run["ends"] not in UNREST]
    return {
        "share": load,
        "restitution": loss,
        "unrest": share(len(runs) - len(rest), len(runs)),
        "ends": {kind: sum(run["ends"] == kind for run in runs) for kind in UNREST},
        "elsewhere": share(sum(run["D"] > ELSEWHERE for run in rest), len(runs)),
        "slip": float(np.median([abs(run["slip"]) for run in rest])) if rest else None,
    }


def _rising_loads(rows: list[dict[str, Any]], rate: float, loss: float) -> dict[str, Any]:
    """Packings whose load rose at a rate: where they left the path, and where those flowed that did.

    "flows" are their loads over the static yield, in the order of the packings; "branch" is how many of them flow
    beyond the end of Newton's branch, and "lower" beyond the least of their static yields.
    """
    runs = [(row, run) for row in rows for run in row["loading"] if (run["rate"], run["restitution"]) == (rate, loss)]
    columns = zip(*(run["left"] for _, run in runs), strict=True)
    known = [[value for value in column if value is not None] for column in columns]
    flowing = [(row, run["flows"]) for row, run in runs if run["flows"] is not None]
    return {
        "rate": rate,
        "restitution": loss,
        "of": len(runs),
        "left": [float(np.median(column)) if column else None for column in known],
        "flows": [load / row["static"] for row, load in flowing],
        "branch": sum(load > row["newton"] for row, load in flowing),
        "lower": sum(load > min(each[1] for each in row["static_by_increment"]) for row, load in flowing),
    }


def from_the_bound(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Layers that move from Coulomb's bound: their runs, and the seeds of those that more loss stops, or does not."""
    moving = [row for row in rows if row["largest_D"] > SEEN_GROWTH]
    states = {(row["seed"], row["share"]) for row in moving}
    lossy = {row["seed"] for row in moving if row["restitution"] < max(each["restitution"] for each in rows)}
    return {
        "sliding": [row for row in rows if (row["seed"], row["share"]) in states],
        "bound_slips": [abs(row["slip"]) for row in moving],
        "creeping": sorted(lossy),
        "vibrating": sorted({seed for seed, _ in states} - lossy),
    }


@styled
def figure(found: dict[str, Any]) -> Figure:
    """Static and dynamic yield over loss, of either size; share of layers of 100 disks without rest over the load."""
    picture = Figure(figsize=(7, 3), layout="constrained")
    left, axes = picture.subplots(1, 2)
    for k, (disks, (static, least)) in enumerate(found["sizes"].items()):
        middle, low, high = static
        place, colour = np.arange(len(LOSSES)) + 0.16 * (k - 0.5), (INK, "C4")[k]
        left.axhspan(low, high, color=colour, alpha=0.12, linewidth=0)
        left.axhline(middle, color=colour, linestyle="--", label=f"static yield, {disks} disks")
        bars = [least[:, 0] - least[:, 1], least[:, 2] - least[:, 0]]
        left.errorbar(
            place, least[:, 0], yerr=bars, fmt="os"[k], color=colour, capsize=3, label=f"dynamic, {disks} disks"
        )
    left.set(xlabel="restitution", ylabel="$F_x/F_y$", ylim=(0, None), xlim=(-0.5, len(LOSSES) - 0.5))
    left.set_xticks(range(len(LOSSES)), ["1 (undamped)", *map(str, LOSSES[1:])])
    left.legend(loc="lower right")
    for k, loss in enumerate(LOSSES):
        rows = [row for row in found["dynamic"] if row["restitution"] == loss and row["unrest"]["of"]]
        middle, low, high = row_columns([row["unrest"] for row in rows], "share", "low", "high")
        bars = np.clip([middle - low, high - middle], 0, 1)
        label = "undamped" if loss == 1 else f"restitution {loss}"
        axes.errorbar(
            row_columns(rows, "share")[0] + 0.01 * (k - 1), middle, yerr=bars, fmt="o-", capsize=3, label=label
        )
    axes.axvline(1.0, color="black", linestyle="--", label="static yield")
    axes.set(xlabel="$F_x$ over static yield", ylabel="share of packings that do not rest", ylim=(-0.02, 1.02))
    axes.legend(loc="upper left")
    return picture


def write_page(folder: Path) -> Path:
    """The page and the picture of a folder with tables; the path of the page."""
    tables = folder / "tables"
    rows, failed = rows_of(tables / "quartz_100.jsonl")
    large = read_rows(tables / "quartz_400.jsonl")
    found = numbers(rows)
    found["sizes"] = {disks: static_and_dynamic(each) for disks, each in ((100, rows), (400, large))}
    (folder / "pictures").mkdir(exist_ok=True)
    save(figure(found), folder / "pictures" / "yield")
    page = render(
        "research.yielding",
        "README.md.j2",
        **found,
        packings=len(rows),
        failed=failed,
        unrest=[share(each["unrest"], len(rows)) for each in found["yields"]],
        large_unrest=[_restless(large, loss) for loss in LOSSES],
        slow=[row for row in found["loading"] if row["rate"] == CONTROLLED_RATE],
        standard=standard(read_rows(tables / "standard_100.jsonl")),
        **from_the_bound(read_rows(tables / "sliding_100.jsonl")),
        interval=interval,
        percent=count_of,
    )
    (folder / "README.md").write_text(page)
    return folder / "README.md"


def standard(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Layers that the standard law has loaded, each with several draws of noise where a run decides.

    "runs" are by share of the static yield and restitution: packings; those whose spectrum has growth; those in whose
    runs noise grows, those that end in each way of `UNREST`, and those that rest elsewhere, in all draws and in any.
    "flows" are packings that flow in any run, by restitution. "at_bound" are seed and share of the lossy layers in
    which noise grows and the spectrum has no growth.
    """
    losses = sorted({run["restitution"] for row in rows for run in row["dynamic"]}, reverse=True)
    runs = [_of_standard(rows, load, loss) for load in SHARES for loss in losses]
    flows = {
        loss: share(
            sum(any(run["ends"] == "flows" for run in row["dynamic"] if run["restitution"] == loss) for row in rows),
            len(rows),
        )
        for loss in losses
    }
    at_bound = {
        (row["seed"], run["share"])
        for row in rows
        for run in row["dynamic"]
        if run["restitution"] < 1 and run["rate"] < ROUNDED_RATE and run["largest_D"] > SEEN_GROWTH
    }
    found = {"static": median([row["static"] for row in rows]), "of": len(rows), "runs": runs, "flows": flows}
    return found | {"at_bound": sorted(at_bound)}


def _ends_as(kind: str) -> Callable[[dict[str, Any]], bool]:
    """Whether a run ends as this kind."""
    return lambda run: bool(run["ends"] == kind)


def _of_standard(rows: list[dict[str, Any]], load: float, loss: float) -> dict[str, Any]:
    """One of the "runs" of `standard`."""
    each = [[run for run in row["dynamic"] if (run["share"], run["restitution"]) == (load, loss)] for row in rows]
    each = [draws for draws in each if draws]
    runs = [run for draws in each for run in draws]

    def in_all_and_any(happens: Callable[[dict[str, Any]], bool]) -> list[int]:
        which = [[happens(run) for run in draws] for draws in each]
        return [sum(map(all, which)), sum(map(any, which))]

    slips = [abs(run["slip"]) for run in runs if run["ends"] not in UNREST]
    return {
        "share": load,
        "restitution": loss,
        "packings": len(each),
        "grows": sum(draws[0]["rate"] > ROUNDED_RATE for draws in each),
        "grown": in_all_and_any(lambda run: run["largest_D"] > SEEN_GROWTH),
        **{kind: in_all_and_any(_ends_as(kind)) for kind in UNREST},
        "elsewhere": in_all_and_any(lambda run: run.get("D", 0.0) > ELSEWHERE),
        "slip": float(np.median(slips)) if slips else None,
        "largest": float(np.median([run["largest_D"] for run in runs])) if runs else None,
        "decades": float(np.median([draws[0]["rate"] for draws in each])) * TIME / np.log(10) if each else None,
    }


def count_vibrating_draws(lasting: list[dict[str, Any]], further: list[dict[str, Any]]) -> dict[str, Any] | None:
    """Lossy layers with three draws of noise: how many vibrate on in how many draws, by history; None without rows.

    Of the seeds whose draws have all been computed.
    """
    found: dict[str, dict[int, list[bool]]] = {"total": {}, "coulomb": {}}
    first = [row for row in lasting if (row["history"], row["share"], row["restitution"]) == ("total", 0.97, 0.9)]
    for row in [*first, *further]:
        found[row["history"]].setdefault(row["seed"], []).append(lasts(row))
    draws = max((row["draw"] + 1 for row in further), default=0)
    seeds = [seed for seed, each in found["coulomb"].items() if len(each) == len(found["total"][seed]) == draws]
    if not seeds:
        return None
    counts = {
        history: [sum(sum(each[seed]) == k for seed in seeds) for k in range(draws + 1)]
        for history, each in found.items()
    }
    late = max(row["late"] for row in further if row["history"] == "coulomb" and row["seed"] in seeds)
    return {"seeds": seeds, "draws": draws, "counts": counts, "late": late}


def write_lasting(folder: Path) -> Path:
    """further.md of a folder with the tables of `research.yielding.further` and quartz_100.jsonl."""
    tables = folder / "tables"
    rows, large = (read_rows(tables / f"{name}.jsonl") for name in ("lasting", "quartz_400"))
    further = tables / "draws.jsonl"
    lossy = [row for row in rows if row["restitution"] < 1]
    page = render(
        "research.yielding",
        "further.md.j2",
        percent=count_of,
        lossy=lossy,
        again=count_vibrating_draws(rows, read_rows(further) if further.exists() else []),
        standard=standard(read_rows(tables / "standard_100.jsonl")),
        **_count_lasting(lossy),
        free=_without_loss(rows, tables / "quartz_100.jsonl"),
        flow=flowing(read_rows(tables / "flow_400.jsonl")),
        large=[of_runs(large, load, loss) for load in SHARES for loss in LOSSES],
        large_unrest=[_restless(large, loss) for loss in LOSSES],
        large_worst={kind: each["count"] for kind, each in worst_ends(large, 1.0)["counts"].items()},
        large_static=interval(median([row["static"] for row in large])),
    )
    (folder / "further.md").write_text(page)
    return folder / "further.md"


def lasts(row: dict[str, Any]) -> bool:
    """Whether a layer vibrates without slowing down, by more than what the noise and rounding leave."""
    return bool(row["late"] > LASTS * row["early"] and row["late"] > QUIET)


def _count_lasting(lossy: list[dict[str, Any]]) -> dict[str, Any]:
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
        "strongly": [row for row in vibrating if row["restitution"] < LOSSES[1]],
        "energies": sorted(row["late"] for row in vibrating),
        "moves": max(row["moves"] for row in vibrating),
        "quiet": max(row["late"] for row in lossy if row["history"] == "rescaled"),
        "slowest": max(
            (row for row in lossy if not lasts(row) and row["late"] > QUIET), key=lambda row: row["late"] / row["early"]
        ),
    }


LAWS = {"total": "total", "rescaled": "rescaled", "coulomb": "the standard law's"}
"""Histories of the slip in words."""


def flowing(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """How the runs of a layer that flows in spite of loss end, by load and history."""
    found = []
    for load, history in product(sorted({row["share"] for row in rows}), LAWS):
        runs = [row for row in rows if (row["share"], row["history"]) == (load, history)]
        slips = [abs(run["slip"]) for run in runs if run["ends"] == "rests"]
        known = {name: runs[0][name] for name in ("seed", "share", "fx_over_fy", "static")}
        ends = {kind: sum(run["ends"] == kind for run in runs) for kind in ("flows", "bursts", "rests")}
        found.append(known | {"law": LAWS[history], "ends": ends, "slip": max(slips, default=None)})
    return found


def _without_loss(rows: list[dict[str, Any]], table: Path) -> dict[str, Any]:
    """Runs without loss, those with total slips and with rescaled ones from the same states, and how they end."""
    total = {
        (row["values"]["packing.seed"], run["share"]): run
        for row in read_rows(table)
        if row["result"]
        for run in row["result"]["dynamic"]
        if run["restitution"] == 1
    }
    runs = [row | {"total": total[row["seed"], row["share"]]} for row in rows if row["restitution"] == 1]
    ends = {}
    for load in (0.97, 0.9):
        here = [row for row in runs if row["share"] == load]
        ends[load] = [
            {kind: share(sum(each["ends"] == kind for each in group), len(group)) for kind in UNREST}
            for group in ([row["total"] for row in here], here)
        ]
    return {"runs": runs, "ends": ends}


def _restless(large: list[dict[str, Any]], loss: float) -> dict[str, Any]:
    """Packings that do not come to rest from a load below their static yield."""
    ends = [any(run["ends"] in UNREST for run in row["dynamic"] if run["restitution"] == loss) for row in large]
    return share(sum(ends), len(ends))
