"""The error of an onset, path and rounding together, covers the onset that the exact path has."""

from contextlib import contextmanager
from functools import partial
from importlib.resources import files
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import LinAlgError

from faultgouge.analysis import NoEquilibriumError, OnsetError, find_onset
from faultgouge.pywrap import Engine, LoadPath, Scene, scene_path, settle
from faultgouge.pywrap.onset import onset_run
from faultgouge.pywrap.runs.path_error import path_error, squared_gap, with_path_error
from faultgouge.studies.onset import onset
from faultgouge.studies.packing_tools import contact_pairs

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


def whole(mu, below, precision, increment):
    """The onset of the paper's packing by equilibria so far apart, alone and with the path's error, of which the
    search of all increments takes most of the time: it lies up to 2e-3 beyond the load below it."""
    scene, last = scene_of(PAPER, precision, increment, 0.1), round((below + 2e-3) / increment)
    with path_of(scene, mu) as path:
        for k in range(1, last + 1):
            path(k * increment)
        found = find_onset(path, increment * np.arange(round(below / increment), last + 1))
        return found, with_path_error(found, path)


@pytest.mark.long
@pytest.mark.parametrize(("mu", "below"), [(1.0, 0.020), (0.8, 0.018)])
def test_stated_intervals_contain_the_extrapolated_onset(mu, below):
    finest = whole(mu, below, "compensated", 1.25e-4)[1]
    assert finest.error < 1e-9
    for precision in ("double", "compensated"):
        for increment in (2e-3, 1e-3, 5e-4, 2.5e-4):
            found = whole(mu, below, precision, increment)[1]
            assert abs(found.fx_c - finest.fx_c) <= found.error + finest.error, (precision, increment)
            assert found.error < 1e-7


def test_the_correction_takes_most_of_the_path_away():
    alone, corrected = whole(1.0, 0.020, "compensated", 2e-3)
    finer = whole(1.0, 0.020, "compensated", 1e-3)[1]
    assert abs(corrected.fx_c - finer.fx_c) < 0.2 * abs(alone.fx_c - finer.fx_c) < 1e-11


SLIDES = {"packing": {"seed": 11}, "law": {"kn": 2e5, "mu": 0.2}}
DAMPED = {"packing": {"disks": 30, "seed": 4}, "damping": {"cn": 0.5, "ct": 0.2}}


@pytest.mark.long
@pytest.mark.parametrize(
    ("sections", "fine", "coarse", "until"), [(SLIDES, 2.5e-4, 5e-4, 3e-3), (DAMPED, 5e-4, 1e-3, 0.012)]
)
def test_onsets_state_the_whole_error(sections, fine, coarse, until):
    """Also where a contact reaches the Coulomb bound before the onset, so that the error is bounded, not extrapolated,
    and with dissipation, beside whose onset stands the undamped one."""
    found = []
    for precision, increment in (("compensated", fine), ("double", 2 * coarse), ("double", coarse)):
        scene = scene_of(HUNDRED | sections, precision, increment, until)
        run = onset_run(scene, scene.law.mus[0], dissipation=scene.damping is not None)
        found.append([(each.fx_c, each.error) for each in (run, run.undamped) if each is not None])
    truth, *others = found
    assert all(covers(*pair) for onsets in others for pair in zip(onsets, truth, strict=True))


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
    assert contact_pairs(one) == contact_pairs(other)
    assert np.abs(one.position - other.position).max() < 1e-11
    assert other.residual < 1e-17


@pytest.fixture(scope="module")
def climbed():
    """A path and its onset, without the error of the path."""
    with path_of(scene_of(HUNDRED, "double", 5e-3, 0.02)) as path:
        yield path, find_onset(path, np.array([0.0, 5e-3, 1e-2, 1.5e-2, 2e-2]))


def test_an_onset_that_is_not_found_again_is_uncertain_by_the_increment(climbed):
    found = path_error(climbed[0], 0.0025, squared_gap(30.0), 1e-11)  # no pair coalesces there
    assert found == (0.0, pytest.approx(2.5e-3))


def test_the_other_path_has_an_error_that_is_part_of_the_onsets(climbed):
    path, found = climbed
    whole = with_path_error(found, path)
    assert 0 < whole.as_dict()["error_of_path"] <= whole.error


@pytest.mark.parametrize("failure", [NoEquilibriumError, LinAlgError, OnsetError])
def test_an_onset_is_kept_where_the_other_path_fails(climbed, failure):
    def solve(load, below, beside, ahead):
        raise failure("no other path")

    path, found = climbed
    alone = with_path_error(found, LoadPath(SimpleNamespace(solve=solve), path.equilibria))
    assert alone.windows == found.windows
    assert alone.as_dict()["error_of_path"] is None
