"""Signals, and the response of a packing to them: against the response to a cosine, which is known in closed form."""

import numpy as np
import pytest
from linearised import dissipative, matrices

from faultgouge.analysis.responses.response import floor_force, impulse_response, layer_force, linear_response
from faultgouge.analysis.responses.signals import Signal, pulse

OMEGA = 5.0
NEAR_ONSET = 0.0218  # F_x^c = 0.021833056408
NEAR = np.linspace(-3e-3, 3e-3, 601)


@pytest.fixture(scope="module", params=[{}, {"cn": 10.0, "ct": 5.0, "drag_time": 20.0}], ids=["undamped", "damped"])
def packing(path, request):
    return dissipative(path(NEAR_ONSET), **request.param)


def layer_response(packing, omega):
    """V = i omega e^T (K - omega^2 M + i omega C)^-1 f of unit forces along x on the upper layer, e their mean."""
    k, c, mass, active = matrices(packing)
    push = layer_force(packing, 1.0)[active]
    sums = [1j * w * (push @ np.linalg.solve(k - w**2 * np.diag(mass) + 1j * w * c, push)) for w in omega]
    return np.array(sums) / packing.top.sum()


@pytest.mark.slow
def test_impulse_response_gives_velocity_and_transfer_function(packing):
    """Its vectors are ill-conditioned by a thousand here, which takes three of fifteen digits."""
    force, times = layer_force(packing, 1.0), np.linspace(0.1, 30.0, 50)
    response = impulse_response(packing, force)
    exact = linear_response(packing, times, force=force, omega=OMEGA).layer_velocity
    assert np.abs(response.velocity(OMEGA, times) - exact).max() < 1e-10 * np.abs(exact).max()
    omegas = np.array([0.1, 1.7, 30.0])
    np.testing.assert_allclose(response.transfer(omegas), layer_response(packing, omegas), rtol=1e-8)


def test_largest_velocity_is_that_of_a_fine_sampling(packing):
    """Samples of half a period of the fastest mode find no larger one, and a thousandth of it finds the same."""
    response = impulse_response(packing, layer_force(packing, 1.0))
    omegas = np.array([0.3, 14.2, 120.0])
    for omega, velocity, time in zip(omegas, *response.largest(omegas, 10.0), strict=True):
        every, near = (np.abs(response.velocity(omega, t)) for t in (np.linspace(0, 10, 4001), time + NEAR))
        assert 0.98 * velocity < every.max() <= velocity * (1 + 1e-9)
        assert near.max() == pytest.approx(velocity, rel=1e-5)
        assert abs(response.velocity(omega, [time])[0]) == pytest.approx(velocity, rel=1e-12)


def test_moving_floor_is_a_force_on_every_disk(packing):
    """A jolt of the floor is a rigid start of all disks with a velocity the other way; rattlers rest."""
    force = floor_force(packing)
    # the fastest mode has turned by 0.02 after 1e-4; a short time from rest the velocity is that of the force
    early = linear_response(packing, [1e-5], force=force)
    lone = np.isin(np.arange(100), packing.rattlers)
    assert np.array_equal(early.displacement[0, :100] == 0, lone)
    np.testing.assert_allclose(early.velocity[0, :100][~lone], -1e-5, rtol=1e-4)
    top = packing.top & ~lone
    assert impulse_response(packing, force).velocity(0.0, [1e-5])[0] == pytest.approx(-1e-5 * top.sum() / 10, rel=1e-4)


def test_signal_is_zero_outside_and_straight_between():
    signal = Signal([1.0, 2.0, 4.0], [0.0, 2.0, -2.0])
    assert list(signal.at([0.0, 1.5, 3.0, 4.0, 5.0])) == [0.0, 1.0, 0.0, -2.0, 0.0]
    assert (list(signal.scale_by(3.0, 2.0).at([3.0, 6.0])), signal.shortest) == ([3.0, 0.0], 1.0)


def test_pulse_peaks_where_it_says():
    wave = pulse(3.0)
    step = wave.time[1] - wave.time[0]
    frequency = 2 * np.pi * np.fft.rfftfreq(1 << 16, step)
    assert frequency[np.abs(np.fft.rfft(wave.value, 1 << 16)).argmax()] == pytest.approx(3.0, rel=1e-2)
    assert abs(wave.value[0]) < 1e-8
    assert wave.value.max() == pytest.approx(1.0, rel=2e-4)  # the peak lies between two rows
