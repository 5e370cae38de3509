"""What rests and what does not: the scale of forces at walls of regions, and particles that leave the box."""

import numpy as np
import pytest
from granular_packings import head

BALL = (
    head("block -4 4 -4 4 -2 8")
    + """
create_atoms 1 single 0 0 {z:.17g} units box
{more}
set group all diameter 1.0 density 1.0
pair_style gran/hooke/history 1e4 3e3 20 10 0.5 1
pair_coeff * *
{wall}
fix load all gravity 1.0 vector 0 0 -1
fix move all nve/sphere
timestep 1e-3
thermo_style custom step
thermo_modify lost ignore
run 0
"""
)
REGION = """
region floor block -4 4 -4 4 0 8 side in open 1 open 2 open 3 open 4 open 6 units box
fix floor all wall/gran/region hooke/history 1e4 3e3 20 10 0.5 1 region floor
"""
WEIGHT = np.pi / 6


@pytest.mark.parametrize(("share", "rests"), [(1e-5, True), (1e-3, False)])
def test_a_sphere_on_a_region(lammps_with, share, rests):
    """Its weight is the scale of what is out of balance, though a region hands out no contacts."""
    from faultgouge.pywrap import NotTakenError, from_lammps

    z = 0.5 - WEIGHT * (1 + share) / 1e4
    lmp = lammps_with(BALL.format(z=z, wall=REGION, more=""))
    if rests:
        found = from_lammps(lmp)
        assert found.residual == pytest.approx(share * WEIGHT, rel=1e-3)
        assert found.proof < 1e-4
        return
    with pytest.raises(NotTakenError, match=r"residual of particle 1 at .* is 0\.000999 of the mean contact force"):
        from_lammps(lmp)
    assert from_lammps(lmp, balance=2 * share).residual == pytest.approx(share * WEIGHT, rel=1e-3)


def test_velocities_of_what_is_taken_at_rest(lammps_with):
    """`fix freeze` leaves a particle its rotation, which contacts feel; forces may balance while a particle moves."""
    from faultgouge import from_lammps

    plane = "fix floor all wall/gran hooke/history 1e4 3e3 20 10 0.5 1 zplane 0 NULL contacts\nfix hold held freeze"
    lmp = lammps_with(
        BALL.format(z=0.5 - WEIGHT / 1e4, wall=plane, more="create_atoms 1 single 1.1 0 0.5 units box\ngroup held id 2")
    )
    assert not any("move" in each for each in from_lammps(lmp).remarks)
    lmp.command("set group held omega 0 0.02 0")
    lmp.command("velocity all set 0.1 0 0")
    for differences in (False, True):
        held, moves = from_lammps(lmp, differences=differences).remarks[-2:]
        assert held.startswith("1 particle that no fix moves has velocities or rotations, up to 0.1 at the surface")
        assert moves == "particles move by up to 0.1 (length / time): this is said of them at rest"
    lmp.command("velocity all set 0 0 0")
    lmp.command("set group held omega 0 0 0")
    assert not any("move" in each for each in from_lammps(lmp).remarks)


ENDS = "variable high equal 1\nfix stop all halt 10 v_high > 0 error soft message no\nrun 20"


def test_a_run_that_fix_halt_ends_brings_nothing_to_rest(lammps_with):
    """LAMMPS skips all further runs without a word."""
    from faultgouge import relax
    from faultgouge.pywrap import NotTakenError

    plane = "fix floor all wall/gran hooke/history 1e4 3e3 20 10 0.5 1 zplane 0 NULL"
    lmp = lammps_with(BALL.format(z=0.5, wall=plane, more="") + ENDS)
    with pytest.raises(NotTakenError, match=r"^LAMMPS ended a run while the packing came to rest, as fix halt and"):
        relax(lmp)
    lmp.command("unfix stop")
    lmp.command("timer timeout unlimited")
    assert relax(lmp) < 1e-8


def test_what_relax_cannot_reach_is_refused(lammps_with):
    from faultgouge import relax
    from faultgouge.analysis import BadInputError

    lmp = lammps_with(BALL.format(z=0.5, wall=REGION, more=""))
    for name, value in (("balance", np.nan), ("balance", -1.0), ("steps", 0)):
        with pytest.raises(BadInputError, match=f"^{name} = {value:g} is refused"):
            relax(lmp, **{name: value})


def test_a_thermostat_is_named(lammps_with):
    """It is a drag where its temperature is zero, and brings nothing to rest where it is not."""
    from faultgouge import relax
    from faultgouge.analysis import NoEquilibriumError
    from faultgouge.pywrap import NotTakenError, from_lammps

    plane = "fix floor all wall/gran hooke/history 1e4 3e3 20 10 0.5 1 zplane 0 NULL"
    lmp = lammps_with(BALL.format(z=0.4999, wall=plane, more="") + "fix heat all langevin 1e-6 1e-6 1.0 4711\nrun 100")
    says = "fix heat langevin shakes the particles by its temperature: unfix it"
    with pytest.raises(NotTakenError, match=f"The packing moves: .*; {says}"):
        from_lammps(lmp)
    with pytest.raises(NoEquilibriumError, match=f"^The packing .* in 10000 steps: .*; {says}"):
        relax(lmp, steps=10_000)
    lmp.command("fix heat all langevin 0.0 0.0 1.0 4711")
    assert relax(lmp) < 1e-8


@pytest.mark.parametrize(
    ("pair", "wall", "style"),
    [
        ("gran/hooke 1e4 3e3 20 10 0.5 1", "hooke 1e4 3e3 20 10 0.5 1", "gran/hooke"),
        ("gran/hooke/history 1e4 3e3 20 10 0.5 1", "hooke 1e4 3e3 20 10 0.5 1", "wall/gran hooke"),
        (
            "granular\npair_coeff * * hooke 1e4 20 tangential linear_nohistory 10 0.5",
            "granular hooke 1e4 20 tangential linear_nohistory 10 0.5",
            "linear_nohistory",
        ),
    ],
)
def test_friction_that_holds_nothing_is_named(lammps_with, pair, wall, style):
    """A sphere on a slope: without a tangential spring it creeps."""
    from faultgouge import relax
    from faultgouge.analysis import NoEquilibriumError

    deck = BALL.format(z=0.4999, wall=f"fix floor all wall/gran {wall} zplane 0 NULL contacts", more="")
    deck = deck.replace("pair_style gran/hooke/history 1e4 3e3 20 10 0.5 1", f"pair_style {pair}")
    lmp = lammps_with(deck.replace("vector 0 0 -1", "vector 0.1 0 -1").replace("pair_coeff * *\n", "", "\n" in pair))
    with pytest.raises(NoEquilibriumError, match=f"; the friction of {style} opposes velocities alone and bears no"):
        relax(lmp, steps=10_000)


@pytest.mark.long
def test_a_packing_so_stiff_that_rounding_moves_it(lammps_with):
    """An overlap of 5e-11 at a coordinate of 4: the rounding of the force is 1e-5 of the weight."""
    from faultgouge import relax
    from faultgouge.pywrap import from_lammps

    law = "hooke/history 1e10 3e9 2e4 1e4 0.5 1"
    plane = f"fix floor all wall/gran {law} zplane 4 NULL"
    hard = BALL.format(z=4.5, wall=plane, more="").replace("hooke/history 1e4 3e3 20 10 0.5 1", law)
    lmp = lammps_with(hard.replace("timestep 1e-3", "timestep 2e-6"))
    left = relax(lmp, steps=200_000)
    assert 1e-8 < left < 1e-4
    assert from_lammps(lmp).proof < 1e-3


def test_what_falls_is_not_at_rest(lammps_with):
    """Nothing touches anything in the first steps, so that nothing is out of balance."""
    from faultgouge import relax
    from faultgouge.pywrap import from_lammps

    plane = "fix floor all wall/gran hooke/history 1e4 3e3 20 10 0.5 1 zplane 0 NULL"
    lmp = lammps_with(BALL.format(z=6.0, wall=plane, more=""))
    relax(lmp)
    assert len(from_lammps(lmp).contacts) == 1


def test_what_flies_without_a_load_comes_to_rest(lammps_with):
    """It touches nothing, and drag alone acts on it."""
    from faultgouge import relax

    lmp = lammps_with(BALL.format(z=4.0, wall="", more="velocity all set 0.1 0 0.2"))
    lmp.command("unfix load")
    assert relax(lmp, steps=20_000) == 0.0
    assert np.all(lmp.numpy.extract_atom("v")[:1] == 0.0)


def test_a_packing_of_rrespa(lammps_with):
    """Its copies take steps of velocity Verlet; the instance goes on with its own."""
    from faultgouge.pywrap import from_lammps

    more = "run_style respa 2 2 pair 1\nrun 0"
    lmp = lammps_with(BALL.format(z=0.5 - WEIGHT / 1e4, wall=REGION, more="") + more)
    assert from_lammps(lmp).proof < 1e-5
    lmp.command("run 10")


def test_a_force_that_swings_is_named(lammps_with):
    from faultgouge import relax
    from faultgouge.pywrap import NotTakenError

    plane = "fix floor all wall/gran hooke/history 1e4 3e3 20 10 0.5 1 zplane 0 NULL"
    swings = "variable f equal 0.05*sin(step*0.001)\nfix swing all addforce v_f 0 0"
    lmp = lammps_with(BALL.format(z=0.4999, wall=plane, more="") + swings)
    with pytest.raises(NotTakenError, match="change with the time, though nothing moves: a load, a wall or a region"):
        relax(lmp, steps=10_000)


def test_particles_that_leave_the_box_while_they_come_to_rest(lammps_with):
    from faultgouge import relax
    from faultgouge.analysis import NoEquilibriumError

    plane = "fix floor one wall/gran hooke/history 1e4 3e3 20 10 0.5 1 zplane 0 NULL contacts"
    falls = "create_atoms 1 single 2 0 -1 units box\ngroup one id 1"
    lmp = lammps_with(BALL.format(z=0.5 - WEIGHT / 1e4, wall=plane, more=falls))
    with pytest.raises(NoEquilibriumError, match=r"^1 particle left the box while the packing came to rest: delete"):
        relax(lmp)
