"""Slips in a made series: begins, ends, force drop and displacement are those with which the series was made."""

import numpy as np
import pytest

from faultgouge.analysis.responses.slips import SlipDetector, find_slips, friction_of

STIFFNESS, VELOCITY, PERIOD, EVERY = 10.0, 1e-3, 2.0, 0.1
SLIPS = [(100.0, 3.0, 0.08), (180.0, 5.0, 0.11), (300.0, 2.0, 0.03)]


def series(noise=0.0, sign=1.0):
    """A layer that creeps at a tenth of V, slips evenly where SLIPS says, and vibrates."""
    time = np.arange(0.0, 400.0, EVERY)
    moved, energy = 0.1 * VELOCITY * time, np.zeros_like(time)
    for begin, lasts, slip in SLIPS:
        moved += slip * np.clip((time - begin) / lasts, 0.0, 1.0)
        energy[(time > begin) & (time < begin + lasts)] = slip
    moved += noise * np.sin(2 * np.pi * time / 0.37)
    return time, sign * STIFFNESS * (VELOCITY * time - moved), sign * moved, energy


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_slips_are_those_of_the_series(noise, sign):
    """Vibration with a velocity of 8 V, faster than the window, moves beginnings and ends by its own period alone."""
    time, force, moved, energy = series(noise, sign)
    found, _ = find_slips(time, force, moved, energy, VELOCITY, PERIOD)
    assert len(found) == len(SLIPS)
    for slip, (begin, lasts, size) in zip(found, SLIPS, strict=True):
        late = 0.37 if noise else 0.0
        # a row, and the window in which the mean velocity is still above the threshold
        assert slip.begins == pytest.approx(begin, abs=EVERY + late)
        assert 0 <= slip.ends - (begin + lasts) + EVERY + late <= 0.25 * PERIOD + 2 * EVERY + 2 * late
        assert sign * slip.slip == pytest.approx(size + 0.1 * VELOCITY * lasts, abs=2e-4 + 4 * noise)
        drop = STIFFNESS * (sign * slip.slip - VELOCITY * (slip.ends - slip.begins))
        assert sign * (slip.force_before - slip.force_after) == pytest.approx(drop, abs=1e-12)
        assert slip.kinetic_energy == size


def test_detector_finds_the_same_while_the_run_goes_on():
    """And says when: two quiet periods after the last fast row; it looks at what was, alone."""
    rows = list(zip(*series(), strict=True))
    detector, found = SlipDetector(VELOCITY, PERIOD), []
    for k, row in enumerate(rows, 1):
        if (slip := detector.add(*row)) is not None:
            assert row[0] - slip.ends == pytest.approx(2 * PERIOD, abs=1.5 * EVERY)
            found.append(slip)
            assert find_slips(*zip(*rows[:k], strict=True), VELOCITY, PERIOD)[0] == found
            assert detector.so_far is None
    assert len(found) == len(SLIPS)


def test_slip_that_has_not_ended_is_told_apart():
    time, force, moved, energy = (column[: int(102.0 / EVERY)] for column in series())
    ended, under_way = find_slips(time, force, moved, energy, VELOCITY, PERIOD)
    assert ended == []
    begin, lasts, size = SLIPS[0]
    assert under_way.begins == pytest.approx(begin, abs=EVERY)
    assert under_way.ends == time[-1] < begin + lasts
    assert under_way.slip == pytest.approx(size * (time[-1] - begin) / lasts, rel=0.01)


def test_friction_and_a_layer_that_follows_the_spring_without_slips():
    time = np.arange(0.0, 400.0, EVERY)
    assert find_slips(time, np.full_like(time, 0.5), VELOCITY * time, 0 * time, VELOCITY, PERIOD) == ([], None)
    time, force, moved, energy = series()
    slips, _ = find_slips(time, force, moved, energy, VELOCITY, PERIOD)
    friction, before = friction_of(time, force, slips, fy=3.0), np.mean([slip.force_before for slip in slips])
    assert (friction.largest, friction.before) == pytest.approx((force.max() / 3.0, before / 3.0))
    assert friction.mean == pytest.approx(force[time >= 100.0].mean() / 3.0, rel=1e-3)
    assert friction_of(time, force, [], fy=3.0).before is None
