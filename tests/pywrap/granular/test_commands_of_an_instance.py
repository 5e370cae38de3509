"""The commands of an instance, by which laws are known: what is refused, and whose log it is."""

import numpy as np
import pytest
from granular_packings import HERTZ, MOVES, command, refused

import faultgouge

WALL = "fix w all wall/gran hertz/history 1e5 NULL 1 1 0.5 1 zplane 0 NULL"
OPEN = r"The line of fix w wall/gran does not say where the wall is: give all of"
TABLE = [
    # more lines of the instance, a change of what is told of it, and the words that name the culprit
    (f"{WALL} shear x 1 contacts{MOVES}", {}, "change with the time, though nothing moves"),
    ("fix r all rigid group 1 all", {}, "together in bodies that may rotate"),
    ("fix m all move linear 0 0 0", {}, "fix m move moves or holds particles"),
    (f"fix s all setforce 0 1 NULL{MOVES}", {}, "drives particles"),
    ("", {}, "Nothing moves"),
    (MOVES, {}, "The packing moves: the residual of particle [12] at .* and 1 more is out of balance"),
    (MOVES, None, "no log to read its commands from: give the lines pair_style"),
    (MOVES, {"history 1e5": "history 2e5"}, "normal forces of the contacts of types 1 and 1 are not those"),
    (MOVES, {"gran/hertz": "gran/hooke"}, "pair_style gran/hooke/history, and the instance has gran/hertz"),
    (MOVES, {"1e5": "${kn}"}, "has a variable: write its number"),
    (MOVES, {"pair_style": "# "}, "no pair_style"),
    (MOVES, {"* *": "A A"}, r"do not stand alone \(LAMMPS stopped: .*\): give the lines"),
    *((WALL + MOVES, {cut: ""}, OPEN) for cut in (WALL[len("fix w all wall/gran") :], " zplane 0 NULL", " 0 NULL")),
]


@pytest.mark.parametrize(("more", "changes", "says"), TABLE)
def test_what_is_refused(two, more, changes, says):
    lmp, told = two(HERTZ, "* *", more.strip())
    text = "\n".join(told)
    for before, after in (changes or {}).items():
        text = text.replace(before, after)
    with refused(says) as refusal:
        faultgouge.from_lammps(lmp, None if changes is None else text)
    assert "\n" not in str(refusal.value)


PRINTS = 'print "pair_style gran/hooke/history 1 1 1 1 1 1"\nvariable word index clear\nprint "${word}"\n'
PRINTS += 'print "${word}" screen no\npair_coeff * *\nprint clear\nprint """\nclear\nfix move all nve/limit 1\n"""\n'
RUNS = 'fix says all print 1 "unfix move"\nrun 2\nrun 2\nunfix says\nrun 4 every 2 "print done"\nrun 1 post no'


@pytest.mark.parametrize("more", ["pair_coeff * *", PRINTS, f"pair_coeff * *\n{RUNS}"], ids=["log", "print", "runs"])
def test_commands_of_a_log_that_a_deck_has_begun(two, tmp_path, more):
    """A log of the command `log` does not begin with the version of LAMMPS. What a deck prints is no command, nor what
    `fix print` writes in runs, at their beginning, too."""
    lmp, told = two(HERTZ, "* *", MOVES.strip())
    (tmp_path / "deck.in").write_text("\n".join([f"log {tmp_path}/own.log", told[0], *told[2:], more, ""]))
    lmp.file(str(tmp_path / "deck.in"))
    # one text is as good as many lines, and a comment is none of the command
    text = "\n".join(told) + "  # ${comment}"
    found, other, same = (faultgouge.from_lammps(lmp, each, balance=np.inf) for each in (None, told, text))
    assert found == other == same
    assert found.free.all()  # by fix move


def test_a_log_that_two_instances_write(two, lammps_with, tmp_path):
    """The commands in it may be those of the other one."""
    lmp, told = two(HERTZ, "* *", MOVES.strip())
    command(lmp, "\n".join([f'log "{tmp_path}/log.lammps"', *told]))
    lammps_with()
    with refused(r"log of another LAMMPS, too: give each LAMMPS a log of its own"):
        faultgouge.from_lammps(lmp, balance=np.inf)
