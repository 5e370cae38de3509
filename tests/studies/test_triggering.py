"""What runs with weakening friction show: jump, growth, or neither."""

import numpy as np
import pytest

from faultgouge.studies.triggering import Forecast, judge

V0, LENGTH = 1e-11, 400.0
TIME = np.linspace(0.1, LENGTH, 4000)


def run_of(msd, crossing):
    """A run whose layer is fast enough from a time on, or never."""
    fast = (np.inf if crossing is None else crossing) <= TIME
    return {"time": TIME, "msd": msd, "layer_velocity": np.where(fast, 2 * V0, 0.5 * V0)}


def noise(exponent=2.0):
    """Of doubles, whose D grows as a power of the time: 1e-26 at first, 1e-24 in the end."""
    return 1e-24 * (TIME / LENGTH) ** exponent


def msd_with_jump(height, at, then=0.0):
    """D that jumps at a time, and grows on from a thousandth of its jump at a rate."""
    later = np.maximum(TIME - at, 0.0)
    return noise() + (at <= TIME) * height * (np.sin(later) ** 2 + 1e-3 * np.exp(then * later))


STABLE, UNSTABLE = Forecast(1.55e-12, 0.0, 1.2, 0.0), Forecast(1e-16, 9.0, 5.0, 0.1)
QUIET = Forecast(1e-16, 0.0, 5.0, 0.0)


@pytest.mark.parametrize(
    ("msd", "crossing", "foreseen", "verdict"),
    [
        # the whole jump, after the first twentieth of the run: no growth over 13.6 decades
        (msd_with_jump(1.5e-12, 265.0), 265.0, STABLE, "jump alone"),
        # nothing but rounding: the first twentieth has a smaller D than the rest
        (noise(), None, STABLE, "does not weaken"),
        (msd_with_jump(1e-12, 390.0), 390.0, STABLE, "too short"),
        (msd_with_jump(1e-16, 50.0, 0.1), 50.0, UNSTABLE, "grows"),
        (msd_with_jump(1e-16, 50.0, 0.16), 50.0, UNSTABLE, "unexplained"),
        (msd_with_jump(1e-16, 50.0, 0.1), 50.0, QUIET, "unexplained"),
        # beyond the jump of its first moments, but not beyond the one that is foreseen
        (msd_with_jump(1e-16, 50.0, 0.02), 50.0, Forecast(1e-15, 0.1, 1.2, 0.1), "jump alone"),
    ],
    ids=["late jump", "noise", "at the end", "grows", "faster", "nothing grows", "foreseen"],
)
def test_only_growth_at_the_rate_of_the_spectrum_and_beyond_the_jump_is_an_instability(
    msd, crossing, foreseen, verdict
):
    assert judge(run_of(msd, crossing), V0, foreseen)["verdict"] == verdict
