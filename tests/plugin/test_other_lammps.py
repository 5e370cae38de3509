"""A LAMMPS of one's own beside that of the environment; tests/with_lammps.sh names it and builds its plugin."""

import os
import subprocess

import numpy as np
import pytest
from reference_layer import BIN

from faultgouge.analysis import read_dump, spectrum
from faultgouge.pywrap.lammps.decks import DECKS

pytestmark = pytest.mark.skipif("LAMMPS_PROGRAM" not in os.environ, reason="LAMMPS_PROGRAM names no LAMMPS")
RAMP = ("-var", "decks", str(DECKS), "-var", "until", "2e-3")


def test_same_eigenvalues_and_forces(lmp, tmp_path):
    """A ramp in either LAMMPS."""
    environment = tmp_path / "environment"
    environment.mkdir()
    wheel = {key: value for key, value in os.environ.items() if key not in ("LAMMPS_PLUGIN_PATH", "LD_LIBRARY_PATH")}
    command = [BIN / "lmp", "-in", DECKS / "ramp.in", "-log", "none", *RAMP]
    subprocess.run(command, cwd=environment, env=wheel, check=True, capture_output=True, timeout=300)
    lmp(DECKS / "ramp.in", *RAMP)
    names = sorted(path.name for path in tmp_path.glob("*.disks"))
    assert len(names) > 1
    for name in names:
        here, there = read_dump(tmp_path / name), read_dump(environment / name)
        # one arithmetic, compiled twice
        np.testing.assert_allclose(here.net_force, there.net_force, rtol=0, atol=1e-12 * np.abs(here.fy))
        ours, others = (spectrum(each).eigenvalues for each in (here, there))
        np.testing.assert_allclose(ours, others, rtol=1e-12)
