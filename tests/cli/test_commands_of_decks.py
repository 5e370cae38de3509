"""faultgouge import DECK.in: what commands hide, decks that end early, and odd surroundings."""

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


EARLY = ['if "1 > 0" then "quit 3"', 'run 10 every 5 "quit 0"', "read_restart none.restart", "jump SELF nowhere"]


@pytest.mark.long
@pytest.mark.ranks
@pytest.mark.parametrize("way", EARLY)
def test_decks_that_end_early_on_two_ranks(faultgouge, tmp_path, monkeypatch, way):
    """At quit the state is there, and after an error it is kept; no temporary file and no lock is left."""
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    deck = DECK.format(**FLAT, word="contacts").replace("run 6000", f"run 60\n{way}")
    (tmp_path / "pile.in").write_text(f"log none\n{deck}")
    quits = "quit" in way
    done = faultgouge("import", "pile.in", "-o", "pile.h5", "--balance", "1e9", ranks=2, code=0 if quits else 1)
    says = "3 disks, " if quits else "(?m)^Error: .*LAMMPS stopped: .* is kept in pile.restart"
    assert re.search(says, done.stdout if quits else done.stderr)
    left = {str(each.relative_to(tmp_path)) for each in tmp_path.rglob("*")}
    kept = {"pile.h5"} if quits else {"pile.restart", "pile.restart.in"}
    assert left - {"log.lammps"} == kept | {"pile.in", "temporary"}


def test_what_cannot_be_taken_is_kept_unless_the_deck_takes_it_away(faultgouge_here, tmp_path):
    deck = DECK.format(**ROUND, word="contacts").replace("boundary f f", "boundary p p").replace("6000", "100")
    deck = deck.replace("timestep", "fix push all press/berendsen x 0.0 ${kn} 10.0\ntimestep")
    (tmp_path / "long.in").write_text(deck)
    last = faultgouge_here("import", "long.in", code=1).stderr.splitlines()[-1]
    assert re.search("fix push press/berendsen moves .* is kept in packing.restart", last)
    (tmp_path / "fine.in").write_text(f"{deck}unfix push\nrun 6000\n")
    assert "3 spheres, " in faultgouge_here("import", "fine.in", "-o", "fine.h5", "--balance", "1e-3").stdout


PLAIN = "LC_ALL=C PYTHONUTF8=0"
"""A locale that cannot decode all names."""


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [("pile", "", "<&- >&- 2>&-"),
     *(pytest.param(*each, marks=pytest.mark.long) for each in
       (("pile", "", "<&-"), ("pile", "", ">&-"), ("pile", "", "2>&-"), ("häufchen", PLAIN, "")))],
)  # fmt: skip
def test_closed_streams_and_names_that_the_locale_cannot_decode(tmp_path, name, before, after):
    """No file of results is taken for a stream that was closed."""
    (tmp_path / f"{name}.in").write_text(DECK.format(**FLAT, word="contacts"))
    command = f"{before} {BIN}/faultgouge import {name}.in -o {name}.h5 {after}"
    done = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=not after, check=False)
    assert done.returncode == 0
    assert after or f"written to {name}.h5\n" in done.stdout.decode()
    assert read_configuration(tmp_path / f"{name}.h5").residual < 1e-6
