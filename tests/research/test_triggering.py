"""The packing of scenes/triggered.toml."""

import pytest

from faultgouge.pywrap import Scene
from research.triggering.make import SCENE, choose_seed


@pytest.mark.long
def test_the_shipped_packing_is_the_one_of_the_rule():
    """`python -m research.triggering.make` begins with seed 1."""
    scene = Scene.from_toml(SCENE)
    (last,) = choose_seed(scene, [37, 38])
    assert (last["seed"], last["fx"], last["says"]) == (scene.packing.seed, scene.perturb.fx, "")
    assert last["forecast"]["growth"] > 4
