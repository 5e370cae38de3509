"""The verdict on three disks of whose contacts one is at Coulomb's bound, and on packings of which not all is known."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from three_disks import balanced, stuck_at_rest, three_disks

from faultgouge.analysis import (
    one_sided_motion,
    spectrum,
    stability,
)
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.motion import linear as linear_module
from faultgouge.analysis.motion import small_motion as small_motion_module
from faultgouge.analysis.motion import stability as stability_module
from faultgouge.analysis.motion.certificate import NoProofError


def test_stability_of_three_disks():
    found = stability(three_disks())
    assert found.at_bound == 1
    assert found.stable is None  # in no balance
    assert "the packing moves" in found.reasons[0]
    at_rest = balanced(three_disks())
    told = stability(at_rest)
    assert told.stable is True
    assert told.one_sided.grows is False
    assert told.one_sided.amplification > 0
    assert str(told).startswith("stable: each of 4 pushes comes to rest")
    assert "neither of two linear motions decides" in str(told)
    assert [told.one_sided[name] for name in ("grows", "amplification")] == [False, told.one_sided.amplification]
    assert json.loads(json.dumps(told.as_dict()))["one_sided"]["pushes"] == told.one_sided["pushes"] == 4
    assert set(told.as_dict()) >= {"stable", "growth_rate", "undamped", "at_bound", "one_sided", "rising", "asymmetry"}
    rising = stability(at_rest, rise=np.tile([1.0, 0.0], (3, 1)), time=4.0).rising
    twice = stability(at_rest, rise=np.tile([2.0, 0.0], (3, 1)), time=4.0).rising
    assert twice.drift == pytest.approx(2 * rising.drift, rel=1e-9)
    # of sixteen windows the drag fades out in four; then all count, or the last half of these
    assert rising.span in (pytest.approx(3.0), pytest.approx(1.5))
    assert dict(rising) == rising.as_dict() | {"other_start": rising.other_start}
    with pytest.raises(ValueError, match="upper layer"):
        stability(at_rest, rise="fx")
    held = derive_frozen(at_rest, free=np.array([False, True, True]))
    for where, forces in ((at_rest, np.zeros((3, 2))), (held, np.outer([1.0, 0.0, 0.0], [1.0, 0.0]))):
        with pytest.raises(ValueError, match="a force on no particle that moves"):
            stability(where, rise=forces)


def test_without_dissipation_no_push_comes_to_rest():
    """Contacts stop sliding, and what is left vibrates for ever."""
    three = three_disks()
    at_rest = balanced(replace(three, law=replace(three.law, cn=0.0, ct=0.0)))
    told = stability(at_rest)
    assert told.stable is True
    assert str(told).startswith("stable: each of 4 pushes ends in vibration that goes on, but does not grow")
    size = one_sided_motion(at_rest, np.ones((3, 2)), times=np.linspace(0, 12, 121)).mean_square_displacement
    assert size[81:].max() > 0.8 * size[41:81].max()


@pytest.mark.parametrize(("scales", "stable"), [((1e-7, 1e-9), None), ((1e-9, np.inf), True), ((np.inf, 1e-3), None)])
def test_a_motion_that_is_that_of_no_push_has_no_verdict(monkeypatch, scales, stable):
    """Some contacts count as at the bound and are not, and others are as near to it."""
    at_rest = balanced(three_disks())
    follow = small_motion_module.follow_pushes

    def with_scales(*given):
        found, reach = follow(*given)
        return replace(found, scales=scales), reach

    monkeypatch.setattr(small_motion_module, "follow_pushes", with_scales)
    found = stability(at_rest)
    assert found.stable is stable
    assert any("bring the packing to rest more closely" in each for each in found.reasons) is (stable is None)
    assert any("no push was found after which" in each for each in found.reasons) is bool(np.isinf(scales[0]))
    assert "Infinity" not in json.dumps(found.as_dict())


@pytest.mark.parametrize(("count", "says"), [(1, "1 of 3 contacts is at Coulomb's bound and slides"), (2, "and slide")])
def test_the_verdict_says_what_contacts_of_a_smoothed_law_do_at_the_bound(count, says):
    found = stability(three_disks())
    found = replace(found, contacts=3, at_bound=count, one_sided=None, sliding=found.sticking)
    assert found.sentences[-1].endswith(says)


def test_a_configuration_says_what_its_stiffness_takes_contacts_at_the_bound_for():
    configuration = three_disks().configuration
    assert configuration.contacts.one_sided.any()
    assert "at Coulomb's bound, sticking in K, 0 rattlers" in repr(configuration)
    contacts = derive_frozen(configuration.contacts, sliding=configuration.contacts.at_bound)
    assert "at Coulomb's bound, sliding in K, 0 rattlers" in repr(derive_frozen(configuration, contacts=contacts))


def test_a_spectrum_without_growth_has_no_rate_of_growth():
    found = spectrum(balanced(three_disks()))
    assert len(found.pairs) == len(found.negative) == 0
    assert "K alone has 0 complex pairs;" in repr(found)


def test_large_packings_have_the_verdict_of_small_ones(monkeypatch):
    """By searches, and one push in longer steps that is followed until nothing that grows is left."""
    at_rest = balanced(replace(three_disks(), law=replace(three_disks().law, cn=40.0, ct=20.0)))
    expected = stability(at_rest)
    with monkeypatch.context() as patch:
        like_a_large_one(patch)
        found = stability(at_rest)
    assert found.stable is True
    assert found.one_sided.pushes == 2
    as_long = stability(at_rest, time=found.one_sided.time)
    assert as_long.one_sided.pushes == 4
    assert 0 < found.one_sided.amplification < 1.1 * as_long.one_sided.amplification
    assert found.searched == 0
    assert found.sliding.growth_rate == pytest.approx(expected.sliding.growth_rate, rel=1e-6)
    assert expected.searched == 0.0


def like_a_large_one(monkeypatch):
    """No eigenvalue is computed, and the search sees fast growth alone."""
    monkeypatch.setattr(stability_module, "LARGE", 0)
    monkeypatch.setattr(small_motion_module, "LAPACK_UP_TO", 0)
    for name, value in {"LAPACK_FIRST": 0, "LAPACK_UP_TO": 0, "SLICES_UP_TO": 0, "PERIODS_OF_LARGE": 9 * 30.0}.items():
        monkeypatch.setattr(linear_module, name, value)


@pytest.mark.long
def test_a_large_packing_is_stable_if_a_push_decays_so_far_that_growth_would_be_seen(monkeypatch):
    at_rest = stuck_at_rest(cn=0.02)
    slowest = stability(at_rest).growth_rate
    assert slowest < 0
    like_a_large_one(monkeypatch)
    monkeypatch.setattr(linear_module, "prove", no_proof)
    found = stability(at_rest)
    assert found.stable is True
    assert found.searched == 0
    assert found.growth_rate == pytest.approx(slowest, rel=0.05)
    assert str(found).startswith("stable: motion from a random state decayed in t = ")
    # |u|^2 of 18 coordinates falls from 36 to 1e-6: by exp(-17.4)
    time = float(re.search(r"in t = (\S+) ", str(found))[1])
    assert -slowest * time == pytest.approx(17.4, rel=0.3)
    short = stability(at_rest, time=0.5 * time)
    assert short.stable is None
    assert short.searched > 0
    assert "D grows no faster than exp(" in str(short)
    needed = float(re.search(r"`time` = (\S+) would do", str(short))[1])
    assert needed == pytest.approx(time, rel=0.3)


def no_proof(*_):
    raise NoProofError("no certificate")


def test_a_large_packing_in_which_nothing_decays_is_not_called_stable(monkeypatch):
    at_rest = stuck_at_rest(cn=0.0, ct=0.0)
    like_a_large_one(monkeypatch)
    found = stability(at_rest, time=20.0)
    assert found.stable is None
    assert "may not have been seen" in str(found).splitlines()[0]


@pytest.mark.parametrize("time", [-1, 0, np.nan, "long"])
def test_a_time_that_is_none_is_refused_before_work_starts(time, monkeypatch):
    monkeypatch.setattr(small_motion_module, "spectrum", None)
    with pytest.raises(ValueError, match=r"The time that motion is followed is a positive number, not "):
        stability(three_disks(), rise="fx", time=time)
