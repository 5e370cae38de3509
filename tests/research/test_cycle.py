"""The page on cycles comes out of its table, and its counts are those of the table."""

from pathlib import Path

import pytest

from research.cycle.compute import LAWS, LOOKED_AT
from research.cycle.make import MANY_TABLE, TABLE, numbers
from research.tables import read_rows

CYCLE = Path(__file__).parents[2] / "research" / "cycle"
ROWS, LARGE = (read_rows(CYCLE / "tables" / name) for name in (TABLE, MANY_TABLE))


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


def test_the_other_page_says_what_the_table_says():
    found = numbers(ROWS)
    said = " ".join((CYCLE.parents[1] / "docs" / "stick_slip.md").read_text().split())
    for law in LAWS:
        before, control = found["before"][law]["sliding"], found["control"][law]["sliding"]
        assert f"{before['count']} of {before['of']} slips" in said
        assert f"{control['count']} of {control['of']} control states" in said
    folds = [found[kind]["coulomb"]["fold"]["count"] for kind in ("before", "control")]
    assert f"a fold before {folds[0]}, and in {folds[1]}." in said
