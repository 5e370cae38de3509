"""Slow motions and the decay of all others, against LAPACK's eigenvalues of the first-order matrix."""

from dataclasses import replace

import numpy as np
import pytest
from known_spectra import complex_block, turned
from linearised import dissipative, motion_matrix
from scipy.sparse import csr_array

from faultgouge.analysis import Configuration, LinearisedContacts
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.contacts import PER_CONTACT
from faultgouge.analysis.motion import rates as module
from faultgouge.analysis.motion.decay import follow_decay
from faultgouge.analysis.motion.decay_steps import ExplicitSteps, ImplicitSteps, slope
from faultgouge.analysis.motion.growth_in_words import exponential
from faultgouge.analysis.motion.motion import Motion
from faultgouge.analysis.motion.rates import rates_of
from faultgouge.analysis.motion.slow_motions import motions_of_one, slow_motions

STRONG, WEAKER, WITH_DRAG = (2.0, 1.0, None), (0.2, 0.1, None), (0.02, 0.01, 30.0)


@pytest.fixture(scope="module", params=[STRONG, WEAKER, WITH_DRAG])
def damped(request, reference_packing):
    """100 disks with strong and with weak dashpots, and with drag."""
    cn, ct, drag = request.param
    return dissipative(reference_packing(1.0), cn, ct, drag)


def all_values(packing):
    """s with Im s >= 0 of motions that a force opposes, the slowest decay first."""
    values = np.linalg.eigvals(motion_matrix(packing))
    values = values[(values.imag >= 0) & (np.abs(values) > 1e-5 * np.abs(values).max())]
    return values[np.argsort(-values.real)]


def found_of(motion):
    """Slow motions of a motion, from one more space than the first."""
    seen = []
    frequency = np.sqrt(abs(motion.stiffness).sum(axis=1).max())
    return slow_motions(
        motion.stiffness,
        motion.damping,
        motion.particle,
        0.1 * frequency,
        lambda found: 1e9 * (seen.append(found) or len(seen) < 3),
    )


def row_of_spheres(count, pressed=2.0, dashpot=40.0):
    """Equal spheres side by side on a plane, between two walls that press them together; apart if `pressed` is 0."""
    first, others = np.arange(count), np.arange(count - 1)
    i = np.concatenate([others + 1, first, [0, count - 1]])
    j = np.concatenate([others, np.full(count + 2, -1)])
    pair, size = j >= 0, len(i)
    normal = np.zeros((size, 3))
    normal[pair, 0] = 1.0
    normal[count - 1 : -2, 2] = 1.0
    normal[-2, 0], normal[-1, 0] = 1.0, -1.0
    force = np.where(np.abs(normal[:, 0]) > 0, pressed, 1.0)
    load = np.zeros((count, 2, 3))
    load[:, 0, 2] = -1.0
    none, ones = np.zeros((size, 3)), np.ones((size, 2))
    contacts = LinearisedContacts(
        i=i, j=j, normal=normal, distance=np.where(pair, 1.0, np.inf), overlap=np.full(size, 1e-3),
        slip_arm=0.5 * ones, lever_arm=0.5 * ones, lever_slope=np.zeros(size),
        normal_force=force, tangential_force=none,
        normal_stiffness=np.full(size, 3e3), tangential_stiffness=np.full(size, 2e3), closing=none, parting=none,
        normal_dashpot=np.full(size, dashpot), tangential_dashpot=np.full(size, 0.5 * dashpot),
        friction=0.5 * force,
    )  # fmt: skip
    place = np.column_stack([first, 0 * first, 0.5 + 0 * first])
    each = np.ones(count)
    contacts = contacts.chosen(force > 0)
    return Configuration(
        dimension=3, position=place, radius=0.5 * each, mass=each, inertia=0.1 * each, contacts=contacts,
        box=np.diag([count, 1.0, 1.0]), origin=np.array([-0.5, -0.5, 0.0]), periodic=np.zeros(3, bool), load=load,
    )  # fmt: skip


def test_slow_motions_are_all_of_lapack_below_the_radius(damped):
    motion, expected = Motion.of(damped), all_values(damped)
    found = found_of(motion)
    # rounding of a dense solver, 1e-13 of the largest eigenvalue for a motion that is not well conditioned
    near = 1e-9 * np.abs(expected).max()
    inside = expected[np.abs(expected) < 0.999 * found.radius]
    assert len(inside) > 10
    for value in inside:
        assert np.abs(found.values - value).min() < near


def test_the_space_of_slow_motions_is_invariant(damped):
    motion = Motion.of(damped)
    found = found_of(motion)
    size, v = len(motion.active), found.basis
    image = np.concatenate(
        [found.reference * v[size:], -(motion.stiffness @ v[:size]) / found.reference - motion.damping @ v[size:]]
    )
    largest = np.sqrt(abs(motion.stiffness).sum(axis=1).max())
    np.testing.assert_allclose(v.T @ v, np.eye(v.shape[1]), atol=1e-12)
    # residuals of the inverse, as its iteration ends
    assert np.abs(image - v @ (v.T @ image)).max() < 1e-6 * largest


@pytest.mark.parametrize("damped", [STRONG, WEAKER, WITH_DRAG], indirect=True)
@pytest.mark.long
def test_rates_of_a_packing_beyond_lapack_have_its_slowest_decay(damped, monkeypatch):
    expected = rates_of(Motion.of(damped))
    assert not expected.grows.any()
    assert expected.growth_rate < 0
    monkeypatch.setattr(module, "DENSE_DAMPED", 100)
    searches, search = [], module.fastest_growing
    monkeypatch.setattr(module, "fastest_growing", lambda *a, **k: searches.append(k["periods"]) or search(*a, **k))
    found = rates_of(Motion.of(damped))
    assert searches == [(module.FIRST_SEARCH, module.FIRST_SEARCH)]  # once all decays, a longer one would say less
    assert not found.grows.any()
    assert found.growth_rate == pytest.approx(expected.growth_rate, rel=1e-6)
    assert found.free == expected.free
    assert found.searched == 0


@pytest.mark.parametrize(("pressed", "grows"), [pytest.param(0.0, False, marks=pytest.mark.long), (2.0, True)])
def test_rates_that_do_not_decide_are_those_of_fast_growth_alone(monkeypatch, pressed, grows):
    """Whether all other motion decays is not found out. Spheres that are pressed together buckle."""
    motion = Motion.of(row_of_spheres(4, pressed, dashpot=4.0))
    expected = rates_of(motion)
    assert bool(expected.grows.any()) is grows
    monkeypatch.setattr(module, "DENSE_DAMPED", 0)
    found = rates_of(motion, decides=False)
    assert found.decay is None
    assert bool(found.grows.any()) is grows
    assert found.growth_rate == pytest.approx(expected.growth_rate if grows else 0.0, rel=1e-6)
    assert expected.growth_rate > found.searched if grows else found.searched > 0


@pytest.mark.long
def test_dashpots_too_weak_for_the_time_leave_a_rate_below_which_growth_may_hide(reference_packing, monkeypatch):
    monkeypatch.setattr(module, "DENSE_DAMPED", 100)
    monkeypatch.setattr(module, "DENSE_AFTER_DECAY", 0)
    monkeypatch.setattr(module, "WORK_OF_DECAY", 1e8)
    found = rates_of(Motion.of(dissipative(reference_packing(1.0), 0.002, 0.001, None)))
    assert not found.grows.any()
    assert found.decay.grows is None
    assert found.searched > -found.growth_rate > 0


@pytest.mark.long
def test_dashpots_too_weak_for_the_time_leave_all_eigenvalues_to_lapack(reference_packing, monkeypatch):
    motion = Motion.of(dissipative(reference_packing(1.0), 0.002, 0.001, None))
    expected = rates_of(motion)
    monkeypatch.setattr(module, "DENSE_DAMPED", 100)
    found = rates_of(motion)
    assert found.searched == 0
    np.testing.assert_array_equal(found.values, expected.values)


@pytest.mark.slow
def test_motions_that_no_force_opposes_are_counted_however_many_are_alike(monkeypatch):
    """Spheres on a plane roll along two axes, each by itself: a zero of more motions than a block holds."""
    apart = row_of_spheres(20, pressed=0.0)
    expected = rates_of(Motion.of(apart))
    monkeypatch.setattr(module, "DENSE_DAMPED", 10)
    found = rates_of(Motion.of(apart))
    assert found.free == expected.free == 40
    assert found.searched == 0
    assert found.growth_rate == pytest.approx(expected.growth_rate, rel=1e-5)


def turned_row(row):
    """The row, and its load, in another direction, so that no number that should be zero is zero to the bit."""
    q, _ = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))
    contacts = derive_frozen(row.contacts, normal=row.contacts.normal @ q)
    return derive_frozen(row, contacts=contacts, load=row.load @ q)


@pytest.mark.slow
def test_motions_of_one_sphere_that_nothing_drives_are_found_with_rounding(monkeypatch):
    """A sphere rolls on a plane in any direction."""
    row = turned_row(row_of_spheres(12, 0.0))
    expected = rates_of(Motion.of(row)).free
    motion = Motion.of(row)
    alone = motions_of_one(motion.stiffness, motion.damping, motion.particle)
    np.testing.assert_allclose((alone.T @ alone).toarray(), np.eye(alone.shape[1]), atol=1e-14)
    for matrix in (motion.stiffness, motion.damping):
        # rounding of a sum of a few entries
        assert abs(alone.T @ matrix).max() < 1e-13 * abs(matrix).max()
    monkeypatch.setattr(module, "DENSE_DAMPED", 10)
    found = rates_of(Motion.of(row))
    assert found.free == expected == alone.shape[1] == 36
    assert found.searched == 0


@pytest.fixture(scope="module")
def made_up():
    """The motion of a known matrix, with a loss in proportion to it, and slow motions, none of them known."""

    def make(growing):
        rng = np.random.default_rng(4)
        matrix = turned(
            [*(np.array([[value]]) for value in rng.uniform(0.5, 100, 150)), complex_block(40.0, growing)], rng
        )
        size = matrix.shape[0]
        row = row_of_spheres(40)
        damping = csr_array(2e-3 * (matrix + matrix.T))
        motion = Motion(row, np.arange(size), np.ones(size), csr_array(matrix), damping)
        slow = slow_motions(motion.stiffness, motion.damping, np.arange(size), 1.0, lambda found: 0.0)
        z = np.block([[np.zeros((size, size)), np.eye(size)], [-matrix.toarray(), -damping.toarray()]])
        values = np.linalg.eigvals(z)
        return motion, replace(slow, values=slow.values[:0], basis=np.zeros((2 * size, 0)), radius=2.0), values

    return make


@pytest.mark.parametrize("kind", [ExplicitSteps, ImplicitSteps])
def test_steps_of_both_kinds_fall_as_the_slowest_motion(made_up, kind):
    motion, slow, values = made_up(0.1)
    slowest = values[np.argmax(values.real)]
    assert slowest.real < 0
    steps = kind.of(motion, 1.0, slow, 0.2)
    logs = [steps.look() for _ in range(4 * int(2 / abs(slowest.real) / steps.time_of_look) + 40)]
    late = 2 * slope(logs[len(logs) // 2 :], steps.time_of_look)
    in_a_step = slowest.real if kind is ExplicitSteps else slowest.real / (1 + abs(slowest / steps.sigma) ** 2)
    # of the mean over a look of one motion, whose |u|^2 oscillates
    assert late / 2 == pytest.approx(2 * in_a_step, rel=0.05)


@pytest.mark.parametrize("kind", [ExplicitSteps, ImplicitSteps])
def test_steps_of_both_kinds_have_the_rate_of_what_grows(made_up, kind):
    motion, slow, values = made_up(4.0)
    fastest = 2 * values.real.max()
    assert fastest > 0.1
    steps = kind.of(motion, 1.0, slow, 0.1)
    logs = [steps.look()]
    while logs[-1] < min(logs) + 12:
        logs.append(steps.look())
    rate, error = steps.growth(logs)
    assert rate == pytest.approx(fastest, abs=max(2 * error, 1e-3 * fastest))
    assert error < 0.1 * fastest


@pytest.mark.slow
def test_slow_motions_of_a_row_that_buckles_grow_as_those_of_lapack():
    """Eigenvalues that are nearly alike, of more motions than a block holds."""
    row = row_of_spheres(40, 1e-2)
    found = follow_decay(Motion.of(row))
    assert found.grows is True
    assert found.growth_rate == pytest.approx(rates_of(Motion.of(row)).growth_rate, rel=1e-6)


def with_a_pair_out_of_balance(row, force):
    """A row on a plane, and two spheres beside it that push each other apart a little, and turn round each other."""
    c, count = row.contacts, len(row)
    given = {name: getattr(c, name) for name in PER_CONTACT}
    more = {name: values[:1] for name, values in given.items()}
    more |= {"i": [count + 1], "j": [count], "normal_force": [force], "friction": [0.5 * force]}
    more |= {"normal": [[1.0, 0.0, 0.0]], "distance": [1.0]}
    contacts = LinearisedContacts(**{name: np.concatenate([given[name], more[name]]) for name in given})
    each = {name: np.append(getattr(row, name), getattr(row, name)[:2]) for name in ("radius", "mass", "inertia")}
    return Configuration(
        dimension=3, position=np.vstack([row.position, np.add(row.position[:2], [0.0, 5.0, 0.0])]), contacts=contacts,
        box=row.box, origin=row.origin, periodic=row.periodic,
        load=np.concatenate([row.load, np.zeros((2, 2, 3))]), **each,
    )  # fmt: skip


def test_motion_that_no_force_opposes_does_not_grow_by_a_force_out_of_balance():
    """1e-9 of the forces leaves it an eigenvalue of A below zero, and s next to the root of that."""
    row = with_a_pair_out_of_balance(row_of_spheres(3, 0.0), 1e-9)
    balanced = with_a_pair_out_of_balance(row_of_spheres(3, 0.0), 1e-16)
    expected, found = rates_of(Motion.of(balanced)), rates_of(Motion.of(row))
    assert row.residual == pytest.approx(1e-9)
    assert 1e-6 < np.linalg.eigvals(Motion.of(row).first_order).real.max() < 1e-4
    assert not found.grows.any()
    assert found.free == expected.free > 6
    assert found.growth_rate == pytest.approx(expected.growth_rate, rel=1e-6)


@pytest.mark.long
def test_of_a_search_that_has_not_converged_the_least_growth_is_told(monkeypatch):
    """Rates of the row that buckles differ by 3e-5 and less: a search mixes their motions, and has an eigenvalue of
    twice the fastest."""
    row = row_of_spheres(40, 1e-2)
    expected = rates_of(Motion.of(row)).growth_rate
    monkeypatch.setattr(module, "DENSE_DAMPED", 10)
    found = rates_of(Motion.of(row))
    assert found.at_least
    # what a mixture grows at in three times, during which it becomes the fastest motion
    assert 0.9 * expected < found.growth_rate < expected


def test_growth_that_is_not_known_closely_is_told_by_a_bound():
    assert exponential(0.21962, 6) == "D as exp(0.21962 t)"
    assert exponential(0.21962, 6, at_least=True) == "D at least as exp(0.21 t), not known closer"
    assert exponential(39.99, 4, at_least=True) == "D at least as exp(39 t), not known closer"
