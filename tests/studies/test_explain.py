"""explain: what it says is what LAMMPS holds, and what is left out leaves the motion to the bit."""

import json
from importlib.resources import files

import numpy as np
import pytest
from mpi4py import MPI
from reference_layer import SMALL

from faultgouge.assessment.explain import affordable, contents, everything, explain, features, in_words, run_of, set_up
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
    "dumps": {
        "part write.in",
        "part write_friction.in",
        "file run.1.contacts",
        "file run.1.disks",
        "file run.1.params",
    },
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
    inside = [{part["name"] for part in each["parts"] if part["included"]} for each in (paper, frictionless)]
    always = {"floor", "periodicity"}
    assert inside[0] == always | {"tangential history", "dynamic friction", "perturbation"}
    assert inside[1] == always | {"signal", "dumps", "per-contact output", "trajectory"}
    low, files = BROUGHT["compensated coordinates"], BROUGHT["dumps"]
    plain = files - {"part write_friction.in"} | {"part write_plain.in"}
    for found, fine, dumps in ((paper, low | {"array f_slips (25 columns)"}, files), (frictionless, low, plain)):
        brings = {part["name"]: {each for each in part["adds"] if "rotations" not in each} for part in found["parts"]}
        assert brings == BROUGHT | {"compensated coordinates": fine, "dumps": dumps}
    for name in ("tangential history", "dynamic friction", "dashpots", "drag", "perturbation"):
        assert BROUGHT[name].isdisjoint(everything(frictionless["loaded"])), name
    assert frictionless["loaded"]["parts"] == ("system.in", "undamped.in", "signal.in")
    assert (paper["defaults"]["friction.B"], paper["defaults"]["packing.periodic"]) == (0.2, True)
    assert not any(key == "packing.seed" or key.startswith("relax") for key in paper["defaults"])
    assert json.loads(json.dumps(paper))["loaded"]["fixes"] == list(paper["loaded"]["fixes"])
    said = "\n".join(in_words(paper))
    assert said.startswith("In: floor, tangential history, periodicity, dynamic friction and perturbation. Out: dashp")
    parts = "deck parts: system.in, friction.in, undamped.in, push.in, weaken.in\n"
    assert all(words in said for words in (parts, "tau in [damping]", "fix drive"))


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


def test_what_is_left_out_leaves_the_motion_and_the_forces_to_the_bit():
    """Friction that could weaken and the output of contacts do not touch the motion; other features act on some disks,
    and the forces on the others are the same. Only the low parts of coordinates give other last digits."""
    packing = settle(Scene.from_toml(SCENES / "minimal.toml"), communicator=MPI.COMM_SELF).packing
    quiet = ("dynamic friction", "dumps", "per-contact output")
    for name, _, without, with_it in features((packing, {})):
        with set_up(without[0], **without[1]) as (one, plain), set_up(with_it[0], **with_it[1]) as (two, switched):
            same = one.net_force == two.net_force
            if name in quiet:
                motion, other = plain.advance(200), switched.advance(200)
                assert all(np.array_equal(getattr(motion, name), getattr(other, name)) for name in motion._fields)
        assert same.all() or name not in ("tangential history", "dashpots", "drag", *quiet), name
        assert same.mean() > 0.5 or name == "compensated coordinates", name


def test_a_driven_scene_has_its_spring(tmp_path):
    scene = Scene.from_toml(SCENES / "drive.toml")
    packing, motion = run_of(scene, settle(scene, communicator=MPI.COMM_SELF).packing)
    with set_up(packing, tmp_path / "log", **motion) as (engine, dynamics):
        still = dynamics.advance(1).position
        assert BROUGHT["spring"] <= set(everything(contents(engine, tmp_path / "log")))
    np.testing.assert_allclose(still, packing.position, atol=1e-9)  # in small steps, from rest
    for own, why in ((motion, "stiffness 10.0"), ({}, "no section [drive]")):
        assert {name: reason for name, reason, *_ in features((packing, own))}["spring"] == why
