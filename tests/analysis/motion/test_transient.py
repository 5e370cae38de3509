"""Transient gain: against the largest singular value of sampled propagators, with and without dissipation."""

import numpy as np
import pytest
from linearised import dissipative, matrices, motion_matrix
from scipy.linalg import eigh, expm, solve_triangular

from faultgouge.analysis import linear_response
from faultgouge.analysis.responses.transient import NoGainError, transient_gain


def sampled(packing, norm, times):
    """Largest singular value squared of the propagator at some times, by the exponential of the first-order system."""
    k, _, mass, _ = matrices(packing)
    system, size = motion_matrix(packing), len(mass)
    if norm == "energy":
        lower = np.zeros_like(system)
        lower[:size, :size] = np.linalg.cholesky(0.5 * (k + k.T)).T
        lower[size:, size:] = np.diag(np.sqrt(mass))
    values = []
    for flow in (expm(system * time) for time in times):
        weighed = lower @ solve_triangular(lower, flow.T, trans="T").T if norm == "energy" else flow[:size, :size]
        values.append(np.linalg.norm(weighed, 2) ** 2)
    return np.array(values)


@pytest.mark.parametrize("norm", ["displacement", "energy"])
@pytest.mark.parametrize("dissipation", [{}, {"cn": 30.0, "ct": 5.0}, {"drag_time": 0.2}])
def test_no_sampled_propagator_is_larger(cluster, norm, dissipation):
    """Six disks in every state of contact, on K's symmetric part where they are unstable by themselves."""
    packing = dissipative(cluster, **dissipation)
    k, _, mass, active = matrices(packing)
    if np.any(np.linalg.eigvals(k / mass[:, None]).imag != 0) or eigh(k + k.T, eigvals_only=True)[0] <= 0:
        with pytest.raises(NoGainError, match="unstable"):
            transient_gain(packing, norm)
        return
    found = transient_gain(packing, norm)
    times = np.linspace(0, found.window, 200)
    assert sampled(packing, norm, times).max() < 1.01 * found.gain
    assert sampled(packing, norm, [found.time])[0] == pytest.approx(found.gain, rel=1e-6)
    assert found.gain <= found.bound * (1 + 1e-9)
    if norm == "energy":  # the start has energy 1/2
        q, v = found.start[active], found.velocity[active]
        assert q @ k @ q + np.sum(mass * v * v) == pytest.approx(1)


@pytest.mark.long
@pytest.mark.parametrize("fx", [0.0205, 0.0218])
def test_the_gain_is_the_largest_singular_value(path, fx):
    """Of the propagator of a real packing at its time, and at others around; the start is one that reaches it. The
    onset is at 0.0218331."""
    packing = path(fx)
    found, step = transient_gain(packing), 0.02
    around = sampled(packing, "displacement", found.time + np.array([-step, 0, step]))
    assert around[1] == pytest.approx(found.gain, rel=1e-6)
    assert around.max() <= found.gain * (1 + 1e-9)
    assert found.gain <= found.bound < 1.5 * found.gain
    lone, places = np.zeros(300), [found.disk, 100 + found.disk]
    lone[places] = found.direction
    best, pushed = (
        np.sum(linear_response(packing, [found.time], initial=start).displacement ** 2) for start in (found.start, lone)
    )
    assert np.sum(found.start**2) == pytest.approx(1)
    assert best == pytest.approx(found.gain, rel=1e-6)
    # its part in the best start grows as that does
    assert pushed >= found.gain * np.sum(found.start[places] ** 2) * (1 - 1e-9)


def test_a_symmetric_operator_has_no_gain(reference_packing):
    """Without slips K is symmetric."""
    for norm in ("displacement", "energy"):
        found = transient_gain(reference_packing(1.0), norm)
        assert (found.gain, found.time) == (1.0, 0.0)
        assert found.bound == pytest.approx(1)
