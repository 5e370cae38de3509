"""What a search may catch is a missing equilibrium; every other error reaches the caller, whenever it comes."""

import numpy as np
import pytest
from families import crossing

from faultgouge.analysis import FaultgougeError, complex_windows, find_onset
from faultgouge.analysis.onset import Family, Limits
from faultgouge.analysis.onset.sliced import first_window


class LostEngineError(FaultgougeError):
    """As of an engine that fails: of the same family of errors as those that the search may catch."""


ERRORS = (LostEngineError, RuntimeError, MemoryError, KeyboardInterrupt)


def small(operator):
    return complex_windows(operator, [0.0, 0.5, 1.0, 1.5])


def large(operator):
    window, _ = first_window(Family(operator, 0.0, Limits()), np.array([0.0, 0.5, 1.0, 1.5]))
    return () if window is None else (window,)


class Failing:
    """An operator that raises an error at its n-th call, and counts its calls."""

    def __init__(self, operator, at=None, error=None):
        self.operator, self.at, self.error, self.calls = operator, at, error, 0

    def __call__(self, fx):
        self.calls += 1
        if self.calls == self.at:
            raise self.error("at this call")
        return self.operator(fx)


def jumping(f):
    """A window of two levels, and a jump to another one, which takes bisection, and divided increments."""
    return crossing(0.6, -0.01)(f) if f < 1.1 else crossing(1.2, -0.04)(f)


@pytest.mark.parametrize("search", [small, large])
@pytest.mark.parametrize("operator", [crossing(0.62, -1e-4), jumping])
@pytest.mark.slow
def test_an_error_at_any_call_reaches_the_caller(search, operator):
    counting = Failing(operator)
    assert search(counting)
    assert counting.calls > 8
    for call in range(1, counting.calls + 1):
        # each kind of error in turn
        error = ERRORS[call % len(ERRORS)]
        with pytest.raises(error, match="at this call"):
            search(Failing(operator, call, error))


@pytest.mark.parametrize("disks", [300, 50])
@pytest.mark.parametrize("error", [LostEngineError, MemoryError])
@pytest.mark.slow
def test_an_engine_that_fails_is_no_packing_without_onset(path, disks, error):
    """Of equilibria along a ramp, with the search of a small packing and with that of a large one."""
    limits = Limits(all_windows=disks)
    loads = path.grid[21:]
    counting = Failing(path)
    assert find_onset(counting, loads, limits=limits).windows
    for call in (1, counting.calls // 3, 2 * counting.calls // 3, counting.calls):
        with pytest.raises(error, match="at this call"):
            find_onset(Failing(path, call, error), loads, limits=limits)
