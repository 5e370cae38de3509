"""explain: what it says is what LAMMPS holds, and what is left out leaves the motion to the bit."""

import json
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from mpi4py import MPI
from reference_layer import SMALL

from faultgouge.assessment.explain import UndampedRun, affordable, explain, features, run_of
from faultgouge.pywrap import Scene, settle

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
    "trajectory": {"positions at each sample in run.h5"},
    "MPI": set(),
    "threads": set(),
}


def test_what_is_in_and_what_each_part_brings():
    smooth = Scene.from_toml(SCENES / "frictionless.toml").resolved() | {"output": {"dumps": True, "trajectory": True}}
    pulse = {"fx": 0.0, "time": 1.0, "signal": "pulse", "amplitude": 1e-9, "omega": 3.0}
    paper, frictionless = (
        explain(scene)
        for scene in (Scene.from_toml(SCENES / "paper.toml"), Scene.from_mapping(smooth | {"perturb": pulse}))
    )
    inside = [{part.name for part in each.parts if part.included} for each in (paper, frictionless)]
    always = {"floor", "periodicity"}
    assert inside[0] == always | {"tangential history", "dynamic friction", "perturbation"}
    assert inside[1] == always | {"signal", "dumps", "per-contact output", "trajectory"}
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
    said = "\n".join(paper.in_words())
    assert said.startswith("In: floor, tangential history, periodicity, dynamic friction and perturbation. Out: dashp")
    for words in (
        "deck parts: system.in, friction.in, undamped.in, push.in, weaken.in\n",
        "tau in [damping]",
        "fix drive",
    ):
        assert words in said


def test_of_a_large_packing_a_strip_is_explained():
    push = {"fx": 0.0, "time": 1.0, "amplitude": 1e-9, "omega": 1.0, "target": [2999]}
    large = {"packing": {"disks": 3000, "top": 62, "width": 65.3}, "perturb": push}
    scene = Scene.from_mapping(SMALL | large)
    strip, remark = affordable(scene)
    assert "a strip of 400 of the 3000 disks" in remark
    whole = scene.packing
    assert strip.packing.disks / strip.packing.width == pytest.approx(whole.disks / whole.width, rel=1e-9)
    assert strip.packing.top / strip.packing.width == pytest.approx(whole.top / whole.width, rel=0.05)
    assert strip.perturb.target == "top"
    small = Scene.from_toml(SCENES / "paper.toml")
    assert affordable(small)[0] == small


@pytest.fixture(scope="module")
def run():
    return UndampedRun(settle(Scene.from_toml(SCENES / "minimal.toml"), communicator=MPI.COMM_SELF).packing)


def test_what_is_left_out_leaves_the_motion_and_the_forces_to_the_bit(run, tmp_path):
    """Friction that could weaken and the output of contacts do not touch the motion; other features act on some disks,
    and the forces on the others are the same. Only the low parts of coordinates give other last digits."""
    for feature in features(run, tmp_path / "contacts"):
        with (
            feature.without.start(MPI.COMM_SELF) as (one, plain),
            feature.with_it.start(MPI.COMM_SELF) as (two, switched),
        ):
            same = one.net_force == two.net_force
            if feature.name in ("dynamic friction", "per-contact output"):
                motion, other = plain.advance(200), switched.advance(200)
                assert all(np.array_equal(getattr(motion, name), getattr(other, name)) for name in motion._fields)
        everyone = feature.name in ("tangential history", "dashpots", "drag", "dynamic friction", "per-contact output")
        assert same.all() or not everyone, feature.name
        assert same.mean() > 0.5 or feature.name == "compensated coordinates", feature.name


def test_a_driven_scene_has_its_spring(tmp_path):
    scene = Scene.from_toml(SCENES / "drive.toml")
    own = run_of(scene, settle(scene, communicator=MPI.COMM_SELF).packing)
    with own.start(MPI.COMM_SELF) as (_, dynamics):
        still = dynamics.advance(1).position
    np.testing.assert_allclose(still, own.packing.position, atol=1e-9)  # in small steps, from rest
    spring = {each.name: each for each in features(own, tmp_path)}["spring"]
    assert spring.reason == "stiffness 10.0"
    assert BROUGHT["spring"] <= set(own.contents(tmp_path / "log").everything)
    assert {each.name: each for each in features(replace(own, motion={}), tmp_path)}[
        "spring"
    ].reason == "no section [drive]"
