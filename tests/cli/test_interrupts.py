"""Ctrl-C and SIGTERM: one sentence, 130 or 143, and soon, whatever the command is doing; and engines that fail."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import failing_engine
import pytest
from reference_layer import LAYER, on_ranks, toml
from table_rows import rows_of

from faultgouge.analysis import RunFile
from faultgouge.pywrap import Engine
from fuzz.kills import CommandToKill, start_command

ASKED = {"perturb": {"fx": 2e-5, "time": 1e4}, "eruptions": {"load": [0.02], "time": 1e3}}
SCENE = LAYER + toml({"ramp": {"step": 1e-5, "until": 0.02}} | ASKED)

SWEPT = {"packing": {"disks": 300}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": {"step": 1e-4, "until": 0.02}}
SWEEP = 'task = "onset"\n[sweep]\n"packing.seed" = "1:50"\n' + toml(SWEPT, "scene.")

GRAINS = Path(__file__).with_name("inputs").joinpath("grains.in").read_text()
"""Spheres in a row; of 220 it takes seconds to say whether they are stable."""

ENDS = {signal.SIGINT: (130, "interrupted"), signal.SIGTERM: (143, "terminated"), signal.SIGKILL: (-9, "")}
"""Exit codes after signals, and what is said."""

SOON = 8.0
"""Seconds within which a command ends after a signal: its guard takes 0.8 to 1.5, and a busy machine takes the rest."""


def interrupted(folder, command, scene, number, when, ranks=1, group=False):
    """Errors of a command that gets a signal as soon as `when()` is true; it is to end soon, and with its exit code."""
    running = start_command(CommandToKill(command, scene, ranks), folder)
    deadline = time.monotonic() + 120
    while not when():
        assert running.poll() is None, running.communicate()[1]
        assert time.monotonic() < deadline, "the command does not get to where it is to be interrupted"
        time.sleep(0.02)
    begin = time.monotonic()
    os.killpg(running.pid, number) if group else running.send_signal(number)
    _, errors = running.communicate(timeout=30)
    assert time.monotonic() - begin < SOON
    assert is_gone(running.pid)
    assert running.returncode == ENDS[number][0]
    assert "Traceback" not in errors
    return errors


def is_gone(group):
    """Whether no process of a group is left."""
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def equilibria(path):
    try:
        with RunFile(path) as run:
            return len(run)
    except ValueError:
        return 0


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("command", "ranks", "at", "group"),
    [
        pytest.param("ramp", 1, 4, False, marks=pytest.mark.long, id="one rank"),
        pytest.param("ramp", 2, 4, False, id="two ranks"),
        pytest.param("perturb", 1, 1, True, marks=pytest.mark.long, id="all processes, as a terminal does"),
    ],
)
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
@pytest.mark.slow
def test_a_run_says_what_is_kept(tmp_path, command, ranks, at, group, number):
    path = tmp_path / "run.h5"
    words = f"{command} scene.toml -o run.h5"
    errors = interrupted(tmp_path, words, SCENE, number, lambda: equilibria(path) >= at, ranks, group)
    (says,) = (line for line in errors.splitlines() if line.startswith("Error:"))
    with RunFile(path) as run:
        held = "1 equilibrium" if len(run) == 1 else f"{len(run)} equilibria"
        assert not run.complete
    assert says.startswith(f"Error: {ENDS[number][1]}: run.h5 holds {held}")
    assert says.endswith("the same command continues from there.")
    assert not list(tmp_path.glob(".*"))  # neither a lock nor half a file


@pytest.mark.slow
def test_the_work_ends_with_its_guard(tmp_path):
    """The same command then goes on to the bit: fuzz/kills.py."""
    interrupted(tmp_path, "ramp scene.toml", SCENE, signal.SIGKILL, lambda: equilibria(tmp_path / "run.h5") > 3)


def simulates(folder):
    """Whether a process that works in a folder has LAMMPS in its memory."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if (process / "cwd").readlink() == folder and "liblammps" in (process / "maps").read_text():
                return True
        except OSError:  # another user's, or gone
            continue
    return False


@pytest.mark.parametrize(("command", "says"), rows_of("cli/kept_at_interrupts.txt"))
@pytest.mark.long
def test_what_is_kept_is_said(tmp_path, command, says):
    (tmp_path / "sweep.toml").write_text(SWEEP)
    errors = interrupted(tmp_path, command, SCENE, signal.SIGINT, lambda: simulates(tmp_path))
    *ahead, last = errors.strip().splitlines()
    assert last.startswith(f"Error: interrupted: {says}")
    assert not any(line.startswith("Error") for line in ahead)


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_import_leaves_nothing(tmp_path, monkeypatch, number):
    """LAMMPS runs for hours without an instruction of Python, and is ended in the midst of its run."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    (tmp_path / "pile.in").write_text(GRAINS.format(last=0, steps=2000000000))
    errors = interrupted(tmp_path, "import pile.in -o pile.h5", "", number, (tmp_path / "begun").exists)
    assert errors.strip().endswith(f"Error: {ENDS[number][1]}: nothing has been written to pile.h5 yet.")
    assert not [path for path in tmp_path.iterdir() if "pile.h5" in path.name]  # nor its lock
    assert not any(temporary.iterdir())


@pytest.mark.long
def test_an_import_says_that_its_file_is_written(tmp_path):
    """When it is interrupted over the verdict, which comes after the packing."""
    (tmp_path / "row.in").write_text(GRAINS.format(last=219, steps=0))
    command = "import row.in -o row.h5 --balance 10"
    errors = interrupted(tmp_path, command, "", signal.SIGINT, (tmp_path / "row.h5").exists)
    says = "row.h5 has been written; whether the packing is stable says `faultgouge stability row.h5`."
    assert errors.strip().endswith(f"Error: interrupted: {says}")


@pytest.mark.long
def test_a_long_search_goes_on_to_the_bit(faultgouge, tmp_path):
    """Killed, interrupted and continued on one process; and in one piece."""
    large = SWEPT | {"packing": {"disks": 5000, "seed": 1, "width": 84.3}, "ramp": {"step": 4e-4, "until": 0.02}}
    (tmp_path / "settle.toml").write_text(toml(large))
    faultgouge("settle", "settle.toml")
    onset = tmp_path, "onset scene.toml -o onset.json", toml(large | {"packing": {"file": "run.h5"}})
    slices = tmp_path / "onset.json.slices"

    def known():
        return len(list(slices.glob("*/*-*.npz")))

    interrupted(*onset, signal.SIGKILL, lambda: known() >= 10, group=True)
    first = known()
    errors = interrupted(*onset, signal.SIGINT, lambda: known() >= first + 10)
    says = "Error: interrupted: onset.json.slices has what was found so far; the same command continues from there."
    assert errors.splitlines()[-1] == says
    for name in ("onset", "whole"):
        faultgouge("onset", "scene.toml", "-o", f"{name}.json")
        assert not slices.exists()
    assert (tmp_path / "onset.json").read_bytes() == (tmp_path / "whole.json").read_bytes()


IN_A_CLASS = """
import os
from faultgouge import cli, commands
interrupting = type("Interrupting", (), {"__set_name__": lambda *_: os.kill(os.getpid(), 2)})
commands.program = lambda: type("Owner", (), {"attribute": interrupting()})
cli.main()
"""
"""Python raises an error of its own in place of what comes from there."""

GUARDED = """
import os, subprocess, sys, time
from faultgouge.signal_guard import guarded, keeps
guarded(lambda: (keeps("all is kept"), {}, time.sleep(9)))
"""

IN_A_LIBRARY = """subprocess.Popen(["sh", "-c", f"sleep 1; kill {os.getppid()}"]),
    __import__("scipy.linalg").linalg.eig(__import__("numpy").random.default_rng(0).normal(size=(3000, 3000)))"""
"""Minutes without an instruction of Python."""


@pytest.mark.parametrize(
    ("does", "code", "says"),
    [
        (IN_A_CLASS, 130, "interrupted: nothing was written: give the same command again.\n"),
        ("os.kill(os.getppid(), 1)", 129, "the terminal or the connection was closed: all is kept.\n"),
        pytest.param(IN_A_LIBRARY, 143, "terminated: all is kept.\n", marks=pytest.mark.long),
        # to the process that works, the child of the one that the shell started
        ("os.kill(os.getpid(), 24)", 152, "the limit of CPU time (ulimit -t) is reached: all is kept.\n"),
        ("os.kill(os.getpid(), 15)", 143, "terminated: all is kept.\n"),
        ("os.kill(os.getpid(), 9)", 137, "killed from outside, possibly for lack of memory: all is kept.\n"),
        ("os.kill(os.getpid(), 11)", 1, "a library has ended the command (SIGSEGV)"),
        ("os.abort()", 1, "a library has ended the command (SIGABRT)"),
        ("os._exit(0)", 1, "a library has ended the command; please report it"),
        ("sys.exit(3)", 3, ""),
    ],
    ids=["class", "hangup", "library", "CPU time", "SIGTERM", "SIGKILL", "SIGSEGV", "abort", "exit of C", "exit"],
)
def test_how_the_work_has_ended_is_said_in_one_sentence(tmp_path, does, code, says):
    script = does if does == IN_A_CLASS else GUARDED.format(does)
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == code
    assert done.stderr.startswith(f"Error: {says}" if says else "")
    assert len(done.stderr.splitlines()) == (1 if says else 0)


@pytest.fixture(scope="module")
def settled(faultgouge_here_in, tmp_path_factory):
    """A folder with a scene whose packing is settled already."""
    folder = tmp_path_factory.mktemp("settled")
    scene = SWEPT | {"packing": {"disks": 16, "seed": 10}, "ramp": {"step": 0.11, "until": 0.11}}
    (folder / "scene.toml").write_text(toml(scene))
    faultgouge_here_in(folder, "settle", "scene.toml", "-o", "settled.h5")
    (folder / "scene.toml").write_text(toml(scene | {"packing": {"file": "settled.h5"}}))
    return folder


@pytest.mark.ranks
@pytest.mark.parametrize(("rank", "call"), [(1, 1), (-1, 30), (0, 30)])
@pytest.mark.long
def test_its_sentence_reaches_the_command_on_two_ranks(settled, rank, call):
    command = [*on_ranks(2), sys.executable, failing_engine.__file__, str(call), str(rank), "onset", "scene.toml"]
    done = subprocess.run(command, cwd=settled, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    says = [line for line in done.stderr.splitlines() if line.startswith("Error:")]
    assert says == [f"Error: LAMMPS stopped: it was told to at call {call}."]


@pytest.mark.slow
def test_no_call_is_taken_for_a_missing_onset(settled, monkeypatch, faultgouge_here_in):
    for call in range(1, 1000, 12):
        with monkeypatch.context() as one:
            one.setattr(Engine, "try_displacement", failing_engine.failing(call))
            done = faultgouge_here_in(settled, "onset", "scene.toml", code=None)
        if done.returncode == 0:
            break
        assert done.returncode == 1
        assert done.stderr.splitlines()[-1] == f"Error: LAMMPS stopped: it was told to at call {call}."
    assert 12 < call < 989
