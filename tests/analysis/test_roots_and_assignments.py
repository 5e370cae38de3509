"""Roots between two bounds, and partners with the largest sum of weights, against NumPy and SciPy."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from faultgouge.analysis.assignment import assign_columns
from faultgouge.analysis.bracketed_root import bracketed_root
from faultgouge.analysis.packing.geometry import FEW, near_pairs


@pytest.mark.parametrize("seed", range(20))
def test_a_root_of_a_cubic_to_the_width_that_was_asked_for(seed):
    rng = np.random.default_rng(seed)
    roots, scale = rng.uniform(-1, 1, 3), 10.0 ** rng.integers(-200, 200)
    calls = []

    def value(x):
        calls.append(x)
        return scale * np.prod(x - roots)

    width = 10.0 ** -rng.integers(3, 15)
    assert np.abs(bracketed_root(value, -1.5, 1.5, width) - roots).min() <= width
    assert len(calls) < 60  # bisection alone takes up to 53


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.75), (-1.0, 0.0), (-0.3, 0.7)])
def test_a_root_at_a_bound_and_a_jump(low, high):
    assert bracketed_root(lambda x: x, low, high, 1e-12) == pytest.approx(0.0, abs=1e-12)
    assert bracketed_root(lambda x: 1.0 if x > 0.3 else -1.0, low, high + 0.5, 1e-12) == pytest.approx(0.3, abs=1e-12)


def test_no_root_without_a_change_of_sign():
    with pytest.raises(ValueError, match="one sign"):
        bracketed_root(lambda x: 1 + x**2, -1, 1, 1e-3)


@pytest.mark.parametrize("shape", [(1, 1), (7, 7), (7, 9), (9, 7), (40, 40)])
@pytest.mark.parametrize("levels", [2, 1000])
def test_the_largest_sum_of_weights_also_where_rows_want_the_same_column(shape, levels):
    weight = np.random.default_rng(1).integers(0, levels, shape) / levels - 0.5
    column = assign_columns(weight)
    rows = np.flatnonzero(column >= 0)
    assert len(rows) == min(shape) == len(np.unique(column[rows]))
    assert weight[rows, column[rows]].sum() == pytest.approx(weight[linear_sum_assignment(weight, True)].sum())


def test_rows_that_may_have_either_column_keep_their_order():
    """As a pair that has just met: rounding would decide which is which."""
    weight = np.array([[0.5, 0.5 - 1e-13, 0.1], [0.5 + 1e-13, 0.5, 0.1], [0.2, 0.3, 1.0]])
    assert list(assign_columns(weight)) == [0, 1, 2]
    assert list(assign_columns(weight[[1, 0, 2]])) == [0, 1, 2]


@pytest.mark.parametrize("box", [None, 12.0])
def test_the_same_near_pairs_of_few_and_of_many(box):
    rng = np.random.default_rng(2)
    position = rng.uniform(-3, 13, (FEW + 1, 2))
    many = {tuple(pair) for pair in near_pairs(position, box, 0.8)}
    few = {tuple(pair) for pair in near_pairs(position[:FEW], box, 0.8)}
    assert few == {(i, j) for i, j in many if j < FEW}
    assert len(few) > 200
