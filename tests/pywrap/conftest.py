"""Scenes that are refused, and the reference packing under load."""

import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import pytest

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
def climbed(reference_packing) -> Callable[..., list]:
    """Equilibria of the reference packing under F_x = increment, 2 increments, ..., for a friction coefficient."""
    from faultgouge.assessment.extremes.packings import at_rest
    from faultgouge.pywrap import Engine, equilibrate

    @cache
    def make(fx: float, increment: float = 1e-3, mu: float = 1.0) -> list:
        path = [at_rest(reference_packing(mu))]
        with Engine(path[0].packing) as engine:
            for k in range(1, round(fx / increment) + 1):
                path.append(equilibrate(engine, path[-1], k * increment))
        return path[1:]

    return make
