"""LAMMPS's own decks, of which the repository has none: the changes of their text, and the page of the table."""

import pytest

from research.lammps_examples.compute import DECKS, Deck
from research.lammps_examples.make import HERE, TABLE, page
from research.tables import read_rows


def test_the_page_has_the_rows_of_the_table():
    assert (HERE / "README.md").read_text() == page()
    decks = [(deck.file, deck.change) for deck in DECKS]
    rows = [(row["deck"], row["change"]) for row in read_rows(TABLE)]
    assert set(rows) <= set(decks)
    assert len(set(rows)) == len(rows)


def test_changes_of_a_deck(tmp_path):
    (tmp_path / "in.pour").write_text("units lj\nfix grav all gravity 1 chute 26\nrun\t 100\nrun 5\n")
    deck = Deck("in.pour", replaces={"chute 26": "chute 15"}, until="run 100", adds=("unfix grav",))
    assert deck.text(tmp_path) == "units lj\nfix grav all gravity 1 chute 15\nunfix grav\n"
    with pytest.raises(ValueError, match=r"in\.pour has no 'chute 30'"):
        Deck("in.pour", replaces={"chute 30": ""}).text(tmp_path)
