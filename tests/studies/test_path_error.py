"""The error of an onset, path and rounding together, covers the onset that the exact path has."""

from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import LinAlgError

from faultgouge.analysis import NoEquilibriumError, OnsetError, find_onset
from faultgouge.pywrap import Engine, LoadPath, Scene, scene_path, settle
from faultgouge.pywrap.onset import onset_run
from faultgouge.pywrap.runs.path_error import contact_changes, path_error, squared_gap, with_path_error
from faultgouge.studies.onset import onset

PAPER = Scene.from_toml(files("faultgouge") / "scenes/paper.toml").resolved()
HUNDRED = {"packing": {"seed": 1}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}


def scene_of(sections, precision, increment, until):
    return Scene.from_mapping(sections | {"precision": precision, "ramp": {"step": increment, "until": until}})


def covers(found, truth):
    """Whether an onset with its error covers that of finer increments in better arithmetic."""
    (fx, error), (exact, least) = found, truth
    return abs(fx - exact) <= error + least and least < 1e-12 and error < 1e-10


@contextmanager
def path_of(scene, mu=None):
    """LAMMPS with the settled packing, and the path from there."""
    start = settle(scene, mu)
    with Engine(start.packing) as engine:
        yield scene_path(engine, start, scene)


class CubicSolver:
    """Increments h that each add h^3 to an error of the path, which the packing stands for here."""

    def solve(self, load, below, beside, ahead):
        packing = (load, below.packing[1] + (load - below.fx) ** 3)
        return SimpleNamespace(fx=load, packing=packing)


@pytest.mark.parametrize("count", [10, 3], ids=["doubled", "halved"])
def test_the_correction_leads_to_the_limit_of_small_increments(monkeypatch, count):
    """An onset at 1 without the error of the path."""
    monkeypatch.setattr("faultgouge.pywrap.runs.path_error.contact_changes", lambda path, fx: np.zeros(count, bool))
    path = LoadPath(CubicSolver(), [SimpleNamespace(fx=0.0, packing=(0.0, 0.0))])
    list(path.climb((np.arange(1, count + 1) / count).tolist()))
    shift = 0.1 / count**2
    correction, error = path_error(path, 1 + shift, lambda packing: packing[0] - 1 - 0.1 * packing[1], 1e-12)
    assert correction == pytest.approx(-shift, rel=0.1)
    assert error >= shift


@pytest.mark.long
@pytest.mark.parametrize(("mu", "below"), [(1.0, 0.020), (0.8, 0.018)])
def test_stated_intervals_contain_the_extrapolated_onset(mu, below):
    """The onset lies up to 2e-3 beyond the load below it: the search of all increments takes most of the time."""

    def whole(precision, increment):
        scene, last = scene_of(PAPER, precision, increment, 0.1), round((below + 2e-3) / increment)
        with path_of(scene, mu) as path:
            for k in range(1, last + 1):
                path(k * increment)
            found = find_onset(path, increment * np.arange(round(below / increment), last + 1))
            return with_path_error(found, path)

    finest = whole("compensated", 1.25e-4)
    assert finest.error < 1e-9
    for precision in ("double", "compensated"):
        for increment in (2e-3, 1e-3, 5e-4, 2.5e-4):
            found = whole(precision, increment)
            assert abs(found.fx_c - finest.fx_c) <= found.error + finest.error, (precision, increment)
            assert found.error < 1e-7


@pytest.mark.long
def test_a_contact_that_slides_before_the_onset_is_covered():
    """Of this packing a contact reaches the Coulomb bound before the onset: the error is bounded, not extrapolated."""
    found = {}
    for precision, increment in (("compensated", 2.5e-4), ("double", 1e-3), ("double", 5e-4)):
        packing = {"disks": 100, "top": 10, "width": 11.9, "seed": 11}
        sections = HUNDRED | {"packing": packing, "law": {"kn": 2e5, "mu": 0.2}}
        scene = scene_of(sections, precision, increment, 3e-3)
        with path_of(scene) as path:
            window, *_ = find_onset(path, increment * np.arange(round(3e-3 / increment) + 1)).windows
            correction, part = path_error(path, window.fx_onset, squared_gap(window.eigenvalue), window.error)
            assert contact_changes(path, window.fx_onset).any()
        assert correction == 0
        found[precision, increment] = window.fx_onset, window.error + part
    truth = found.pop(("compensated", 2.5e-4))
    assert all(covers(onset, truth) for onset in found.values())


@pytest.mark.long
def test_onsets_with_dissipation_state_the_whole_error():
    """Beside them stands the undamped onset, with its whole error."""
    found = {}
    for precision, increment in (("compensated", 5e-4), ("double", 2e-3), ("double", 1e-3)):
        sections = HUNDRED | {"packing": {"disks": 30, "seed": 4}, "damping": {"cn": 0.5, "ct": 0.2}}
        run = onset_run(scene_of(sections, precision, increment, 0.012), 1.0, dissipation=True)
        found[precision, increment] = (run.fx_c, run.error), (run.undamped.fx_c, run.undamped.error)
    truth = found.pop(("compensated", 5e-4))
    assert all(covers(*pair) for onsets in found.values() for pair in zip(onsets, truth, strict=True))


@pytest.mark.long
def test_rows_of_a_sweep_state_the_error_that_onset_states_and_it_covers():
    """Of this packing the root alone is known to 1.3e-11."""
    ramp = {"step": 2e-3, "until": 0.006}
    sections = {"packing": {"disks": 100, "seed": 28}, "law": {"kn": 2e5, "mu": 0.15}, "load": {"fy": 3.0}}
    scene, fine = (Scene.from_mapping(sections | {"ramp": ramp | more}) for more in ({}, {"step": 1e-4}))
    row = onset.row(scene, partial(settle, scene))
    known, limit = (onset_run(each, 0.15, first=True) for each in (scene, fine))
    window = known.windows[0]
    assert (row["fx_c"], row["error"], row["error_of_path"]) == (window.fx_onset, window.error, window.path_error)
    assert row["error_of_path"] > 0.5 * row["error"]
    assert abs(row["fx_c"] - limit.fx_c) <= row["error"] + limit.error < 2e-10


@pytest.mark.slow
def test_one_packing_per_seed_whatever_the_arithmetic():
    one, other = (
        settle(Scene.from_mapping(HUNDRED | {"precision": each})).packing for each in ("double", "compensated")
    )
    pairs = [set(zip(p.contacts.i.tolist(), p.contacts.j.tolist(), strict=True)) for p in (one, other)]
    assert pairs[0] == pairs[1]
    assert np.abs(one.position - other.position).max() < 1e-11
    assert other.residual < 1e-17


def test_an_onset_that_is_not_found_again_is_uncertain_by_the_increment():
    scene = scene_of(HUNDRED, "double", 1e-3, 0.02)
    with path_of(scene) as path:
        path(1e-3)
        found = path_error(path, 0.0005, squared_gap(30.0), 1e-11)  # no pair coalesces there
    assert found == (0.0, pytest.approx(5e-4))


@pytest.fixture(scope="module")
def climbed():
    """A path and its onset, without the error of the path."""
    with path_of(scene_of(HUNDRED, "double", 5e-3, 0.02)) as path:
        yield path, find_onset(path, np.array([0.0, 5e-3, 1e-2, 1.5e-2, 2e-2]))


@dataclass(frozen=True)
class FailingSolver:
    """Whatever is asked for beside what a path knows fails."""

    failure: Exception

    def solve(self, load, below, beside, ahead):
        raise self.failure


@pytest.mark.parametrize(
    "failure",
    [NoEquilibriumError("no equilibrium was found"), LinAlgError("no convergence"), OnsetError("a pair was lost")],
    ids=lambda failure: type(failure).__name__,
)
def test_an_onset_is_kept_where_the_other_path_fails(climbed, failure):
    path, found = climbed
    alone = with_path_error(found, LoadPath(FailingSolver(failure), path.equilibria))
    assert alone.windows == found.windows
    assert alone.as_dict()["error_of_path"] is None


def test_the_other_path_has_an_error_that_is_part_of_the_onsets(climbed):
    path, found = climbed
    whole = with_path_error(found, path)
    assert 0 < whole.as_dict()["error_of_path"] <= whole.error
