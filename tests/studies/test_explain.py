"""explain: what it says is what LAMMPS holds, what it measures is measured, and a wrong claim is found out."""

import json
from dataclasses import replace
from importlib.resources import files
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from reference_layer import SMALL

from faultgouge.assessment.explain.cost_comparison import Cost, Part
from faultgouge.assessment.explain.explain import _affordable, _run_feature, _run_of, explain
from faultgouge.assessment.explain.explanation_table import in_words, units_in_words
from faultgouge.assessment.explain.switches import Feature, InstanceContents, UndampedRun, features
from faultgouge.pywrap import Scene, settle
from faultgouge.pywrap.scenes.units import real_units

SCENES = files("faultgouge") / "scenes"

BROUGHT = {
    "floor": {"fix floor", "array f_floor (7 columns)"},
    "tangential history": {
        "part friction.in",
        "fix angle",
        "fix slips",
        "array f_slips (17 columns)",
        "array d_theta",
        "velocities of ghosts",
    },
    "periodicity": {"periodic x"},
    "dynamic friction": {"part weaken.in", "fix weaken"},
    "dashpots": {"part dashpots.in", "fix dashpots", "array f_dashpots (6 columns)"},
    "drag": {"part drag.in"},
    "perturbation": {"part push.in", "fix push"},
    "signal": {"part signal.in", "fix force"},
    "spring": {"part spring.in", "fix drive"},
    "compensated coordinates": {"fix low", "array f_floor (8 columns)", "array f_low (5 columns)"},
    "dumps": {"part write.in", "file run.1.contacts", "file run.1.disks", "file run.1.params"},
    "per-contact output": {"compute contact", "dump contact"},
    "trajectory": {"dataset trajectory/position", "dataset trajectory/time"},
    "MPI": {"messages between ranks"},
    "threads": {"a second thread"},
}


@pytest.fixture(scope="module")
def paper():
    return explain(Scene.from_toml(SCENES / "paper.toml"), timed=True)


@pytest.fixture(scope="module")
def frictionless():
    mapping = Scene.from_toml(SCENES / "frictionless.toml").resolved()
    pulse = {"fx": 0.0, "time": 1.0, "signal": "pulse", "amplitude": 1e-9, "omega": 3.0}
    return explain(
        Scene.from_mapping(mapping | {"output": {"dumps": True, "trajectory": True}, "perturb": pulse}), timed=True
    )


def test_the_first_sentences_say_what_is_in_what_is_out_and_what_that_saves():
    def part(name, included, seconds):
        cost = None if seconds is None else Cost("step", np.array([[1.0, each] for each in seconds]))
        return Part(name, included, "", (), cost, "", True)

    parts = (
        part("floor", True, [1.1]),
        part("drag", False, [1.1, 1.3, 1.5]),
        part("signal", False, [0.9, 1.02, 1.1]),
        part("threads", False, None),
    )
    said = in_words(SimpleNamespace(parts=parts, timed=True))
    assert said == "In: floor. Out: drag, signal and threads. A step would take longer by 30 % for drag, one at a time."
    (alone,) = parts[:1]
    said = in_words(SimpleNamespace(parts=(alone,), timed=True))
    assert said == "In: floor. Out: nothing; that saves no time that can be measured."
    assert in_words(SimpleNamespace(parts=(alone,), timed=False)) == "In: floor. Out: nothing."


def included(explanation):
    return {part.name for part in explanation.parts if part.included}


@pytest.mark.long
def test_what_is_in_and_what_each_part_brings(paper, frictionless):
    always = {"floor", "periodicity"}
    assert included(paper) == always | {"tangential history", "dynamic friction", "perturbation"}
    assert included(frictionless) == always | {"signal", "dumps", "per-contact output", "trajectory"}
    low = BROUGHT["compensated coordinates"]
    for explanation, compensated in ((paper, low | {"array f_slips (25 columns)"}), (frictionless, low)):
        found = {part.name: {each for each in part.adds if "rotations" not in each} for part in explanation.parts}
        assert found == BROUGHT | {"compensated coordinates": compensated}
    for name in ("tangential history", "dynamic friction", "dashpots", "drag", "perturbation"):
        assert BROUGHT[name].isdisjoint(frictionless.loaded.everything), name
    assert frictionless.loaded.parts == ("system.in", "undamped.in", "signal.in")
    assert (paper.defaults["friction.B"], paper.defaults["packing.periodic"]) == (0.2, True)
    assert not any(key == "packing.seed" or key.startswith("relax") for key in paper.defaults)
    copy = json.loads(json.dumps(paper.as_dict()))
    assert copy["loaded"]["fixes"] == list(paper.loaded.fixes)
    assert [part["cost"]["ratio"] for part in copy["parts"]] == [part.cost.ratio[1] for part in paper.parts]


@pytest.mark.long
def test_what_both_compute_agrees_to_the_bit_and_has_its_cost(paper, frictionless):
    for part in (*paper.parts, *frictionless.parts):
        # another arithmetic, another order of sums
        assert part.identical is (part.name not in ("compensated coordinates", "threads")), part.name
        low, middle, high = part.cost.ratio
        assert 0 < low <= middle <= high, part.name
        assert part.cost.seconds.min() > 0
    # a history makes a step half as long again, or twice as long, on every machine
    costs = {part.name: part.cost.ratio[1] for part in paper.parts}
    assert costs["tangential history"] > 1.2
    # 1.05 to 1.2 in fixes of the plugin; 2.4 to 3.5 with LAMMPS's variables
    assert max(costs[name] for name in ("dynamic friction", "perturbation", "signal")) < 1.7


def test_of_a_large_packing_a_strip_is_explained():
    push = {"fx": 0.0, "time": 1.0, "amplitude": 1e-9, "omega": 1.0, "target": [2999]}
    large = {"packing": {"disks": 3000, "top": 62, "width": 65.3}, "perturb": push}
    scene = Scene.from_mapping(SMALL | large)
    strip, remark = _affordable(scene)
    assert "a strip of 400 of the 3000 disks" in remark
    whole = scene.packing
    assert strip.packing.disks / strip.packing.width == pytest.approx(whole.disks / whole.width, rel=1e-9)
    assert strip.packing.top / strip.packing.width == pytest.approx(whole.top / whole.width, rel=0.05)
    assert strip.perturb.target == "top"
    small = Scene.from_toml(SCENES / "paper.toml")
    assert _affordable(small)[0] == small


@pytest.fixture(scope="module")
def run():
    return UndampedRun(settle(Scene.from_toml(SCENES / "minimal.toml"), communicator=MPI.COMM_SELF).packing)


def test_a_wrong_claim_is_found_out(run, tmp_path):
    """A push that is said to touch nobody, and one that is said to leave the motion."""
    pushed = replace(run, motion={"amplitude": 1.0, "omega": 1.0})
    with run.start(MPI.COMM_SELF, tmp_path / "log") as (engine, _):
        loaded = InstanceContents.of(engine, tmp_path / "log")
    top = np.flatnonzero(run.packing.top)
    for touched, moves in (((), True), (top, False)):
        part = _run_feature(Feature("push", "", run, pushed, touched, moves), loaded, 50, tmp_path, timed=False)
        assert part.identical is False
        assert not part.included
        assert part.cost is None
    honest = _run_feature(Feature("push", "", run, pushed, top), loaded, 50, tmp_path, timed=False)
    assert honest.identical is True


def test_spring_of_a_driven_scene_is_told_with_its_share(tmp_path):
    """Of a scene that draws the layer its own run has the spring; the cost is that of one fix beside the contacts."""
    scene = Scene.from_toml(SCENES / "drive.toml")
    own = _run_of(scene, settle(scene, communicator=MPI.COMM_SELF).packing)
    with own.start(MPI.COMM_SELF, tmp_path / "log") as (engine, dynamics):
        loaded = InstanceContents.of(engine, tmp_path / "log")
        still = dynamics.advance(1).position
    np.testing.assert_allclose(still, own.packing.position, atol=1e-9)  # in small steps, from rest
    spring = {feature.name: feature for feature in features(own)}["spring"]
    part = _run_feature(spring, loaded, 300, tmp_path, timed=True)
    assert part.included
    assert part.identical
    assert set(part.adds) == BROUGHT["spring"]
    assert part.reason == "stiffness 10.0"
    assert part.cost.ratio[1] < 1.5  # 1.04 to 1.05, of processor time
    other = {feature.name: feature for feature in features(replace(own, motion={}))}["spring"]
    assert other.reason == "no section [drive]"


def test_open_scene_has_no_period(run):
    side = {feature.name: feature for feature in features(run)}["periodicity"]
    again = {feature.name: feature for feature in features(side.without)}["periodicity"]
    assert side.reason == "x has the period 11.9"
    assert again.reason == "the sides are open"
    assert again.without.packing.box_length is None
    assert len(again.touched) == 0  # a period wide enough for all: no contact across it


@pytest.mark.long
def test_command_prints_a_table_with_times_on_request(faultgouge):
    timed = faultgouge("explain", "--time", SCENES / "minimal.toml")
    done = faultgouge("explain", SCENES / "minimal.toml")
    for name in BROUGHT:
        assert name in done.stdout
    for said in ("time with it : without it", "load average", "A step would take longer by"):
        assert said in timed.stdout
        assert said not in done.stdout
    assert "deck parts: system.in, friction.in, undamped.in\n" in done.stdout
    assert "not imported: matplotlib, MDAnalysis" in done.stdout
    assert "law.mu = 1.0" in done.stdout


def test_what_real_units_make_of_a_scene_is_told():
    scene = Scene.from_toml(SCENES / "quartz.toml", command="settle")
    units = {"kn": scene.law.kn, "fy": scene.load.fy} | real_units(scene).as_dict()
    said = units_in_words(units)
    assert said.startswith(
        "law.kn = 200000 (Hertz's contact of the grains) and load.fy = 74.7 (1e+07 Pa on the layer);"
    )
    assert "one unit of the scene is 0.0001 m, 1.388e-09 kg, 9.331e-06 s and 0.001594 N" in said
