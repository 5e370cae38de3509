"""Input decks: on two ranks, on one page each, in another LAMMPS; and what LAMMPS refuses, in one sentence."""

import os
import subprocess

import numpy as np
import pytest
from reference_layer import BIN

from faultgouge.analysis import read_dump, spectrum
from faultgouge.analysis.files.formats.lammps_dump import dump_frames
from faultgouge.pywrap.lammps.decks import DECKS

SOON = {"force_tolerance": 1e-3}
"""A relaxation ends after some thousand steps: ranks that wait for each other in every step are slow."""
DRAWN = {"time": 0.15, "velocity": 60.0, "spring": 500.0, "states": 0.04, "every": 1}
"""A layer that goes round the period."""
SHORT = {
    "settle": {},
    "ramp": {"until": 1e-3},
    "perturb": {"time": 0.1},
    "perturb, damped": {"fx": 0.01, "time": 0.2, "amplitude": 1e-6, "v_ss": 2e-9, "cn": 2.0, "ct": 1.0, "tau": 20.0},
    "perturb, signal": {"time": 0.2, "signal": "record.txt", "scale": 1e-6, "on": "floor"},
    "drive": DRAWN,
    "drive, protocol": {**DRAWN, "protocol": "60 0.1 0 0.02 -60 0.03"},
    "drive, rigid": {**DRAWN, "velocity": 5.0, "spring": "rigid", "time": 0.05},
    "drive, signal": {**DRAWN, "signal": "record.txt", "scale": 1.0},
}


@pytest.mark.ranks
@pytest.mark.parametrize("precision", ["double", pytest.param("compensated", marks=pytest.mark.long)])
@pytest.mark.parametrize("run", SHORT)
@pytest.mark.slow
def test_deck_runs_alone_and_the_same_on_ranks(lmp, tmp_path, run, precision):
    """On three ranks in `make long`, as they share two cores. LAMMPS's sums depend on ranks in the last digits."""
    (tmp_path / "record.txt").write_text("# time value\n0 0\n0.1 1\n0.2 -1\n")
    written, sums, given = [], [], SHORT[run]
    for ranks in (1, 3 if (run, precision) == ("drive", "compensated") else 2):
        done = lmp(DECKS / f"{run.split(',')[0]}.in", ranks=ranks, decks=DECKS, precision=precision, **SOON, **given)
        assert "WARNING" not in done.stdout
        assert ranks != 2 or "initial/final imbalance factor  = 2 1\n" in done.stdout  # half of the disks each
        found = {path: path.read_text() for path in tmp_path.glob("*.disks")}
        if run.startswith("drive"):
            rows = np.loadtxt(tmp_path / "drive.series")
            found["series"] = rows[:, :4].tobytes()
            sums.append(rows[:, 4:])
        written.append(found)
    assert written[0] == written[1] != {}
    packings = [read_dump(path) for path in written[0] if path != "series"]
    damping = {(each.law.cn, each.law.ct, each.drag_time) for each in packings}
    if sums:
        np.testing.assert_allclose(sums[1], sums[0], rtol=1e-13, atol=0)
        assert rows[-1, 3] > 3.0 or run != "drive"
        assert read_dump(tmp_path / "drive.end.disks").fx == pytest.approx(rows[-1, 2], rel=1e-15)
        assert {cn for cn, *_ in damping} == {60.0}
    else:
        assert (given.get("cn", 0.0), given.get("ct", 0.0), given.get("tau")) in damping


TEACHING = {
    "settle": ("loose100.data", "settled", "settled", {}),
    "ramp": ("packing100.data", "ramp.2", "ramp.2", {"until": 2e-3}),
    "perturb": ("packing100.data", "perturb", "perturb.end", {"time": 5, "amplitude": 1e-9}),
}


@pytest.mark.parametrize("stage", TEACHING)
@pytest.mark.slow
def test_teaching_deck_of_one_page_is_to_the_bit_the_deck_of_parts(lmp, tmp_path, stage):
    data, taught, composed, variables = TEACHING[stage]
    done = lmp(DECKS / "teaching" / f"{stage}.in", data=DECKS / data)
    assert "WARNING" not in done.stdout
    lmp(DECKS / f"{stage}.in", decks=DECKS, force_tolerance=1e-9, **variables)
    one, other = (next(dump_frames(tmp_path / name)) for name in (f"{taught}.dump", f"{composed}.disks"))
    for column in ("id", "x", "y"):
        assert np.array_equal(*(each.rows[:, each.columns.index(column)] for each in (one, other)))


@pytest.mark.skipif("LAMMPS_PROGRAM" not in os.environ, reason="LAMMPS_PROGRAM names no LAMMPS")
def test_same_eigenvalues_and_forces_in_a_lammps_of_ones_own(lmp, tmp_path):
    """A ramp in that of the environment, and in the one that tests/with_lammps.sh names and builds the plugin for."""
    environment, given = tmp_path / "environment", {"decks": DECKS, "until": 2e-3}
    environment.mkdir()
    wheel = {key: value for key, value in os.environ.items() if key not in ("LAMMPS_PLUGIN_PATH", "LD_LIBRARY_PATH")}
    command = [BIN / "lmp", "-in", DECKS / "ramp.in", "-log", "none"]
    command += [str(word) for name, value in given.items() for word in ("-var", name, value)]
    subprocess.run(command, cwd=environment, env=wheel, check=True, capture_output=True, timeout=300)
    lmp(DECKS / "ramp.in", **given)
    names = sorted(path.name for path in tmp_path.glob("*.disks"))
    assert len(names) > 1
    for here, there in ((read_dump(tmp_path / name), read_dump(environment / name)) for name in names):
        # one arithmetic, compiled twice
        np.testing.assert_allclose(here.net_force, there.net_force, rtol=0, atol=1e-12 * np.abs(here.fy))
        np.testing.assert_allclose(spectrum(here).eigenvalues, spectrum(there).eigenvalues, rtol=1e-12)
