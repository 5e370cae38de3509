"""One-sided motion beside a force law that is integrated as it stands, and its properties."""

import json
from dataclasses import replace
from itertools import count, islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from linearised import motion_matrix
from quasistatic import moved
from scipy.linalg import expm
from scipy.sparse import csr_array

from faultgouge.analysis import (
    Contacts,
    MindlinLaw,
    Motion,
    Packing,
    one_sided_motion,
    spectrum,
    stability,
    stiffness_matrix,
)
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.motion import decay as decay_module
from faultgouge.analysis.motion import rates as rates_module
from faultgouge.analysis.motion import rising_load
from faultgouge.analysis.motion import small_motion as small_motion_module
from faultgouge.analysis.motion import stability as stability_module
from faultgouge.analysis.motion.eigenvalues import mass_weighted
from faultgouge.analysis.motion.one_sided import OneSidedSystem, forces_on_coordinates
from faultgouge.analysis.motion.rising_load import Span, follow_load
from faultgouge.analysis.operators.sliders import sliders_of

PUSH = 1e-6
"""Times a velocity of one: displacements of 1e-7 are far below overlaps of 1e-2, and far above rounding."""


@pytest.fixture
def bound(cluster):
    """Six disks with Coulomb's slider and dashpots; contacts slide at the bound in either direction, or stick."""
    law = MindlinLaw(2e3, 6e2, 0.7, exponent=cluster.law.exponent, cn=9.0, ct=4.0, coulomb=True)
    bare, c = replace(cluster, law=law), cluster.contacts
    share = np.resize([1.0, 0.3, -1.0, -0.4], len(c))
    return replace(bare, contacts=Contacts(c.i, c.j, share * law.slip_limit(bare.geometry.overlap)))


def integrate(packing, velocity, step, count, rise=None):
    """Displacements of the disks: velocity Verlet of the law itself, under loads that balance the packing at first."""
    law, c, n, top = packing.law, packing.contacts, len(packing), np.zeros((3, len(packing)))
    pair = np.flatnonzero(~c.floor)
    mass = np.array([packing.mass, packing.mass, packing.inertia_factor * packing.mass])
    place = np.array([*packing.position.T, np.zeros(n)])  # with u = R theta
    slip, speed, start = c.slip.copy(), np.array([*velocity.T, np.zeros(n)]), place.copy()

    def branch(where):
        x = where[:2, c.i] - np.where(c.floor, 0, where[:2, c.j])
        x[0, c.floor] = 0.0
        x[0] -= packing.box_length * np.round(x[0] / packing.box_length)
        return x

    def forces(where, moves, slip):
        x = branch(where)
        r = np.hypot(*x)
        normal, overlap = x / r, packing.radius[c.i] + np.where(c.floor, 0, packing.radius[c.j]) - r
        tangent = np.array([-normal[1], normal[0]])
        v = moves[:, c.i] * [[1.0], [1.0], [1.0]] - np.where(c.floor, 0, moves[:, c.j] * [[1.0], [1.0], [-1.0]])
        rate = np.sum(tangent * v[:2], axis=0) - v[2]
        power, bound = law.growth(overlap), law.mu * law.kn * overlap * law.growth(overlap)
        fn = law.kn * overlap * power - law.cn * power * np.sum(normal * v[:2], axis=0)
        ft = np.clip(-law.kt * power * slip - law.ct * power * rate, -bound, bound)
        on = np.zeros((3, n))
        for axis, f in enumerate(fn * normal + ft * tangent):
            np.add.at(on[axis], c.i, f)
            np.subtract.at(on[axis], c.j[pair], f[pair])
        np.subtract.at(on[2], c.i, ft)
        np.subtract.at(on[2], c.j[pair], ft[pair])
        return on

    rest = forces(place, 0 * speed, slip)
    force = forces(place, speed, slip) - rest
    for k in range(count):
        speed = speed + 0.5 * step * force / mass
        before, place = place, place + step * speed
        a, b = branch(before), branch(place)
        r0, r1 = np.hypot(*a), np.hypot(*b)
        middle = 0.5 * (a / r0 + b / r1)
        d = step * speed
        rolled = d[2, c.i] + np.where(c.floor, 0, d[2, c.j])
        between = d[:2, c.i] - np.where(c.floor, 0, d[:2, c.j])
        gain = -middle[1] * between[0] + middle[0] * between[1] - rolled
        overlap = packing.radius[c.i] + np.where(c.floor, 0, packing.radius[c.j]) - r1
        if law.rescales:
            gain = gain - slip / (2 * overlap) * np.maximum(r0 - r1, 0.0)
        slip = law.clamped(overlap, slip + gain)
        load = top if rise is None else (k + 1) * step * np.array([*rise.T, np.zeros(n)])
        force = forces(place, speed, slip) - rest + load
        speed = speed + 0.5 * step * force / mass
    return (place - start)[:2].T


def test_is_the_motion_of_the_law(bound):
    system = OneSidedSystem.of(bound)
    count = 400
    time = count * system.time_step
    velocity = np.random.default_rng(3).standard_normal((len(bound), 2))
    found = one_sided_motion(bound, velocity, times=[time])
    assert np.count_nonzero(found.slid[-1] > 0) > 3  # contacts slide, in both directions
    assert len(sliders_of(bound.configuration)) == np.count_nonzero(bound.sliding)
    followed = integrate(bound, PUSH * velocity, system.time_step, count) / PUSH
    size = np.abs(found.displacement[0]).max()
    np.testing.assert_allclose(followed, found.displacement[0], rtol=0, atol=1e-4 * size)  # second order in PUSH
    # sticking contacts alone move otherwise
    linear = expm(time * motion_matrix(bound)) @ np.concatenate([np.zeros(18), *velocity.T, np.zeros(6)])
    assert np.abs(linear[:12].reshape(2, 6).T - found.displacement[0]).max() > 0.1 * size


def test_is_the_motion_of_the_law_under_a_load_that_rises(bound):
    system, count = OneSidedSystem.of(bound), 400
    rise = np.random.default_rng(4).standard_normal((len(bound), 2))
    found = one_sided_motion(bound, rise=rise, times=[count * system.time_step])
    followed = integrate(bound, 0 * rise, system.time_step, count, PUSH * rise) / PUSH
    size = np.abs(found.displacement[0]).max()
    np.testing.assert_allclose(followed, found.displacement[0], rtol=0, atol=1e-4 * size)
    assert np.count_nonzero(found.slid[-1] > 0) > 2


@settings(max_examples=10, deadline=None)
@given(scale=st.floats(1e-6, 1e6), seed=st.integers(0, 99))
def test_is_homogeneous(scale, seed):
    packing = _three()
    velocity = np.random.default_rng(seed).standard_normal((3, 2))
    one, other = (one_sided_motion(packing, v, times=[0.1, 0.3]) for v in (velocity, scale * velocity))
    size = np.abs(one.displacement).max()
    np.testing.assert_allclose(other.displacement / scale, one.displacement, rtol=0, atol=1e-12 * size)
    assert one.mean_square_displacement.shape == (2,)


def _three():
    law = MindlinLaw(2e3, 6e2, 0.5, cn=2.0, ct=1.0, coulomb=True)
    c = Contacts([0, 1, 2, 2, 0], [-1, -1, 0, 1, 1], np.zeros(5))
    bare = Packing(position=[[0.0, 0.49], [0.99, 0.49], [0.495, 1.34]], radius=[0.5] * 3, contacts=c, law=law)
    return replace(bare, contacts=c.slipped(law.slip_limit(bare.geometry.overlap) * [0.3, -0.3, 0.2, 1.0, 0.1], None))


def test_without_contacts_at_the_bound_it_is_linear(bound):
    """To rounding; and by steps, to their second order."""
    packing = replace(bound, law=replace(bound.law, mu=7.0, exponent=1.0))
    velocity = np.random.default_rng(5).standard_normal((6, 2))
    times = [0.05, 0.2]
    start = np.concatenate([np.zeros(18), *velocity.T, np.zeros(6)])
    found = one_sided_motion(packing, velocity, times=times)
    for k, time in enumerate(times):
        linear = (expm(time * motion_matrix(packing)) @ start)[:12].reshape(2, 6).T
        size = np.abs(linear).max()
        np.testing.assert_allclose(found.displacement[k], linear, rtol=0, atol=1e-12 * size)
    errors = []
    for share in (0.1, 0.05):
        system = OneSidedSystem(Motion.of(replace(packing, law=replace(packing.law, cn=0.0, ct=0.0))), share)
        state = system.start(start[18:, None])
        exact = system.start(start[18:, None])
        system.advance(state, 0.2)
        system.advance_exactly(exact, 0.2)
        errors.append(np.abs(state.z - exact.z).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_times_are_refused_that_are_none():
    for times in ([1.0, 0.5], [-1.0], [np.nan]):
        with pytest.raises(ValueError, match="increasing order"):
            one_sided_motion(_three(), times=times)


def test_sliding_on_for_ever_is_the_derivative_of_the_bound(bound):
    """K + G Y of sliders is K with f_t = mu f_n, as the law itself has it."""
    slides = stiffness_matrix(bound, sliding=True)
    found = Motion.of(bound, sliding=True)
    expected = mass_weighted(slides, bound)[found.active][:, found.active]
    assert abs(found.stiffness - expected).max() < 1e-12 * abs(expected).max()


def test_stability_of_three_disks():
    found = stability(_three())
    assert found.at_bound == 1
    assert found.stable is None  # in no balance
    assert "the packing moves" in found.reasons[0]
    at_rest = _three().configuration
    at_rest = derive_frozen(at_rest, load=-at_rest.contact_force)
    told = stability(at_rest)
    assert told.stable is True
    assert told.one_sided["grows"] is False
    assert told.one_sided["amplification"] > 0
    assert str(told).startswith("stable: each of 4 pushes comes to rest")
    assert "neither of two linear motions decides" in str(told)
    assert set(told.as_dict()) >= {"stable", "growth_rate", "undamped", "at_bound", "one_sided", "rising", "asymmetry"}
    rising = stability(at_rest, rise=np.tile([1.0, 0.0], (3, 1)), time=4.0).rising
    twice = stability(at_rest, rise=np.tile([2.0, 0.0], (3, 1)), time=4.0).rising
    assert twice["drift"] == pytest.approx(2 * rising["drift"], rel=1e-9)
    # of sixteen windows the drag fades out in four; then all count, or the last half of these
    assert rising["span"] in (pytest.approx(3.0), pytest.approx(1.5))
    with pytest.raises(ValueError, match="upper layer"):
        stability(at_rest, rise="fx")
    with pytest.raises(ValueError, match="a force on no particle"):
        stability(at_rest, rise=np.zeros((3, 2)))


@pytest.mark.parametrize(("scales", "stable"), [((1e-7, 1e-9), None), ((1e-9, np.inf), True)])
def test_a_motion_that_is_that_of_no_push_has_no_verdict(monkeypatch, scales, stable):
    """Some contacts count as at the bound and are not, and others are as near to it."""
    at_rest = _three().configuration
    at_rest = derive_frozen(at_rest, load=-at_rest.contact_force)
    follow = small_motion_module.follow_pushes

    def with_scales(*given):
        found, residual = follow(*given)
        return found | {"scales": scales}, residual

    monkeypatch.setattr(small_motion_module, "follow_pushes", with_scales)
    found = stability(at_rest)
    assert found.stable is stable
    assert any("bring the packing to rest more closely" in each for each in found.reasons) is (stable is None)
    assert "Infinity" not in json.dumps(found.as_dict())


@pytest.mark.parametrize(("count", "says"), [(1, "1 of 3 contacts is at Coulomb's bound and slides"), (2, "and slide")])
def test_the_verdict_says_what_contacts_of_a_smoothed_law_do_at_the_bound(count, says):
    found = stability(_three())
    found = replace(found, contacts=3, at_bound=count, one_sided=None, sliding=found.sticking)
    assert found.sentences[-1].endswith(says)


def test_a_configuration_says_what_its_stiffness_takes_contacts_at_the_bound_for():
    configuration = _three().configuration
    assert configuration.contacts.one_sided.any()
    assert "at Coulomb's bound, sticking in K, 0 rattlers" in repr(configuration)
    contacts = derive_frozen(configuration.contacts, sliding=configuration.contacts.at_bound)
    assert "at Coulomb's bound, sliding in K, 0 rattlers" in repr(derive_frozen(configuration, contacts=contacts))


def test_a_spectrum_without_growth_has_no_rate_of_growth():
    found = spectrum(derive_frozen(_three().configuration, load=-_three().configuration.contact_force))
    assert len(found.pairs) == len(found.negative) == 0
    assert "K alone has 0 complex pairs;" in repr(found)


def test_large_packings_have_the_verdict_of_small_ones(monkeypatch):
    """By searches, and one push in longer steps that is followed until nothing that grows is left."""
    lossy = replace(_three(), law=replace(_three().law, cn=40.0, ct=20.0)).configuration
    at_rest = derive_frozen(lossy, load=-lossy.contact_force)
    expected = stability(at_rest)
    with monkeypatch.context() as patch:
        like_a_large_one(patch)
        found = stability(at_rest)
    assert found.stable is True
    assert found.one_sided["pushes"] == 2
    as_long = stability(at_rest, time=found.one_sided["time"])
    assert as_long.one_sided["pushes"] == 4
    assert 0 < found.one_sided["amplification"] < 1.1 * as_long.one_sided["amplification"]
    assert found.decay.grows is False
    assert found.searched == 0
    assert found.sliding.growth_rate == pytest.approx(expected.sliding.growth_rate, rel=1e-6)
    assert expected.searched == 0.0


def like_a_large_one(monkeypatch):
    """No eigenvalue is computed, and the search sees fast growth alone."""
    monkeypatch.setattr(stability_module, "LARGE", 0)
    for name, value in {"SLICED": 0, "DENSE_DAMPED": 0, "DECAY_UP_TO": 0, "PERIODS_OF_LARGE": 9 * 30.0}.items():
        monkeypatch.setattr(rates_module, name, value)


def stuck_at_rest(**law):
    stuck = replace(_three(), law=replace(_three().law, mu=50.0, **law)).configuration
    return derive_frozen(stuck, load=-stuck.contact_force)


def test_a_large_packing_is_stable_if_a_push_decays_so_far_that_growth_would_be_seen(monkeypatch):
    at_rest = stuck_at_rest(cn=0.02)
    slowest = stability(at_rest).growth_rate
    assert slowest < 0
    like_a_large_one(monkeypatch)
    monkeypatch.setattr(decay_module, "FACTORED", {2: 0})  # no slow motion is known: here these would be all
    found = stability(at_rest)
    assert found.stable is True
    assert found.decay.grows is False
    assert found.searched == 0
    # |u|^2 of 18 coordinates falls from 36 to 1e-6: by exp(-17.4)
    assert -slowest * found.decay.time == pytest.approx(17.4, rel=0.3)
    assert found.growth_rate == pytest.approx(slowest, rel=0.05)
    assert str(found).startswith("stable: motion from a random state decayed in t = ")
    short = stability(at_rest, time=0.5 * found.decay.time)
    assert short.stable is None
    assert 0 < short.searched == short.decay.searched
    assert short.decay.needed == pytest.approx(found.decay.time, rel=0.3)
    assert "D that grows more slowly than exp(" in str(short)
    assert "would do" in str(short)


def test_a_large_packing_in_which_nothing_decays_is_not_called_stable(monkeypatch):
    at_rest = stuck_at_rest(cn=0.0, ct=0.0)
    like_a_large_one(monkeypatch)
    found = stability(at_rest, time=20.0)
    assert found.stable is None
    assert found.decay.needed is None
    assert str(found).splitlines()[0].endswith("in which motion did not decay")


RISE = np.tile([1.0, 0.0], (3, 1))


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_what_follows_a_load_that_rises_does_not_vibrate(exponent):
    """The drift is solved for, and is that of the motion that is followed."""
    at_rest = stuck_at_rest(cn=2.0, ct=1.0, exponent=exponent)
    assert np.any(at_rest.contacts.closing != at_rest.contacts.parting) == (exponent == 1.5)
    rising = stability(at_rest, rise=RISE).rising
    assert rising["steady"]
    assert rising["vibration"] == 0
    assert rising["time"] is None
    system = OneSidedSystem.of(at_rest)
    followed = follow_load(system, forces_on_coordinates(at_rest, RISE), 30.0)
    assert rising["drift"] == pytest.approx(followed["drift"], rel=1e-3)
    assert rising["next_change"] == pytest.approx(followed["next_change"], rel=1e-2)
    assert followed["vibration"] < 1e-2 * rising["drift"]


@pytest.mark.parametrize(("mu", "up", "event"), [(0.5, 0.0, "reaches Coulomb's bound"), (0.0, 1.0, "opens")])
def test_the_load_may_rise_until_a_contact_reaches_the_bound_or_opens(mu, up, event):
    """At the increase that is told the law itself, displaced by K^-1 times the rise, is about at the bound, or open."""
    bare, slips = _three(), [0.3, -0.3, 0.2, 0.9, 0.1]
    law = replace(bare.law, exponent=1.0, mu=mu)
    slips = np.array(slips) * law.slip_limit(bare.geometry.overlap) if mu else np.zeros(5)
    packing = replace(bare, contacts=bare.contacts.slipped(slips, None), law=law)
    at_rest = packing.configuration
    at_rest = derive_frozen(at_rest, load=-at_rest.contact_force)
    rise = np.array([[1 - up, 0.0], [1 - up, 0.0], [1 - up, up]])
    found = stability(at_rest, rise=rise)
    rising = found.rising
    assert rising["next_event"] == event
    drift = np.linalg.lstsq(stiffness_matrix(packing).toarray(), [*rise.T.ravel(), 0.0, 0.0, 0.0])[0]
    assert rising["drift"] == pytest.approx(np.sqrt(np.mean(drift[:6] ** 2)), rel=1e-4)
    before, after = (moved(packing, share * rising["next_change"] * drift, 0.0) for share in (0.9, 1.1))
    if event == "opens":
        assert len(after.contacts) < len(before.contacts) == len(packing.contacts)
    else:
        assert before.configuration.mobilised.max() < 1 - 1e-3
        assert after.configuration.contacts.at_bound.any()
    assert str(found).endswith(f"until the load has risen by {rising['next_change']:.2g} (a contact {event})")


def test_the_drift_of_a_slow_cycle_is_its_mean_velocity(monkeypatch):
    """Ten units of motion in one window of five, and rest in four: a drift of two, and a vibration of four."""
    at_rest = stuck_at_rest()
    system = OneSidedSystem.of(at_rest)
    shape = np.zeros((3, 2, 1))
    coordinates = np.zeros(at_rest.coordinates)
    coordinates[[0, 3]] = at_rest.mass[0] ** 0.5 * np.array([0.6, 0.8])
    shape[0, :, 0] = [0.6, 0.8]
    z = coordinates[system.motion.active, None]

    def windows(system, direction, length):
        for number in count():
            speed = 10.0 if number % 5 == 0 else 0.0
            yield Span(length, speed * length * z, np.zeros((system.rescaled[1].shape[1], 1)),
                       speed**2 * length * shape**2, np.zeros((system.sliders[1].shape[0], 1)))  # fmt: skip

    monkeypatch.setattr(rising_load, "windows_under_load", windows)
    found = follow_load(system, forces_on_coordinates(at_rest, RISE))
    size = np.sqrt(1 / 6)
    assert found["drift"] == pytest.approx(2 * size, abs=2 * found["drift_error"])
    assert found["vibration"] == pytest.approx(4 * size, abs=2 * found["vibration_error"])
    assert found["drift_error"] < 0.3 * found["drift"]
    assert found["steady"]


def test_a_rise_that_comes_after_the_next_change_is_refused(monkeypatch):
    """A contact that counts as at the bound lacks 5e-7 of it, and another one reaches it before."""
    three = _three()
    limit = three.law.slip_limit(three.geometry.overlap)
    slips = np.array([1 - 5e-7, -0.3, 0.2, 0.3, 0.1]) * limit
    at_rest = replace(three, contacts=three.contacts.slipped(slips, None)).configuration
    at_rest = derive_frozen(at_rest, load=-at_rest.contact_force)
    assert at_rest.contacts.at_bound.sum() == 1
    found = stability(at_rest, rise=RISE, time=4.0)
    least, change = found.rising["least_rise"], found.rising["next_change"]
    assert 0 < least < change
    assert f"from a rise of {least:.1g} on" in str(found)
    monkeypatch.setattr(rising_load, "next_change", lambda *given: {"next_change": 0.5 * least, "next_event": "opens"})
    found = stability(at_rest, rise=RISE, time=4.0)
    assert found.rising is None
    assert found.not_followed.endswith(
        f"another contact opens before, at {0.5 * least:.1g}: bring the packing to rest more closely"
    )


def test_spans_of_windows_are_joined_exactly(bound):
    system = OneSidedSystem.of(bound)
    direction = forces_on_coordinates(bound.configuration, np.random.default_rng(4).standard_normal((len(bound), 2)))
    short = list(islice(rising_load.windows_under_load(system, direction, 0.2), 6))
    whole = Span.joined(short)
    assert whole.time == pytest.approx(1.2)
    np.testing.assert_allclose(
        Span.joined([Span.joined(short[:4]), Span.joined(short[4:])]).drift_and_vibration(system),
        whole.drift_and_vibration(system),
        rtol=1e-12,
    )
    # what the means of the windows differ by is no drift of the whole, but vibration
    apart = np.var([system.displacement(each.displacement) / each.time for each in short], axis=0).mean(axis=(0, 1))
    of_windows = np.mean([each.drift_and_vibration(system) ** 2 for each in short], axis=0)
    assert np.all(apart > 1e-3 * of_windows[0])
    drift, vibration = whole.drift_and_vibration(system) ** 2
    np.testing.assert_allclose(drift, of_windows[0] - apart, rtol=1e-9)
    # sums over the steps of a short window may fall below the square of its mean, and count as none
    np.testing.assert_allclose(vibration, of_windows[1] + apart, rtol=1e-4)


def test_a_load_that_accelerates_a_free_motion_is_not_followed():
    """Three disks without friction on a floor, on which they slide together."""
    packing = replace(_three(), law=replace(_three().law, mu=0.0), contacts=_three().contacts.slipped(np.zeros(5)))
    at_rest = derive_frozen(packing.configuration, load=-packing.configuration.contact_force)
    found = stability(at_rest, rise=RISE)
    assert found.stable is True
    assert found.free == 1
    assert found.rising is None
    says = "under a load that rises: not followed, since the load accelerates 1 motion that no force opposes"
    assert found.sentences[-1] == says


def test_under_a_rising_load_a_packing_that_is_unstable_is_not_followed():
    """A disk that stands on another, pressed by its weight, falls over."""
    law = MindlinLaw(2e3, 6e2, 50.0, cn=0.5, ct=0.1, coulomb=True)
    position, c = [[0.0, 0.49], [0.0, 1.47]], Contacts([0, 1], [-1, 0], np.zeros(2))
    pile = Packing(position=position, radius=[0.5] * 2, contacts=c, law=law).configuration
    found = stability(derive_frozen(pile, load=-pile.contact_force), rise=np.tile([1.0, 0.0], (2, 1)))
    assert found.stable is False
    assert found.rising is None
    assert found.sentences[-1] == "under a load that rises: not followed, since small motion grows"
    json.dumps(found.as_dict(), allow_nan=False)


@pytest.mark.parametrize("time", [-1, 0, np.nan, "long"])
def test_a_time_that_is_none_is_refused_before_work_starts(time, monkeypatch):
    monkeypatch.setattr(small_motion_module, "spectrum", None)
    with pytest.raises(ValueError, match=r"The time that motion is followed is a positive number, not "):
        stability(_three(), rise="fx", time=time)


def test_two_vibrations_of_one_packing_are_told_apart():
    """What is said of two starts, whose motions are those of a layer that vibrates in two ways."""
    lossy = replace(_three(), law=replace(_three().law, cn=0.02, ct=0.01)).configuration
    at_rest = derive_frozen(lossy, load=-lossy.contact_force)
    found = stability(at_rest, rise=np.tile([1.0, 0.0], (3, 1)), time=4.0)
    errors = {"drift_error": 1e-5, "vibration_error": 2e-5}
    one = {"drift": 3.75e-3, "vibration": 6.85e-4, "steady": True} | errors
    for other, says in (
        (
            {"vibration": 1.05e-3},
            "\u00b1 2e-05, and from another start drift 0.00375 \u00b1 1e-05, vibration 0.00105 \u00b1 2e-05",
        ),
        ({"steady": False}, "vibration 0.000685 \u00b1 2e-05, not steady yet"),
        ({"vibration": 6.8e-4}, "1e-05, vibration 0.000685 \u00b1 2e-05"),
    ):
        rest = {"time": 4.0, "span": 3.0, "least_rise": 0.0, "next_change": None, "next_event": None}
        rising = {**one, **rest, "other_start": one | other}
        assert replace(found, rising=rising).sentences[-1].endswith(says)
    assert set(found.rising["other_start"]) == set(one)


def test_a_rising_load_is_followed_where_pushes_have_not_settled():
    at_rest = _three().configuration
    at_rest = derive_frozen(at_rest, load=-at_rest.contact_force)
    found = stability(at_rest, rise=np.tile([1.0, 0.0], (3, 1)), time=0.05)
    assert found.stable is None
    assert found.rising["drift"] > 0


@pytest.mark.parametrize("cluster", [1.0], indirect=True)
def test_a_body_moves_as_one(bound):
    """Two disks that move as one along x on a spring: forces add up, both have the displacement, masses add up.

    No disk touches another, so that one law is enough.
    """
    configuration, n = bound.configuration, len(bound)
    size, k, rate = configuration.coordinates, 3.0, 0.5
    lead = np.zeros((size, size))
    lead[0, 0] = lead[1, 0] = 1.0  # x of the first two disks
    held = np.zeros((size, size))
    held[0, 0] = k
    body = derive_frozen(
        configuration,
        contacts=configuration.contacts.chosen(np.zeros(len(configuration.contacts), bool)),
        stiffness=csr_array(held),
        damping=csr_array((size, size)),
        constraint=csr_array(lead),
    )
    rise = np.zeros((n, 2))
    rise[:2, 0] = rate / 2
    times = np.array([0.7, 3.0])
    found = one_sided_motion(body, rise=rise, times=times)
    omega = np.sqrt(k / configuration.mass[:2].sum())
    wanted = rate / k * (times - np.sin(omega * times) / omega)
    for disk in (0, 1):
        np.testing.assert_allclose(found.displacement[:, disk, 0], wanted, rtol=1e-6)
    assert not found.displacement[:, 2:].any()
    moving = stability(body, rise=rise).rising
    assert moving["drift"] == pytest.approx(rate / k * np.sqrt(2 / (2 * n)), rel=1e-6)
    assert moving["other_start"] is None


@pytest.mark.parametrize("drag_time", [None, 2.0])
def test_a_disk_that_touches_nothing_flies_on(bound, drag_time):
    """With the drag v = v_0 exp(-t/tau); under a load that rises without drag x = v_0 t + g t^3 / 6 m."""
    n, times = len(bound), np.array([0.5, 1.0, 3.0])
    with_rattler = replace(
        bound,
        position=np.vstack([bound.position, bound.position.max(axis=0) + 20.0]),
        radius=np.append(bound.radius, 0.5),
        angle=np.append(bound.angle, 0.0),
        top=np.append(bound.top, False),
        mass=np.append(bound.mass, 4.0),
        drag_time=drag_time,
    )
    assert list(with_rattler.rattlers) == [n]
    velocity, rise = np.ones((n + 1, 2)), np.full((n + 1, 2), 3.0)
    found = one_sided_motion(with_rattler, velocity, times=times)
    decay = np.exp(-times / drag_time) if drag_time else np.ones(3)
    flight = drag_time * (1 - decay) if drag_time else times
    np.testing.assert_allclose(found.displacement[:, n, 0], flight, rtol=1e-12)
    np.testing.assert_allclose(found.velocity[:, n, 1], decay, rtol=1e-12)
    others = one_sided_motion(replace(bound, drag_time=drag_time), velocity[:n], times=times)
    np.testing.assert_allclose(found.displacement[:, :n], others.displacement, atol=1e-12)
    if drag_time is None:
        drawn = one_sided_motion(with_rattler, velocity, rise, times=times)
        np.testing.assert_allclose(drawn.displacement[:, n, 1], times + 3 * times**3 / 6 / 4.0, rtol=1e-12)


def test_fx_is_a_force_on_the_upper_layer(bound):
    forces = np.outer(bound.top, [1.0, 0.0])
    found, expected = (one_sided_motion(bound, rise=rise, times=[0.0, 1.0]) for rise in ("fx", forces))
    assert np.array_equal(found.displacement, expected.displacement)
    with pytest.raises(ValueError, match='rise is "fx" of a packing with an upper layer, or an array of forces'):
        one_sided_motion(bound, rise="fy", times=[1.0])
