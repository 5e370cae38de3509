"""explain: what it says is what LAMMPS holds, and what is left out leaves the motion to the bit."""

import json
from importlib.resources import files

import numpy as np
import pytest
from mpi4py import MPI
from reference_layer import SMALL

from benchmarks.parts import features as pairs_of
from benchmarks.parts import set_up
from faultgouge.assessment.explain import affordable, contents, everything, explain, features, in_words
from faultgouge.pywrap import Scene, settle

SCENES = files("faultgouge") / "scenes"


def kinds(held):
    """What an instance holds, but for the numbers of columns."""
    return {each.partition(" (")[0] for each in everything(held)}


def test_what_is_in_and_what_is_out():
    smooth = Scene.from_toml(SCENES / "frictionless.toml").resolved() | {"output": {"dumps": True, "trajectory": True}}
    pulse = {"fx": 0.0, "time": 1.0, "signal": "pulse", "amplitude": 1e-9, "omega": 3.0}
    paper, drawn = (explain(Scene.from_toml(SCENES / f"{name}.toml")) for name in ("paper", "drive"))
    frictionless = explain(Scene.from_mapping(smooth | {"perturb": pulse}))
    always, inside = {"floor", "periodicity"}, {"dynamic friction", "perturbation"}
    for found, more in (
        (paper, {"tangential history"} | inside),
        (frictionless, {"signal", "dumps", "trajectory"}),
        (drawn, {"tangential history", "dashpots", "spring"}),
    ):
        assert {part["name"] for part in found["parts"] if part["included"]} == always | more
    for part in frictionless["parts"]:
        if part["name"] in {"tangential history", "dashpots", "drag"} | inside:
            assert kinds(frictionless["loaded"]).isdisjoint(part["adds"]), part
    assert frictionless["loaded"]["parts"] == ("system.in", "undamped.in", "signal.in")
    assert (paper["defaults"]["friction.B"], paper["defaults"]["packing.periodic"]) == (0.2, True)
    assert not any(key == "packing.seed" or key.startswith("relax") for key in paper["defaults"])
    assert json.loads(json.dumps(paper))["loaded"]["fixes"] == list(paper["loaded"]["fixes"])
    said = "\n".join(in_words(paper))
    assert said.startswith("In: floor, tangential history, periodicity, dynamic friction, perturbation. Out: dashp")
    parts = "deck parts: system.in, friction.in, undamped.in, push.in, weaken.in\n"
    assert all(words in said for words in (parts, "tau in [damping]", "fix drive"))


def test_of_a_large_packing_a_strip_is_explained():
    push = {"fx": 0.0, "time": 1.0, "amplitude": 1e-9, "omega": 1.0, "target": [2999]}
    scene = Scene.from_mapping(SMALL | {"packing": {"disks": 3000, "top": 62, "width": 65.3}, "perturb": push})
    strip, remark = affordable(scene)
    assert "a strip of 400 of the 3000 disks" in remark
    assert strip.packing.disks / strip.packing.width == pytest.approx(3000 / 65.3, rel=1e-9)
    assert strip.packing.top / strip.packing.width == pytest.approx(62 / 65.3, rel=0.05)
    assert strip.perturb.target == "top"


def test_each_feature_brings_what_is_said_and_leaves_the_rest_to_the_bit(tmp_path):
    """Friction that could weaken and the output of contacts do not touch the motion; other features act on some disks,
    and the forces on the others are the same. Only the low parts of coordinates give other last digits."""
    packing = settle(Scene.from_toml(SCENES / "minimal.toml"), communicator=MPI.COMM_SELF).packing
    brings = {name: set(words) for name, (_, *words) in features(packing, {}).items()}
    quiet, seen = ("dynamic friction", "dumps", "per-contact output"), set()
    for name, without, with_it in pairs_of(packing, {}):
        logs = tmp_path / "without", tmp_path / "with"
        with (
            set_up(without[0], logs[0], **without[1]) as (one, plain),
            set_up(with_it[0], logs[1], **with_it[1]) as (two, switched),
        ):
            before, after = (kinds(contents(*each)) for each in ((one, logs[0]), (two, logs[1])))
            if name in brings:
                seen.add(name)
                assert after - before == brings[name], name
            same = one.gather("f", 3)[:, :2] == two.gather("f", 3)[:, :2]
            if name in quiet:
                motion, other = plain.advance(200), switched.advance(200)
                assert all(np.array_equal(getattr(motion, name), getattr(other, name)) for name in motion._fields)
        assert same.all() or name not in ("tangential history", "dashpots", "drag", *quiet), name
        assert same.mean() > 0.5 or name == "compensated coordinates", name
    assert seen == set(brings)
