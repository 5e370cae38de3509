"""What a scene asks for, and runs without end; test_scene.py has what else is refused before any of it is done."""

import pytest

from faultgouge.pywrap import Scene, SceneError
from faultgouge.pywrap.scenes.estimate import estimated, foreseen

SCENE = {
    "packing": {"disks": 30, "top": 6, "width": 6.5, "seed": 3},
    "law": {"kn": 2e5},
    "load": {"fy": 3.0},
    "ramp": {"step": 1e-3, "until": 0.01},
    "perturb": {"fx": 2e-3, "time": 1.0},
}


def with_key(section, key, value):
    return SCENE | {section: SCENE[section] | {key: value}}


@pytest.mark.parametrize(
    ("key", "value"), [("time", 2.0**63), ("time_step", 1e-30), ("inertia_factor", 1e-50), ("time", 1e13)]
)
def test_runs_without_end_are_refused(key, value):
    scene = Scene.from_mapping(with_key("perturb", key, value))
    with pytest.raises(SceneError, match="the scene asks perturb for a year and more"):
        foreseen(scene, "perturb")
    assert foreseen(scene, "settle") == ""


def test_a_reproduction_counts_what_it_runs():
    scene = Scene.from_mapping(SCENE)
    one, onset = estimated(scene, "reproduce"), estimated(scene, "onset")
    assert one.increments == onset.increments
    assert one.steps > onset.steps + 1e5
    assert foreseen(scene, "reproduce", 1000).startswith("reproduce, 1000 packings: about ")
    with pytest.raises(SceneError, match="the scene asks reproduce for a year and more"):
        foreseen(scene, "reproduce", 10**9)


@pytest.mark.parametrize(
    ("disks", "fy", "step", "until", "cn", "measured"),
    [
        (100, 3.0, 1e-3, 0.12, None, 29.0),
        (100, 74.7, 1.0, 26.0, None, 137.0),
        (100, 74.7, 1.0, 26.0, 50.0, 431.0),
        (100, 3.0, 1e-3, 0.06, 1.0, 20.0),
        (400, 3.0, 1e-3, 0.1, 1.0, 15.0),
        (1000, 3.0, 2e-3, 0.1, None, 8.0),
        (1000, 3.0, 2e-3, 0.1, 1.0, 32.0),
        (3000, 3.0, 5e-4, 0.02, 1.0, 124.0),
        (10_000, 3.0, 2e-4, 0.02, None, 275.0),
        (10_000, 3.0, 2e-4, 0.02, 1.0, 1680.0),
        (30_000, 3.0, 6.7e-5, 0.002, None, 3198.0),
    ],
)
def test_time_of_a_search(disks, fy, step, until, cn, measured):
    """Against processor time (docs/benchmarks.md, seed 11 and quartz), within a factor of three, settling apart."""
    packing = {"disks": disks, "width": 1.192 * disks**0.5, "seed": 1}
    scene = {"packing": packing, "law": {"kn": 2e5}, "load": {"fy": fy}, "ramp": {"step": step, "until": until}}
    scene |= {} if cn is None else {"damping": {"cn": cn}}
    search, settling = (estimated(Scene.from_mapping(scene), command).seconds for command in ("onset", "settle"))
    assert measured / 3 < search - settling < 3 * measured


@pytest.mark.parametrize(("disks", "measured"), [(3000, 1.7e9), (10_000, 0.9e9), (30_000, 1.7e9), (100_000, 5.2e9)])
def test_memory_of_a_search_in_slices(disks, measured):
    """Against peaks of the whole process in two threads (docs/benchmarks.md), within a factor of two."""
    scene = SCENE | {"packing": {"disks": disks, "width": 1.2 * disks**0.5, "seed": 3}}
    memory = estimated(Scene.from_mapping(scene), "onset").memory
    assert measured / 2 < memory < 2 * measured
