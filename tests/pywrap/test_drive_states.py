"""The states of a driven run that are stored: even ones, and those in which a slip begins and ends."""

import numpy as np
import pytest

from faultgouge.analysis.responses.slips import SlipDetector, find_slips
from faultgouge.pywrap.runs.drive import DriveSample, DriveState, PendingStates

VELOCITY, PERIOD, EVERY, ROWS_A_PART = 1e-3, 2.0, 0.1, 24


def noisy_series(seed, rows=3000):
    """A layer that creeps back and forth under a force that wanders, with slips of both signs."""
    rng = np.random.default_rng(seed)
    time = EVERY * np.arange(1, rows + 1)
    leaps = rng.choice([0.0, 1.0, -1.0], size=rows, p=[0.98, 0.015, 0.005])
    moved = np.cumsum(0.3 * VELOCITY * EVERY * rng.standard_normal(rows) + 0.05 * leaps)
    force = 0.3 * np.sin(time / 40.0) + 0.01 * np.cumsum(rng.standard_normal(rows))
    return time, force, moved, rng.random(rows)


def is_even(time):
    return round(time / EVERY) % ROWS_A_PART == 0


def given(detector, row):
    return detector.add(row.time, row.force, row.displacement, row.kinetic_energy)


def stored_times(series, cuts=()):
    """Times of the states of a run that is handed over, at some rows, from one choice of states to the next."""
    rows = [DriveSample(time, force, moved, 0.0, energy, 0) for time, force, moved, energy in zip(*series, strict=True)]
    detector = SlipDetector(VELOCITY, PERIOD)
    pending, found, most = PendingStates(detector, is_even), [], 0
    for k, row in enumerate(rows):
        slip = given(detector, row)
        found += pending.take(DriveState(row.time, row.displacement, None), slip, k == len(rows) - 1)
        most = max(most, len(pending.states))
        if k in cuts:
            detector = SlipDetector(VELOCITY, PERIOD)
            for known in rows[: k + 1]:
                given(detector, known)
            pending = PendingStates(detector, is_even, pending.states)
    assert most <= 4 * PERIOD / EVERY + 2  # no more than the rows in which a slip may begin, and an even state
    return [state.time for state in found]


@pytest.mark.parametrize("seed", range(4))
def test_states_are_the_even_ones_and_both_ends_of_each_slip(seed):
    series = noisy_series(seed)
    slips, under_way = find_slips(*series, VELOCITY, PERIOD)
    assert len(slips) > 10
    even = {time for time in series[0].tolist() if is_even(time)}
    ends = {time for slip in slips for time in (slip.begins, slip.ends)}
    last = {series[0][-1]} | ({under_way.begins} if under_way else set())
    assert stored_times(series) == sorted(even | ends | last)


def test_a_run_that_is_cut_off_anywhere_stores_the_same_states():
    series = noisy_series(4)
    assert stored_times(series, set(range(0, 3000, 101))) == stored_times(series)
