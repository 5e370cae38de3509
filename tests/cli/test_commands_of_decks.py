"""faultgouge import DECK.in: each command is carried out once, what commands hide, and decks that end early."""

import os
import re
import subprocess
from functools import partial

import h5py
import pytest
from pile_decks import DECK, FLAT, ROUND
from reference_layer import BIN

from faultgouge.analysis.files.configuration_file import read_configuration


def test_what_variables_hide_is_not_refused(faultgouge_here, tmp_path):
    """The fix of a variable's name is gone in the end, which no line of the deck says as it stands."""
    deck = DECK.format(**FLAT, word="contacts").replace(
        "fix move",
        "fix start all nve/limit 0.01\nvariable name string start\nrun 10\nunfix ${name}\nfix move",
    )
    (tmp_path / "start.in").write_text(deck)
    assert "3 disks, " in faultgouge_here("import", "start.in", "-o", "start.h5").stdout


def test_fixes_with_variables_are_refused_before_the_run(faultgouge_here, tmp_path):
    deck = DECK.format(**ROUND, word="contacts").replace("run 6000", "run 1000000000")
    deck = deck.replace("boundary f f", "boundary p p")
    for lines, says in (
        (
            "fix top all wall/gran hertz/history ${kn} 1 1 1 1 1 zplane NULL 4 shear x ${kn} contacts",
            "The wall .* moves",
        ),
        ("fix push all nph/sphere x 0.0 ${kn} 10.0", "fix push nph/sphere moves the box"),
        ("fix push all press/berendsen x 0.0 ${kn} 10.0", "fix push press/berendsen moves the box"),
    ):
        (tmp_path / "long.in").write_text(deck.replace("timestep", f"{lines}\ntimestep"))
        assert re.search(f"long.in: {says}", faultgouge_here("import", "long.in", code=2).stderr)


LOOP = """fix start all deform 1 x erate 0.0
label again
variable i loop 3
run 1000
if "$i == 2" then "unfix start"
next i
jump SELF again
run 6000"""


def test_deck_with_a_loop(faultgouge_here, tmp_path):
    """What the loop sets up before its first run stays, unless a line of the loop says otherwise."""
    deck = DECK.format(**FLAT, word="contacts")
    fine = deck.replace("run 6000", LOOP).replace("boundary f f", "boundary p f")
    (tmp_path / "fine.in").write_text(fine)
    assert "3 disks, " in faultgouge_here("import", "fine.in", "-o", "fine.h5").stdout
    (tmp_path / "long.in").write_text(fine.replace("unfix start", "print $i").replace("run 1000", "run 1000000000"))
    assert "long.in: fix start deform moves the box" in faultgouge_here("import", "long.in", code=2).stderr
    hertz = "gran/hertz/history ${kn} NULL 10 NULL 0.9 1"
    either = deck.replace(
        f"pair_style {hertz}", f"pair_style gran/hooke 1 NULL 1 NULL 1 1\nif '1 > 0' then 'pair_style {hertz}'"
    )
    (tmp_path / "either.in").write_text(either)
    assert "3 disks, " in faultgouge_here("import", "either.in", "-o", "either.h5").stdout


def test_deck_that_fix_halt_ends(faultgouge_here, tmp_path):
    """The kinetic energy falls to 1e-20 long before the last step."""
    halt = "variable slow equal ke\nfix stop all halt 100 v_slow < 1e-20 message no\nrun 100000000"
    (tmp_path / "halt.in").write_text(DECK.format(**FLAT, word="contacts").replace("run 6000", f"run 3000\n{halt}"))
    assert "3 disks, " in faultgouge_here("import", "halt.in", "-o", "halt.h5").stdout


def test_comments_with_variables(faultgouge_here, tmp_path):
    """LAMMPS fills in no variable of a comment, and logs such a command once."""
    deck = DECK.format(**FLAT, word="contacts").replace("pair_coeff * *", "pair_coeff * *  # as ${kn} above")
    deck = deck.replace("fix move all nve/sphere", "fix move all nve/sphere  # $x and $y")
    (tmp_path / "said.in").write_text(deck)
    assert "3 disks, " in faultgouge_here("import", "said.in", "-o", "said.h5").stdout


@pytest.mark.ranks
def test_deck_without_commands_on_two_ranks(faultgouge, tmp_path):
    (tmp_path / "mute.in").write_text("log none\n" + DECK.format(**FLAT, word="contacts"))
    assert "No pair_style is in the log" in faultgouge("import", "mute.in", ranks=2, code=2).stderr


def test_deck_with_logs_of_its_own(faultgouge_here, tmp_path):
    """Commands are in three logs, one after the other."""
    deck = DECK.format(**FLAT, word="contacts").replace(
        "pair_style", "variable name string my\nlog ${name}_1.log\npair_style"
    )
    (tmp_path / "own.in").write_text(deck.replace("fix move", "log second.log\nfix move") + "log none\n")
    assert "3 disks, " in faultgouge_here("import", "own.in", "-o", "own.h5").stdout
    assert "fix move" in (tmp_path / "second.log").read_text()


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ("units lj", "echo screen\nunits lj", "No pair_style is in the log"),
        ("units lj", "log none\nunits lj", "leave out log none and echo"),
    ],
)
def test_decks_that_leave_no_commands(faultgouge_here, tmp_path, before, after, says):
    (tmp_path / "mute.in").write_text(DECK.format(**FLAT, word="contacts").replace(before, after))
    assert says in faultgouge_here("import", "mute.in", code=2).stderr


def test_deck_that_quit_ends(faultgouge_here, tmp_path):
    """Lines behind it are not read; a text that has the word is no command."""
    says = 'print """\nquit\n"""\n'
    (tmp_path / "quits.in").write_text(
        says + DECK.format(**FLAT, word="contacts") + "quit 1  # done\nno such command\n"
    )
    assert "3 disks, " in faultgouge_here("import", "quits.in", "-o", "quits.h5").stdout


def test_deck_that_clears_all(faultgouge_here, tmp_path):
    (tmp_path / "cleared.in").write_text(DECK.format(**FLAT, word="contacts") + "clear\n")
    assert "no pair_style after `clear`, which takes all away" in faultgouge_here("import", "cleared.in", code=1).stderr


def test_deck_that_moves_its_own_file(faultgouge_here, tmp_path):
    deck = DECK.format(**FLAT, word="contacts") + "shell mv pile.in done.in\n"
    (tmp_path / "pile.in").write_text(deck)
    faultgouge_here("import", "pile.in", "-o", "pile.h5")
    with h5py.File(tmp_path / "pile.h5") as file:
        assert file.attrs["deck"] == deck


ONCE = """
shell mkdir -p {out}
shell echo begun >> {out}/begun
variable before file count
variable now equal ${{before}}+1
print "${{now}}" file count screen no
if "$(is_file({out}/state.restart)) == 1" then "jump SELF again"
"""


@pytest.mark.parametrize("again", [False, True])
def test_each_command_is_carried_out_once(faultgouge_here, tmp_path, again):
    """A file that counts, one outside of the folder, a restart that the deck reads if there is one, and a copy."""
    folder, out = tmp_path / "own", tmp_path / "out"
    folder.mkdir()
    (folder / "count").write_text("7\n")
    (folder / "precious.data").write_text("made by hand\n")
    deck = DECK.format(**FLAT, word="contacts")
    made, law = deck[: deck.index("variable kn")], deck[deck.index("variable kn") :]
    keeps = f"shell cp precious.data old.data\nwrite_data precious.data\nrestart 6000 {out}/state.restart"
    law = law.replace("run 6000", f"{keeps} {out}/state.restart\nrun 6000")
    once = ONCE.format(out=out) if again else ONCE.format(out=out).rpartition("if")[0]
    reads = f"jump SELF ready\nlabel again\nread_restart {out}/state.restart\nlabel ready\n" if again else ""
    (folder / "pile.in").write_text(once + made + reads + law)
    for time in range(1 + again):
        done = faultgouge_here("import", "own/pile.in", "-o", f"pile{time}.h5")
        assert "3 disks, 0 contacts between them and 3 with walls" in done.stdout
        assert (folder / "count").read_text() == f"{8 + time}\n"
        assert (out / "begun").read_text() == "begun\n" * (1 + time)
        if time == 0:
            assert (folder / "old.data").read_text() == "made by hand\n"


EARLY = {
    "if": 'if "1 > 0" then "quit 3"',
    "include": "include end.inc",
    "variable": "variable end string quit\n${end}",
    "every": 'run 10 every 5 "quit 0"',
    "error": "read_restart none.restart",
    "jump": "jump SELF nowhere",
}


ON_TWO_RANKS = [pytest.param(way, 2, marks=() if way in ("if", "error") else pytest.mark.long) for way in EARLY]


@pytest.mark.ranks
@pytest.mark.parametrize(("way", "ranks"), [*((way, 1) for way in EARLY), *ON_TWO_RANKS])
def test_decks_that_end_early(faultgouge, faultgouge_here, tmp_path, monkeypatch, way, ranks):
    """One sentence, no file of results, no temporary file, no lock."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    (tmp_path / "end.inc").write_text("quit\n")
    (tmp_path / "pile.in").write_text(DECK.format(**FLAT, word="contacts").replace("run 6000", f"run 60\n{EARLY[way]}"))
    stopped = way in ("error", "jump")  # `quit` would end this process
    run = faultgouge_here if stopped and ranks == 1 else partial(faultgouge, ranks=ranks)
    done = run("import", "pile.in", "-o", "pile.h5", code=1)
    says = [line for line in done.stderr.splitlines() if line.startswith("Error: ")]
    assert len(says) == 1
    assert ("LAMMPS stopped: " if stopped else "as LAMMPS does at quit, which a deck") in says[0]
    assert not [each.name for each in tmp_path.iterdir() if "pile.h5" in each.name]
    assert not any(temporary.iterdir())


@pytest.mark.ranks
@pytest.mark.long
def test_empty_deck_on_two_ranks(faultgouge, tmp_path):
    (tmp_path / "empty.in").write_text("")
    assert "No pair_style is in the log" in faultgouge("import", "empty.in", ranks=2, code=2).stderr


@pytest.mark.parametrize(
    "closed", ["<&- >&- 2>&-", *(pytest.param(each, marks=pytest.mark.long) for each in ("<&-", ">&-", "2>&-"))]
)
def test_closed_streams(tmp_path, closed):
    """No file of results is taken for a stream that was closed."""
    (tmp_path / "pile.in").write_text(DECK.format(**FLAT, word="contacts"))
    done = subprocess.run(f"{BIN}/faultgouge import pile.in -o pile.h5 {closed}", shell=True, cwd=tmp_path, check=False)
    assert done.returncode == 0
    assert read_configuration(tmp_path / "pile.h5").residual < 1e-6


def test_deleted_folder(tmp_path):
    """Of the shell in which the command is called."""
    (tmp_path / "pile.in").write_text(DECK.format(**FLAT, word="contacts"))
    (tmp_path / "gone").mkdir()
    words = f"cd gone && rmdir ../gone && {BIN}/faultgouge import {tmp_path}/pile.in"
    done = subprocess.run(words, shell=True, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == ("Error: the folder in which this command was called has been deleted: go to another one\n")


def test_names_that_the_locale_cannot_decode(tmp_path):
    (tmp_path / "häufchen.in").write_text(DECK.format(**FLAT, word="contacts"))
    words = [BIN / "faultgouge", "import", "häufchen.in", "-o", "häufchen.h5"]
    plain = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0"}
    done = subprocess.run(words, cwd=tmp_path, env=plain, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "written to häufchen.h5\n" in done.stdout.decode()
    assert len(read_configuration(tmp_path / "häufchen.h5")) == 3


@pytest.mark.parametrize("before", ["pair_style", "fix load"])
def test_the_line_of_a_deck_that_hides_commands_is_named(faultgouge_here, tmp_path, before):
    """A user of the command has no script in Python to which he could give commands."""
    text = DECK.format(**FLAT, word="contacts").replace(f"\n{before}", f"\nlog none\n{before}", 1)
    (tmp_path / "quiet.in").write_text(text)
    said = faultgouge_here("import", "quiet.in", code=None).stderr
    assert "from_lammps" not in said
    assert "commands" not in said.partition("give")[2]
    number = 1 + text.splitlines().index("log none")
    assert before == "pair_style" or f"line {number}, `log none`, may keep it out of LAMMPS's log" in said
