"""Drift and vibration under a load that rises, and how far this motion goes on."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from quasistatic import moved
from three_disks import balanced, stuck_at_rest, three_disks

from faultgouge.analysis import stability, stiffness_matrix
from faultgouge.analysis.motion import rising_load
from faultgouge.analysis.motion.one_sided import OneSidedSystem, forces_on_coordinates
from faultgouge.analysis.motion.rising_load import motion_under_load

RISE = np.tile([1.0, 0.0], (3, 1))


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_what_follows_a_load_that_rises_does_not_vibrate(exponent):
    """The drift is solved for, and is that of the motion that is followed."""
    at_rest = stuck_at_rest(cn=2.0, ct=1.0, exponent=exponent)
    assert np.any(at_rest.contacts.closing != at_rest.contacts.parting) == (exponent == 1.5)
    rising = stability(at_rest, rise=RISE).rising
    assert (rising.steady, rising.vibration, rising.time) == (True, 0, None)
    system = OneSidedSystem.of(at_rest)
    followed = motion_under_load(system, forces_on_coordinates(at_rest, RISE), 30.0, decays=False)
    assert rising.drift == pytest.approx(followed.drift, rel=1e-3)
    assert rising.next_change == pytest.approx(followed.next_change, rel=1e-2)
    assert followed.vibration < 1e-2 * rising.drift
    assert followed.steady


@pytest.mark.parametrize(("mu", "up", "event"), [(0.5, 0.0, "reaches Coulomb's bound"), (0.0, 1.0, "opens")])
def test_the_load_may_rise_until_a_contact_reaches_the_bound_or_opens(mu, up, event):
    """At the increase that is told the law itself, displaced by K^-1 times the rise, is about at the bound, or open."""
    bare, share = three_disks(), np.array([0.3, -0.3, 0.2, 0.9, 0.1])
    law = replace(bare.law, exponent=1.0, mu=mu)
    slips = share * law.slip_limit(bare.geometry.overlap)
    packing = replace(bare, contacts=bare.contacts.slipped(slips, None), law=law)
    at_rest = balanced(packing)
    rise = np.array([[1 - up, 0.0], [1 - up, 0.0], [1 - up, up]])
    found = stability(at_rest, rise=rise)
    rising = found.rising
    assert rising.next_event == event
    drift = np.linalg.lstsq(stiffness_matrix(packing).toarray(), [*rise.T.ravel(), 0.0, 0.0, 0.0])[0]
    assert rising.drift == pytest.approx(np.sqrt(np.mean(drift[:6] ** 2)), rel=1e-4)
    before, after = (moved(packing, share * rising.next_change * drift, 0.0) for share in (0.9, 1.1))
    if event == "opens":
        assert len(after.contacts) < len(before.contacts) == len(packing.contacts)
    else:
        assert before.configuration.mobilised.max() < 1 - 1e-3
        assert after.configuration.contacts.at_bound.any()
    assert str(found).endswith(f"until the load has risen by {rising.next_change:.2g} (a contact {event})")


def test_the_drift_of_a_slow_cycle_is_its_mean_velocity(monkeypatch):
    """Ten units of motion in one window of five, and rest in four: a drift of two, and a vibration of four."""
    at_rest = stuck_at_rest()
    system, shape, coordinates = OneSidedSystem.of(at_rest), np.zeros((3, 2, 1)), np.zeros((at_rest.coordinates, 1))
    shape[0, :, 0] = [0.6, 0.8]
    coordinates[[0, 3]] = at_rest.mass[0] ** 0.5 * shape[0]
    z = coordinates[system.motion.active]

    def windows(system, direction, length):
        for number in count():
            speed = 10.0 if number % 5 == 0 else 0.0
            worn, slid = (np.zeros((each.shape[0], 1)) for each in (system.rates, system.excess))
            moved, squares = speed * length * shape, speed**2 * length * shape**2
            yield length, speed * length * z, worn, slid, moved, squares

    monkeypatch.setattr(rising_load, "windows_under_load", windows)
    found = motion_under_load(system, forces_on_coordinates(at_rest, RISE), decays=False)
    size = np.sqrt(1 / 6)
    assert found.drift == pytest.approx(2 * size, abs=2 * found.drift_error)
    assert found.vibration == pytest.approx(4 * size, abs=2 * found.vibration_error)
    assert found.drift_error < 0.3 * found.drift
    assert found.steady


def test_a_rise_that_comes_after_the_next_change_is_refused(monkeypatch):
    """A contact that counts as at the bound lacks 5e-7 of it, and another one reaches it before."""
    three = three_disks()
    limit = three.law.slip_limit(three.geometry.overlap)
    slips = np.array([0.3, 5e-7 - 1, 0.2, 0.3, 0.1]) * limit
    at_rest = balanced(replace(three, contacts=three.contacts.slipped(slips, None)))
    assert at_rest.contacts.at_bound.sum() == 1
    found = stability(at_rest, rise=RISE, time=4.0)
    least, change = found.rising.least_rise, found.rising.next_change
    assert 0 < least < change
    assert f"from a rise of {least:.1g} on" in str(found)
    monkeypatch.setattr(rising_load, "next_change", lambda *given: (0.5 * least, "opens"))
    found = stability(at_rest, rise=RISE, time=4.0)
    assert found.rising is None
    assert found.not_followed.endswith(
        f"another contact opens before, at {0.5 * least:.1g}: bring the packing to rest more closely"
    )


def test_a_load_that_accelerates_a_free_motion_is_not_followed():
    """Three disks without friction on a floor, on which they slide together."""
    three = three_disks()
    slides = replace(three, law=replace(three.law, mu=0.0), contacts=three.contacts.slipped(np.zeros(5)))
    found = stability(balanced(slides), rise=RISE)
    assert (found.stable, found.free, found.rising) == (True, 1, None)
    says = "under a load that rises: not followed, since the load accelerates 1 motion that no force opposes"
    assert found.sentences[-1] == says
