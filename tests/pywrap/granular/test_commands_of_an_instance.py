"""The commands of an instance, by which laws are known: what is refused, and whose log it is."""

import numpy as np
import pytest
from granular_packings import HERTZ, MOVES, command


@pytest.mark.parametrize(
    ("pair", "coefficients", "more", "says"),
    [
        (HERTZ, "* *", "fix w all wall/gran hertz/history 1e5 NULL 1 1 0.5 1 zplane 0 NULL shear x 1 contacts" + MOVES,
         "without shear"),
        (HERTZ, "* *", "fix r all rigid group 1 all", "together in bodies that may rotate"),
        (HERTZ, "* *", "fix m all move linear 0 0 0", "unfix it, and let the packing come to rest"),
        (HERTZ, "* *", "fix s all setforce 0 1 NULL" + MOVES, "drives particles"),
        (HERTZ, "* *", "", "Nothing moves"),
        (HERTZ, "* *", MOVES + "\nfix again all nve/sphere", "fix move and fix again both move 2 particles"),
        (HERTZ, "* *", MOVES + "\nfix again all nve", "fix move and fix again both move 2 particles"),
        (HERTZ, "* *", MOVES, "The packing moves: the residual of particle [12] at .* and 1 more is out of balance"),
    ],
)  # fmt: skip
def test_what_is_refused(two, pair, coefficients, more, says):
    from faultgouge.pywrap import NotTakenError, from_lammps

    lmp, told = two(pair, coefficients, more.strip())
    with pytest.raises(NotTakenError, match=says) as refusal:
        from_lammps(lmp, told)
    assert "\n" not in str(refusal.value)


def test_commands_that_are_not_those_of_the_instance(two):
    from faultgouge.pywrap import NotTakenError, from_lammps

    lmp, told = two(HERTZ, "* *", MOVES.strip())
    with pytest.raises(NotTakenError, match=r"no log to read its commands from: give the lines pair_style"):
        from_lammps(lmp)
    other = [told[0].replace("1e5", "2e5"), *told[1:]]
    with pytest.raises(NotTakenError, match=r"normal forces of the contacts of types 1 and 1 are not those"):
        from_lammps(lmp, other)
    with pytest.raises(NotTakenError, match=r"pair_style gran/hooke/history, and the instance has gran/hertz"):
        from_lammps(lmp, ["pair_style gran/hooke/history 1 1 1 1 1 1"])
    with pytest.raises(NotTakenError, match="has a variable: write its number"):
        from_lammps(lmp, ["pair_style gran/hertz/history ${kn} 1 1 1 1 1"])
    with pytest.raises(NotTakenError, match="no pair_style"):
        from_lammps(lmp, told[2:])
    with pytest.raises(NotTakenError, match=r"do not stand alone \(LAMMPS stopped: .*\): give the lines") as refusal:
        from_lammps(lmp, [told[0], "pair_coeff A A", *told[2:]])
    assert "\n" not in str(refusal.value)
    # a comment is none of the command, and one text is as good as many lines
    whole = from_lammps(lmp, "\n".join([*told[:-1], f"{told[-1]}  # ${{comment}}"]), balance=np.inf)
    assert whole == from_lammps(lmp, told, balance=np.inf)


@pytest.mark.parametrize("given", ["", " hertz/history 1e5 NULL 1 1 0.5 1", " hertz/history 1e5 NULL 1 1 0.5 1 zplane"])
def test_a_line_of_a_wall_that_is_not_whole(two, given):
    from faultgouge.pywrap import NotTakenError, from_lammps

    wall = "fix w all wall/gran hertz/history 1e5 NULL 1 1 0.5 1 zplane 0 NULL"
    lmp, told = two(HERTZ, "* *", wall + MOVES)
    lines = [f"fix w all wall/gran{given}" if line == wall else line for line in told]
    with pytest.raises(
        NotTakenError, match=r"^The line of fix w wall/gran does not say where the wall is: give all of"
    ):
        from_lammps(lmp, lines, balance=np.inf)


def test_commands_of_a_log_that_a_deck_has_begun(two, tmp_path):
    """A log of the command `log` does not begin with the version of LAMMPS."""
    from faultgouge.pywrap import from_lammps

    lmp, told = two(HERTZ, "* *", MOVES.strip())
    lmp.command(f'log "{tmp_path}/own.log"')
    command(lmp, "\n".join(told))
    assert len(from_lammps(lmp, balance=np.inf).contacts) == 1


PRINTS = '''print "pair_style gran/hooke/history 1 1 1 1 1 1"
variable word index clear
print "${word}"
print "${word}" screen no
pair_coeff * *
print clear
print """
clear
fix move all nve/limit 1
"""
'''


def test_what_a_deck_prints_is_no_command(two, tmp_path):
    from faultgouge.pywrap import from_lammps

    lmp, told = two(HERTZ, "* *", MOVES.strip())
    (tmp_path / "deck.in").write_text("\n".join([f"log {tmp_path}/own.log", told[0], *told[2:], PRINTS]))
    lmp.file(str(tmp_path / "deck.in"))
    assert from_lammps(lmp, balance=np.inf) == from_lammps(lmp, told, balance=np.inf)


def test_a_log_that_two_instances_write(two, lammps_with, tmp_path):
    """The commands in it may be those of the other one."""
    from faultgouge.pywrap import NotTakenError, from_lammps

    lmp, told = two(HERTZ, "* *", MOVES.strip())
    lmp.command(f'log "{tmp_path}/log.lammps"')
    command(lmp, "\n".join(told))
    lammps_with()
    with pytest.raises(NotTakenError, match=r"log of another LAMMPS, too: give each LAMMPS a log of its own"):
        from_lammps(lmp, balance=np.inf)
