"""Section [output]: what is written only when it is asked for."""

import numpy as np
import pytest
from reference_layer import LAYER

from faultgouge.analysis import RunFile, mean_square_displacement, read_dump

SCENE = f"""{LAYER}
[ramp]
step = 1e-3
until = 2e-3
[perturb]
fx = 1e-3
time = 0.2
amplitude = 1e-6
omega = 1.0
"""


@pytest.fixture
def written_by(faultgouge, tmp_path):
    """What a command leaves in the folder, with a section [output]."""

    def run(command, output):
        (tmp_path / "scene.toml").write_text(SCENE + output)
        faultgouge(command, "scene.toml")
        return sorted(path.name for path in tmp_path.iterdir())

    return run


@pytest.mark.slow
def test_nothing_but_the_result_without_output(written_by, tmp_path):
    assert written_by("ramp", "") == ["run.h5", "scene.toml"]
    assert written_by("perturb", "") == ["perturb.h5", "run.h5", "scene.toml"]
    with RunFile(tmp_path / "perturb.h5") as file, pytest.raises(ValueError, match="no series trajectory"):
        file.series("trajectory")


@pytest.mark.slow
def test_dumps_hold_the_equilibria(written_by, tmp_path):
    written = written_by("ramp", "[output]\ndumps = true\n")
    assert {f"run.{k}.{kind}" for k in (1, 2) for kind in ("disks", "contacts", "params")} <= set(written)
    with RunFile(tmp_path / "run.h5") as file:
        for k in (1, 2):
            stored, dumped = file.packing(k), read_dump(tmp_path / f"run.{k}.disks")
            assert np.array_equal(dumped.position, stored.position)
            assert np.array_equal(dumped.contacts.slip, stored.contacts.slip)
            assert dumped.fx == stored.fx


@pytest.mark.slow
def test_trajectory_is_that_of_the_displacements(written_by, tmp_path):
    written_by("perturb", "[output]\ntrajectory = true\n")
    with RunFile(tmp_path / "perturb.h5") as file:
        path, series, start = file.series("trajectory"), file.series("undamped"), file.packing()
    assert np.array_equal(path["time"], series["time"])
    assert np.array_equal(mean_square_displacement(path["position"], start.position, start.box_length), series["msd"])
