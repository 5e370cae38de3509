"""What tests of commands share."""

import pytest
from reference_layer import LAYER, toml

BEYOND_ITS_ONSET = {
    "ramp": {"step": 6e-3, "until": 0.024},
    "perturb": {"fx": 0.024, "time": 1.0},
    "output": {"dumps": True, "trajectory": True},
}
"""A ramp in four steps through the onset, 0.0218, and an undamped run from its end."""


@pytest.fixture(scope="session")
def beyond(tmp_path_factory, faultgouge_here_in):
    """A folder with ramp.h5 beyond the onset and its dumps, and perturb.h5, the undamped run with its trajectory."""
    made = tmp_path_factory.mktemp("beyond")
    (made / "scene.toml").write_text(LAYER + toml(BEYOND_ITS_ONSET))
    for command, result in (("ramp", "F_x = 0.024 reached"), ("perturb", "F_x = 0.024, mu = 1: D = ")):
        assert faultgouge_here_in(made, command, "scene.toml", "-o", f"{command}.h5").stdout.startswith(result)
    return made
