"""A block on a slope, whose motion is known: it sticks and vibrates, or slides at a constant velocity."""

import pytest
from granular_packings import command
from pushes import PUSH

from faultgouge.analysis import one_sided_motion, stability

FRICTION = 0.5
LAW = f"hooke 1e3 5 tangential linear_history 300 1.0 {FRICTION} damping velocity"
BLOCK = f"""
units lj
atom_style sphere
boundary p p f
newton off
comm_modify vel yes
region box block -2 2 -2 2 0 4 units box
create_box 1 box
create_atoms 1 single 0 0 0.4995 units box
set group all diameter 1.0
set group all density 1.0
pair_style granular
pair_coeff * * {LAW}
fix floor all wall/gran granular {LAW} zplane 0 NULL contacts
fix load all gravity 1.0 vector 0 0 -1
variable pull equal mass(all)*v_slope
fix pull all addforce v_pull 0 0
fix drag all viscous 2.0
fix move all nve/limit 0.1
timestep 0.001
thermo 1000000
run 15000
"""
"""A sphere that does not turn."""


@pytest.fixture
def block(lammps_with):
    """Makes a block at rest on a slope, by a share of the angle of repose, to first order in the share."""

    def make(share: float):
        lmp = lammps_with(f"variable slope equal {share * FRICTION:.17g}")
        command(lmp, BLOCK)
        return lmp

    return make


def moved(lmp, velocity: float, steps: int) -> float:
    """By how much the block moves ahead in some steps of 0.001 without drag, over the velocity of the push."""
    from faultgouge.pywrap.granular.look_in_a_copy import in_a_copy, quieten

    def follow():
        quieten(lmp, drag=True)
        x = lmp.numpy.extract_atom("x")
        before = float(x[0, 0])
        lmp.numpy.extract_atom("v")[0, 0] = velocity
        lmp.command(f"run {steps} post no")
        return (float(lmp.numpy.extract_atom("x")[0, 0]) - before) / abs(velocity)

    return in_a_copy(follow)


def test_at_the_angle_of_repose_a_block_slides_on_ahead(block):
    from faultgouge.pywrap import from_lammps

    lmp = block(1.0)
    here = from_lammps(lmp)
    assert here.contacts.at_bound.all()
    assert here.free.all()
    ahead, back = (one_sided_motion(here, [[v, 0, 0]], times=[20.0]).displacement[0, 0, 0] for v in (1.0, -1.0))
    assert ahead == pytest.approx(20.0, rel=1e-9)
    assert moved(lmp, PUSH, 20_000) == pytest.approx(ahead, rel=1e-6)
    # a push back is turned round, and loses energy: 2 % is what steps of one-sided motion change
    assert 0 < moved(lmp, -PUSH, 20_000) == pytest.approx(back, rel=0.02)
    verdict = stability(here, time=20.0)
    assert verdict.stable is None
    assert "has not settled" in str(verdict)


def test_a_block_below_the_angle_of_repose_vibrates_and_rests(block):
    from faultgouge.pywrap import from_lammps

    lmp = block(0.9)
    here = from_lammps(lmp)
    verdict = stability(here)
    assert verdict.stable is True
    assert verdict.free == 0
    assert abs(moved(lmp, PUSH, 20_000)) < 1e-6


def test_of_a_block_that_slides_the_load_alone_is_not_accused(block):
    """The slope is 2e-7 beyond the angle of repose: less is out of balance than is allowed, but nothing stops it."""
    from faultgouge.pywrap import from_lammps
    from faultgouge.pywrap.granular.granular_commands import NotTakenError

    with pytest.raises(NotTakenError, match="1 contact at Coulomb's bound or just below may slide while"):
        from_lammps(block(1.0 + 4e-7))
