"""The verdict on linear motion: certificate, slow motions and random states beside LAPACK's eigenvalues."""

import re
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from known_spectra import complex_block
from known_spectra import turned as turned_blocks
from linearised import dissipative
from scipy.linalg import null_space
from scipy.sparse import csr_array, diags_array
from scipy.spatial import cKDTree

from faultgouge.analysis import Configuration, Contacts, LinearisedContacts, Motion, fastest_growing
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.motion import linear as module
from faultgouge.analysis.motion.certificate import NoProofError, prove
from faultgouge.analysis.motion.eigenvalues import exponential
from faultgouge.analysis.motion.linear import linear_verdict, opposed
from faultgouge.analysis.motion.random_state import follow_decay
from faultgouge.analysis.motion.slow_motions import slow_motions


def random_packing(seed):
    """A and G of disks with random contacts: springs, dashpots of some strength, forces that follow the overlap or
    turn.

    Some have drag, no tangential dashpots, springs that push apart, or lever arms that differ; some nothing that holds
    them, so that they drift."""
    rng = np.random.default_rng(seed)
    side = int(rng.integers(4, 7))
    place = np.stack(np.meshgrid(*[np.arange(side)] * 2), -1).reshape(-1, 2) + rng.uniform(-0.25, 0.25, (side**2, 2))
    pairs = cKDTree(place).query_pairs(1.35, output_type="ndarray")
    i, j = pairs[rng.random(len(pairs)) < 0.9].T
    normal = place[i] - place[j]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    count, contacts = len(place), np.arange(len(i))
    stretch, slide = np.zeros((2, len(i), 3 * count))  # rows: what a motion stretches and slides
    for sign, end in ((1, i), (-1, j)):
        stretch[contacts, 3 * end], stretch[contacts, 3 * end + 1] = sign * normal.T
        slide[contacts, 3 * end], slide[contacts, 3 * end + 1] = -sign * normal[:, 1], sign * normal[:, 0]
        slide[contacts, 3 * end + 2] = -1.0
    other = slide.copy()
    other[:, 2::3] *= 1 - rng.choice([0.0, 1e-3])
    kn, kt = rng.uniform(500, 2000, len(i)), rng.uniform(300, 800, len(i))
    follows = 10 ** rng.uniform(-4, -0.5) * kn * rng.uniform(-1, 1, len(i))
    pressed = rng.choice([0.0, 1e-3, 0.05]) * kn * rng.random(len(i))
    turn = slide * np.tile([1, 1, 0], count)
    a = stretch.T @ (kn[:, None] * stretch) + other.T @ (kt[:, None] * slide)
    a += other.T @ (follows[:, None] * stretch) - turn.T @ (pressed[:, None] * turn)
    strength, tangential = 10 ** rng.uniform(-4.5, -0.5), rng.choice([0.5, 0.5, 0.0])
    g = strength * (stretch.T @ (kn[:, None] * stretch) + tangential * other.T @ (kn[:, None] * slide))
    if rng.random() < 0.3:
        g += 10 ** rng.uniform(-3, 0) * np.eye(3 * count)
    held = np.arange(3 * count) >= (0 if rng.random() < 0.2 else 3 * side)  # a floor
    return csr_array(a[held][:, held]), csr_array(g[held][:, held])


def all_values(a, g):
    """s by LAPACK."""
    size = a.shape[0]
    return np.linalg.eigvals(np.block([[np.zeros((size, size)), np.eye(size)], [-a.toarray(), -g.toarray()]]))


@pytest.mark.parametrize("first", range(0, 200, 20))
def test_certificate_against_lapack_on_random_packings(first):
    """Never a false word: what is proved to decay decays, each stated error covers, and no growth is overlooked."""
    proofs = 0
    for a, g in map(random_packing, range(first, first + 20)):
        with suppress(NoProofError):
            found = prove(a, g, 1e-9)
            proofs += 1
            s, top = all_values(a, g), np.sqrt(abs(a).sum(axis=1).max())
            slowest = 2 * s[np.abs(s) > 1e-5 * top].real.max()
            rounding = 1e-11 * top  # of LAPACK's eigenvalues, whose vectors are oblique
            assert found.stable is not (slowest > rounding)
            least = -np.inf if found.at_least and found.stable is False else slowest - found.error - rounding
            assert least <= found.growth_rate <= slowest + found.error + rounding
            assert not found.s or np.abs(s - found.s).min() <= max(found.error, 1e-6 * top)
            free = a.shape[0] - np.linalg.matrix_rank(a.toarray(), tol=1e-8 * top**2)
            assert not found.stable or found.free == free
    assert proofs >= 5


def test_a_certificate_bounds_fast_motions_that_decay_more_slowly_than_the_slow_ones():
    """Lone oscillators, of which the fastest has the weakest dashpot: the error reaches up to 2 Re s of that one."""
    frequency, dashpot = np.linspace(1.0, 10.0, 200), np.linspace(0.3, 0.1, 200)
    found = prove(csr_array(np.diag(frequency**2)), csr_array(np.diag(dashpot)), 0.0)
    assert found.stable
    assert found.growth_rate + found.error >= -0.1 > found.growth_rate + 0.5 * found.error


@pytest.fixture
def beyond_lapack(monkeypatch):
    """As if LAPACK served no packing."""
    monkeypatch.setattr(module, "LAPACK_FIRST", 0)
    monkeypatch.setattr(module, "LAPACK_UP_TO", 0)


def row_of_spheres(count, pressed=2.0, dashpot=40.0):
    """Equal spheres side by side on a plane, between two walls that press them together; apart if `pressed` is 0."""
    first, x, z = np.arange(count), [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]
    i, j = np.r_[first[1:], first, 0, count - 1], np.r_[first[:-1], np.full(count + 2, -1)]
    normal = np.array([x] * (count - 1) + [z] * count + [x, [-1.0, 0.0, 0.0]])
    force, none, ones = np.where(normal[:, 0] == 0, 1.0, pressed), np.zeros((len(i), 3)), np.ones(len(i))
    load = np.tile([[0.0, 0.0, -1.0], [0.0] * 3], (count, 1, 1))
    contacts = LinearisedContacts(
        i=i, j=j, normal=normal, distance=np.where(j >= 0, 1.0, np.inf), overlap=1e-3 * ones,
        slip_arm=np.full((len(i), 2), 0.5), lever_arm=np.full((len(i), 2), 0.5), lever_slope=0 * ones,
        normal_force=force, tangential_force=none, normal_stiffness=3e3 * ones, tangential_stiffness=2e3 * ones,
        closing=none, parting=none, normal_dashpot=dashpot * ones, tangential_dashpot=0.5 * dashpot * ones,
        friction=0.5 * force,
    )  # fmt: skip
    each = np.ones(count)
    return Configuration(
        dimension=3, position=np.column_stack([first, 0 * first, 0.5 * each]), radius=0.5 * each, mass=each,
        inertia=0.1 * each, contacts=contacts.chosen(force > 0), box=np.diag([count, 1.0, 1.0]),
        origin=np.array([-0.5, -0.5, 0.0]), periodic=np.zeros(3, bool), load=load,
    )  # fmt: skip


def turned_row(row):
    """The row, and its load, in another direction, so that no number that should be zero is zero to the bit."""
    q = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    contacts = derive_frozen(row.contacts, normal=row.contacts.normal @ q)
    return derive_frozen(row, contacts=contacts, load=row.load @ q)


STRONG, WEAK, WITH_DRAG = (2.0, 1.0, None), (0.2, 0.1, None), (0.02, 0.01, 30.0)


@pytest.mark.parametrize("dashpots", [STRONG, WEAK, WITH_DRAG])
def test_rate_of_a_packing_beyond_lapack_is_that_of_lapack(reference_packing, request, dashpots):
    motion = Motion.of(dissipative(reference_packing(1.0), *dashpots))
    expected = linear_verdict(motion)
    request.getfixturevalue("beyond_lapack")
    found = linear_verdict(motion)
    assert found.stable is expected.stable is True
    assert found.said.startswith("no motion faster than")
    assert found.growth_rate == pytest.approx(expected.growth_rate, abs=found.error + expected.error)
    assert found.error < (0.51 if dashpots is WITH_DRAG else 1e-2) * abs(found.growth_rate)
    assert found.free == expected.free


def test_many_particles_alone_with_the_same_eigenvalues_hide_none(reference_packing, beyond_lapack):
    """Two hundred disks on a wall, none of which touches another: more equal eigenvalues than six vectors see."""
    packing, count, n = reference_packing(1.0), 200, 100
    place = np.tile([0.0, 0.5 - (packing.fy / packing.law.kn) ** (2 / 3)], (count, 1))
    c, alone = packing.contacts, n + np.arange(count)
    both = replace(
        packing, position=np.vstack([packing.position, place]), radius=np.append(packing.radius, np.full(count, 0.5)),
        contacts=Contacts(*np.hstack([(c.i, c.j), (alone, 0 * alone - 1)]), np.zeros(len(c) + count)),
        top=np.append(packing.top, np.ones(count, bool)), mass=None, angle=None,
    )  # fmt: skip
    expected, found = (linear_verdict(Motion.of(dissipative(each, *WEAK))) for each in (packing, both))
    assert found.stable is expected.stable is True
    assert found.free == expected.free + count  # these roll
    assert found.growth_rate == pytest.approx(expected.growth_rate, abs=found.error + expected.error)
    assert found.said.startswith("no motion faster than")


@pytest.mark.parametrize(
    ("row", "stable", "free"),
    [
        (row_of_spheres(20, 0.0), True, 40),  # they roll along two axes, each by itself
        (turned_row(row_of_spheres(12, 0.0)), True, 36),  # with rounding, and about the third axis
        (row_of_spheres(4, 2.0, 4.0), False, 1),  # pressed together they buckle
        (row_of_spheres(40, 1e-2), False, 1),
    ],
)
def test_motions_that_no_force_opposes_are_counted_and_no_growth(row, stable, free, request):
    motion = Motion.of(row)
    expected = linear_verdict(motion)
    assert (expected.stable, expected.free) == (stable, free)
    request.getfixturevalue("beyond_lapack")
    found = linear_verdict(motion)
    assert found.stable is stable
    assert found.growth_rate == pytest.approx(expected.growth_rate, rel=1e-6)
    if stable:
        assert found.free == free
    kept = opposed(motion)
    np.testing.assert_allclose((kept.T @ kept).toarray(), np.eye(kept.shape[1]), rtol=0, atol=1e-14)


def test_motion_that_no_force_opposes_does_not_grow_by_a_force_out_of_balance():
    """Two spheres beside three on a plane push each other apart by 1e-9 of the forces, and turn round each other: this
    motion has an eigenvalue of A below zero, and s next to the root of that."""
    row = row_of_spheres(5, 1.0)
    c, load = row.contacts.chosen([3, 4, 5, 6]), row.load.copy()  # that of the last two, and three on the plane
    load[3:] = 0.0
    made = [
        derive_frozen(row, contacts=derive_frozen(c, normal_force=force, friction=0.5 * force), load=load)
        for force in np.array([[1e-9, 1.0, 1.0, 1.0], [1e-16, 1.0, 1.0, 1.0]])
    ]
    found, expected = (linear_verdict(Motion.of(each)) for each in made)
    assert made[0].residual == pytest.approx(1e-9)
    assert 1e-6 < np.linalg.eigvals(Motion.of(made[0]).first_order).real.max() < 1e-4
    assert found.stable
    assert found.free == expected.free > 6
    assert found.growth_rate == pytest.approx(expected.growth_rate, rel=1e-6)


def test_a_symmetric_stiffness_is_decided_by_its_energy_alone(beyond_lapack):
    found = linear_verdict(Motion.of(row_of_spheres(20, 0.0), dissipation=False))
    assert (found.stable, found.free) == (True, 40)
    assert found.said == "the stiffness is symmetric, and its energy positive (proved)"


def test_where_dashpots_do_not_hold_the_law_a_random_state_is_followed(beyond_lapack, path):
    """Dashpots along the normals alone leave motions undamped in which the law is not symmetric: there is no
    certificate, and a reason within a second."""
    found = linear_verdict(Motion.of(dissipative(path(0.02), 2.0, 0.0, None)), time=5.0)
    assert found.stable is None
    assert re.search(
        "^the dashpots hold growth at no frequency .* a random state shows within t = 5.8", found.reasons[0]
    )
    assert 0 < found.searched < 20


@pytest.mark.parametrize("seed", range(3))
def test_the_slowest_motions_are_those_of_lapack_and_others_stay_in_a_state(seed):
    """One alone, and twelve that are nearly one, below all others; oblique, of 500 states in a space of 300."""
    rng = np.random.default_rng(seed)
    values = [2.0, *rng.uniform(4.0, 4.04, 12), *rng.uniform(9, 100, 235)]
    turned, scale = turned_blocks([*values, complex_block(40.0, 0.1)], rng), rng.uniform(0.8, 1.25, 250)
    a = csr_array(diags_array(scale) @ turned @ diags_array(1 / scale))
    g, size = csr_array(2e-3 * (a + a.T)), 250
    s, vectors = np.linalg.eig(np.block([[np.zeros((size, size)), np.eye(size)], [-a.toarray(), -g.toarray()]]))
    known, errors, leave = slow_motions(a, g, csr_array(np.eye(size)), 1.0, 0)
    assert 26 <= len(known) < 100
    slow = np.abs(s - 0.1) <= np.sort(np.abs(s - 0.1))[len(known) - 1]  # next to the shift
    rounding = 1e-14 * np.linalg.cond(vectors)  # of LAPACK
    for each, error in zip(known, errors, strict=True):
        assert np.abs(s - each).min() <= error + rounding
    assert errors.max() < 1e-8
    # vectors in the space have residuals of 1e-6 at the most
    np.testing.assert_allclose(leave(vectors[:, slow].real), 0, rtol=0, atol=1e-6)
    np.testing.assert_allclose(leave(vectors[:, ~slow].real), vectors[:, ~slow].real, rtol=0, atol=1e-6)


def made_up(growing, count=150):
    """The motion of a known matrix, with a loss in proportion to it, and its largest 2 Re s."""
    rng = np.random.default_rng(4)
    matrix = turned_blocks([*rng.uniform(0.5, 100, count), complex_block(40.0, growing)], rng)
    size, damping = matrix.shape[0], csr_array(2e-2 * (matrix + matrix.T))
    motion = Motion(row_of_spheres(40), np.arange(size), np.ones(size), csr_array(matrix), damping)
    return motion, 2 * all_values(matrix, damping).real.max()


@pytest.mark.parametrize("growing", [0.1, 30.0])
def test_a_random_state_falls_or_grows_as_the_slowest_motion(growing):
    """The row of spheres, whose time step the state is followed with, is stiffer than the matrix."""
    motion, expected = made_up(growing)
    found = follow_decay(motion, csr_array(np.eye(len(motion.active))), "", work=2e10)
    assert found.stable is bool(growing < 1)
    assert found.growth_rate == pytest.approx(expected, rel=0.1, abs=0)
    assert found.growth_rate == pytest.approx(expected, abs=found.error)


def test_common_motion_and_motion_that_nothing_opposes_are_left_out_together():
    """Their vectors are not orthogonal: to leave out one after the other would bring the first in again."""
    motion, expected = made_up(0.1, 60)
    size = len(motion.active) + 2
    y = np.random.default_rng(5).standard_normal((size, 1))
    common = np.where(np.arange(size) < len(motion.configuration), 1.0, 0.0)[:, None]
    others = null_space(np.hstack([y, common]).T)
    a, g = (csr_array(others @ matrix @ others.T) for matrix in (motion.stiffness.toarray(), motion.damping.toarray()))
    widened = Motion(motion.configuration, np.arange(size), np.ones(size), a, g)
    found = follow_decay(widened, csr_array(null_space(y.T)), "", work=3e10)
    assert (found.stable, found.free) == (True, 2)
    assert found.growth_rate == pytest.approx(expected, rel=0.1)


def operator(seed, growing):
    """150 real eigenvalues and some that grow, sparse."""
    rng = np.random.default_rng(seed)
    return turned_blocks([*rng.uniform(0.5, 100, 150), *growing], rng)


@pytest.mark.parametrize("seed", [2, 3])
@pytest.mark.parametrize("damped", [True, False])
def test_fastest_growing_motion(seed, damped):
    """Dashpots stop one of the motions, and slow others down; LAPACK's eigenvalues of the first-order system."""
    growing = [complex_block(30.0, 3.0), complex_block(70.0, 2.5), complex_block(2.0, 0.05)]
    matrix = operator(seed, growing)
    loss = 4e-4 * (matrix + matrix.T) + diags_array(np.random.default_rng(seed).uniform(0, 0.06, matrix.shape[0]))
    values = all_values(matrix, loss * damped)
    found = fastest_growing(matrix, csr_array(loss) if damped else None)
    assert found.stable is False
    assert found.growth_rate == pytest.approx(2 * values.real.max(), rel=1e-6)
    assert np.abs(found.s - values).min() < 1e-6


@pytest.mark.parametrize("strong", [0.5, 40.0])
def test_strong_dissipation(strong):
    """A loss of many times the largest frequency: the sum does not lose its digits, and a negative eigenvalue grows."""
    matrix = operator(4, [-25.0])
    found = fastest_growing(matrix, csr_array(strong * diags_array(np.ones(matrix.shape[0]))), periods=(3, 10))
    # s^2 + c s - 25 = 0
    assert found.growth_rate == pytest.approx(-strong + np.sqrt(strong**2 + 100), rel=1e-6)


@pytest.mark.parametrize("damped", [False, True])
def test_nothing_grows(damped):
    """Then a rate of about 3 over the longest time is the limit."""
    matrix = operator(5, [complex_block(50.0, 1e-4)])
    damping = csr_array(0.01 * diags_array(np.ones(matrix.shape[0]))) if damped else None
    found = fastest_growing(matrix, damping, periods=(10.0, 30.0))
    assert found.stable is None
    assert 1 < found.searched * 30 * 2 * np.pi / 10 < 4


def test_many_that_grow_alike_are_seen_to_grow():
    """Their space does not converge; still the growth of one is certain, at a rate that is told as the least."""
    growing = [complex_block(30.0 + 0.003 * k, 5.0) for k in range(80)]
    found = fastest_growing(operator(7, growing), periods=(10.0, 10.0))
    assert found.stable is False
    rate = 2 * abs(np.sqrt(30.0 + 5j).imag)
    # the fastest of the eighty, which are not orthogonal, grows at 1.001 times this rate
    assert 0.95 * rate < found.growth_rate < 1.001 * rate
    assert exponential(0.21962, 6) == "D as exp(0.21962 t)"
    assert exponential(39.99, 4, at_least=True) == "D at least as exp(39 t), not known closer"
