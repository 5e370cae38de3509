"""How far vibration carries particles whose contacts have two derivatives, of a hundred disks that are held."""

import numpy as np
import pytest
from linearised import dissipative

from faultgouge.analysis import stability
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.motion import pushes
from faultgouge.analysis.motion.one_sided import OneSidedSystem
from faultgouge.analysis.motion.pushes import CREEP_LEFT, follow_creep


@pytest.fixture
def wearing(reference_packing):
    """A configuration with dashpots of a size. The tangential force of each contact falls by up to a share of the
    normal force as the overlap opens, in either direction, and rises by as much less as the overlap closes."""

    def make(share, dashpot):
        c = dissipative(reference_packing(1.0), dashpot, 0.5 * dashpot, None).configuration
        k, mobilised = c.contacts, np.random.default_rng(0).uniform(-1, 1, (len(c.contacts), 1))
        assert not k.at_bound.any()
        mean, along = k.overlap_derivative(), np.cross([0.0, 0.0, 1.0], k.normal)
        differs = 0.5 * share * mobilised * (k.normal_force / k.overlap)[:, None] * along
        return derive_frozen(c, contacts=derive_frozen(k, closing=mean - differs, parting=mean + differs))

    return make


@pytest.mark.long
def test_strong_dashpots_end_it(wearing):
    """It settles, and a longer time adds next to nothing."""
    here = wearing(0.5, 600.0)
    told = stability(here)
    assert told.creep.settled
    assert "and they stay displaced" in str(told)
    longer = stability(here, time=1.5 * told.creep.time).creep
    assert longer.amplification == pytest.approx(told.creep.amplification, rel=(1 + CREEP_LEFT) ** 2 - 1)


@pytest.mark.long
def test_weak_dashpots_leave_a_limit_that_holds(wearing, monkeypatch):
    monkeypatch.setattr(pushes, "CREEP_CHUNKS", 4)
    here = wearing(0.5, 100.0)
    told = stability(here)
    assert not told.creep.settled
    assert f"D may reach {told.creep.limit:.2g} times" in str(told)
    longer = stability(here, time=2 * told.creep.time).creep
    assert told.creep.amplification < longer.amplification < told.creep.limit


def test_what_is_not_known_to_decay_has_no_limit(wearing):
    found = follow_creep(OneSidedSystem.of(wearing(0.5, 600.0)), 1)
    assert (found.limit, found.settled) == (None, False)


def test_forces_that_fall_far_more_than_they_rise_make_vibration_grow(wearing):
    """The steps of closing and parting push the packing, at more than the mean of both loses."""
    told = stability(wearing(2.0, 20.0))
    assert (told.sticking.stable, told.creep.grows, told.stable) == (True, True, False)
    assert told.growth_rate == told.creep.growth_rate > 0
