"""Ctrl-C and SIGTERM: one sentence, 130 or 143, and soon, whatever the command is doing; and engines that fail."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from reference_layer import LAYER, on_ranks, toml
from table_rows import rows_of

from faultgouge.analysis import RunFile
from faultgouge.pywrap import Engine, EngineError
from fuzz.kills import CommandToKill, start_command

ASKED = {"perturb": {"fx": 2e-5, "time": 1e4}, "eruptions": {"load": [0.02], "time": 1e3}}
SCENE = LAYER + toml({"ramp": {"step": 1e-5, "until": 0.02}} | ASKED)

SWEPT = {"packing": {"disks": 300}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": {"step": 1e-4, "until": 0.02}}
SWEEP = 'task = "onset"\n[sweep]\n"packing.seed" = "1:50"\n' + toml(SWEPT, "scene.")

ENDS = {signal.SIGINT: (130, "interrupted"), signal.SIGTERM: (143, "terminated"), signal.SIGKILL: (-9, "")}
"""Exit codes after signals, and what is said."""

SOON = 8.0
"""Seconds within which a command ends after a signal: its guard takes 0.8 to 1.5, and a busy machine takes the rest."""


def interrupted(running, number, when, group=False):
    """Errors of a command that gets a signal as soon as `when()` is true; it is to end soon, and with its exit code."""
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
    running = start_command(CommandToKill(f"{command} scene.toml -o run.h5", SCENE, ranks), tmp_path)
    errors = interrupted(running, number, lambda: equilibria(path) >= at, group)
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
    running = start_command(CommandToKill("ramp scene.toml", SCENE), tmp_path)
    interrupted(running, signal.SIGKILL, lambda: equilibria(tmp_path / "run.h5") > 3)


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
    errors = interrupted(
        start_command(CommandToKill(command, SCENE), tmp_path), signal.SIGINT, lambda: simulates(tmp_path)
    )
    *ahead, last = errors.strip().splitlines()
    assert last.startswith(f"Error: interrupted: {says}")
    assert not any(line.startswith("Error") for line in ahead)


GRAINS = """
units lj
atom_style sphere
region box block -1 221 -2 2 -1 4 units box
create_box 1 box
{spheres}
set group all diameter 1.0 density 1.0
pair_style gran/hertz/history 1e3 NULL 10 NULL 0.9 1
pair_coeff * *
comm_modify vel yes
fix move all nve/sphere
shell touch begun
run {steps}
"""
ROW = "\n".join(f"create_atoms 1 single {0.9999 * k} 0 0 units box" for k in range(220))
"""Spheres in a row, of which to say whether they are stable takes seconds."""


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_an_import_leaves_nothing(tmp_path, monkeypatch, number):
    """LAMMPS runs for hours without an instruction of Python, and is ended in the midst of its run."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    (tmp_path / "pile.in").write_text(GRAINS.format(spheres="create_atoms 1 single 0 0 0.5", steps=2000000000))
    running = start_command(CommandToKill("import pile.in -o pile.h5", ""), tmp_path)
    errors = interrupted(running, number, (tmp_path / "begun").exists)
    assert errors.strip().endswith(f"Error: {ENDS[number][1]}: nothing has been written to pile.h5 yet.")
    assert not [path for path in tmp_path.iterdir() if "pile.h5" in path.name]  # nor its lock
    assert not any(temporary.iterdir())


@pytest.mark.long
def test_an_import_says_that_its_file_is_written(tmp_path):
    """When it is interrupted over the verdict, which comes after the packing."""
    (tmp_path / "row.in").write_text(GRAINS.format(spheres=ROW, steps=0))
    running = start_command(CommandToKill("import row.in -o row.h5 --balance 10", ""), tmp_path)
    errors = interrupted(running, signal.SIGINT, (tmp_path / "row.h5").exists)
    says = "row.h5 has been written; whether the packing is stable says `faultgouge stability row.h5`."
    assert errors.strip().endswith(f"Error: interrupted: {says}")


LARGE = SWEPT | {"packing": {"disks": 5000, "seed": 1, "width": 84.3}, "ramp": {"step": 4e-4, "until": 0.02}}


@pytest.mark.long
def test_a_long_search_goes_on_to_the_bit(faultgouge, tmp_path):
    """Killed, interrupted and continued on one process; and in one piece."""
    (tmp_path / "settle.toml").write_text(toml(LARGE))
    faultgouge("settle", "settle.toml")
    onset = CommandToKill("onset scene.toml -o onset.json", toml(LARGE | {"packing": {"file": "run.h5"}}))
    slices = tmp_path / "onset.json.slices"

    def known():
        return len(list(slices.glob("*/*-*.npz")))

    interrupted(start_command(onset, tmp_path), signal.SIGKILL, lambda: known() >= 10, group=True)
    first = known()
    errors = interrupted(start_command(onset, tmp_path), signal.SIGINT, lambda: known() >= first + 10)
    says = "Error: interrupted: onset.json.slices has what was found so far; the same command continues from there."
    assert errors.splitlines()[-1] == says
    faultgouge(*onset.command.split())
    assert not slices.exists()
    faultgouge("onset", "scene.toml", "-o", "whole.json")
    assert (tmp_path / "onset.json").read_bytes() == (tmp_path / "whole.json").read_bytes()


IN_A_LIBRARY = """
from faultgouge.signal_guard import guarded, keeps

def work():
    import numpy, pathlib, scipy.linalg
    matrix = numpy.random.default_rng(0).normal(size=(1500, 1500))
    keeps("nothing is kept")
    pathlib.Path("begun").touch()
    scipy.linalg.eig(matrix)  # half a minute without a Python instruction

guarded(work)
"""


@pytest.mark.long
def test_a_long_call_of_a_library_does_not_hold_the_signal(tmp_path):
    command = [sys.executable, "-c", IN_A_LIBRARY]
    running = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True)
    errors = interrupted(running, signal.SIGTERM, (tmp_path / "begun").exists)
    assert errors == "Error: terminated: nothing is kept.\n"


IN_A_CLASS = """
import os
from faultgouge import commands
from faultgouge.cli import main

class Interrupting:
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), 2)

def program():
    type("Owner", (), {"attribute": Interrupting()})

commands.program = program
main()
"""


GUARDED = """
import os, sys, time
from faultgouge.signal_guard import guarded, keeps
guarded(lambda: (keeps("all is kept"), {}, time.sleep(9)))
"""


@pytest.mark.parametrize(
    ("does", "code", "says"),
    [
        (IN_A_CLASS, 130, "interrupted: nothing was written: give the same command again.\n"),
        ("os.kill(os.getppid(), 1)", 129, "the terminal or the connection was closed: all is kept.\n"),
        # to the process that works, the child of the one that the shell started
        ("os.kill(os.getpid(), 24)", 152, "the limit of CPU time (ulimit -t) is reached: all is kept.\n"),
        ("os.kill(os.getpid(), 15)", 143, "terminated: all is kept.\n"),
        ("os.kill(os.getpid(), 9)", 137, "killed from outside, possibly for lack of memory: all is kept.\n"),
        ("os.kill(os.getpid(), 11)", 1, "a library has ended the command (SIGSEGV)"),
        ("os.abort()", 1, "a library has ended the command (SIGABRT)"),
        ("os._exit(0)", 1, "a library has ended the command; please report it"),
        ("sys.exit(3)", 3, ""),
    ],
    ids=["in a class", "hangup", "CPU time", "SIGTERM", "SIGKILL", "SIGSEGV", "abort", "exit of a library", "exit"],
)
def test_how_the_work_has_ended_is_said_in_one_sentence(tmp_path, does, code, says):
    script = does if does == IN_A_CLASS else GUARDED.format(does)
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == code
    assert done.stderr.startswith(f"Error: {says}" if says else "")
    assert len(done.stderr.splitlines()) == (1 if says else 0)


FAILS = {"packing": {"disks": 16, "seed": 10}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
FAILS["ramp"] = {"step": 0.11, "until": 0.11}

FAILING = """
import sys
from mpi4py import MPI
from faultgouge.cli import main
from faultgouge.pywrap import Engine, EngineError

failing_rank, wanted = int(sys.argv.pop()), int(sys.argv.pop())
try_displacement, calls = Engine.try_displacement, 0

def failing(self, *arguments):
    global calls
    calls += 1
    if calls == wanted and failing_rank in (-1, MPI.COMM_WORLD.rank):
        raise EngineError(f"LAMMPS stopped: it was told to at call {wanted}.")
    return try_displacement(self, *arguments)

Engine.try_displacement = failing
main()
"""


@pytest.fixture(scope="module")
def settled(faultgouge_here_in, tmp_path_factory):
    """A folder with the scene of the packing that is settled already."""
    folder = tmp_path_factory.mktemp("settled")
    (folder / "scene.toml").write_text(toml(FAILS))
    faultgouge_here_in(folder, "settle", "scene.toml", "-o", "settled.h5")
    (folder / "scene.toml").write_text(toml(FAILS | {"packing": {"file": "settled.h5"}}))
    return folder


@pytest.mark.ranks
@pytest.mark.parametrize(("rank", "call"), [(1, 1), (-1, 30), (0, 30)])
@pytest.mark.long
def test_its_sentence_reaches_the_command_on_two_ranks(settled, rank, call):
    command = [*on_ranks(2), sys.executable, "-c", FAILING, "onset", "scene.toml", str(call), str(rank)]
    done = subprocess.run(command, cwd=settled, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    says = [line for line in done.stderr.splitlines() if line.startswith("Error:")]
    assert says == [f"Error: LAMMPS stopped: it was told to at call {call}."]


@pytest.mark.slow
def test_no_call_is_taken_for_a_missing_onset(settled, monkeypatch, faultgouge_here_in):
    calls, fails, try_displacement = [0], [0], Engine.try_displacement

    def counted(self, *arguments):
        calls[0] += 1
        if calls == fails:
            raise EngineError(f"LAMMPS stopped: it was told to at call {fails[0]}.")
        return try_displacement(self, *arguments)

    monkeypatch.setattr(Engine, "try_displacement", counted)
    faultgouge_here_in(settled, "onset", "scene.toml")
    asked = range(1, calls[0] + 1, 12)
    assert len(asked) > 1
    for wanted in asked:
        calls[0], fails[0] = 0, wanted
        said = faultgouge_here_in(settled, "onset", "scene.toml", code=1).stderr
        assert said.splitlines()[-1] == f"Error: LAMMPS stopped: it was told to at call {wanted}."
