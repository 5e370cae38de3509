"""The motion of linearised packings: against other methods, near and at coalescences, and against LAMMPS."""

import mpmath
import numpy as np
import pytest
from known_spectra import of_stiffness
from linearised import dissipative, motion_matrix
from scipy.linalg import block_diag, expm
from scipy.sparse import csr_array

from faultgouge.analysis import layer_force, linear_response, mean_square_displacement

OMEGA = 2.0
"""That of a motion of `oblique`: resonance."""

DISTANCES = [0.3, 1e-2, 1e-6, 1e-12, 0.0, -1e-6]


def oblique(epsilon):
    """The normal form with delta = 0.2 beside three other modes, in an oblique basis of condition 3 or so."""
    eta = 0.2 * (1 - epsilon)
    return turned(block_diag([[0.8, eta], [-eta, 1.2]], 3.0, 4.0, 6.0))


def turned(inner):
    """A matrix in an oblique basis."""
    size = len(inner)
    basis = np.eye(size) + 0.2 * np.random.default_rng(3).normal(size=(size, size))
    return basis @ inner @ np.linalg.inv(basis)


def vectors(size):
    """A force and a start."""
    return np.random.default_rng(4).normal(size=(2, size))


def by_digits(matrix, force, start, time, tau):
    """Displacement and velocity from the exponential of the first-order system, with fifty digits."""
    n = len(matrix)
    with mpmath.workdps(50):
        system = mpmath.zeros(2 * n + 2)
        system[:n, n : 2 * n] = mpmath.eye(n)
        system[n : 2 * n, :n], system[n : 2 * n, 2 * n] = mpmath.matrix(-matrix), mpmath.matrix(force)
        system[n : 2 * n, n : 2 * n] = mpmath.eye(n) * (0 if tau is None else -1 / mpmath.mpf(tau))
        system[2 * n, 2 * n + 1], system[2 * n + 1, 2 * n] = -mpmath.mpf(OMEGA), mpmath.mpf(OMEGA)
        state = mpmath.matrix([*start, *np.zeros(n), 1, 0])
        end = np.array([float(v) for v in mpmath.expm(system * time) * state])
    return end[:n], end[n : 2 * n]


def motion_of(matrix, force, start, time, tau=None, dt=None):
    """Of two disks of unit mass whose K is given; the first coordinates move."""
    size = len(matrix)
    stiffness, damping = (csr_array(np.pad(k, (0, 6 - size))) for k in (matrix, np.eye(size) / (tau or np.inf)))
    disks = of_stiffness(stiffness, damping if tau else None)
    force, start = (np.pad(each, (0, 6 - size)) for each in (force, start))
    found = linear_response(disks, time, force=force, omega=OMEGA, initial=start, dt=dt)
    return found.displacement[:, :size], found.velocity[:, :size]


def assert_exact(matrix, times, tau, digits):
    """Displacement and velocity are those of fifty digits."""
    force, start = vectors(len(matrix))
    found = motion_of(matrix, force, start, times, tau)
    for k, time in enumerate(times):
        for part, expected in zip(found, by_digits(matrix, force, start, time, tau), strict=True):
            np.testing.assert_allclose(part[k], expected, atol=digits * np.abs(expected).max(), rtol=0)


@pytest.mark.parametrize("tau", [None, 30.0, 0.05])
@pytest.mark.parametrize("epsilon", DISTANCES)
def test_nothing_is_lost_near_a_coalescence(epsilon, tau):
    """Nor far from one, nor where tau = 0.05 damps even the fastest mode beyond oscillation."""
    # An error u |A| of A itself has an effect of u |A| t^2 delta at a coalescence: 1e-13 at t = 40.
    assert_exact(oblique(epsilon), [0.3, 40.0], tau, 5e-13)


def test_two_pairs_and_a_pair_among_other_modes():
    """Two coalescences, one of them with a third eigenvalue between its members."""
    inner = block_diag([[0.8, 0.2], [-0.2, 1.2]], [[2.0, 200.0], [0.0, 4.0]], 3.0, 5.0)  # the second overlaps by 2/200
    # |A| = 250 rounds to 3e-14, and t^2/2 |A| u is what a coalescence makes of it
    assert_exact(turned(inner), [20.0], None, 1e-11)


@pytest.mark.parametrize("dt", [0.01, 0.4])
@pytest.mark.parametrize("epsilon", [0.3, 1e-9, 0.0])
def test_time_step_is_that_of_velocity_verlet(epsilon, dt):
    """dt = 0.4 is half of the limit 2/omega_max: far from the exact motion, and met all the same."""
    matrix, (force, start), steps = oblique(epsilon), vectors(5), 400
    x, v = start.copy(), np.zeros(5)
    run = [(x, v)]
    for n in range(steps):
        v = v + 0.5 * dt * (force * np.cos(OMEGA * n * dt) - matrix @ x)
        x = x + dt * v
        v = v + 0.5 * dt * (force * np.cos(OMEGA * (n + 1) * dt) - matrix @ x)
        run.append((x, v))
    known, time = np.array(run), dt * np.arange(steps + 1)
    displacement, velocity = motion_of(matrix, force, start, time, dt=dt)
    # Rounding of 400 steps adds up as u steps^2, and the sums of velocities are divided by dt.
    for found, expected in ((displacement, known[:, 0]), (velocity, known[:, 1])):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    exact, _ = motion_of(matrix, force, start, time)
    assert np.abs(exact - known[:, 0]).max() > 1e-5


@pytest.mark.parametrize(
    "dissipation", [{}, {"cn": 30.0, "ct": 10.0}, {"cn": 3e3}, {"ct": 20.0, "drag_time": 0.03}, {"drag_time": 0.05}]
)
def test_motion_of_a_packing_against_the_exponential(cluster, dissipation):
    """M q'' + C q' + K q = f cos(omega t), with unequal masses; dashpots of 3e3 are far beyond critical damping."""
    packing = dissipative(cluster, **dissipation)
    mass = np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass])
    force, start, omega = layer_force(packing, 2.0), 1e-3 * np.random.default_rng(7).normal(size=18), 40.0
    system = np.zeros((38, 38))  # q, q', cos and sin
    system[:36, :36] = motion_matrix(packing)
    system[18:36, 36] = force / mass
    system[36, 37], system[37, 36] = -omega, omega
    time, begin = np.linspace(0, 0.1, 6), np.concatenate([start, np.zeros(18), [1, 0]])
    known = np.array([expm(system * t) @ begin for t in time])
    found = linear_response(packing, time, force=force, omega=omega, initial=start)
    for part, expected in ((found.displacement, known[:, :18]), (found.velocity, known[:, 18:36])):
        np.testing.assert_allclose(part, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    moved = packing.position + np.stack([known[:, :6], known[:, 6:12]], axis=-1)
    expected = mean_square_displacement(moved, packing.position, packing.box_length)
    np.testing.assert_allclose(found.msd, expected, rtol=1e-6)
    np.testing.assert_allclose(found.layer_velocity, known[:, 18:24][:, packing.top].mean(axis=1), rtol=0, atol=1e-7)
