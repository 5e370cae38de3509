"""The first window of growing motion in slices of the spectrum: against all modes, cut off, and on several ranks."""

import numpy as np
import pytest
from families import OTHERS, with_dissipation
from scipy.linalg import block_diag
from scipy.sparse import csr_array
from test_slicing import FEW, on_ranks

from faultgouge.analysis.windows import LIMITS, System, find_windows
from faultgouge.analysis.windows.sliced_search import SlicedSearch
from faultgouge.pywrap import Scene, settle
from faultgouge.pywrap.runs.ramp_loads import ramp_loads
from faultgouge.studies.packing_tools import path_from


def first_window(system, loads, limits=LIMITS, **how):
    """The search in slices."""
    return SlicedSearch(system, limits=limits, **how).first_window(np.asarray(loads))


KINDS = {"weak": {"cn": 0.1}, "medium": {"cn": 10.0}, "drag": {"drag_time": 100.0}}


@pytest.fixture(scope="module")
def path(ramp):
    """Equilibria of the reference packing, through its onset with dissipation as well."""
    return ramp(1.0, 1e-3, 26)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_the_window_is_that_among_all_modes_on_one_rank_and_on_two(path, kind):
    """From a little before it on."""
    damped, loads = with_dissipation(path, **KINDS[kind]), path.grid[21:]

    def system(fx):
        return System.of(damped(fx), dissipation=True)

    (expected, *_) = find_windows(system, loads, first=True)
    found, doubtful = first_window(system, loads, FEW)
    assert (doubtful, found.kind, expected.kind) == ((), "hopf", "hopf")
    assert abs(found.fx_onset - expected.fx_onset) <= found.error + expected.error
    assert found.frequency == pytest.approx(expected.frequency, rel=1e-8)
    assert found.error < 1e-9
    for each in on_ranks(2, lambda mine: first_window(system, loads, FEW, ranks=mine)):
        assert each.result() == (found, ())


def oscillators(feed):
    """Twelve modes in pairs, each pair fed by the load times its number; dashpots take the same of all."""

    def pencil(fx):
        levels = np.array([9.0, 10.0, *OTHERS])
        turns = [np.array([[0, feed[k] * fx], [-feed[k] * fx, 0]]) for k in range(6)]
        stiffness = np.diag(levels**2) + block_diag(*turns)
        return System(fx, *(csr_array(each) for each in (stiffness, np.eye(12))))

    return pencil


@pytest.mark.parametrize("loads", [np.linspace(0, 1, 5), np.linspace(0, 1, 41)])
def test_the_first_of_two_coupled_motions_in_closed_form(loads):
    """Where the first of two coupled modes of frequencies 9 and 10 begins to grow, in closed form.

    On the axis s = i w: (81 - w^2)(100 - w^2) - w^2 + b^2 = 0 and w (181 - 2 w^2) = 0, b the antisymmetric coupling.
    """
    b = np.sqrt(90.5 + 9.5**2)
    window, doubtful = first_window(oscillators([2 * b, 1, 1, 1, 1, 1]), loads)
    assert doubtful == ()
    assert window.fx_onset == pytest.approx(0.5, abs=1e-9)
    assert window.frequency == pytest.approx(np.sqrt(90.5), rel=1e-9)
    assert first_window(oscillators([1] * 6), loads) == (None, ())


def dashpot_on_all(fx):
    """120 oscillators that one strong dashpot couples, more than a cluster can have; the load feeds two far apart."""
    stiffness = np.diag(100 + 0.5 * np.arange(120))
    even = np.arange(0, 120, 2)
    for first, second, feed in ((even, even + 1, 0.2), (20, 80, 25.0)):
        stiffness[first, second] += feed * fx
        stiffness[second, first] -= feed * fx
    damping = 0.01 * np.eye(120) + 40.0 / 120
    return System(fx, csr_array(stiffness), csr_array(damping))


def fastest(system):
    """Largest Re s, by LAPACK."""
    return np.linalg.eigvals(system.first_order).real.max()


@pytest.mark.long
def test_where_dashpots_couple_all_motions_the_loads_before_the_window_are_in_doubt():
    loads = [0.5, 0.55, 0.575, 0.65]
    window, doubtful = first_window(dashpot_on_all, loads)
    assert window.kind == "hopf"
    below, above = (fastest(dashpot_on_all(window.fx_onset * (1 + side))) for side in (-1e-6, 1e-6))
    assert below < 0 < above
    assert doubtful == ((0.5, 0.575),)


@pytest.mark.long
@pytest.mark.parametrize(
    ("disks", "seed", "kind", "grows"),
    [
        (200, 7, {"cn": 1.0}, True),
        (200, 4, {"drag_time": 100.0}, True),
        (300, 3, {"cn": 0.1}, True),
        (200, 1, {"cn": 10.0, "ct": 5.0}, False),
    ],
)
def test_packings_against_all_eigenvalues(disks, seed, kind, grows):
    """The companion matrix has no eigenvalue that grows just below the onset, and one just above; or none at all."""
    packing = {"disks": disks, "width": round(1.192 * disks**0.5, 1), "seed": seed}
    ramp = {"step": 2e-3, "until": 0.04}
    scene = Scene.from_mapping({"packing": packing, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": ramp})
    with path_from(settle(scene), scene) as path:

        def system(fx):
            return System.of(path(fx).with_dissipation(**kind), dissipation=True)

        window, doubtful = first_window(system, ramp_loads(scene), FEW)
        assert (doubtful, window is not None) == ((), grows)
        if grows:
            below, above = (fastest(system(window.fx_onset * (1 + side))) for side in (-1e-6, 1e-6))
            assert below < 1e-11 < above
        else:
            assert max(fastest(system(fx)) for fx in (0.0, 0.01, 0.02, 0.03, 0.04)) < 0
