"""The command line as a user types it: results, errors in one sentence, exit codes."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from reference_layer import LAYER, REFERENCE, toml

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
    rows = json.loads(done.stdout)["equilibria"]
    assert [row["fx"] for row in rows] == [k * 1e-3 for k in range(5)]
    for row in rows:
        assert row["residual"] < 1.5 * row["floor"] < 1.5e-10
        assert row["contacts"] == 191
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.h5", "scene.toml"]
    with RunFile(tmp_path / "run.h5") as file:
        assert len(file) == 5
        assert json.loads(file.attributes["scene"])["ramp"]["until"] == 4e-3


@pytest.mark.slow
@pytest.mark.long
def test_a_ramp_says_which_way_it_took(faultgouge, tmp_path):
    """Of this packing, halved increments end before 0.0785; the same command again reads the way from the file."""
    scene = {"packing": {"disks": 100, "seed": 11}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
    (tmp_path / "scene.toml").write_text(
        'precision = "compensated"\n' + toml(scene | {"ramp": {"step": 5e-4, "until": 0.0785}})
    )
    way = "3 increments from F_x = 0.078"
    for says in (f"F_x = 0.0785 was reached by {way}, after", ""):
        done = faultgouge("ramp", "scene.toml", "--json")
        assert says in done.stderr
        *before, last = json.loads(done.stdout)["equilibria"]
        assert last["way"] == way
        assert all(row["way"] is None for row in before)


@pytest.mark.ranks
@pytest.mark.slow
def test_two_ranks_write_the_same_run(faultgouge, tmp_path):
    faultgouge("ramp", "scene.toml", "-o", "one.h5")
    faultgouge("ramp", "scene.toml", "-o", "two.h5", ranks=2)
    assert_same_datasets(tmp_path / "one.h5", tmp_path / "two.h5")


@pytest.mark.slow
def test_a_ramp_that_was_cut_off_goes_on(faultgouge, tmp_path):
    faultgouge("ramp", "scene.toml", "-o", "whole.h5")
    for until in ("2e-3", "4e-3"):
        (tmp_path / "scene.toml").write_text(SCENE.replace("4e-3", until))
        faultgouge("ramp", "scene.toml", "-o", "parts.h5")
    assert_same_datasets(tmp_path / "whole.h5", tmp_path / "parts.h5")


@pytest.mark.slow
@pytest.mark.parametrize("loads", [(0.0,), (0.0, 1e-3)], ids=["settled", "with a ramp"])
def test_settle_finishes_a_settling_and_no_ramp(faultgouge, tmp_path, loads):
    scene = Scene.from_toml(tmp_path / "scene.toml")
    settled = settle(scene)
    with Record(tmp_path / "run.h5", scene) as record:  # as a kill between the packing and the end leaves it
        for fx in loads:
            record.append(replace(settled, packing=replace(settled.packing, fx=fx)))
    faultgouge("settle", "scene.toml")
    with RunFile(tmp_path / "run.h5") as file:
        assert len(file) == len(loads)
        assert file.complete == (loads == (0.0,))


@pytest.mark.slow
def test_run_of_another_scene_is_not_continued(faultgouge, tmp_path):
    faultgouge("settle", "scene.toml")
    (tmp_path / "scene.toml").write_text(SCENE.replace("fy = 3.0", "fy = 3.00001"))
    done = faultgouge("ramp", "scene.toml", "-o", "run.h5", code=2)
    assert "run.h5 holds a run of another scene (load.fy is 3.0 there and 3.00001 here)" in done.stderr


@pytest.mark.slow
def test_perturb_writes_the_series(faultgouge, tmp_path):
    done = faultgouge("perturb", "scene.toml", "--json")
    series = json.loads(done.stdout)
    assert ", at most " in done.stderr
    assert series["time"][-1] == pytest.approx(0.5, abs=1e-3)
    # a stable packing at rest: D stays at the rounding of coordinates, the residual over the softest mode squared
    assert 0 < max(series["msd"]) < 1e-22
    with RunFile(tmp_path / "perturb.h5") as file:
        assert file.fx.tolist() == [1.5e-3]
        assert list(file.names_of_series) == ["undamped"]
        assert file.series("undamped")["msd"].tolist() == series["msd"]


@pytest.mark.slow
def test_spectrum_from_run_file_and_from_memory(faultgouge, faultgouge_here, tmp_path):
    faultgouge("ramp", "scene.toml")
    with RunFile(tmp_path / "run.h5") as file:
        packing = file.packing()
    for more, values in ((), spectrum(packing).eigenvalues), (("--values",), eigenvalues(packing)):
        printed = json.loads(faultgouge_here("spectrum", "run.h5", *more, "--json").stdout)
        assert printed["eigenvalues"] == [[value.real, value.imag] for value in values.tolist()]
        assert printed["rattlers"] == packing.rattlers.tolist()
    first = faultgouge_here("spectrum", "run.h5", "--values").stdout.splitlines()[0]
    assert [float(word) for word in first.split()] == printed["eigenvalues"][0]


@pytest.mark.ranks
@pytest.mark.slow
@pytest.mark.long
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
def test_onset_as_json_and_among_some_modes(faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace("until = 4e-3", "until = 0.022"))
    for more, modes in (((), None), (("--modes", "0:285"), [0, 285])):
        result = json.loads(faultgouge_here("onset", "scene.toml", *more, "--json").stdout)
        assert result.get("modes") == modes
        assert result["fx_c"] == pytest.approx(0.0218330564080, rel=1e-9)
        assert result["windows"][0].keys() >= {"fx_onset", "fx_end", "lambda", "error"}
    for modes, says in (("600", "as in --modes 0:600"), ("5:5", "as in --modes 0:600"), ("900:910", "are no part of")):
        done = faultgouge_here("onset", "scene.toml", "--modes", modes, code=2)
        assert says in done.stderr


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("kn = 2e5", "kn = -1.0"), "law.kn = -1.0 is refused: give a number above 0"),
        ((f'file = "{REFERENCE}"', 'file = "no.json"'), "no.json"),
        (("fy = 3.0", "fy = 300.0"), "the packing is not in balance, a disk feels"),
        (("time = 0.5", "time = 0.5\ntime_step = 0.1"), "over the limit 2/omega_max"),
        (("time = 0.5", "time = 1e-9"), "shorter than one step"),
    ],
    ids=lambda value: value[1][:30] if isinstance(value, tuple) else "",
)
@pytest.mark.slow
def test_bad_input_is_refused_in_one_sentence(faultgouge_here, tmp_path, change, says):
    (tmp_path / "scene.toml").write_text(SCENE.replace(*change))
    done = faultgouge_here("perturb", "scene.toml", code=2)
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
    done = faultgouge_here(*arguments, code=2)
    assert says in done.stderr


@pytest.mark.slow
def test_every_command_has_help_with_an_example(faultgouge, faultgouge_here):
    commands = ["settle", "ramp", "perturb", "onset", "spectrum", "explain", "report", "stability", "reproduce"]
    commands += ["import", "export", "movie", "view", "sweep", "modes", "eruptions"]
    overview = faultgouge("--help").stdout
    for command in commands:
        assert command in overview
        done = faultgouge_here(command, "--help")
        assert "Example" in done.stdout
        assert "\\" not in done.stdout  # plain text escapes no brackets
