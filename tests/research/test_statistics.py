"""Intervals of what several runs have: of runs whose values depend on each other, and of values that do not."""

import numpy as np
import pytest

from faultgouge.studies.statistics import share
from research.statistics import count_of, median_interval, median_over_runs, share_over_runs


def test_a_share_of_runs_that_differ_is_less_certain_than_one_of_single_values():
    apart = share_over_runs([[True] * 10, [False] * 10, [True] * 10, [False] * 10])
    single = share(20, 40)
    assert (apart["count"], apart["of"], apart["share"]) == (20, 40, 0.5)
    assert apart["low"] < single["low"] - 0.1
    assert apart["high"] > single["high"] + 0.1
    mixed = share_over_runs([[True, False] * 5] * 4)
    assert (mixed["low"], mixed["high"]) == (single["low"], single["high"])
    assert count_of(share_over_runs([[], []])) == "-"


@pytest.mark.long
def test_the_interval_of_runs_covers_the_truth_where_that_of_values_does_not():
    """Runs with a level of their own, many values each: 95 % of the intervals contain the level of all, or few less."""
    rng, covers = np.random.default_rng(0), []
    for _ in range(40):
        runs = [level + 0.1 * rng.standard_normal(20) for level in rng.standard_normal(8)]
        _, low, high = median_over_runs(runs)
        covers.append(low <= 0 <= high)
    assert np.mean(covers) > 0.8
    assert median_over_runs([[1.0]]) is None
    assert median_over_runs([[1.0, 2.0], [], [3.0]])[0] == pytest.approx(2.0)


def test_interval_of_a_median_covers_it_as_often_as_it_says():
    generator, covered = np.random.default_rng(1), 0
    for trial in range(100):
        sample = generator.exponential(size=40)
        median, low, high = median_interval(np.minimum(sample, 2.0), sample < 2.0, draws=200, seed=trial)
        assert low <= median <= high
        covered += low <= np.log(2) <= high
    # 95 are expected, and 88 is three standard deviations below
    assert covered >= 88
