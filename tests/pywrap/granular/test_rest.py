"""What rests and what does not: the scale of forces at walls of regions, and particles that leave the box."""

from contextlib import nullcontext

import numpy as np
import pytest
from granular_packings import deck, refused

import faultgouge
from faultgouge.analysis import BadInputError, FaultgougeError

LAW, PLANE = "hooke/history 1e4 3e3 20 10 0.5 1", "zplane 0 NULL"
REGION = f"""
region floor block -4 4 -4 4 0 8 side in open 1 open 2 open 3 open 4 open 6 units box
fix floor all wall/gran/region {LAW} region floor
fix move all nve/sphere
"""
WEIGHT = np.pi / 6
AT_REST = 0.5 - WEIGHT / 1e4


def ball(z: float, *others, law: str = LAW, wall: str = PLANE, more: str = "", **changes) -> str:
    """A sphere above a plane, and others."""
    return deck([(0, 0, z), *others], law, wall, more=f"fix move all nve/sphere\n{more}", **changes)


@pytest.mark.parametrize(("share", "rests"), [(1e-5, True), (1e-3, False)])
def test_a_sphere_on_a_region(lammps_with, share, rests):
    """Its weight is the scale of what is out of balance, though a region hands out no contacts."""
    lmp = lammps_with(deck([(0, 0, 0.5 - WEIGHT * (1 + share) / 1e4)], LAW, more=REGION))
    with nullcontext() if rests else refused("residual of particle 1 at .* is 0.000999 of the mean contact force"):
        faultgouge.from_lammps(lmp)
    found = faultgouge.from_lammps(lmp, balance=1e-4 if rests else 2 * share)
    assert found.residual == pytest.approx(share * WEIGHT, rel=1e-3)
    assert found.proof < 1e-4 if rests else found.proof is None


def test_velocities_of_what_is_taken_at_rest(lammps_with):
    """`fix freeze` leaves a particle its rotation, which contacts feel; forces may balance while a particle moves."""
    lmp = lammps_with(ball(AT_REST, (1.1, 0, 0.5), more="group held id 2\nfix hold held freeze"))
    lmp.commands_string("set group held omega 0 0.02 0\nvelocity all set 0.1 0 0")
    for differences in (False, True):
        held, moves = faultgouge.from_lammps(lmp, differences=differences).remarks[-2:]
        assert held.startswith("1 particle that no fix moves has velocities or rotations, up to 0.1 at the surface")
        assert moves.startswith("particles move by up to 0.1 ")
    lmp.commands_string("set group held omega 0 0 0\nvelocity all set 0 0 0")
    assert not any("move" in each for each in faultgouge.from_lammps(lmp).remarks)


def test_a_run_that_fix_halt_ends_brings_nothing_to_rest(lammps_with):
    """LAMMPS skips all further runs without a word."""
    ends = "variable high equal 1\nfix stop all halt 10 v_high > 0 error soft message no\nrun 20"
    lmp = lammps_with(ball(0.5, run=ends))
    with refused(r"^LAMMPS ended a run while the packing came to rest, as fix halt and"):
        faultgouge.relax(lmp)
    lmp.commands_string("unfix stop\ntimer timeout unlimited")
    with pytest.raises(BadInputError, match=r"^balance = -1 is refused"):
        faultgouge.relax(lmp, balance=-1.0)
    assert faultgouge.relax(lmp) < 1e-8


SHAKES = "fix heat all langevin 1e-6 1e-6 1.0 4711"
CREEPS = "opposes velocities alone and bears no"
NO_HISTORY = "granular hooke 1e4 20 tangential linear_nohistory 10 0.5"
LOST = f"group one id 1\nunfix floor\nfix floor one wall/gran {LAW} {PLANE}"
SWINGS = "variable f equal 0.05*sin(step*0.001)\nfix swing all addforce v_f 0 0"
RESTLESS = [
    (ball(0.4999, more=SHAKES), "in 10000 steps: .*; fix heat langevin shakes the particles by its temperature: unfix"),
    # without a tangential spring a sphere on a slope creeps
    (ball(0.4999, law="hooke 1e4 3e3 20 10 0.5 1", load="0.1 0 -1"), f"; the friction of gran/hooke {CREEPS}"),
    (ball(0.4999, law=NO_HISTORY, load="0.1 0 -1"), f"; the friction of linear_nohistory {CREEPS}"),
    (ball(0.4999, more=SWINGS), "^LAMMPS's forces change with the time, though nothing moves: a load, a wall or"),
    (ball(AT_REST, (2, 0, -1), more=LOST), "^1 particle left the box while the packing came to rest: delete"),
]


@pytest.mark.parametrize(("lines", "says"), RESTLESS)
def test_what_keeps_a_packing_from_resting_is_named(lammps_with, lines, says):
    lmp = lammps_with(lines)
    with pytest.raises(FaultgougeError, match=says):
        faultgouge.relax(lmp, steps=10_000)
    if SHAKES in lines:  # it is a drag where its temperature is zero
        lmp.command(SHAKES.replace("1e-6", "0.0"))
        assert faultgouge.relax(lmp) < 1e-8


@pytest.mark.long
def test_a_packing_so_stiff_that_rounding_moves_it(lammps_with):
    """An overlap of 5e-11 at a coordinate of 4: the rounding of the force is 1e-5 of the weight."""
    lmp = lammps_with(ball(4.5, law="hooke/history 1e10 3e9 2e4 1e4 0.5 1", wall="zplane 4 NULL", timestep=2e-6))
    assert 1e-8 < faultgouge.relax(lmp, steps=200_000) < 1e-4
    assert faultgouge.from_lammps(lmp).proof < 1e-3


def test_what_falls_or_flies_comes_to_rest(lammps_with):
    """Nothing touches anything in the first steps, so that nothing is out of balance; or drag alone acts."""
    faultgouge.relax(lmp := lammps_with(ball(6.0)))
    assert len(faultgouge.from_lammps(lmp).contacts) == 1
    lmp = lammps_with(ball(4.0, wall="", load="", more="velocity all set 0.1 0 0.2"), log="log.flies")
    assert (faultgouge.relax(lmp, steps=20_000), *lmp.numpy.extract_atom("v")[0]) == (0.0, 0.0, 0.0, 0.0)


def test_a_packing_of_rrespa(lammps_with):
    """Its copies take steps of velocity Verlet; the instance goes on with its own."""
    lmp = lammps_with(deck([(0, 0, AT_REST)], LAW, more=REGION, run="run_style respa 2 2 pair 1\nrun 0"))
    assert faultgouge.from_lammps(lmp).proof < 1e-5
    lmp.command("run 10")
