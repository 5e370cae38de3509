"""The onset with dissipation: against LAPACK's companion matrix, families with known windows, and weak damping."""

import numpy as np
import pytest
from families import with_dissipation
from linearised import motion_matrix
from scipy.linalg import block_diag
from scipy.optimize import brentq
from scipy.sparse import csr_array

from faultgouge.analysis import NoEquilibriumError
from faultgouge.analysis.windows import System, find_onset, find_windows
from faultgouge.analysis.windows.search import Search

RNG = np.random.default_rng(11)
TURN = np.linalg.qr(RNG.normal(size=(8, 8)))[0]


def family(block, damping):
    """A 2 x 2 block of loads and its damping among six quiet modes, in a turned basis."""

    def pencil(fx):
        a = block_diag(block(fx), np.diag([30.0, 40, 50, 60, 70, 80]))
        g = block_diag(np.diag(damping), 0.02 * np.eye(6))
        return System(fx, *(csr_array(TURN @ each @ TURN.T) for each in (a, g)))

    return pencil


def growth(block, damping, fx):
    """Largest Re s of the 2 x 2 block alone."""
    companion = np.block([[np.zeros((2, 2)), np.eye(2)], [-block(fx), -np.diag(damping)]])
    return np.linalg.eigvals(companion).real.max()


def crossing(half_width, place=0.4):
    """Two levels that pass each other, with an undamped window of this half width about the place."""

    def block(fx):
        return np.array([[10 + fx - place, half_width], [-half_width, 10 - fx + place]])

    return block


@pytest.mark.parametrize("damping", [(1e-6, 3e-6), (1e-3, 4e-3), (1e-2, 1e-2)])
@pytest.mark.parametrize("half_width", [0.2, 1e-2, 1e-3])
def test_windows_narrower_than_the_increment(half_width, damping):
    """Both ends of the increment are stable; the edges are those of the block by itself."""
    block = crossing(half_width)
    found = find_windows(family(block, damping), [-1.0, 0.0, 1.0, 2.0])
    if growth(block, damping, 0.4) < 0:
        # a coupling that feeds less than the dashpots take: no window of the pair's
        assert half_width * 0.2 < max(damping)
        assert found == ()
        return
    (window,) = found
    ends = 0.4 - 13 * half_width, 0.4 + 13 * half_width
    edges = [brentq(lambda fx: growth(block, damping, fx), 0.4, end, xtol=1e-14) for end in ends]
    # Re s is known to 1e-15; its slope is the damping over the width, or one where the block is nearly defective
    digits = 1e-10 + 1e-14 * half_width / max(damping)
    assert [window.fx_onset, window.fx_end] == pytest.approx(edges, abs=digits)
    assert window.frequency == pytest.approx(np.sqrt(10), rel=0.1)
    assert window.kind == "hopf"
    assert window.error < 10 * digits


def test_a_steady_loss_of_stability_is_no_hopf_point():
    """A restoring force that vanishes: s = 0. And nothing grows where levels repel each other."""
    (window,) = find_windows(family(lambda fx: np.diag([10 * (0.3 - fx), 12.0]), (1e-2, 1e-2)), [0.0, 1.0])
    assert (window.kind, window.fx_end) == ("steady", None)
    assert window.fx_onset == pytest.approx(0.3, abs=1e-10)
    repels = family(lambda fx: np.array([[9.6 + fx, 1e-2], [1e-2, 10.4 - fx]]), (1e-3, 1e-4))
    assert find_windows(repels, [0.0, 1.0]) == ()


def test_what_is_known_is_told_as_it_comes_and_what_grows_from_the_beginning():
    told = Search(family(crossing(0.2), (1e-3, 1e-3)), 1e-7).along([-1.0, 0.0, 0.4, 1.0, 2.0])
    open_ones = [(fx, [each.fx_end is None for each in windows]) for fx, windows in told]
    assert open_ones == [(0.0, []), (0.4, [True]), (1.0, [False]), (2.0, [False])]
    (window,) = find_windows(family(crossing(0.2, place=0.0), (1e-3, 1e-3)), [0.0, 1.0])
    assert (window.kind, window.fx_onset) == ("start", 0.0)
    assert 0.15 < window.fx_end < 0.25


def test_a_load_besides_that_has_no_equilibrium_costs_no_window():
    """Where a ramp goes on beyond a gap; a load of the ramp itself without an equilibrium is an error."""
    pencil, loads = family(crossing(0.2), (1e-3, 1e-3)), [-1.0, 0.0, 1.0, 2.0]

    def with_a_gap(fx):
        if 1.2 < fx < 1.8:
            raise NoEquilibriumError("a gap", beyond=1.2)
        return pencil(fx)

    beside = {0.0: [0.4], 1.0: [1.5]}  # where the search looks, too
    found = find_windows(with_a_gap, loads, look=lambda below, above: beside.get(below, []))
    assert found == find_windows(pencil, loads, look=lambda below, above: [0.4] * (below == 0.0)) != ()
    with pytest.raises(NoEquilibriumError):
        find_windows(with_a_gap, [*loads[:3], 1.5, 2.0])


@pytest.mark.parametrize(
    ("cn", "onset", "digits"), [pytest.param(1.0, 0.0218328, 1e-7, marks=pytest.mark.long), (10.0, 0.02235, 1e-5)]
)
@pytest.mark.slow
def test_reference_packing_with_normal_dashpots(path, cn, onset, digits):
    """The onsets that an independent computation had found, and LAPACK's root of the same to 1e-9."""
    damped = with_dissipation(path, cn=cn)
    window = find_onset(damped, [0.0218, 0.0224], dissipation=True).windows[0]
    assert (window.fx_onset, window.kind) == (pytest.approx(onset, abs=digits), "hopf")
    below, above = (motion_matrix(damped(window.fx_onset + side)) for side in (-1e-9, 1e-9))
    assert np.linalg.eigvals(below).real.max() < 0 < np.linalg.eigvals(above).real.max()
    assert window.error < 1e-9
