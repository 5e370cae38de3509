"""The page on loads that rise: it comes out of the committed tables, and the tables bear what it says."""

import pytest

from research.rising.compute import RATES, RESTITUTIONS
from research.rising.make import HERE, VIBRATES, check, numbers, write_page

FOUND = numbers()


def test_the_page_is_what_the_tables_make(tmp_path):
    assert write_page(tmp_path).read_text() == (HERE / "README.md").read_text()


def test_layers_that_rest_under_a_load_that_is_held_vibrate_under_one_that_rises():
    at, smoothed = FOUND["usual"][0.2], FOUND["smoothed"][0.2]
    assert at["packings"] == smoothed["packings"] > 3
    assert at["grows"]["count"] == at["sticking"]["count"] == 0
    assert smoothed["grows"]["count"] > 0.8 * smoothed["packings"]
    assert at["rising"]["vibrate"]["low"] > 0.2
    # without contacts at the bound nothing vibrates
    assert FOUND["lammps"]["control"] == 0


def test_lammps_vibrates_where_one_sided_motion_does_and_as_much():
    lammps = FOUND["lammps"]
    assert lammps["compared"] == FOUND["usual"][0.2]["packings"]
    slow = str(min(RATES))
    for row in (each for each in lammps["rows"] if each["rising"]["steady"]):
        vibrates = row["lammps"][slow]["vibration"] > VIBRATES * row["lammps"][slow]["drift"]
        assert vibrates == (row["ratio"] > VIBRATES)
    assert lammps["near"][0] == pytest.approx(1, abs=0.02)
    # the two layers that vibrate otherwise than one-sided motion says are on the page, by their seeds
    assert [seed for seed, _ in lammps["apart"]] == [11, 15]
    assert lammps["both"] == 17


def test_pages_have_the_count_of_the_tables():
    said = "{count} of {of} layers with".format(**FOUND["usual"][0.2]["rising"]["vibrate"])
    for page in ("README.md", "paper/paper.md"):
        assert said in " ".join((HERE.parents[1] / page).read_text().split()), page


def test_no_seed_is_left_out():
    assert {cell["restitution"] for cell in FOUND["cells"]} == set(RESTITUTIONS)
    counts = [cell["packings"] for cell in FOUND["cells"]]
    ended = sum(len(row) > 0 for row in FOUND["ended"])
    assert max(counts) == FOUND["seeds"]
    assert min(counts) >= FOUND["seeds"] - ended


@pytest.mark.long
def test_the_first_seed_comes_out_again():
    assert check() == []
