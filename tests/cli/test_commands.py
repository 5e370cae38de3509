"""The command line as a user types it: what it prints, what it leaves behind, and what it refuses in one sentence.

`onset` and `spectrum` have files of their own beside this one.
"""

import json
import re
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from reference_layer import LAYER, SMALL, toml
from table_rows import rows_of

from faultgouge.analysis import RunFile, mean_square_displacement, read_dump, spectrum
from faultgouge.commands import terminal
from faultgouge.pywrap import Record, Scene, settle
from fuzz.kills import difference, results

SECTIONS = {"ramp": {"step": 1e-3, "until": 0.004}, "perturb": {"fx": 1.5e-3, "time": 0.5}}
SCENE = LAYER + toml(SECTIONS | {"output": {"trajectory": True}})


@pytest.fixture(autouse=True)
def _scene(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)


def test_ramp_to_a_load_that_the_file_went_beyond(faultgouge_here, tmp_path):
    """Nothing is computed, and the load is not the last one of the file."""
    said, files = [], []
    for until in ([0.012, 0.0], 6e-3):
        (tmp_path / "scene.toml").write_text(toml(SMALL | {"ramp": {"step": 6e-3, "until": until}}))
        said.append(faultgouge_here("ramp", "scene.toml").stdout)
        files.append((tmp_path / "run.h5").read_bytes())
    assert "F_x = 0 reached" in said[0]
    assert said[1] == "run.h5 goes on from F_x = 0.006, where ramp.until ends, to F_x = 0: nothing is left to compute\n"
    assert files[0] == files[1]


@pytest.mark.long
def test_a_ramp_says_which_way_it_took(faultgouge, tmp_path):
    """Of this packing, halved increments end before 0.0785; the same command again reads the way from the file."""
    scene = SMALL | {"packing": {"disks": 100, "seed": 11}, "ramp": {"step": 5e-4, "until": 0.0785}}
    (tmp_path / "scene.toml").write_text('precision = "compensated"\n' + toml(scene))
    way = "3 increments from F_x = 0.078"
    for says in (f"F_x = 0.0785 was reached by {way}, after", ""):
        done = faultgouge("ramp", "scene.toml", "--json")
        assert says in done.stderr
        *before, last = json.loads(done.stdout)["equilibria"]
        assert last["way"] == way
        assert all(row["way"] is None for row in before)


@pytest.mark.ranks
@pytest.mark.slow
def test_a_ramp_as_json_and_cut_off_on_two_ranks_and_continued_on_one(faultgouge, faultgouge_here, tmp_path):
    """Both write the same."""
    printed = json.loads(faultgouge_here("ramp", "scene.toml", "--json").stdout)["equilibria"]
    assert [(row["fx"], row["contacts"]) for row in printed] == [(k * 1e-3, 191) for k in range(5)]
    assert all(row["residual"] < 1.5 * row["floor"] < 1.5e-10 for row in printed)
    assert {path.name for path in tmp_path.iterdir()} == {"run.h5", "scene.toml"}
    with RunFile(tmp_path / "run.h5") as file:
        assert json.loads(file.attributes["scene"])["ramp"]["until"] == 4e-3
    whole = results(tmp_path)
    (tmp_path / "run.h5").unlink()
    for until, run in (("until = 0.002", partial(faultgouge, ranks=2)), ("until = 0.004", faultgouge_here)):
        (tmp_path / "scene.toml").write_text(SCENE.replace("until = 0.004", until))
        run("ramp", "scene.toml")
    assert difference(whole, results(tmp_path)) == ""


@pytest.mark.slow
@pytest.mark.parametrize("loads", [(0.0,), (0.0, 1e-3)], ids=["settled", "with a ramp"])
def test_settle_finishes_a_settling_and_no_ramp(faultgouge_here, tmp_path, loads):
    scene = Scene.from_toml(tmp_path / "scene.toml", command="settle")
    settled = settle(scene)
    with Record(tmp_path / "run.h5", scene) as record:  # as a kill between the packing and the end leaves it
        for fx in loads:
            record.append(replace(settled, packing=replace(settled.packing, fx=fx)))
    faultgouge_here("settle", "scene.toml")
    with RunFile(tmp_path / "run.h5") as file:
        assert len(file) == len(loads)
        assert file.complete == (loads == (0.0,))


@pytest.mark.slow
def test_perturb_writes_the_series_and_the_trajectory_that_is_asked_for(faultgouge_here, tmp_path):
    done = faultgouge_here("perturb", "scene.toml", "--json")
    series = json.loads(done.stdout)
    assert done.stderr.endswith("written to perturb.h5\n")
    assert (series["growth"], series["predicted_rate"], series["time_needed"]) == (None, 0, None)
    assert "linearly stable" in series["says"]
    # a stable packing at rest: D stays at the rounding of coordinates, the residual over the softest mode squared
    assert 0 < max(series["msd"]) < 1e-22
    with RunFile(tmp_path / "perturb.h5") as file:
        path, start, stored = file.series("trajectory"), file.packing(), file.series("undamped")["msd"]
    assert (start.fx, path["time"].tolist()) == (1.5e-3, series["time"])
    assert series["time"][-1] == pytest.approx(0.5, abs=1e-3)
    moved = mean_square_displacement(path["position"], start.position, start.box_length)
    assert moved.tolist() == stored.tolist() == series["msd"]


@pytest.mark.slow
def test_dumps_that_are_asked_for_hold_the_equilibria(faultgouge_here, beyond):
    with RunFile(beyond / "ramp.h5") as file:
        for k in (1, 2):
            stored, dumped = file.packing(k), read_dump(beyond / f"ramp.{k}.disks")
            assert np.array_equal(dumped.position, stored.position)
            assert np.array_equal(dumped.contacts.slip, stored.contacts.slip)
            assert dumped.fx == stored.fx
    printed = json.loads(faultgouge_here("spectrum", beyond / "ramp.2.disks", "--json").stdout)
    assert [complex(*each) for each in printed["eigenvalues"]] == spectrum(dumped).eigenvalues.tolist()
    # the forces were balanced, so that what was read is what was written
    assert (printed["fx"], printed["residual"] < 1.2e-10) == (0.012, True)


@pytest.mark.slow
def test_a_lack_of_memory_is_no_fault_of_the_program(faultgouge_here, monkeypatch):
    monkeypatch.setattr("faultgouge.commands.terminal.read_scene", lambda *_: np.empty(1 << 55))
    said = faultgouge_here("settle", "scene.toml", code=1).stderr
    assert said.startswith("Error: there is not enough memory (Unable to allocate 256. PiB for an array")


def test_every_command_has_help_with_an_example_and_the_overview_its_first_sentence(faultgouge_here, refusal):
    _, table = faultgouge_here("--help").stdout.split("Commands:")
    text = " ".join(table.split())
    assert "ramp Raise F_x from equilibrium to equilibrium, and store each equilibrium. perturb Run" in text
    commands = re.findall(r"^  (\w+)  ", table, re.MULTILINE)
    assert len(commands) > 20
    for command in commands:
        shown = faultgouge_here(command, "--help").stdout
        assert "Example" in shown
        assert "\\" not in shown  # plain text escapes no brackets
    assert "Did you mean 'onset'?" in refusal("onst")


@pytest.mark.slow
def test_off_a_terminal_progress_is_a_line_a_minute_until_it_is_left(monkeypatch, capsys):
    """Also within one long item."""
    monkeypatch.setattr(terminal, "SECONDS_BETWEEN_LINES", 0.02)
    for item in terminal.progress([1, 2, 3], "equilibria", 5, done=2):
        time.sleep(0.2)
        if item == 2:
            break
    lines = capsys.readouterr().err.splitlines()
    assert set(lines) - {"equilibria: 2 of 5"} == {"equilibria: 3 of 5", "equilibria: 4 of 5"}
    time.sleep(0.1)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("command", "code", "says"), rows_of("cli/refused_commands.txt"))
@pytest.mark.slow
def test_a_command_that_cannot_be_run(refusal, tmp_path, beyond, command, code, says):
    (tmp_path / "scene.toml").write_text((beyond / "scene.toml").read_text().replace("fy = 3.0", "fy = 3.00001"))
    for name, old, new in (
        ("negative", "kn = 2e5", "kn = -1.0"),
        ("heavy", "fy = 3.0", "fy = 300.0"),
        ("fast", "time = 0.5", "time = 0.5\ntime_step = 0.1"),
        ("damped", "[ramp]", "[damping]\n[ramp]"),
        ("short", "", ""),
    ):
        (tmp_path / f"{name}.toml").write_text(SCENE.replace(old, new))
    for name in ("ramp.h5", "perturb.h5"):
        (tmp_path / name).symlink_to(beyond / name)
    before = sorted(tmp_path.iterdir())
    assert says in refusal(*command.split(), code=code)
    assert sorted(tmp_path.iterdir()) == before
