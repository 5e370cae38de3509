"""faultgouge import DECK.in: what commands hide, decks that end early, and odd surroundings."""

import os
import re
import subprocess

import h5py
import pytest
from pile_decks import DECK, FLAT, ROUND
from reference_layer import BIN

from faultgouge.analysis.files.configuration_file import read_configuration


def test_deck_that_moves_its_own_file(faultgouge_here, tmp_path):
    deck = DECK.format(**FLAT, word="contacts") + "shell mv pile.in done.in\n"
    (tmp_path / "pile.in").write_text(deck)
    faultgouge_here("import", "pile.in", "-o", "pile.h5")
    with h5py.File(tmp_path / "pile.h5") as file:
        assert file.attrs["deck"] == deck


EARLY = {
    "if": 'if "1 > 0" then "quit 3"',
    "every": 'run 10 every 5 "quit 0"',
    "error": "read_restart none.restart",
    "jump": "jump SELF nowhere",
}


@pytest.mark.long
@pytest.mark.ranks
@pytest.mark.parametrize("way", EARLY)
def test_decks_that_end_early_on_two_ranks(faultgouge, tmp_path, monkeypatch, way):
    """At quit the state is there, and after an error it is kept; no temporary file and no lock is left."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    deck = DECK.format(**FLAT, word="contacts").replace("run 6000", f"run 60\n{EARLY[way]}")
    (tmp_path / "pile.in").write_text(f"log none\n{deck}")
    quits = way in ("if", "every")
    done = faultgouge("import", "pile.in", "-o", "pile.h5", "--balance", "1e9", ranks=2, code=0 if quits else 1)
    if quits:
        assert "3 disks, " in done.stdout
    else:
        (says,) = [line for line in done.stderr.splitlines() if line.startswith("Error: ")]
        assert re.search("LAMMPS stopped: .* is kept in pile.restart", says)
    left = {each.name for each in tmp_path.iterdir()} - {"pile.in", "temporary", "log.lammps"}
    assert left == ({"pile.h5"} if quits else {"pile.restart", "pile.restart.in"})
    assert not any(temporary.iterdir())


def test_what_cannot_be_taken_is_kept_unless_the_deck_takes_it_away(faultgouge_here, tmp_path):
    deck = DECK.format(**ROUND, word="contacts").replace("boundary f f", "boundary p p").replace("6000", "100")
    deck = deck.replace("timestep", "fix push all press/berendsen x 0.0 ${kn} 10.0\ntimestep")
    (tmp_path / "long.in").write_text(deck)
    last = faultgouge_here("import", "long.in", code=1).stderr.splitlines()[-1]
    assert "fix push press/berendsen moves" in last
    assert "is kept in packing.restart" in last
    (tmp_path / "fine.in").write_text(f"{deck}unfix push\nrun 6000\n")
    assert "3 spheres, " in faultgouge_here("import", "fine.in", "-o", "fine.h5", "--balance", "1e-3").stdout


CLOSED = ["<&- >&- 2>&-", *(pytest.param(each, marks=pytest.mark.long) for each in ("<&-", ">&-", "2>&-"))]


@pytest.mark.parametrize("closed", CLOSED)
def test_closed_streams(tmp_path, closed):
    """No file of results is taken for a stream that was closed."""
    (tmp_path / "pile.in").write_text(DECK.format(**FLAT, word="contacts"))
    done = subprocess.run(f"{BIN}/faultgouge import pile.in -o pile.h5 {closed}", shell=True, cwd=tmp_path, check=False)
    assert done.returncode == 0
    assert read_configuration(tmp_path / "pile.h5").residual < 1e-6


@pytest.mark.long
def test_names_that_the_locale_cannot_decode(tmp_path):
    (tmp_path / "häufchen.in").write_text(DECK.format(**FLAT, word="contacts"))
    words = [BIN / "faultgouge", "import", "häufchen.in", "-o", "häufchen.h5"]
    plain = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0"}
    done = subprocess.run(words, cwd=tmp_path, env=plain, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "written to häufchen.h5\n" in done.stdout.decode()
    assert len(read_configuration(tmp_path / "häufchen.h5")) == 3
