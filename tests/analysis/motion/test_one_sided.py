"""One-sided motion beside a force law that is integrated as it stands, and its properties."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from linearised import motion_matrix
from quasistatic import branches, lengths_one, turned
from scipy.linalg import expm
from scipy.sparse import csr_array
from three_disks import three_disks

from faultgouge.analysis import Motion, one_sided_motion, stability, stiffness_matrix
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.motion.eigenvalues import mass_weighted
from faultgouge.analysis.motion.one_sided import MOTION_STEP, OneSidedSystem
from faultgouge.analysis.operators.sliders import sliders_of

PUSH = 1e-6
"""Times a velocity of one: displacements of 1e-7 are far below overlaps of 1e-2, and far above rounding."""


def integrate(packing, velocity, step, count, rise=0.0):
    """Displacements of the disks: velocity Verlet of the law itself, under loads that balance the packing at first."""
    law, c, n = packing.law, packing.contacts, len(packing)
    reach = packing.radius[c.i] + np.where(c.floor, 0.0, packing.radius[c.j])
    mass = np.outer([1.0, 1.0, packing.inertia_factor], packing.mass).T
    place, slip, speed = packing.position, c.slip, np.column_stack([velocity, np.zeros(n)])

    def contact(place):
        between = branches(place, packing.box_length, c.i, c.j)
        return lengths_one(between), reach - np.linalg.norm(between, axis=1)

    def relative(moves):
        """Along x and y, and how far contacts roll."""
        other = np.where(c.floor[:, None], 0.0, moves[c.j])
        return moves[c.i, :2] - other[:, :2], moves[c.i, 2] + other[:, 2]

    def forces(place, speed, slip):
        normal, overlap = contact(place)
        moves, rolls = relative(speed)
        power, bound = law.growth(overlap), law.mu * law.kn * overlap * law.growth(overlap)
        fn = law.kn * overlap * power - law.cn * power * np.sum(normal * moves, axis=1)
        rate = np.sum(turned(normal) * moves, axis=1) - rolls
        ft = np.clip(-law.kt * power * slip - law.ct * power * rate, -bound, bound)
        on, net = np.column_stack([fn[:, None] * normal + ft[:, None] * turned(normal), -ft]), np.zeros((n, 3))
        np.add.at(net, c.i, on)
        np.subtract.at(net, c.j[~c.floor], on[~c.floor] * [1.0, 1.0, -1.0])
        return net

    rest = forces(place, 0 * speed, slip)
    force = forces(place, speed, slip) - rest
    for k in range(count):
        speed = speed + 0.5 * step * force / mass
        (before, less), place = contact(place), place + step * speed[:, :2]
        (after, overlap), (moves, rolls) = contact(place), relative(step * speed)
        gain = np.sum(turned(0.5 * (before + after)) * moves, axis=1) - rolls
        if law.rescales:
            gain = gain - slip / (2 * overlap) * np.maximum(overlap - less, 0.0)
        slip = law.clamped(overlap, slip + gain)
        force = forces(place, speed, slip) - rest
        force[:, :2] += (k + 1) * step * rise
        speed = speed + 0.5 * step * force / mass
    return place - packing.position


@pytest.mark.parametrize("rises", [False, True])
def test_is_the_motion_of_the_law(bound, rises):
    """After a push, and under a load that rises; contacts slide, in both directions."""
    count, step = 400, MOTION_STEP * OneSidedSystem.of(bound).stable_step
    given = np.random.default_rng(3 + rises).standard_normal((len(bound), 2))
    found = one_sided_motion(bound, **{"rise" if rises else "velocity": given}, times=[count * step])
    assert np.count_nonzero(found.slid[-1] > 0) > 2 + (not rises)
    assert len(sliders_of(bound.configuration)) == np.count_nonzero(bound.sliding)
    push, rise = (0 * given, PUSH * given) if rises else (PUSH * given, 0.0)
    followed = integrate(bound, push, step, count, rise) / PUSH
    size = np.abs(found.displacement[0]).max()
    np.testing.assert_allclose(followed, found.displacement[0], rtol=0, atol=1e-4 * size)  # second order in PUSH
    if not rises:  # sticking contacts alone move otherwise
        linear = expm(count * step * motion_matrix(bound)) @ np.concatenate([np.zeros(18), *given.T, np.zeros(6)])
        assert np.abs(linear[:12].reshape(2, 6).T - found.displacement[0]).max() > 0.1 * size


@settings(max_examples=10, deadline=None)
@given(scale=st.floats(1e-6, 1e6), seed=st.integers(0, 99))
def test_is_homogeneous(scale, seed):
    packing = three_disks()
    velocity = np.random.default_rng(seed).standard_normal((3, 2))
    one, other = (one_sided_motion(packing, v, times=[0.1, 0.3]) for v in (velocity, scale * velocity))
    size = np.abs(one.displacement).max()
    np.testing.assert_allclose(other.displacement / scale, one.displacement, rtol=0, atol=1e-12 * size)
    assert one.mean_square_displacement.shape == (2,)


def test_without_contacts_at_the_bound_it_is_linear(bound):
    """To rounding; and by steps, to their second order."""
    packing = replace(bound, law=replace(bound.law, mu=7.0, exponent=1.0))
    velocity = np.random.default_rng(5).standard_normal((6, 2))
    times = [0.05, 0.2]
    start = np.concatenate([np.zeros(18), *velocity.T, np.zeros(6)])
    found = one_sided_motion(packing, velocity, times=times)
    for each, time in zip(found.displacement, times, strict=True):
        linear = (expm(time * motion_matrix(packing)) @ start)[:12].reshape(2, 6).T
        np.testing.assert_allclose(each, linear, rtol=0, atol=1e-12 * np.abs(linear).max())
    errors, undamped = [], replace(packing, law=replace(packing.law, cn=0.0, ct=0.0))
    system, exact = OneSidedSystem.of(undamped), one_sided_motion(undamped, velocity, times=[0.2])
    for share in (0.1, 0.05):
        state = system.start(start[18:, None])
        system.advance(state, 0.2, share)
        errors.append(np.abs(system.displacement(state.z)[..., 0] - exact.displacement[0]).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_sliding_on_for_ever_is_the_derivative_of_the_bound(bound):
    """K + G Y of sliders is K with f_t = mu f_n, as the law itself has it."""
    slides = stiffness_matrix(bound, sliding=True)
    found = Motion.of(bound, sliding=True)
    expected = mass_weighted(slides, bound)[found.active][:, found.active]
    assert abs(found.stiffness - expected).max() < 1e-12 * abs(expected).max()


@pytest.mark.parametrize("cluster", [1.0], indirect=True)
def test_a_body_moves_as_one(bound):
    """Two disks that move as one along x on a spring: forces add up, both have the displacement, masses add up.

    No disk touches another, so that one law is enough.
    """
    configuration, k, rate, times = bound.configuration, 3.0, 0.5, np.array([0.7, 3.0])
    none = np.zeros((configuration.coordinates, configuration.coordinates))
    lead, held = none.copy(), none.copy()
    lead[:2, 0], held[0, 0] = 1.0, k  # x of the first two disks
    body = derive_frozen(
        configuration, contacts=configuration.contacts.chosen(np.zeros(len(bound.contacts), bool)),
        stiffness=csr_array(held), damping=csr_array(none), constraint=csr_array(lead),
    )  # fmt: skip
    rise = np.outer(np.arange(len(bound)) < 2, [rate / 2, 0.0])
    found = one_sided_motion(body, rise=rise, times=times)
    omega = np.sqrt(k / configuration.mass[:2].sum())
    wanted = rate / k * (times - np.sin(omega * times) / omega)
    np.testing.assert_allclose(found.displacement[:, :2, 0], np.column_stack([wanted, wanted]), rtol=1e-6)
    assert not found.displacement[:, 2:].any()
    moving = stability(body, rise=rise).rising
    assert moving.drift == pytest.approx(rate / k * np.sqrt(2 / (2 * len(bound))), rel=1e-6)
    assert moving.other_start is None


@pytest.mark.parametrize("drag_time", [None, 2.0])
def test_a_disk_that_touches_nothing_flies_on(bound, drag_time):
    """With the drag v = v_0 exp(-t/tau); under a load that rises without drag x = v_0 t + g t^3 / 6 m."""
    n, times = len(bound), np.array([0.5, 1.0, 3.0])
    more = {"radius": 0.5, "angle": 0.0, "top": False, "mass": 4.0}
    more = {name: np.append(getattr(bound, name), value) for name, value in more.items()}
    place = np.vstack([bound.position, bound.position.max(axis=0) + 20.0])
    with_rattler = replace(bound, position=place, drag_time=drag_time, **more)
    assert list(with_rattler.rattlers) == [n]
    velocity, rise = np.ones((n + 1, 2)), np.full((n + 1, 2), 3.0)
    found = one_sided_motion(with_rattler, velocity, times=times)
    decay = np.exp(-times / drag_time) if drag_time else np.ones(3)
    flight = drag_time * (1 - decay) if drag_time else times
    np.testing.assert_allclose(found.displacement[:, n, 0], flight, rtol=1e-12)
    np.testing.assert_allclose(found.velocity[:, n, 1], decay, rtol=1e-12)
    others = one_sided_motion(replace(bound, drag_time=drag_time), velocity[:n], times=times)
    np.testing.assert_allclose(found.displacement[:, :n], others.displacement, rtol=0, atol=1e-12)
    if drag_time is None:
        drawn = one_sided_motion(with_rattler, velocity, rise, times=times)
        np.testing.assert_allclose(drawn.displacement[:, n, 1], times + 3 * times**3 / 6 / 4.0, rtol=1e-12)


def test_fx_is_a_force_on_the_upper_layer(bound):
    forces = np.outer(bound.top, [1.0, 0.0])
    found, expected = (one_sided_motion(bound, rise=rise, times=[0.0, 1.0]) for rise in ("fx", forces))
    assert np.array_equal(found.displacement, expected.displacement)
