"""Section [output]: what is written only when it is asked for."""

import numpy as np
import pytest
from reference_layer import LAYER, toml

from faultgouge.analysis import RunFile, mean_square_displacement, read_dump

PERTURB = {"fx": 1e-3, "time": 0.2, "amplitude": 1e-6, "omega": 1.0}
SCENE = LAYER + toml({"ramp": {"step": 1e-3, "until": 2e-3}, "perturb": PERTURB})


@pytest.mark.slow
def test_dumps_hold_the_equilibria(faultgouge, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE + "[output]\ndumps = true\n")
    faultgouge("ramp", "scene.toml")
    with RunFile(tmp_path / "run.h5") as file:
        for k in (1, 2):
            stored, dumped = file.packing(k), read_dump(tmp_path / f"run.{k}.disks")
            assert np.array_equal(dumped.position, stored.position)
            assert np.array_equal(dumped.contacts.slip, stored.contacts.slip)
            assert dumped.fx == stored.fx


@pytest.mark.slow
def test_trajectory_is_that_of_the_displacements(faultgouge, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE + "[output]\ntrajectory = true\n")
    faultgouge("perturb", "scene.toml")
    with RunFile(tmp_path / "perturb.h5") as file:
        path, series, start = file.series("trajectory"), file.series("undamped"), file.packing()
    assert np.array_equal(path["time"], series["time"])
    assert np.array_equal(mean_square_displacement(path["position"], start.position, start.box_length), series["msd"])
