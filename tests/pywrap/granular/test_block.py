"""A block, whose motion is known: on a slope it sticks and vibrates, or slides at a constant velocity; on top of a
sphere it slides down faster and faster."""

import numpy as np
import pytest
from granular_packings import command, of_particle, refused
from pushes import PUSH, in_a_quiet_copy

import faultgouge
from faultgouge.analysis import one_sided_motion, stability

FRICTION = 0.5


@pytest.fixture
def block(taken):
    """Makes a sphere that does not turn at rest on a slope, by a share of the angle of repose, to first order in the
    share; and its configuration."""
    return lambda share: taken(f"variable slope equal {share * FRICTION:.17g}", "block.in")


def moved(lmp, velocity: float, steps: int, which: int = 1) -> float:
    """By how much a block moves in some steps of 0.001 without drag, over the size of the velocity of the push."""

    def follow():
        before = float(of_particle(lmp, "x", which)[0])
        of_particle(lmp, "v", which)[0] = velocity
        lmp.command(f"run {steps} post no")
        return (of_particle(lmp, "x", which)[0] - before) / abs(velocity)

    return in_a_quiet_copy(lmp, follow)


def under_a_rising_load(lmp, rate: float, time: float, force: str) -> np.ndarray:
    """By how much a block moves, shape (2,), while a force `v_rise` rises from zero."""
    before = np.array(of_particle(lmp, "x", 1)[:2])
    command(lmp, f"unfix drag\nreset_timestep 0\nvariable rise equal {rate}*step*dt\nfix rise all addforce {force}")
    lmp.command(f"run {round(time / 0.001)} post no")
    return of_particle(lmp, "x", 1)[:2] - before


@pytest.mark.long
def test_at_the_angle_of_repose_a_block_slides_on_ahead(block):
    lmp, here = block(1.0)
    assert np.all([here.contacts.at_bound, here.free])
    ahead, back = (one_sided_motion(here, [[v, 0, 0]], times=[5.0]).displacement[0, 0, 0] for v in (1.0, -1.0))
    assert ahead == pytest.approx(5.0, rel=1e-9)
    assert moved(lmp, PUSH, 5000) == pytest.approx(5.0, rel=1e-6)
    # a push back is turned round, and loses energy: 2 % is what steps of one-sided motion change
    assert 0 < moved(lmp, -PUSH, 5000) == pytest.approx(back, rel=0.02)
    rising, verdict = stability(here, rise=[[1.0, 0.0, 0.0]], time=5.0), stability(here)
    assert "no constant drift is seen" in rising.not_followed  # however short the time
    assert rising.stable is verdict.stable is None
    assert "has not settled: 1 contact at Coulomb's bound slides on after a push" in str(verdict)
    assert "if all slid on, 1 motion would go on for ever" in str(verdict)


@pytest.mark.long
def test_a_load_that_rises_accelerates_a_block_that_slides_and_pushes_one_back_that_sticks(block):
    """At the angle of repose: ahead nothing bears the load, which displaces the block by t^3 / (6 m); back the spring
    of the contact does. The drift is a root mean square over three axes."""
    lmp, here = block(1.0)
    ahead = stability(here, rise=[[1.0, 0.0, 0.0]], time=250.0)
    assert ahead.rising is None
    assert "no constant drift is seen: the mean velocity over the rate rises from" in str(ahead)
    # where the drag of the start ends, vibration begins that falls as the power -3.5 of the time
    back = stability(here, rise=[[-1.0, 0.0, 0.0]], time=64.0).rising
    assert np.sqrt(3) * back["drift"] == pytest.approx(1 / 300, rel=0.02)
    assert back["vibration"] < 1e-6 * back["drift"]
    assert (back["steady"], back["next_event"]) == (True, "slides back")
    assert back["next_change"] == pytest.approx(2 * here.contacts.friction[0], rel=0.01)
    found = under_a_rising_load(lmp, 1e-7, 2.0, "v_rise 0 0")
    assert found[0] == pytest.approx(1e-7 * 2.0**3 / (6 * float(here.mass[0])), rel=0.01)


def test_a_block_below_the_angle_of_repose_vibrates_and_rests(block):
    lmp, here = block(0.9)
    verdict = stability(here)
    assert (verdict.stable, verdict.free) == (True, 0)
    assert abs(moved(lmp, PUSH, 5000)) < 1e-6


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_push_back_may_be_so_large_that_the_block_slides_back(block, share):
    """On the level, where its contact has no tangential force, and at the angle of repose, where the force turns round
    to the bound on the other side. Nothing else limits the push."""
    lmp, here = block(share)
    motion = one_sided_motion(here, [[-1.0, 0.0, 0.0]], times=np.linspace(0.01, 0.2, 20))
    of_small, near, beyond = (moved(lmp, -size * motion.scales[1], 200) for size in (0.01, 0.95, 2.0))
    assert of_small == pytest.approx(motion.displacement[-1, 0, 0], rel=0.01)  # of LAMMPS's time steps
    assert near == pytest.approx(of_small, rel=1e-6)
    assert abs(beyond - of_small) > 0.1 * abs(of_small)


def test_a_push_sideways_turns_the_force_at_the_bound_and_the_block_slides_ahead(block):
    """To first order it vibrates sideways alone. As its force a turns, what is left along the slope is a^2/(2 mu f_n),
    which accelerates it ahead; and nothing stops it. A load that rises sideways does so for ever."""
    lmp, here = block(1.0)
    motion = one_sided_motion(here, [[0.0, 1.0, 0.0]], times=np.linspace(0.02, 2.0, 100))
    assert np.all(motion.displacement[..., 0] == 0)
    verdict = stability(here, rise=[[0.0, 1.0, 0.0]], time=20.0)
    assert "the load turns the forces of contacts at Coulomb's bound, and nothing holds" in verdict.not_followed
    rate, time = 0.01 * here.contacts.friction[0], 2.0
    ahead, sideways = under_a_rising_load(lmp, rate, time, "0 v_rise 0")
    assert sideways == pytest.approx(rate * time / 300, rel=0.05)  # the slip ahead is turned, too
    assert ahead == pytest.approx((rate * time**2) ** 2 / (24 * here.contacts.friction[0] * here.mass[0]), rel=0.05)


@pytest.mark.long
def test_of_a_block_that_slides_the_load_alone_is_not_accused(block):
    """The slope is 4e-6 beyond the angle of repose: less is out of balance than is allowed, but nothing stops it."""
    with refused("1 contact at Coulomb's bound or just below may slide while"):
        block(1.0 + 4e-6)


@pytest.mark.parametrize(("which", "named"), [(1, True), (2, False)])
def test_the_mass_of_what_moves_decides_whether_its_velocity_is_named(lammps_with, which, named):
    """A velocity of 2e-5 becomes a force of 2e-5 (k m)^(1/2): 17e-4 of the mean force, or 0.5e-4; 1e-4 may be left."""
    lmp = lammps_with(deck="unequal.in")
    of_particle(lmp, "v", which)[1] = 2e-5
    assert ("particles move by up to 2e-05 " in str(faultgouge.from_lammps(lmp).remarks)) is named


REPOSE = 0.9978189798742391 * FRICTION
"""The pull over the weight at which the contact lacks 9e-8 of Coulomb's bound: the pull moves the block, and turns the
contact."""


def test_a_block_on_top_of_a_sphere_slides_down_from_the_push_on_that_is_said(taken):
    """Ahead it slides with s^2 = (1 + mu^2) g / r for the distance r of the centres, or not at all.

    The torque does not turn it. The weight is g, and the pull mu g: as the contact turns by a, the force along it grows
    by (1 + mu^2) g a."""
    lmp, here = taken(f"variable slope equal {REPOSE:.17g}", "hill.in")
    verdict = stability(here)
    assert (verdict.stable, verdict.at_bound) == (False, 1)
    assert verdict.growth_rate == pytest.approx(2 * (1 + FRICTION**2) ** 0.5, rel=1e-3)  # r is shorter by the overlap
    motion = one_sided_motion(here, [[0, 0, 0], [1, 0, 0]], times=[6.0])
    (least, most), expected = motion.scales, motion.displacement[0, 1, 0]
    assert 1e-7 < least < 1e-5 < most
    assert f"after pushes from {verdict.one_sided['scales'][0]:.1g} on" in str(verdict)
    assert moved(lmp, least, 6000, which=2) == pytest.approx(expected, rel=0.1)
    assert abs(moved(lmp, 0.01 * least, 6000, which=2)) < 1e-3 * expected
    short = stability(here, time=4.0)
    assert f"`time` = {short.one_sided.needed:.2g} may do" in str(short)
    assert 4.0 < short.one_sided.needed < 1.1 * verdict.one_sided.time
