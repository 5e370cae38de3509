"""The tables of the pages on cycles computed, the pages made from the tables, or a run computed again and compared.

python -m research.cycle.make compute RUNS SEEDS   the runs of the seeds 1 to SEEDS that the table lacks; their files
                                                   go to the folder RUNS; half a minute a run
python -m research.cycle.make many RUNS SEEDS      the same of 400 disks; two minutes a run
python -m research.cycle.make springs SEEDS        what the table of three springs lacks; four minutes a seed
python -m research.cycle.make clock SEEDS          what the table of clock advances lacks; a minute a seed
python -m research.cycle.make last SEEDS          what the table of last periods lacks; ten seconds a seed
python -m research.cycle.make page                 README.md and further.md from the tables
python -m research.cycle.make check                a tenth of the tables of 100 disks once more, and compared

From the folder of the repository.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from faultgouge.figures import render
from faultgouge.studies.statistics import share
from research.cycle import clock, further, last_period, springs
from research.cycle.compute import DISKS, LAWS, LOOKED_AT, MANY, UNTIL, compute, compute_many
from research.statistics import DRAWS, count_of, interval, median_over_runs, share_over_runs
from research.tables import add_seeds, differing, read_rows

HERE = Path(__file__).parent
TABLE, MANY_TABLE, LAST_TABLE = "cycles.jsonl", "cycles_400.jsonl", "last_period.jsonl"

Row = dict[str, Any]

FORETELLERS = {
    "force": "force",
    "since": "time since the last slip",
    "at_bound": "contacts at the bound",
    "pairs_sticking": "complex pairs, sticking",
    "pairs_sliding": "complex pairs, sliding",
    "undamped_sliding": "growth without loss, sliding",
    "damped_sticking": "growth with loss, sticking",
    "damped_sliding": "growth with loss, sliding",
    "lowest_sliding": "lowest eigenvalue, sliding (the lower, the sooner)",
}
"""What may foretell a slip, with its name on the page."""

AGREES = 1e-6
"""Relative difference of numbers that are computed again on the same machine."""

FORCES_DIFFER = 0.2
"""Share of the force before a slip by which that of its matched control may differ; the median is 0.02."""

NEAR = 10.0
"""Time before a slip within which a state is no control."""


def begins_with(state: Row) -> dict[str, bool]:
    """Which instabilities a state has."""
    grows, folds = state["damped_sliding"] > 0, state["lowest_sliding"] < 0
    return {
        "sticking": state["damped_sticking"] > 0,
        "sliding": grows,
        "fold": folds,
        "growth alone": grows and not folds,
        "neither": not grows and not folds,
    }


def counts(rows: Sequence[Row], law: str, kind: str) -> dict[str, dict[str, Any]]:
    """Of how many states of a kind each instability is there, with intervals."""
    runs = [
        [begins_with(state) for state in row["states"] if state["kind"] == kind] for row in rows if row["law"] == law
    ]
    names = ("sticking", "sliding", "fold", "growth alone", "neither")
    return {name: share_over_runs([[state[name] for state in run] for run in runs]) for name in names}


QUESTIONS = {
    "sliding": "growth, bound slides",
    "fold": "fold, bound slides",
    "sticking": "growth, bound sticks",
    "bound": "contacts at the bound",
}
"""What a state may have, and its name on the page."""


def before_or_control(rows: Sequence[Row], law: str, matched: bool = False) -> dict[str, dict[str, Any]]:
    """Of how many slips an instability is there before the slip alone, or in its control alone.

    Slips of one run depend on each other: p is that of the sums of the runs with signs that are drawn, all of them
    (a sign-flip test over runs), and `of_all` is p times the number of questions and laws.

    Parameters
    ----------
    rows : sequence of dict
        The runs.
    law : str
        The law that is asked about.
    matched : bool
        Whether the control is the state of the same run whose force is nearest to that before the slip, within
        `FORCES_DIFFER` of this, of all that are not within `NEAR` of the next slip; slips without one are left out.
    """
    found = {}
    for name in (*QUESTIONS, "force"):
        sums, alone, of = [], np.zeros(2, dtype=int), 0
        for row in (each for each in rows if each["law"] == law):
            pairs = [(each, _control(row, each, matched)) for each in row["states"] if each["kind"] == "before"]
            both = [(_value(state, name), _value(control, name)) for state, control in pairs if control]
            sums.append(float(sum(np.sign(before - control) for before, control in both)))
            alone += [
                sum(before > control for before, control in both),
                sum(control > before for before, control in both),
            ]
            of += len(both)
        chance = flipped_signs(sums)
        found[name] = {
            "before": int(alone[0]),
            "control": int(alone[1]),
            "of": of,
            "p": chance,
            "of_all": min(1.0, chance * len(LAWS) * len(QUESTIONS)),
        }
    return found


def _value(state: Row, name: str) -> float:
    return float((begins_with(state) | {"bound": state["at_bound"] > 0, "force": state["force"]})[name])


def _control(row: Row, before: Row, matched: bool) -> Row | None:
    if not matched:
        return next(each for each in row["states"] if (each["kind"], each["slip"]) == ("control", before["slip"]))
    others = [
        each for each in row["states"] if each["kind"] != "before" and (each["until"] is None or each["until"] > NEAR)
    ]
    nearest = min(others, key=lambda each: abs(each["force"] - before["force"]), default=None)
    apart = np.inf if nearest is None else abs(nearest["force"] - before["force"])
    return nearest if apart < FORCES_DIFFER * before["force"] else None


def flipped_signs(sums: Sequence[float]) -> float:
    """Share of all choices of signs with which the sum of some numbers is as large in size as with their own."""
    known = [each for each in sums if each]
    totals = np.zeros(1)
    for each in known:
        totals = np.concatenate([totals + each, totals - each])
    return float(np.mean(np.abs(totals) >= abs(sum(known))))


def ordered_pairs(row: Row, name: str) -> tuple[float, int]:
    """Pairs of even states of a run that a number orders rightly, ties as a half, and how many pairs there are.

    Both states are of different waits: in one wait the time since the last slip would be right by construction. The
    state nearer to its slip shall have the larger number (of the lowest eigenvalue the smaller). A state after the last
    slip waits at least until the end of the run.
    """
    sign = -1.0 if name.startswith("lowest") else 1.0
    states = [state for state in row["states"] if state["kind"] == "even"]
    right, of = 0.0, 0
    for state in states:
        if state["until"] is None:
            continue
        for other in states:
            waits = UNTIL - other["time"] if other["until"] is None else other["until"]
            if other["slip"] != state["slip"] and waits > state["until"]:
                difference = sign * (state[name] - other[name])
                right, of = right + (0.5 if difference == 0 else float(difference > 0)), of + 1
    return right, of


def concordance(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Share of pairs that each number orders rightly, and its excess over that of the force, with 95 % intervals.

    The intervals are of resampled runs. One half is chance.
    """
    found = {name: np.array([ordered_pairs(row, name) for row in rows]) for name in FORETELLERS}
    chosen = np.random.default_rng(0).integers(len(rows), size=(DRAWS, len(rows)))

    def shares(name: str) -> tuple[float, np.ndarray]:
        drawn = found[name][chosen].sum(axis=1)
        total = found[name].sum(axis=0)
        return total[0] / total[1], np.divide(
            drawn[:, 0], drawn[:, 1], out=np.full(DRAWS, np.nan), where=drawn[:, 1] > 0
        )

    force, force_draws = shares("force")
    rows_of_table = []
    for name, says in FORETELLERS.items():
        value, draws = shares(name)
        rows_of_table.append(
            {
                "name": name,
                "says": says,
                "share": [value, *np.nanquantile(draws, [0.025, 0.975])],
                "over_force": [value - force, *np.nanquantile(draws - force_draws, [0.025, 0.975])],
                "pairs": int(found[name][:, 1].sum()),
            }
        )
    return rows_of_table


def sizes(row: Row) -> dict[str, Any]:
    """Slips of a run: how many, medians of force drop and of slip, and the mean time between two."""
    slips = row["slips"]
    begins = [slip["begins"] for slip in slips]
    drops = [slip["force_before"] - slip["force_after"] for slip in slips]
    return {
        "seed": row["seed"],
        "law": row["law"],
        "slips": len(slips),
        "drop": [float(np.median(drops)), max(drops)] if slips else None,
        "slip": [float(np.median([slip["slip"] for slip in slips])), max(slip["slip"] for slip in slips)]
        if slips
        else None,
        "recurrence": (begins[-1] - begins[0]) / (len(begins) - 1) if len(begins) > 1 else None,
    }


def by_size(few: Sequence[Row], many: Sequence[Row]) -> list[dict[str, Any]]:
    """Slips of both sizes: how many a run, and medians with intervals of their numbers."""
    found = []
    for law in LAWS:
        for disks, rows in ((DISKS, few), (MANY, many)):
            own = [row for row in rows if row["law"] == law]
            runs = [row["slips"] for row in own]
            drops = [[slip["force_before"] - slip["force_after"] for slip in run] for run in runs]
            found.append(
                {"law": law, "disks": disks, "runs": len(own), "slips": sum(map(len, runs))}
                | {
                    name: median_over_runs([[slip[column] for slip in run] for run in runs])
                    for name, column in (("before", "force_before"), ("slip", "slip"))
                }
                | {
                    "drop": median_over_runs(drops),
                    "apart": median_over_runs([np.diff([slip["begins"] for slip in run]).tolist() for run in runs]),
                    "largest": max((drop for run in drops for drop in run), default=None),
                }
            )
    return found


def of_states(rows: Sequence[Row]) -> dict[str, Any]:
    """Counts of the states before slips and of their controls, by the law."""
    laws = [law for law in LAWS if any(row["law"] == law for row in rows)]
    return {
        "laws": laws,
        "seeds": {law: [row["seed"] for row in rows if row["law"] == law] for law in laws},
        "before": {law: counts(rows, law, "before") for law in laws},
        "control": {law: counts(rows, law, "control") for law in laws},
        "paired": {law: before_or_control(rows, law) for law in laws},
        "matched": {law: before_or_control(rows, law, matched=True) for law in laws},
    }


def numbers(rows: Sequence[Row], many: Sequence[Row] = ()) -> dict[str, Any]:
    """All numbers of the page."""
    found = of_states(rows)
    every = {law: [row for row in rows if row["law"] == law] for law in found["laws"]}
    better = {law: concordance(every[law]) for law in every}
    states = [state for row in rows for state in row["states"]]
    return found | {
        "earlier": [row["seed"] for row in rows if row.get("earlier_version")],
        "runs": [sizes(row) for row in rows],
        "slips": {law: sum(len(row["slips"]) for row in every[law]) for law in every},
        "concordance": better,
        "sooner": [each["says"] for law in every for each in better[law] if each["over_force"][1] > 0],
        "resting": share(sum(state["rests"] for state in states), len(states)),
        "by_size": by_size(rows, many),
        "many": of_states(many),
        "disks": MANY,
        "looked_at": LOOKED_AT,
        "questions": QUESTIONS,
        "forces_differ": FORCES_DIFFER,
        "near": NEAR,
        "residual": float(np.median([state["residual"] for state in states])),
    }


def write_page(folder: Path = HERE) -> Path:
    """Write README.md of a folder from its table."""
    found = numbers(*(read_rows(folder / "tables" / name) for name in (TABLE, MANY_TABLE)))
    found["last"] = last_period.summary(read_rows(folder / "tables" / LAST_TABLE), flipped_signs)
    (folder / "README.md").write_text(
        render("research.cycle", "README.md.j2", **found, percent=count_of, interval=interval)
    )
    return folder / "README.md"


def check() -> list[str]:
    """Differences from the table, with the first run computed again."""
    known = read_rows(HERE / "tables" / TABLE)[0]
    with TemporaryDirectory() as folder:
        again = Path(folder) / TABLE
        compute(again, Path(folder), range(1, 2), LAWS[:1])
        new = read_rows(again)[0]
    names = ("time", "force", "damped_sliding", "lowest_sliding", "pairs_sliding")
    return [
        f"t = {old['time']:g}: {each}"
        for old, state in zip(known["states"], new["states"], strict=True)
        for each in differing(old, state, names, AGREES)
    ]


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute", runs, seeds]:
            compute(HERE / "tables" / TABLE, Path(runs), range(1, int(seeds) + 1))
        case ["many", runs, seeds]:
            compute_many(HERE / "tables" / MANY_TABLE, Path(runs), range(1, int(seeds) + 1))
        case ["last", seeds]:
            add_seeds(HERE / "tables" / LAST_TABLE, range(1, int(seeds) + 1), last_period.rows_of)
        case ["springs", seeds]:
            add_seeds(HERE / "tables" / further.SPRINGS_TABLE, range(1, int(seeds) + 1), springs.rows_of)
        case ["clock", seeds]:
            add_seeds(HERE / "tables" / further.CLOCK_TABLE, range(1, int(seeds) + 1), clock.rows_of)
        case ["page"]:
            print(write_page(), further.write_further())
        case ["check"]:
            print([*check(), *further.check()] or "the same")
        case _:
            sys.exit(__doc__)
