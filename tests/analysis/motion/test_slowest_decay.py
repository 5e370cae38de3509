"""The slowest decay by discs along the imaginary axis, against LAPACK's eigenvalues of the first-order matrix."""

import numpy as np
import pytest
from linearised import dissipative, motion_matrix

from faultgouge.analysis.motion import motion as module
from faultgouge.analysis.motion.motion import Motion
from faultgouge.analysis.motion.slowest_decay import slowest_decay


@pytest.fixture(scope="module", params=[(2.0, 1.0, None), (0.02, 0.01, None), (0.02, 0.01, 30.0)])
def damped(request, reference_packing):
    """100 disks with strong and with weak dashpots, and with drag."""
    cn, ct, drag = request.param
    return dissipative(reference_packing(1.0), cn, ct, drag)


def all_values(packing):
    """s with Im s >= 0 of motions that a force opposes, the slowest decay first."""
    values = np.linalg.eigvals(motion_matrix(packing))
    values = values[(values.imag >= 0) & (np.abs(values) > 1e-5 * np.abs(values).max())]
    return values[np.argsort(-values.real)]


def test_slowest_decays_are_those_of_lapack(damped):
    motion, expected = Motion.of(damped), all_values(damped)
    found = slowest_decay(motion.stiffness, motion.damping)
    assert found.covered == np.inf
    # rounding of a dense solver, 1e-13 of the largest eigenvalue for a motion that is not well conditioned
    near = 1e-9 * np.abs(expected).max()
    assert abs(found.values[0].real - expected[0].real) < near
    for value in found.values[:8]:
        assert np.abs(expected - value).min() < near


def test_a_part_of_the_axis_says_how_far_it_goes(damped):
    motion = Motion.of(damped)
    found = slowest_decay(motion.stiffness, motion.damping, discs=1)
    expected = all_values(damped)
    here = expected[expected.imag < found.covered]
    assert 0 < found.covered < np.abs(expected).max()
    assert found.values.real.max() == pytest.approx(here.real.max(), rel=1e-6)


def test_rates_of_a_packing_beyond_lapack_have_its_slowest_decay(damped, monkeypatch):
    expected = Motion.of(damped).rates
    assert not expected.grows.any()
    assert expected.growth_rate < 0
    monkeypatch.setattr(module, "DENSE_DAMPED", 100)
    found = Motion.of(damped).rates
    assert not found.grows.any()
    assert found.growth_rate == pytest.approx(expected.growth_rate, rel=1e-6)
    assert found.searched == 0
