"""The first window of growing motion in slices of the spectrum: against all modes, cut off, and on several ranks."""

from dataclasses import replace

import numpy as np
import pytest
from families import OTHERS, with_dissipation
from scipy.linalg import block_diag
from scipy.sparse import csr_array
from test_found import PASSING, cut_off
from test_slicing import FEW, on_ranks

from faultgouge.analysis import NoEquilibriumError
from faultgouge.analysis.motion.energy_norm import EnergyNorm
from faultgouge.analysis.progress import show_progress
from faultgouge.analysis.windows import LIMITS, Edge, System, SystemModes, Window, find_onset, find_windows
from faultgouge.analysis.windows.nearby import find_growing_near, nearest_mode
from faultgouge.analysis.windows.slices.axis import growing_modes
from faultgouge.analysis.windows.slices.first_window import first_window
from faultgouge.analysis.windows.slices.growth import SlicedGrowth
from faultgouge.analysis.windows.slices.store import Candidate
from faultgouge.pywrap import Scene, settle
from faultgouge.pywrap.runs.ramp_loads import ramp_loads
from faultgouge.studies.packing_tools import path_from

KINDS = {"weak": {"cn": 0.1}, "medium": {"cn": 10.0}, "drag": {"drag_time": 100.0}}


@pytest.fixture(scope="module")
def path(ramp):
    """Equilibria of the reference packing, through its onset with dissipation as well."""
    return ramp(1.0, 1e-3, 26)


@pytest.fixture(scope="module")
def search(path):
    """The search of the reference packing, from a little before its onset on."""

    def make(kind, limits=FEW):
        damped = with_dissipation(path, **KINDS[kind])
        loads = np.array(path.grid[21:])

        def search(watch=None, **how):
            with show_progress(watch):
                return first_window(lambda fx: System.of(damped(fx), dissipation=True), loads, limits=limits, **how)

        return search

    return make


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", [pytest.param("weak", marks=pytest.mark.long), pytest.param("medium", marks=pytest.mark.long), "drag"]
)
def test_the_window_is_that_among_all_modes(path, search, kind):
    expected = find_onset(with_dissipation(path, **KINDS[kind]), path.grid[21:], dissipation=True, first=True).windows[
        0
    ]
    found, doubtful = search(kind)()
    assert doubtful == ()
    assert abs(found.fx_onset - expected.fx_onset) <= found.error + expected.error
    assert found.frequency == pytest.approx(expected.frequency, rel=1e-8)
    assert found.kind == expected.kind == "hopf"
    assert found.error < 1e-9


@pytest.mark.long
def test_a_search_goes_on_to_the_bit_on_two_ranks(search, tmp_path):
    expected = search("weak", PASSING)()
    cut_off(search("weak", PASSING), 8, tmp_path)
    for each in on_ranks(2, lambda mine: search("weak", PASSING)(ranks=mine, folder=tmp_path)):
        assert each.result() == expected


@pytest.mark.slow
def test_ranks_find_the_same_with_bases_that_are_kept(search):
    expected = search("medium")()
    for each in on_ranks(2, lambda mine: search("medium")(ranks=mine)):
        assert each.result() == expected


@pytest.mark.long
def test_windows_are_the_same_to_the_bit_in_another_unit_of_time(path):
    """One in which single precision does not hold the squares of eigenvalues."""
    damped, loads, unit = with_dissipation(path, cn=10.0), np.array(path.grid[21:24]), 2.0**36

    def fast(fx):
        own = System.of(damped(fx), dissipation=True)
        return System(fx, unit**2 * own.stiffness, unit * own.damping, balance=own.balance)

    def first(pencil):
        return [first_window(pencil, loads, limits=FEW)[0]]

    for search in (first, lambda pencil: find_windows(pencil, loads)):
        expected = search(lambda fx: System.of(damped(fx), dissipation=True))
        assert len(expected)
        assert list(search(fast)) == [each.in_units_of(unit**2) for each in expected]


def first_order(system):
    """The first-order matrix in coordinates of the energy."""
    a, g = csr_array(system.stiffness), csr_array(system.damping)
    return EnergyNorm.of(a).first_order(a, g)


def oscillators(feed):
    """Twelve modes in pairs, each pair fed by the load times its number; dashpots take the same of all."""

    def pencil(fx):
        levels = np.array([9.0, 10.0, *OTHERS])
        turns = [np.array([[0, feed[k] * fx], [-feed[k] * fx, 0]]) for k in range(6)]
        stiffness = np.diag(levels**2) + block_diag(*turns)
        return System(fx, *(csr_array(each) for each in (stiffness, np.eye(12))))

    return pencil


@pytest.mark.parametrize("loads", [np.linspace(0, 1, 5), np.linspace(0, 1, 41)])
def test_slices_that_bear_more_are_left_out_until_they_do_not(loads):
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


@pytest.mark.long
def test_where_dashpots_couple_all_modes_what_grows_is_followed_back_to_its_onset():
    """The motion is seen at the last load, and begins before it; all eigenvalues tell where."""
    loads = np.array([0.5, 0.55, 0.575, 0.62, 0.65])
    window, doubtful = first_window(dashpot_on_all, loads[[0, 1, 2, 4]])
    assert doubtful == ()

    def fastest(fx):
        return np.linalg.eigvals(first_order(dashpot_on_all(fx))).real.max()

    assert window.kind == "hopf"
    assert fastest(window.fx_onset * (1 - 1e-6)) < 0 < fastest(window.fx_onset * (1 + 1e-6))
    # where all motions are too many to be looked for, all loads before the window are in doubt
    assert first_window(dashpot_on_all, loads, limits=replace(LIMITS, axis_coordinates=0))[1] == ((0.5, 0.575),)


@pytest.mark.long
def test_a_motion_that_grows_where_another_one_begins_to_is_found():
    """It ends to grow between that load and the next one of the ramp, and is not seen at the loads of the ramp."""
    scene = Scene.from_mapping(
        {
            "packing": {"disks": 300, "width": 20.6, "seed": 4},
            "law": {"kn": 2e5},
            "load": {"fy": 3.0},
            "ramp": {"step": 2e-3, "until": 0.014},
        }
    )
    with path_from(settle(scene), scene) as path:
        damped = with_dissipation(path, drag_time=100.0)
        window, doubtful = first_window(lambda fx: System.of(damped(fx), dissipation=True), ramp_loads(scene))
        assert doubtful == ()
        among_all = find_windows(lambda fx: System.of(damped(fx), dissipation=True), [0.01, 0.012], first=True)
        assert window.fx_onset == pytest.approx(min(each.fx_onset for each in among_all), abs=1e-9)
        for fx in (0.01, 0.014):
            rates = growing_modes(System.of(damped(fx), dissipation=True))
            assert not any(abs(mode.mean.imag - window.frequency) < 0.1 for mode in rates)


@pytest.mark.slow
def test_what_cannot_be_followed_back_is_in_doubt_and_ends_the_search():
    """Two motions grow at the last load; one of them at the load before, too, beyond loads without an equilibrium."""
    asked = []

    def with_a_gap(fx):
        if 0.55 < fx < 0.62:
            asked.append(fx)
            assert len(asked) < 10, "the same motion is followed back again and again"
            raise NoEquilibriumError("a gap", beyond=0.55)
        place = dashpot_on_all(fx)
        second = csr_array(([24.0 * fx, -24.0 * fx], ([30, 90], [90, 30])), place.stiffness.shape)
        return replace(place, stiffness=place.stiffness + second)

    def growing(fx):
        return int(np.sum(np.linalg.eigvals(first_order(with_a_gap(fx))).real > 0)) // 2

    window, doubtful = first_window(with_a_gap, np.array([0.5, 0.55, 0.62, 0.65]))
    assert [growing(window.fx_onset * (1 + share)) for share in (-1e-6, 1e-6)] == [1, 2]
    # the one that grows right below the onset of the other is lost there, too
    assert doubtful[::2] == ((0.55, 0.65), (0.55, 0.62))
    assert doubtful[1] == (0.55, pytest.approx(window.fx_onset, rel=1e-6))
    assert asked


@pytest.mark.long
def test_modes_near_a_frequency_are_those_of_all(path):
    damped = with_dissipation(path, cn=0.1)
    modes = SystemModes.of(System.of(damped(0.023), dissipation=True))
    for rate in modes.values[[3, 100, 200]]:
        found = nearest_mode(modes.system, float(rate.imag) * (1 + 1e-6))
        assert found.mean == pytest.approx(rate, rel=1e-9)
    assert len(modes.grows)
    for rate in modes.values[modes.grows]:
        found = [mode.mean for mode in find_growing_near(modes.system, 1.001j * rate.imag, 12)]
        assert min(abs(each - rate) for each in found) < 1e-9 * abs(rate)
        assert find_growing_near(System.of(damped(0.02), dissipation=True), 1j * rate.imag, 12) == []
    found = sorted((mode.mean for mode in growing_modes(modes.system)), key=lambda s: s.imag)
    assert found == pytest.approx(modes.values[modes.grows], rel=1e-9)
    assert growing_modes(System.of(damped(0.02), dissipation=True)) == []


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
    with path_from(settle(scene), scene) as equilibria:
        path = with_dissipation(equilibria, **kind)

        def fastest(fx):
            return np.linalg.eigvals(first_order(System.of(path(fx), dissipation=True))).real.max()

        window, doubtful = first_window(lambda fx: System.of(path(fx), dissipation=True), ramp_loads(scene), limits=FEW)
        assert doubtful == ()
        if grows:
            assert fastest(window.fx_onset * (1 - 1e-6)) < 1e-11 < fastest(window.fx_onset * (1 + 1e-6))
        else:
            assert window is None
            assert max(map(fastest, [0.0, 0.01, 0.02, 0.03, 0.04])) < 0


def test_all_announced_modes_are_looked_at_also_beside_one_that_grew_before():
    """Clusters do not tell where modes begin to grow: the second may have begun in an earlier increment still."""
    begun = {0.5: -1.0, 0.9: -2.0}
    one = csr_array(np.eye(2))

    class Told(SlicedGrowth):
        def candidates(self, places, depth):
            return [[Candidate(onset, onset, np.zeros((2, 2)), np.zeros((2, 2))) for onset in begun]]

        def _window_of(self, candidate, there, first):
            return Window(Edge(begun[candidate.onset], 0.0, 1j, 1.0, "hopf"), None)

    search = Told(lambda fx: System(fx, one, one))
    assert search.first_window(np.array([0.0, 1.0]))[0].fx_onset == begun[0.9]
