"""Transient gain: against the largest singular value of sampled propagators, with and without dissipation."""

from dataclasses import replace

import numpy as np
import pytest
import quasistatic
from scipy.linalg import eigh, expm, solve_triangular

from faultgouge.analysis import damping_matrix, linear_response, stiffness_matrix
from faultgouge.analysis.motion.transient import NoGainError, transient_gain


def matrices(packing):
    """K, C and M on the coordinates that feel a force."""
    k, c = stiffness_matrix(packing).toarray(), damping_matrix(packing).toarray()
    active = np.flatnonzero(np.any(k != 0, axis=1))
    mass = np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass])[active]
    return k[np.ix_(active, active)], c[np.ix_(active, active)], mass


def sampled(packing, norm, times):
    """Largest singular value squared of the propagator at some times, by the exponential of the first-order system."""
    k, c, mass = matrices(packing)
    size = len(mass)
    system = np.zeros((2 * size, 2 * size))
    system[:size, size:] = np.eye(size)
    system[size:, :size], system[size:, size:] = -k / mass[:, None], -c / mass[:, None]
    if norm == "energy":
        lower = np.zeros_like(system)
        lower[:size, :size] = np.linalg.cholesky(0.5 * (k + k.T)).T
        lower[size:, size:] = np.diag(np.sqrt(mass))
    values = []
    for time in times:
        flow = expm(system * time)
        weighed = lower @ solve_triangular(lower, flow.T, trans="T").T if norm == "energy" else flow[:size, :size]
        values.append(np.linalg.norm(weighed, 2) ** 2)
    return np.array(values)


@pytest.mark.parametrize("norm", ["displacement", "energy"])
@pytest.mark.parametrize("dissipation", [{}, {"cn": 30.0, "ct": 5.0}, {"tau": 0.2}])
def test_no_sampled_propagator_is_larger(cluster, norm, dissipation):
    """Six disks in every state of contact, on K's symmetric part where they are unstable by themselves."""
    packing = replace(
        cluster,
        law=replace(cluster.law, cn=dissipation.get("cn", 0.0), ct=dissipation.get("ct", 0.0)),
        drag_time=dissipation.get("tau"),
    )
    k, _, mass = matrices(packing)
    if np.any(np.linalg.eigvals(k / mass[:, None]).imag != 0) or eigh(k + k.T, eigvals_only=True)[0] <= 0:
        with pytest.raises(NoGainError):
            transient_gain(packing, norm)
        return
    found = transient_gain(packing, norm)
    times = np.linspace(0, found.window, 400)
    assert sampled(packing, norm, times).max() < 1.01 * found.gain
    assert sampled(packing, norm, [found.time])[0] == pytest.approx(found.gain, rel=1e-6)
    assert found.gain <= found.bound * (1 + 1e-9)


@pytest.fixture(scope="module")
def near(ramp):
    """Below the onset of the reference packing at 0.0218331, by 6e-2 and 1.5e-3 of it."""
    coarse = ramp(1.0, 1e-3, 22)
    return [quasistatic.equilibrium(coarse(0.02), 0.0205), quasistatic.equilibrium(coarse(0.021), 0.0218)]


@pytest.fixture(scope="module")
def gains(near):
    """Their transient gains, in displacement."""
    return [transient_gain(packing) for packing in near]


@pytest.mark.slow
def test_the_gain_is_the_largest_singular_value(near, gains):
    """Of the propagator of a real packing at its time, and at others around; the start is one that reaches it."""
    for packing, found in zip(near, gains, strict=True):
        step = 0.02
        around = sampled(packing, "displacement", found.time + np.array([-step, 0, step]))
        assert around[1] == pytest.approx(found.gain, rel=1e-6)
        assert around.max() <= found.gain * (1 + 1e-9)
        moved = linear_response(packing, [found.time], initial=found.start).displacement[0]
        assert np.sum(found.start**2) == pytest.approx(1)
        assert np.sum(moved**2) == pytest.approx(found.gain, rel=1e-6)
        assert found.gain <= found.bound < 1.5 * found.gain
        lone = np.zeros(300)
        lone[[found.disk, 100 + found.disk]] = found.direction
        pushed = linear_response(packing, [found.time], initial=lone).displacement[0]
        # its part in the best start grows as that does
        assert np.sum(pushed**2) >= found.gain * np.sum(found.start.reshape(3, -1)[:2, found.disk] ** 2) * (1 - 1e-9)


@pytest.mark.slow
def test_energy_counts_velocities_as_well(near):
    """The start has energy 1/2, and what it becomes has the gain times as much; no less than a start at rest."""
    found = transient_gain(near[0], "energy")
    k, _, mass = matrices(near[0])
    active = np.flatnonzero(np.any(stiffness_matrix(near[0]).toarray() != 0, axis=1))
    q, v = found.start[active], found.velocity[active]
    assert q @ k @ q + np.sum(mass * v * v) == pytest.approx(1)
    assert sampled(near[0], "energy", [found.time])[0] == pytest.approx(found.gain, rel=1e-6)


def test_a_symmetric_operator_has_no_gain(bed):
    """Without slips K is symmetric."""
    for norm in ("displacement", "energy"):
        found = transient_gain(bed(1.0), norm)
        assert (found.gain, found.time) == (1.0, 0.0)
        assert found.bound == pytest.approx(1)


def test_an_unstable_packing_has_no_largest_gain(ramp):
    coarse = ramp(1.0, 1e-3, 22)
    with pytest.raises(NoGainError, match="unstable"):
        transient_gain(coarse(0.022))
