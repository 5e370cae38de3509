"""A layer that is loaded, unloaded and loaded again, for what is drawn along a path of loads."""

import pytest
from reference_layer import SMALL

TURN = 8
"""The equilibrium at which `there_and_back` turns for the first time, with two complex pairs."""


@pytest.fixture(scope="session")
def there_and_back():
    """Equilibria of a small layer up through its onset, down to zero, and up again."""
    from faultgouge.pywrap import Scene, ramp

    changed = {"packing": SMALL["packing"] | {"seed": 2}, "ramp": {"step": 0.02, "until": [0.16, 0.0, 0.16]}}
    return [each.packing for each in ramp(Scene.from_mapping(SMALL | changed))]
