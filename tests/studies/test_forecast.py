"""What linear theory says of a packing whose friction has weakened, against LAMMPS, and the shipped choice by it."""

from dataclasses import replace
from importlib.resources import files
from itertools import takewhile

import pytest
from reference_layer import REFERENCE, SMALL

from faultgouge.pywrap import Scene, perturb, reach
from faultgouge.studies.triggering.forecast import JUMP_SHARE, chosen, forecast

SCENE = SMALL | {"packing": {"file": str(REFERENCE)}, "ramp": {"step": 1e-3, "until": 0.004}}


@pytest.mark.slow
def test_the_jump_is_that_of_a_run_in_lammps():
    """Weak friction from the first step on, and a load so small that disks move by far less than they overlap."""
    scene = Scene.from_mapping(SCENE | {"perturb": {"fx": 0.002, "time": 40.0}})
    *_, start = reach(scene, 0.002)
    foreseen = forecast(start, 0.8, 40.0)
    weak = replace(start, packing=replace(start.packing, law=replace(start.packing.law, mu=0.8)))
    samples = takewhile(lambda sample: sample.time <= JUMP_SHARE * 40.0, perturb(scene, weak))
    assert max(sample.msd for sample in samples) == pytest.approx(foreseen.jump, rel=0.01)
    assert foreseen.rate == 0.0
    assert foreseen.growth < 0.2


@pytest.mark.slow
def test_the_shipped_packing_is_the_one_of_the_rule():
    """`python docs/triggered.py` begins with seed 1."""
    scene = Scene.from_toml(files("faultgouge") / "scenes/triggered.toml")
    (last,) = chosen(scene, [37, 38])
    assert (last["seed"], last["fx"], last["says"]) == (scene.packing.seed, scene.perturb.fx, "")
    assert last["forecast"]["growth"] > 4
