"""What tests of pictures share."""

import pytest
from reference_layer import BEYOND_ITS_ONSET


@pytest.fixture(scope="session")
def beyond(tmp_path_factory, faultgouge_in):
    """A folder with ramp.h5 beyond the onset 0.0218, and perturb.h5, an undamped run from its end with trajectory."""
    made = tmp_path_factory.mktemp("beyond")
    (made / "scene.toml").write_text(BEYOND_ITS_ONSET + "[output]\ntrajectory = true\n")
    for command in ("ramp", "perturb"):
        faultgouge_in(made, command, "scene.toml", "-o", f"{command}.h5")
    return made
