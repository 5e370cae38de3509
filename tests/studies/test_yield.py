"""The page of the study of yield says what its table says."""

from dataclasses import replace
from pathlib import Path

import pytest

from faultgouge.studies.packings import distance
from faultgouge.studies.yielding.compute import CONTROLLED
from faultgouge.studies.yielding.page import numbers, rows_of, text

FOLDER = Path(__file__).parents[2] / "docs" / "yield"


def test_the_page_is_that_of_its_table():
    rows, failed = rows_of(FOLDER / "tables" / "quartz_100.jsonl")
    assert (FOLDER / "yield.md").read_text() == text(numbers(rows), len(rows), failed)


def test_the_static_yield_lies_beyond_the_end_of_newtons_branch():
    rows, _ = rows_of(FOLDER / "tables" / "quartz_100.jsonl")
    assert all(row["static"] >= row["newton"] for row in rows)


def test_layers_without_loss_flow_below_their_static_yield_and_lossy_ones_do_not():
    rows, _ = rows_of(FOLDER / "tables" / "quartz_100.jsonl")
    undamped, *lossy = numbers(rows)["yields"]
    assert undamped["flow"] > len(rows) / 2
    assert undamped["share"][2] < 1
    assert all(each["flow"] == 0 for each in lossy)
    assert all(each["share"] == [1, 1, 1] for each in lossy)


def test_with_more_loss_the_same_layers_flow_as_the_load_rises():
    """And all of them beyond the end of Newton's branch."""
    rows, _ = rows_of(FOLDER / "tables" / "quartz_100.jsonl")

    def flowing(loss):
        runs = [
            [run for run in row["loading"] if (run["rate"], run["restitution"]) == (CONTROLLED, loss)] for row in rows
        ]
        return [k for k, (run,) in enumerate(runs) if run["flows"] is not None]

    assert flowing(0.9) == flowing(0.5) == flowing(0.1) != []
    for row in rows:
        for run in row["loading"]:
            assert run["flows"] is None or row["newton"] < run["flows"] < row["static"]


def test_disks_that_carry_nothing_have_no_part_in_d(reference_packing):
    packing = reference_packing(1.0)
    position = packing.position + 1e-3
    position[packing.rattlers] += 1.0
    assert len(packing.rattlers) > 0
    assert distance(packing, replace(packing, position=position)) == pytest.approx(2e-6, rel=1e-9)
