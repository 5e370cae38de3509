"""The first window of complex eigenvalues in slices of the spectrum, and what is in doubt about it."""

from dataclasses import replace

import numpy as np
import pytest
from families import DIGITS, crossing, normal_form, then_jumping
from scipy.linalg import eigvals
from scipy.sparse import csr_array
from tiling import tile

from faultgouge.analysis import FaultgougeError, NoEquilibriumError, OnsetError, complex_windows, find_onset
from faultgouge.analysis.windows import LIMITS, Limits, System
from faultgouge.analysis.windows.sliced_search import SlicedSearch


def searched(operator, loads, limits=LIMITS):
    return SlicedSearch(lambda fx: System(fx, csr_array(operator(fx))), limits=limits).first_window(np.array(loads))


def bent(f):
    """Levels that cross at 0.906 of an increment, and at 0.5 of the straight line between its ends."""
    return crossing(0.0, -0.0025)(2 * f**7 - 1)


@pytest.mark.parametrize(
    ("operator", "loads", "edges"),
    [
        (crossing(0.47, -0.04), [0.0, 1.0, 2.0], (0.27, 0.67)),
        (crossing(0.47, -0.0009), [0.0, 1.0, 2.0], (0.44, 0.5)),
        (bent, [0.0, 1.0, 2.0], (0.475 ** (1 / 7), 0.525 ** (1 / 7))),
        (normal_form(0.1), [0.2, 0.3], (0.2, None)),
        (crossing(0.37, 1e-3), np.linspace(0, 1, 4), None),
    ],
)
def test_first_window_that_is_known(operator, loads, edges):
    """It begins and ends within an increment, is there from the start, or there is none."""
    window, doubtful = searched(operator, loads)
    assert doubtful == ()
    if edges is None:
        assert window is None
        return
    assert window.kind == ("coalescence" if edges[1] else "start")
    assert (window.fx_onset, window.fx_end) == pytest.approx(edges, abs=DIGITS)


def test_load_without_equilibrium_ends_the_search_for_the_first_window():
    """As it does where all eigenvalues are computed, and not before what lies below it has been looked at."""

    def ending(operator):
        def until(f):
            if f > 1.5:
                raise NoEquilibriumError("no equilibrium")
            return operator(f)

        return until

    for search in (complex_windows, searched):
        with pytest.raises(NoEquilibriumError, match="no equilibrium"):
            search(ending(crossing(0.37, 1e-3)), [0.0, 1.0, 2.0])
    window, _ = searched(ending(crossing(0.5, -0.04)), [0.0, 1.0, 2.0])
    assert window.fx_onset == pytest.approx(0.3, abs=DIGITS)


def test_the_search_ends_with_the_first_window():
    """Of one in each increment."""
    asked = []

    def operator(f):
        asked.append(f)
        return crossing(0.0, -0.04)(np.cos(np.pi * f))

    window, _ = searched(operator, [0.0, 1.0, 2.0, 3.0], Limits(largest_basis=0))
    assert window.fx_end == pytest.approx(np.arccos(-0.2) / np.pi, abs=DIGITS)
    assert max(asked) <= 1.0


def jumping(f):
    """Two levels that exchange their places at a jump, and are real at all loads: a straight line has them meet."""
    return crossing(0.0, -0.04)(-1.0 if f < 0.47 else 1.0)


def test_pair_that_is_announced_and_not_found_is_told_of():
    """Slices that announce a pair of which the operator knows nothing: the shortest increment about it is named."""
    none, doubtful = searched(jumping, [0.0, 1.0])
    assert (none, doubtful) == (None, ((7 / 16, 8 / 16),))
    with pytest.raises(OnsetError, match=r"expected between 0\.4375 and 0\.5: take smaller increments"):
        raise OnsetError.of_search(1.0, doubtful)


@pytest.mark.parametrize(("mu", "expected", "last"), [(1.0, 0.0218330564080, 22), (0.8, 0.0191432059561, 20)])
@pytest.mark.slow
def test_first_window_of_the_reference(ramp, mu, expected, last):
    path = ramp(mu, 1e-3, 22)
    found = find_onset(path, path.grid[last - 2 : last + 1], limits=Limits(all_windows=50))
    assert not found.complete
    (window,) = found.windows
    assert window.kind == "coalescence"
    assert window.fx_onset == pytest.approx(expected, rel=1e-9)


@pytest.mark.long
def test_first_window_of_hundreds_of_disks(path):
    """Against all eigenvalues by LAPACK, at the loads before it, just below and just above it.

    Masses make the copies of a packing differ.
    """
    mass = np.random.default_rng(3).uniform(0.7, 1.3, 200)

    def operator(fx):
        return System.of(replace(tile(path(fx), 2), mass=mass)).stiffness

    window, _ = searched(operator, path.grid)
    assert window.kind == "coalescence"
    assert window.error < 1e-9
    onset, last = window.fx_onset, max(fx for fx in path.grid if fx < window.fx_onset)
    before, below, above = (eigvals(operator(fx).toarray()) for fx in (last, onset - 1e-6, onset + 1e-6))
    # a double eigenvalue is uncertain by the root of u |A| times its coupling
    assert np.abs([before.imag, below.imag]).max() < 1e-4
    assert above[above.imag > 1e-4].real == pytest.approx([window.eigenvalue], abs=1e-2)


@pytest.mark.parametrize("search", [complex_windows, searched])
@pytest.mark.parametrize("operator", [crossing(0.62, -1e-4), then_jumping])
@pytest.mark.slow
def test_an_error_at_any_call_reaches_the_caller(search, operator):
    """What a search may catch is a missing equilibrium: the kinds of other errors in turn, at some eight calls."""
    kinds, loads, asked = (FaultgougeError, RuntimeError, MemoryError, KeyboardInterrupt), [0.0, 0.5, 1.0, 1.5], []
    search(lambda fx: asked.append(fx) or operator(fx), loads)
    assert len(asked) > 5
    for turn, last in enumerate(asked[:: -(-len(asked) // 8)]):
        error = kinds[turn % len(kinds)]

        def ending(fx, error=error, last=last):
            if fx == last:
                raise error("at this call")
            return operator(fx)

        with pytest.raises(error, match="at this call"):
            search(ending, loads)
