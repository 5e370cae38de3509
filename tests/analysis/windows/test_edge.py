"""Edges of a pair that has a third mode close by, and of one whose equilibrium jumps."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import complex_windows

BASIS = np.eye(12) + 0.1 * np.random.default_rng(2).normal(size=(12, 12))
INVERSE = np.linalg.inv(BASIS)


def family(onset, third):
    """A pair of discriminant onset - F about 10, of couplings 5 and (F - onset) / 20, beside a third eigenvalue."""

    def operator(f):
        inner = np.diag([10.0, 10.0, third, *np.linspace(40, 80, 9)])
        inner[0, 1], inner[1, 0] = 5.0, (onset - f) / 20
        return BASIS @ inner @ INVERSE

    return operator


@pytest.mark.parametrize("third", [10.8, 9.2, 12.0, 15.5])
@pytest.mark.parametrize("last", [1.1, 3.0])
def test_a_pair_beside_a_third_eigenvalue(third, last):
    """The third one is closer than the pair's own spread of 5."""
    (window,) = complex_windows(family(1.0, third), [-1.0, last])
    assert window.kind == "coalescence"
    assert window.fx_onset == pytest.approx(1.0, abs=1e-10)
    assert window.eigenvalue == pytest.approx(10, abs=1e-10)


def test_edge_where_the_equilibrium_jumps():
    """A pair that is complex from the jump on."""
    (window,) = complex_windows(lambda f: family(1.0, 15.5)(f + 2.0 * (f > 0.37)), [0.0, 0.5])
    assert window.kind == "contact change"
    assert window.fx_onset == pytest.approx(0.37, abs=2 * window.error + 1e-12)
    assert window.error < 1e-9


@pytest.mark.parametrize("ulps", [-3, -1, 0, 1, 3])
def test_a_load_that_is_the_root_itself(ulps):
    """D is rounding there, of either sign: the edge is a root for all that, with the error that rounding leaves."""
    own = 1.0 + ulps * np.spacing(1.0)
    (window,) = complex_windows(family(1.0, 15.5), [-1.0, own, 3.0])
    assert window.kind == "coalescence"
    assert abs(window.fx_onset - 1.0) <= 2 * window.error < 1e-12


def test_forces_out_of_balance_at_random_are_an_error_of_the_load(path):
    packing = path(0.02)
    assert packing.load_error < 1e-10
    forces = 1e-6 * np.random.default_rng(1).uniform(-1, 1, (10_000, packing.top.sum()))
    off = replace(packing, fx=packing.fx + np.abs(forces).max())
    assert off.load_error == pytest.approx(np.sqrt(3) * forces.mean(axis=1).std(), rel=0.02)
