"""The verdict of a file and of a deck, and where a packing that grows ends in LAMMPS: command and Python."""

import json

import numpy as np
import pytest
from pile_decks import DECK, ROUND
from reference_layer import store

from faultgouge import load, stability
from faultgouge.analysis import Contacts, MindlinLaw, Packing

LAW = MindlinLaw(2e3, 6e2, 0.5, cn=0.5, ct=0.1, coulomb=True)
COLUMN = Packing(
    position=[[0.0, 0.49], [0.0, 1.48]], radius=[0.5] * 2, contacts=Contacts([0, 1], [-1, 0], np.zeros(2)), law=LAW,
    top=[False, True], fy=2e3 * 0.01**1.5,
)  # fmt: skip
"""A disk that is pressed onto another, and falls off it."""


@pytest.fixture
def stored(tmp_path):
    """A run.h5 with the column."""
    return store(tmp_path / "run.h5", COLUMN, about={"task": "ramp", "scene": "{}"})


def test_the_verdict_of_a_file_comes_first_and_as_json(faultgouge_here, stored):
    told = stability(stored)
    assert told.stable is False
    assert faultgouge_here("stability", stored).stdout == f"{told}\n"
    found = json.loads(faultgouge_here("stability", stored, "--json").stdout)
    inside = json.loads(faultgouge_here("spectrum", stored, "--json").stdout)["stability"]
    assert {key: found[key] for key in inside} == inside


def test_a_column_falls_in_lammps_and_the_verdict_says_so(faultgouge_here, stored):
    told = stability(load(stored), follow=True)
    assert (told.follow["ends"], told.follow["displacement"] > 0.1, told.first_change > 0) == ("flows", True, True)
    for command in ("stability", "spectrum"):
        said = faultgouge_here(command, stored, "--follow").stdout
        assert "LAMMPS goes on from there, and flows, at a displacement of" in said
    alone = stability(load(stored).configuration, follow=True)
    assert alone.follow is None
    assert "this packing has no LAMMPS behind it" in alone.remarks[-1]


def test_a_deck_is_run_and_judged(faultgouge_here, tmp_path):
    (tmp_path / "pile.in").write_text(DECK.format(**ROUND, word="contacts"))
    said = faultgouge_here("stability", "pile.in").stdout
    assert said.startswith("stable: ")
    assert json.loads(faultgouge_here("stability", "pile.in", "--json").stdout)["stable"] is True


@pytest.mark.long
def test_without_a_file_it_is_the_old_name_of_extremes(faultgouge_here, tmp_path):
    done = faultgouge_here("stability", "-o", "cases", "--quick")
    assert "is called faultgouge extremes now" in done.stderr
    assert json.loads((tmp_path / "cases" / "extremes.json").read_text())["cases"]
