"""The pages of the study of yield say what its tables say, and other pages say the same."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from faultgouge.studies.packings import distance
from faultgouge.studies.yielding.compute import CONTROLLED
from faultgouge.studies.yielding.page import numbers, rows_of, text, write_lasting

DOCS = Path(__file__).parents[2] / "docs"
ROWS, FAILED = rows_of(DOCS / "yield" / "tables" / "quartz_100.jsonl")


def test_the_page_is_that_of_its_table():
    assert (DOCS / "yield" / "yield.md").read_text() == text(numbers(ROWS), len(ROWS), FAILED)


def test_layers_without_loss_flow_below_their_static_yield_and_lossy_ones_do_not():
    assert all(row["static"] >= row["newton"] for row in ROWS)
    undamped, *lossy = numbers(ROWS)["yields"]
    assert undamped["flow"] > len(ROWS) / 2
    assert undamped["share"][2] < 1
    assert all(each["flow"] == 0 and each["share"] == [1, 1, 1] for each in lossy)


def test_with_more_loss_the_same_layers_flow_as_the_load_rises():
    """And all of them beyond the end of Newton's branch."""
    flowing = {0.9: [], 0.5: [], 0.1: []}
    for k, row in enumerate(ROWS):
        for run in row["loading"]:
            assert run["flows"] is None or row["newton"] < run["flows"] < row["static"]
            if run["rate"] == CONTROLLED and run["flows"] is not None and run["restitution"] in flowing:
                flowing[run["restitution"]].append(k)
    assert flowing[0.9] == flowing[0.5] == flowing[0.1] != []


def test_disks_that_carry_nothing_have_no_part_in_d(reference_packing):
    packing = reference_packing(1.0)
    position = packing.position + 1e-3
    position[packing.rattlers] += 1.0
    assert len(packing.rattlers) > 0
    assert distance(packing, replace(packing, position=position)) == pytest.approx(2e-6, rel=1e-9)


def test_the_page_of_layers_left_to_themselves_is_that_of_its_tables_and_other_pages_say_the_same(tmp_path):
    shutil.copytree(DOCS / "yield" / "tables", tmp_path / "tables")
    written = write_lasting(tmp_path).read_text()
    assert (DOCS / "yield" / "further.md").read_text() == written
    referee = " ".join((DOCS / "modes" / "referee.md").read_text().split())
    assert "restitution 0.9, 5 of 20 (11 to 47 %) layers vibrate" in " ".join(written.split())
    assert "[lossy layers](../yield/further.md), 5 of 20, vibrate" in referee
    assert "5 of 20 vibrate on" in referee
