"""The page on loads that rise: it comes out of the committed tables, and the tables bear what it says."""

import re

import pytest

from research.rising.compute import APART, RATES, RESTITUTIONS
from research.rising.make import HERE, ONSETS, VIBRATES, check, numbers
from research.statistics import count_of
from research.tables import read_rows

FOUND = numbers()


def test_layers_that_rest_under_a_load_that_is_held_vibrate_under_one_that_rises():
    at, smoothed = FOUND["usual"][0.2], FOUND["smoothed"][0.2]
    assert at["packings"] == smoothed["packings"] > 3
    assert at["grows"]["count"] == at["sticking"]["count"] == 0
    assert smoothed["grows"]["count"] > 0.8 * smoothed["packings"]
    assert at["rising"]["vibrate"]["low"] > 0.2
    # without contacts at the bound nothing vibrates
    assert FOUND["in_lammps"]["control"] == 0
    assert FOUND["in_lammps"]["layers"] == at["packings"]


def test_from_each_start_and_over_the_same_span_lammps_vibrates_as_one_sided_motion_does():
    rows = FOUND["both_starts"] + FOUND["elsewhere"]
    assert len(rows) == 2 * len({(row["seed"], row["fx_over_fy"], row["restitution"]) for row in rows})
    for row in (each for each in rows if each["one_sided"]["steady"]):
        moving = row["lammps"][str(min(RATES))]
        assert moving["drift"] == pytest.approx(row["one_sided"]["drift"], abs=2 * row["one_sided"]["drift_error"])
        assert row["vibrates"] == (moving["vibration"] > VIBRATES * moving["drift"])
        assert row["within"] or not row["vibrates"]


def test_from_the_same_start_lammps_vibrates_as_one_sided_motion_does():
    """To 2 %: means over eight windows of a motion that is not periodic."""
    rows = {row["seed"]: row for row in FOUND["starts"]}
    assert tuple(rows) == APART
    for row in rows.values():
        for one, other in zip(row["one_sided"], row["lammps"], strict=True):
            assert one["steady"]
            assert other["steady"]
            assert other["vibration"] == pytest.approx(one["vibration"], rel=0.02)


def test_growth_over_load_and_loss_is_that_of_both_tables():
    """Weaker loss stops less, larger loads bring more, and at a large Q both laws have growth."""
    for law in ("smooth", "loaded"):
        rows = [row for row in FOUND["over_quality"] if row["law"] == law]
        shares = [[count["share"] for count in row["counts"].values()] for row in rows]
        assert all(few == sorted(few) for few in shares)
        assert all(list(few) == sorted(few) for few in zip(*shares, strict=True))
    assert all(row["smooth"]["count"] >= row["loaded"]["count"] for row in FOUND["over_loss"])
    rows = read_rows(ONSETS)
    assert [row["seed"] for row in rows] == list(range(1, len(rows) + 1)) == FOUND["onset_seeds"]
    for row in rows:
        if row["0.99"] is not None and row["0.9"] is not None:
            assert row["undamped"] < row["0.99"] < row["0.9"]


def test_pages_have_the_count_of_the_tables_and_no_seed_is_left_out():
    """Quasi-static counts with their intervals, and those of layers that are loaded at the smallest rate."""
    slow = next(each for each in FOUND["loaded"] if (each["law"], each["rate"]) == ("coulomb", 1e-4))
    for page in ("README.md", "paper/results.md"):
        text = " ".join((HERE.parents[1] / page).read_text().split())
        for each in (FOUND["usual"][0.2]["rising"]["vibrate"], slow["slip"]):
            interval = count_of(each).split("(")[1][:-1]
            assert re.search(rf"{each['count']} of {each['of']}\b[\w ]*\({interval}", text), page
        assert "{:.2g} of its way (median; {:.2g} to {:.2g})".format(*slow["part"]) in text, page
    at = {row["law"]: row["counts"][300] for row in FOUND["over_quality"] if row["load"] == 0.2}
    counts = at["smooth"]["count"], at["loaded"]["count"], at["smooth"]["of"]
    said = "Q = 300, motion grows in {} and {} of {}".format(*counts)
    assert said in " ".join((HERE.parents[1] / "README.md").read_text().split())
    assert {cell["restitution"] for cell in FOUND["cells"]} == set(RESTITUTIONS)
    packings = [cell["packings"] for cell in FOUND["cells"]]
    assert max(packings) == FOUND["seeds"] <= min(packings) + sum(len(row) > 0 for row in FOUND["ended"])


@pytest.mark.long
def test_the_first_seed_comes_out_again():
    assert check() == []
