"""What triggers on a small scale: the commands trigger and eruptions, also cut off, and the forecast of a jump."""

import json
from dataclasses import replace
from importlib import import_module
from itertools import takewhile

import numpy as np
import pytest
from reference_layer import REFERENCE, SMALL, toml

from faultgouge.analysis.files.atomic_write import FORMAT, FORMAT_KEY
from faultgouge.pywrap import Scene, SceneError, perturb, reach, settle
from faultgouge.studies.eruptions import erupt, eruptions
from faultgouge.studies.trigger import bisect_amplitude, predictions, trigger
from faultgouge.studies.triggering import JUMP_SHARE, forecast

BASE = SMALL | {"packing": {"file": str(REFERENCE)}, "ramp": {"step": 1e-3, "until": 0.025}}
WAVES = {"omega": [1.0, 14.0], "time": 4.0, "runs": 2}
WEAKENS = {"v0": 1e-7, "v_ss": "10 v0"}


def after_a_kill(study, scene, folder, result):
    """A study that is cut off before its last result, and goes on: the whole again, to the bit."""
    lines = (folder / f"{study.name}.jsonl").read_text().splitlines(keepends=True)
    cut = folder / "cut"
    cut.mkdir()
    (cut / f"{study.name}.jsonl").write_text("".join(lines[:-1]))
    assert study(scene, cut, say=id) == result
    return len(lines)


@pytest.mark.long
@pytest.mark.parametrize(
    ("damping", "fx_c", "distances"), [({}, 0.021833056408, [0.1, 1e-3]), ({"cn": 1.0}, 0.0218328368, [0.1])]
)
def test_prediction_is_what_lammps_bisects(tmp_path, damping, fx_c, distances):
    """Distances count from the onset, which normal dashpots alone lower; the wave is damped in K's answer, too."""
    sections = BASE | {"friction": WEAKENS, "trigger": WAVES | {"distance": distances}}
    scene, out = Scene.from_mapping(sections | ({"damping": damping} if damping else {})), tmp_path / "out"
    result = trigger(scene, out, say=id)
    assert result["fx_c"] == pytest.approx(fx_c, abs=1e-10)
    runs = [row for row in result["map"] if row["measured"] is not None]
    assert (len(result["map"]), len(runs)) == (2 * len(distances), 2)
    for row in runs:
        assert row["fx"] == pytest.approx((1 - row["distance"]) * result["fx_c"], rel=1e-12)
        assert row["below"] < row["measured"] < row["above"] < 1.011 * row["below"]
        assert row["predicted"] == pytest.approx(row["measured"], rel=0.05)
    lines = (out / "trigger.jsonl").read_text()
    assert trigger(scene, out, say=id) == result
    assert (out / "trigger.jsonl").read_text() == lines  # nothing was computed again
    after_a_kill(trigger, scene, out, result)
    page = " ".join((out / "trigger.md").read_text().split())
    assert ("the onset with the dashpots and the drag" in page) is bool(damping)
    assert (out / "thresholds.png").stat().st_size > 10_000


@pytest.mark.ranks
@pytest.mark.long
def test_a_map_is_the_same_on_two_ranks(faultgouge, tmp_path):
    more = {"friction": WEAKENS, "packing": SMALL["packing"] | {"seed": 2}, "trigger": WAVES | {"distance": [0.1]}}
    (tmp_path / "scene.toml").write_text(toml(SMALL | more))
    one = trigger(Scene.from_mapping(SMALL | more), tmp_path / "one", say=id)
    done = faultgouge("trigger", "scene.toml", "-o", "two", "--json", ranks=2)
    assert json.loads(done.stdout) == {FORMAT_KEY: FORMAT, **one}


def test_a_threshold_is_asked_for_before_work(tmp_path):
    for friction, says in (({}, r"no section \[friction\]"), ({"friction": {"v_ss": 1e-6}}, "give a velocity above 0")):
        with pytest.raises(SceneError, match=says):
            trigger(Scene.from_mapping(SMALL | friction), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_threshold_below_rounding_noise_gives_no_amplitude():
    """Bisected down to the noise, it was given as the wave that triggers: 3.6e-19 where linear theory had 2.3e-15."""
    scene = Scene.from_mapping(SMALL | {"friction": {"v0": 1e-16, "v_ss": "10 v0"}, "trigger": {"time": 1.0}})
    packing = settle(scene).packing
    (expected,) = predictions(scene, packing, 0.1, np.array([14.0]))
    with pytest.raises(SceneError, match="exceeds v_0 = 1e-16 without a wave"):
        bisect_amplitude((scene, packing, expected))


@pytest.mark.long
@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), (2.0**-20, 2.0**-10, 2.0**-14)])
def test_a_stable_packing_is_watched_for_a_time_of_its_own_units(units, friction, monkeypatch):
    """And if D rises all the same, as after settling with friction, that is said, and it is not called stable."""
    length, force, mass = units
    packing = {"disks": 20, "top": 4, "width": 4.9 * length, "radii": [0.5 * length, 0.7 * length], "mass": mass}
    law, load = {"kn": 2e5 * force / length**1.5, "mu": 0.5}, {"fy": 3.0 * force}
    scene = {"packing": packing | {"settle_friction": friction}, "law": law, "load": load}
    start, unit = settle(Scene.from_mapping(scene)), (mass * length / force) ** 0.5
    if friction:
        monkeypatch.setattr(import_module("faultgouge.studies.eruptions"), "growth_rate", lambda packing: 0.0)
    run = erupt((start.packing, start.residual, 200.0 * unit))
    assert run["ends"] == ("rises" if friction else "stable")
    assert 50 <= run["time"] / unit < 52  # looked at 400 times in 200


@pytest.mark.long
def test_eruptions_that_were_cut_off_are_those_of_one_run(tmp_path):
    """Though the loads that are known are not run again."""
    small = {"packing": {"disks": 30, "seed": 4}, "ramp": {"step": 0.02, "until": 0.3}}
    scene = Scene.from_mapping({**BASE, **small, "eruptions": {"load": [0.05, 0.25], "time": 10.0}})
    assert after_a_kill(eruptions, scene, tmp_path, eruptions(scene, tmp_path, say=id)) == 2


@pytest.mark.ranks
@pytest.mark.long
def test_eruptions_grow_out_of_noise_and_are_the_same_on_two_ranks(faultgouge, tmp_path):
    """Above the onset, 0.0218, D grows, but not to its end in the time that is given; with strong drag nothing does."""
    sections = BASE | {"eruptions": {"load": [0.024], "time": 60.0}, "damping": {"tau": 0.5}}
    (tmp_path / "scene.toml").write_text(toml(sections))
    one = eruptions(Scene.from_mapping(sections), tmp_path / "one", say=id)
    free, dragged = one["runs"]
    assert (free["damped"], free["ends"]) == (False, "cut off")
    assert (dragged["damped"], dragged["ends"], dragged["rate"]) == (True, "stable", 0.0)
    assert free["rate"] > 0
    assert free["balance"] < 1e-2
    assert "| 0.024 | 0.0361 | 0 |" in (tmp_path / "one/eruptions.md").read_text()
    # rounding alone: 1e-25 after a hundred time units
    assert all(run["noise"] < 1e-25 for run in one["runs"])
    done = faultgouge("eruptions", "scene.toml", "-o", "two", "--json", ranks=2)
    stored = json.loads((tmp_path / "two/eruptions.json").read_text())
    assert json.loads(done.stdout) == stored == {FORMAT_KEY: FORMAT, **one}


@pytest.mark.slow
def test_the_jump_is_that_of_a_run_in_lammps():
    """Weak friction from the first step on, and a load so small that disks move by far less than they overlap."""
    more = {"ramp": {"step": 1e-3, "until": 0.004}, "perturb": {"fx": 0.002, "time": 40.0}}
    scene = Scene.from_mapping(BASE | more)
    *_, start = reach(scene, 0.002)
    foreseen = forecast(start, 0.8, 40.0)
    weak = replace(start, packing=replace(start.packing, law=replace(start.packing.law, mu=0.8)))
    samples = takewhile(lambda sample: sample.time <= JUMP_SHARE * 40.0, perturb(scene, weak))
    assert max(sample.msd for sample in samples) == pytest.approx(foreseen.jump, rel=0.01)
    assert foreseen.rate == 0.0
    assert foreseen.growth < 0.2
