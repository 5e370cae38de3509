"""The study of both laws at the same equilibria: its page, and the tables of docs/modes."""

import json
from pathlib import Path

import pytest

from research.laws_at_the_bound.make import HERE, TABLES, read_table, write_page

MODES = Path(__file__).parents[2] / "research" / "modes" / "tables"


def test_the_page_is_what_the_tables_make(tmp_path):
    assert write_page(tmp_path).read_text() == (HERE / "README.md").read_text()


def test_the_smoothed_law_is_that_of_the_tables_of_many_modes():
    known = {row["seed"]: row for row in map(json.loads, (MODES / "loss_100.jsonl").read_text().splitlines())}
    compared = 0
    for row in read_table(TABLES / "mu_1.jsonl"):
        before = {each["fx_over_fy"]: each for each in known[row["seed"]]["loads"]}
        if row["contacts"] != known[row["seed"]]["contacts"]:
            continue  # another build settled this seed to another packing
        for each in row["loads"]:
            other, smooth = before[each["fx_over_fy"]], each["smooth"]
            assert other["pairs"] == smooth["pairs"]
            assert smooth["growth_rate"] == pytest.approx(other["growth_rate"], rel=1e-5)
            assert smooth["damped"] == [pytest.approx(found, rel=1e-4) for found in other["damped"][1:3]]
            compared += 1
    assert compared > 20
