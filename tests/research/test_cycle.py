"""The page on cycles comes out of its table, and its counts are those of the table."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from research.cycle.compute import EVERY, LAWS, LOOKED_AT, chosen
from research.cycle.make import MANY_TABLE, TABLE, concordance, numbers, ordered_pairs, write_page
from research.tables import read_rows

CYCLE = Path(__file__).parents[2] / "research" / "cycle"
ROWS, LARGE = (read_rows(CYCLE / "tables" / name) for name in (TABLE, MANY_TABLE))


@pytest.mark.long
def test_the_page_of_cycles_is_that_of_its_table(tmp_path):
    shutil.copytree(CYCLE / "tables", tmp_path / "tables")
    assert (CYCLE / "README.md").read_text() == write_page(tmp_path).read_text()


def test_the_runs_are_those_of_the_rule():
    expected = [(1 + k // 2, LAWS[k % 2]) for k in range(len(ROWS))]
    assert [(row["seed"], row["law"]) for row in ROWS] == expected


def test_the_large_runs_are_those_of_the_rule():
    expected = [(seed, law) for law in reversed(LAWS) for seed in range(1, 11)]
    assert [(row["seed"], row["law"]) for row in LARGE] == expected[: len(LARGE)]
    for row in LARGE:
        slips = list(range(min(LOOKED_AT, len(row["slips"]))))
        for kind in ("before", "control"):
            assert [state["slip"] for state in row["states"] if state["kind"] == kind] == slips


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['seed']}-{row['law']}")
def test_each_slip_has_its_state_before_and_its_control(row):
    for kind in ("before", "control"):
        assert [state["slip"] for state in row["states"] if state["kind"] == kind] == list(range(len(row["slips"])))
    for state in row["states"]:
        if state["kind"] == "before":
            slip = row["slips"][state["slip"]]
            assert (state["time"], state["force"], state["until"]) == (slip["begins"], slip["force_before"], 0.0)
        elif state["kind"] == "even":
            assert not any(slip["begins"] <= state["time"] <= slip["ends"] for slip in row["slips"])


def test_the_smoothed_law_has_one_derivative_at_the_bound_and_the_standard_law_two():
    differ = {law: 0 for law in LAWS}
    for row in ROWS:
        differ[row["law"]] += sum(state["lowest_sticking"] != state["lowest_sliding"] for state in row["states"])
    assert differ["total"] == 0 < differ["coulomb"]


def test_a_number_that_knows_the_slip_orders_all_pairs_and_the_reverse_none():
    known = [row | {"states": [state | {"force": -(state["until"] or 1e9)} for state in row["states"]]} for row in ROWS]
    right, of = np.sum([ordered_pairs(row, "force") for row in known], axis=0)
    assert right == of > 100
    worst = [row | {"states": [s | {"force": -s["force"]} for s in row["states"]]} for row in known]
    assert np.sum([ordered_pairs(row, "force") for row in worst], axis=0)[0] == 0
    assert concordance(known)[0]["share"] == [1.0, 1.0, 1.0]


def test_even_states_are_those_nearest_to_multiples():
    times = np.arange(0.0, 100.0, 5.0)
    assert [frame for kind, _, frame in chosen(times, []) if kind == "even"] == [
        int(np.argmin(np.abs(times - multiple))) for multiple in np.arange(EVERY, times[-1], EVERY)
    ]


def test_the_other_page_says_what_the_table_says():
    found = numbers(ROWS)
    said = " ".join((CYCLE.parents[1] / "docs" / "stick_slip.md").read_text().split())
    for law in LAWS:
        before, control = found["before"][law]["sliding"], found["control"][law]["sliding"]
        assert f"{before['count']} of {before['of']} slips" in said
        assert f"{control['count']} of {control['of']} control states" in said
    folds = [found[kind]["coulomb"]["fold"]["count"] for kind in ("before", "control")]
    assert f"a fold before {folds[0]}, and in {folds[1]}." in said
