"""The normal form of two coalescing modes: exact solutions, exponents, damping, and the pair of a real packing."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.linalg import expm

from faultgouge.analysis import fit_power_law, linear_response
from faultgouge.analysis.responses.normal_form import ORTHOGONAL, NormalForm
from faultgouge.analysis.windows.pair_over_load import normal_forms

STAR = np.array([1.0, 1.0]) / np.sqrt(2)
ONSET, DOUBLE_EIGENVALUE = 0.0218330564080, 2058.269
DISTANCES = np.geomspace(1e-7, 1e-2, 11)


def matrix(form):
    return np.array([[1 - form.delta, form.eta], [-form.eta, 1 + form.delta]])


@pytest.mark.parametrize("tau", [None, 40.0, 0.6])
@pytest.mark.parametrize("epsilon", [1.0, 0.3, 1e-3, 0.0, -1e-3])
def test_exact_solution_against_the_exponential(epsilon, tau):
    form, time, one = NormalForm(0.3, epsilon), np.linspace(0, 60, 61), np.eye(2)
    system = np.block([[0 * one, one], [-matrix(form), -one / (tau or np.inf)]])
    known = [(expm(t * system) @ [*ORTHOGONAL, 0, 0])[:2] for t in time]
    np.testing.assert_allclose(form.solution(time, tau), known, rtol=0, atol=1e-11)


@pytest.mark.parametrize("epsilon", [1e-6, 1e-12])
def test_small_distances_keep_their_digits(epsilon):
    """At the first maximum, after 1/(delta epsilon^(1/2)): fifty digits beside it."""
    delta = 0.3
    form = NormalForm(delta, epsilon)
    time = round(np.pi / 2 / (delta * np.sqrt(epsilon / 2))) + 0.25
    with mpmath.workdps(50):
        d, e = mpmath.mpf(delta), mpmath.mpf(delta) * (1 - mpmath.mpf(epsilon))
        r = mpmath.sqrt(d**2 - e**2)
        a, b = (mpmath.cos(mpmath.sqrt(1 + sign * r) * time) for sign in (1, -1))
        odd = (a - b) / (2 * r)  # times N (1, -1)/2^(1/2) = -(d + e) v*
        expected = float((a + b) / 2) * ORTHOGONAL - float(odd * (d + e)) * STAR
    # A time of 1e7 is known to 1e-9, and so is the phase.
    np.testing.assert_allclose(form.solution([time])[0], expected, rtol=0, atol=4e-16 * time * form.gain)


@pytest.mark.parametrize("tau", [None, 20.0, 300.0])
@pytest.mark.parametrize("epsilon", [0.3, 0.01, 1e-3])
def test_amplitude_is_the_maximum_of_the_solution(epsilon, tau):
    form = NormalForm(0.2, epsilon)
    # a beat and a little more; the second one is lower, or damped
    time = np.arange(0, 1.1 * np.pi * np.sqrt(2) * form.tau_d, 2e-3)
    largest = np.linalg.norm(form.solution(time, damping_time=tau), axis=1).max()
    # A maximum between samples is higher by half the square of the phase, 1e-3.
    assert form.amplitude(tau) == pytest.approx(largest, rel=1e-6)
    assert form.amplitude(tau) <= form.gain


def damped(form, tau):
    """The maximum of (2/epsilon)^(1/2) exp(-t/2 tau) sin(t/(2^(1/2) tau_d)), at least the 1 of the start."""
    theta = np.arctan(np.sqrt(2) * tau / form.tau_d)
    return max(1.0, np.sqrt(2 / form.epsilon) * np.sin(theta) * np.exp(-theta / np.tan(theta)))


def test_damping_competes_with_the_beat():
    """One function of tau/tau_d: half at 1.3455, 0.4155 at 1."""
    for delta, epsilon in ((0.1, 1e-7), (0.05, 1e-8), (0.001, 1e-9)):
        form = NormalForm(delta, epsilon)
        assert form.half_gain_time() / form.tau_d == pytest.approx(1.34552, rel=1e-3)
        assert form.amplitude(form.tau_d) / form.gain == pytest.approx(0.41551, rel=1e-3)
        for tau in (form.tau_d / 100, form.tau_d, form.tau_d * 1000):
            assert form.amplitude(tau) == pytest.approx(damped(form, tau), rel=1e-3)


def test_complex_pairs_grow():
    form = NormalForm(0.2, -0.01)
    assert form.gain == form.amplitude() == form.tau_d == np.inf
    rate = abs(np.sqrt(np.linalg.eigvals(matrix(form))[0]).imag)
    strong, weak = 0.9 / (2 * rate), 1.1 / (2 * rate)
    assert form.amplitude(weak) == np.inf
    largest = np.linalg.norm(form.solution(np.arange(0, 40 / rate, 0.01), damping_time=strong), axis=1).max()
    assert form.amplitude(strong) == pytest.approx(largest, rel=1e-4)


def test_power_law_and_its_error():
    x = np.geomspace(1, 1e4, 9)
    assert fit_power_law(x, 3 * x**-0.7).exponent == pytest.approx(-0.7, abs=1e-14)
    rng = np.random.default_rng(2)
    fits = [fit_power_law(x, 3 * x**-0.7 * np.exp(0.1 * rng.normal(size=9))) for _ in range(300)]
    # Three hundred draws give a spread to 4 %, seven degrees of freedom a mean error to another 4 %.
    spread = np.std([fit.exponent for fit in fits])
    assert spread == pytest.approx(np.mean([fit.error for fit in fits]), rel=0.15)


@pytest.fixture(scope="module")
def packings(path):
    """Equilibria of the reference packing at F_x^c (1 - distance), nearest first."""
    return [path(ONSET * (1 - distance)) for distance in DISTANCES]


@pytest.fixture(scope="module")
def pairs(packings):
    return normal_forms(packings, DOUBLE_EIGENVALUE)


def test_amplitude_of_a_real_pair_diverges_with_exponent_one_half(pairs):
    """Five decades of the load's distance from the onset, and as many of the pair's own epsilon."""
    amplitude, epsilon = np.transpose([(pair.amplitude(), pair.epsilon) for pair in pairs])
    assert epsilon.max() / epsilon.min() > 1e4
    for distance in (DISTANCES, epsilon):
        # Measured: -0.4994 and -0.5009; the next order in epsilon = 0.07 is what is left.
        assert fit_power_law(distance, amplitude).exponent == pytest.approx(-0.5, abs=0.002)
    close = slice(7)  # three decades by themselves
    assert fit_power_law(DISTANCES[close], amplitude[close]).exponent == pytest.approx(-0.5, abs=2e-4)


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.slow
def test_whole_packing_follows_its_pair(packings, pairs, damped):
    """All 285 modes, started across the coalescing vectors: the normal form to the rounding of the operator."""
    packing, pair = packings[6], pairs[6]  # at 1e-4
    tau = 0.7 * pair.tau_d if damped else None
    time = np.linspace(0 if damped else 0.48, 0.6, 1001) * np.pi * np.sqrt(2) * pair.tau_d  # about a beat
    response = linear_response(replace(packing, drag_time=tau), time, initial=pair.start)
    scaled = pair.solution(time, damping_time=tau)
    expected = scaled @ pair.right.T
    # The rounding 3e-11 of the operator, over the splitting 0.12 and times the phase of a beat.
    np.testing.assert_allclose(response.displacement, expected, rtol=0, atol=1e-7 * np.abs(expected).max())
    assert pair.amplitude(tau) >= np.linalg.norm(scaled, axis=1).max()
