"""Scenes that are refused, and the reference packing under load."""

import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import pytest

from faultgouge.analysis import Packing

sys.path.insert(0, str(Path(__file__).parent / "granular"))  # granular_packings


@pytest.fixture(scope="session")
def refused_scene() -> Callable[..., str]:
    """Makes a scene that is refused in one sentence, and gives the sentence."""
    from faultgouge.pywrap import Scene, SceneError

    def make(mapping: Mapping, folder: Path = Path()) -> str:
        with pytest.raises(SceneError) as refusal:
            Scene.from_mapping(mapping, folder)
        sentence = str(refusal.value)
        assert sentence.endswith(".")
        assert "\n" not in sentence
        assert "pydantic" not in sentence
        return sentence

    return make


@pytest.fixture(scope="session")
def loaded(reference_packing) -> Callable[..., Packing]:
    """The reference packing in equilibrium under F_x, reached in increments of the size that is given, for mu = 1."""
    from faultgouge.assessment.extremes.packings import at_rest
    from faultgouge.pywrap import Engine, equilibrate

    @cache
    def make(fx: float, increment: float = 1e-3) -> Packing:
        here = at_rest(reference_packing(1.0))
        with Engine(here.packing) as engine:
            for k in range(1, round(fx / increment) + 1):
                here = equilibrate(engine, here, k * increment)
        return here.packing

    return make
