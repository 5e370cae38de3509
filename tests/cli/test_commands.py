"""The command line as a user types it: results, errors in one sentence, exit codes."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from reference_layer import LAYER, REFERENCE

from faultgouge.analysis import RunFile, eigenvalues, read_dump, spectrum
from faultgouge.pywrap import Record, Scene, settle
from faultgouge.pywrap.lammps.decks import DECKS

SCENE = f"""{LAYER}
[ramp]
step = 1e-3
until = 4e-3
[perturb]
fx = 1.5e-3
time = 0.5
"""


@pytest.fixture(autouse=True)
def _scene(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)


def datasets(path):
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[...]}) if isinstance(item, h5py.Dataset) else None)
    return found


def assert_same_datasets(one, other):
    one, other = datasets(one), datasets(other)
    assert one.keys() == other.keys()
    for name, value in one.items():
        assert np.array_equal(value, other[name], equal_nan=value.dtype.kind == "f"), name


@pytest.mark.slow
def test_ramp_as_json(faultgouge, tmp_path):
    done = faultgouge("ramp", "scene.toml", "--json")
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)["equilibria"]
    assert [row["fx"] for row in rows] == [k * 1e-3 for k in range(5)]
    for row in rows:
        assert row["residual"] < 1.5 * row["floor"] < 1.5e-10
        assert row["contacts"] == 191
    with RunFile(tmp_path / "run.h5") as file:
        assert len(file) == 5
        assert json.loads(file.attributes["scene"])["ramp"]["until"] == 4e-3


@pytest.mark.slow
def test_a_ramp_says_which_way_it_took(faultgouge, tmp_path):
    """Of this packing, halved increments end before 0.0785; the same command again reads the way from the file."""
    (tmp_path / "scene.toml").write_text(
        'precision = "compensated"\n[packing]\ndisks = 100\nseed = 11\n[law]\nkn = 2e5\n[load]\nfy = 3.0\n'
        "[ramp]\nstep = 5e-4\nuntil = 0.0785\n"
    )
    way = "3 increments from F_x = 0.078"
    for says in (f"F_x = 0.0785 was reached by {way}, after", ""):
        done = faultgouge("ramp", "scene.toml", "--json")
        assert done.returncode == 0, done.stderr
        assert says in done.stderr
        *before, last = json.loads(done.stdout)["equilibria"]
        assert last["way"] == way
        assert all(row["way"] is None for row in before)


@pytest.mark.ranks
@pytest.mark.slow
def test_two_ranks_write_the_same_run(faultgouge, tmp_path):
    assert faultgouge("ramp", "scene.toml", "-o", "one.h5").returncode == 0
    assert faultgouge("ramp", "scene.toml", "-o", "two.h5", ranks=2).returncode == 0
    assert_same_datasets(tmp_path / "one.h5", tmp_path / "two.h5")


@pytest.mark.slow
def test_a_ramp_that_was_cut_off_goes_on(faultgouge, tmp_path):
    assert faultgouge("ramp", "scene.toml", "-o", "whole.h5").returncode == 0
    (tmp_path / "scene.toml").write_text(SCENE.replace("until = 4e-3", "until = 2e-3"))
    assert faultgouge("ramp", "scene.toml", "-o", "parts.h5").returncode == 0
    (tmp_path / "scene.toml").write_text(SCENE)
    assert faultgouge("ramp", "scene.toml", "-o", "parts.h5").returncode == 0
    assert_same_datasets(tmp_path / "whole.h5", tmp_path / "parts.h5")


@pytest.mark.slow
@pytest.mark.parametrize("loads", [(0.0,), (0.0, 1e-3)], ids=["settled", "with a ramp"])
def test_settle_finishes_a_settling_and_no_ramp(faultgouge, tmp_path, loads):
    scene = Scene.from_toml(tmp_path / "scene.toml")
    settled = settle(scene)
    with Record(tmp_path / "run.h5", scene) as record:  # as a kill between the packing and the end leaves it
        for fx in loads:
            record.append(replace(settled, packing=replace(settled.packing, fx=fx)))
    done = faultgouge("settle", "scene.toml")
    assert done.returncode == 0, done.stderr
    with RunFile(tmp_path / "run.h5") as file:
        assert len(file) == len(loads)
        assert file.complete == (loads == (0.0,))


@pytest.mark.slow
def test_run_of_another_scene_is_not_continued(faultgouge, tmp_path):
    assert faultgouge("settle", "scene.toml").returncode == 0
    (tmp_path / "scene.toml").write_text(SCENE.replace("fy = 3.0", "fy = 3.00001"))
    done = faultgouge("ramp", "scene.toml", "-o", "run.h5")
    assert done.returncode == 2
    assert "run.h5 holds a run of another scene (load.fy is 3.0 there and 3.00001 here)" in done.stderr


@pytest.mark.slow
def test_perturb_writes_the_series(faultgouge, tmp_path):
    done = faultgouge("perturb", "scene.toml", "--json")
    assert done.returncode == 0, done.stderr
    series = json.loads(done.stdout)
    assert series["time"][-1] == pytest.approx(0.5, abs=1e-3)
    # a stable packing at rest: D stays at the rounding of coordinates, the residual over the softest mode squared
    assert 0 < max(series["msd"]) < 1e-22
    with RunFile(tmp_path / "perturb.h5") as file:
        assert file.fx.tolist() == [0.0, 1e-3, 1.5e-3][-1:]
        assert file.series("undamped")["msd"].tolist() == series["msd"]


@pytest.mark.slow
def test_spectrum_from_run_file_and_from_memory(faultgouge, tmp_path):
    assert faultgouge("ramp", "scene.toml").returncode == 0
    printed = json.loads(faultgouge("spectrum", "run.h5", "--json").stdout)
    with RunFile(tmp_path / "run.h5") as file:
        here = spectrum(file.packing())
    assert printed["eigenvalues"] == [[value.real, value.imag] for value in here.eigenvalues.tolist()]
    assert printed["rattlers"] == here.rattlers.tolist()


@pytest.mark.slow
def test_eigenvalues_alone(faultgouge, tmp_path):
    assert faultgouge("ramp", "scene.toml").returncode == 0
    printed = json.loads(faultgouge("spectrum", "run.h5", "--values", "--json").stdout)
    with RunFile(tmp_path / "run.h5") as file:
        assert printed["eigenvalues"] == [[v.real, v.imag] for v in eigenvalues(file.packing()).tolist()]
    first = faultgouge("spectrum", "run.h5", "--values").stdout.splitlines()[0]
    assert [float(word) for word in first.split()] == printed["eigenvalues"][0]


@pytest.mark.ranks
@pytest.mark.slow
def test_spectrum_of_a_decks_dumps(faultgouge, lmp, tmp_path):
    done = lmp(DECKS / "ramp.in", "-var", "decks", str(DECKS), "-var", "until", "2e-3", ranks=2)
    assert done.returncode == 0, done.stdout[-2000:]
    printed = json.loads(faultgouge("spectrum", "ramp.2.disks", "--json").stdout)
    packing = read_dump(tmp_path / "ramp.2.disks")
    assert printed["fx"] == packing.fx == 2e-3
    assert printed["eigenvalues"] == [[v.real, v.imag] for v in spectrum(packing).eigenvalues.tolist()]
    # the deck balanced its forces, so that what was read is what was written
    assert printed["residual"] < 1.2e-10


@pytest.mark.slow
def test_onset_as_json(faultgouge, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace("until = 4e-3", "until = 0.022"))
    done = faultgouge("onset", "scene.toml", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["fx_c"] == pytest.approx(0.0218330564080, rel=1e-9)
    assert result["windows"][0].keys() >= {"fx_onset", "fx_end", "lambda", "error"}


@pytest.mark.slow
def test_onset_among_some_modes(faultgouge, faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace("until = 4e-3", "until = 0.022"))
    done = faultgouge("onset", "scene.toml", "--modes", "0:285", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["modes"] == [0, 285]
    assert result["fx_c"] == pytest.approx(0.0218330564080, rel=1e-9)
    for modes, says in (("600", "as in --modes 0:600"), ("5:5", "as in --modes 0:600"), ("900:910", "are no part of")):
        done = faultgouge_here("onset", "scene.toml", "--modes", modes)
        assert done.returncode == 2
        assert says in done.stderr


@pytest.mark.slow
def test_no_onset_is_a_failed_computation(faultgouge):
    done = faultgouge("onset", "scene.toml")
    assert done.returncode == 1
    assert "No pair of eigenvalues becomes complex up to fx = 0.004" in done.stderr


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("kn = 2e5", "kn = 2e5\nfriction = 1"), "law.friction is no key"),
        (("kn = 2e5", "kn = -1.0"), "law.kn = -1.0 is refused: give a number above 0"),
        (("kn = 2e5", "kn = nan"), "law.kn = nan is refused"),
        (("kn = 2e5", "kt = 1.0"), "law.kt stands without kn"),
        ((f'file = "{REFERENCE}"', "disks = 0"), "packing.disks = 0 is refused"),
        ((f'file = "{REFERENCE}"', "top = 200"), "packing.top = 200 is more than the 100 disks"),
        ((f'file = "{REFERENCE}"', "width = 2.7"), "under two cutoffs"),
        ((f'file = "{REFERENCE}"', 'file = "no.json"'), "no.json"),
        (("fy = 3.0", "fy = 300.0"), "the packing is not in balance, a disk feels"),
        (("time = 0.5", "time = 0.5\ntime_step = 0.1"), "over the limit 2/omega_max"),
        (("time = 0.5", "time = 1e-9"), "shorter than one step"),
        (("fx = 1.5e-3", "fx = 5e-3"), "lies beyond the last equilibrium"),
        (("[law]", "[law"), "not valid TOML"),
    ],
    ids=lambda value: value[1][:30] if isinstance(value, tuple) else "",
)
@pytest.mark.slow
def test_bad_input_is_refused_in_one_sentence(faultgouge_here, tmp_path, change, says):
    (tmp_path / "scene.toml").write_text(SCENE.replace(*change))
    done = faultgouge_here("perturb", "scene.toml")
    assert done.returncode == 2
    assert done.stderr.startswith("Error: ")
    assert says in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "perturb.h5").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("ramp", "no.toml"), "no.toml: the scene cannot be read"),
        (("spectrum", "no.h5"), "no.h5 does not exist"),
        (("spectrum", "scene.toml"), "scene.toml is not a readable HDF5 file"),
        (("spectrum", "no.disks"), "no.disks cannot be read"),
        (("rampp", "scene.toml"), "rampp"),
    ],
)
@pytest.mark.slow
def test_bad_file_is_refused(faultgouge_here, arguments, says):
    done = faultgouge_here(*arguments)
    assert done.returncode == 2
    assert says in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_every_command_has_help_with_an_example(faultgouge, faultgouge_here):
    commands = ["settle", "ramp", "perturb", "onset", "spectrum", "explain", "report", "stability", "reproduce"]
    overview = faultgouge("--help").stdout
    for command in commands:
        assert command in overview
        done = faultgouge_here(command, "--help")
        assert done.returncode == 0
        assert "Example" in done.stdout
