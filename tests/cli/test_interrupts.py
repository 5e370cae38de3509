"""Ctrl-C and SIGTERM: one sentence, 130 or 143, and soon, whatever the command is doing."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from reference_layer import BIN, LAYER, toml

from faultgouge.analysis import RunFile

ASKED = {"perturb": {"fx": 2e-5, "time": 1e4}, "eruptions": {"load": [0.02], "time": 1e3}}
SCENE = LAYER + toml({"ramp": {"step": 1e-5, "until": 0.02}} | ASKED)

SWEPT = {"packing": {"disks": 300}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": {"step": 1e-4, "until": 0.02}}
SWEEP = 'task = "onset"\n[sweep]\n"packing.seed" = "1:50"\n' + toml(SWEPT, "scene.")

SOON = 8.0
"""Seconds within which a command ends after a signal: its guard takes 0.8 to 1.5, and a busy machine takes the rest."""


def interrupted(folder, command, number, when, group=False):
    """Exit code and errors of a command that gets a signal as soon as `when()` is true."""
    running = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + 120
    while not when():
        assert running.poll() is None, running.communicate()[1]
        assert time.monotonic() < deadline, "the command does not get to where it is to be interrupted"
        time.sleep(0.02)
    begin = time.monotonic()
    os.killpg(running.pid, number) if group else running.send_signal(number)
    _, errors = running.communicate(timeout=30)
    seconds = time.monotonic() - begin
    assert is_gone(running.pid)
    return running.returncode, errors, seconds


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
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("number", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
@pytest.mark.slow
def test_a_ramp_says_what_is_kept(tmp_path, ranks, number, code, word):
    (tmp_path / "scene.toml").write_text(SCENE)
    command = [BIN / "faultgouge", "ramp", "scene.toml"]
    if ranks > 1:
        command = [BIN / "mpiexec", "-n", str(ranks), *command]
    path = tmp_path / "run.h5"
    returned, errors, seconds = interrupted(tmp_path, command, number, lambda: equilibria(path) > 3)
    assert returned == code
    assert seconds < SOON
    says = [line for line in errors.splitlines() if line.startswith("Error:")]
    assert len(says) == 1
    assert says[0].startswith(f"Error: {word}: run.h5 holds")
    assert says[0].endswith("the same command goes on from there.")
    assert "Traceback" not in errors
    with RunFile(path) as run:
        assert f"{len(run)} equilibria" in says[0]
        assert not run.complete


@pytest.mark.slow
def test_a_terminal_interrupts_all_processes_of_the_command(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    path, command = tmp_path / "perturb.h5", [BIN / "faultgouge", "perturb", "scene.toml"]
    returned, errors, seconds = interrupted(tmp_path, command, signal.SIGINT, lambda: equilibria(path) > 0, group=True)
    assert returned == 130
    assert seconds < SOON
    ahead, says = errors.strip().splitlines()
    assert ahead.startswith("perturb: about ")
    assert says.startswith("Error: interrupted: perturb.h5 holds 1 equilibrium")


def simulates(folder):
    """Whether a process that works in a folder has LAMMPS in its memory."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if (process / "cwd").readlink() == folder and "liblammps" in (process / "maps").read_text():
                return True
        except OSError:  # another user's, or gone
            continue
    return False


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("onset scene.toml -o onset.json", "nothing was written, and the same command begins anew"),
        ("explain scene.toml", "nothing was written, and the same command begins anew"),
        ("reproduce scene.toml -o out", "what is in out so far is kept; the same command begins anew and replaces it"),
        ("report --quick -o out", "out has the studies that were finished; the same command begins anew and replaces"),
        ("stability --quick -o out", "out has the cases that were finished; the same command begins anew and replaces"),
        ("eruptions scene.toml -o out", "out/eruptions.jsonl has the runs that were over; the same command goes on"),
        ("sweep sweep.toml -o out", "out/results.jsonl has the scenes that have ended; the same command goes on from"),
    ],
)
@pytest.mark.slow
@pytest.mark.long
def test_what_is_kept_is_said(tmp_path, command, says):
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "sweep.toml").write_text(SWEEP)
    arguments = [BIN / "faultgouge", *command.split()]
    returned, errors, seconds = interrupted(tmp_path, arguments, signal.SIGINT, lambda: simulates(tmp_path))
    assert returned == 130
    assert seconds < SOON
    *ahead, last = errors.strip().splitlines()
    assert last.startswith(f"Error: interrupted: {says}")
    assert not any(line.startswith(("Error", "Traceback")) for line in ahead)


LARGE = SWEPT | {"packing": {"disks": 5000, "seed": 1, "width": 84.3}, "ramp": {"step": 4e-4, "until": 0.02}}


@pytest.mark.slow
@pytest.mark.long
def test_a_long_search_goes_on_to_the_bit(tmp_path):
    """Killed, interrupted and continued on one process; and in one piece."""
    (tmp_path / "scene.toml").write_text(toml(LARGE))
    subprocess.run([BIN / "faultgouge", "settle", "scene.toml"], cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "settled.toml").write_text(toml(LARGE | {"packing": {"file": "run.h5"}}))
    command = [BIN / "faultgouge", "onset", "settled.toml", "-o", "onset.json"]
    slices = tmp_path / "onset.json.slices"

    def known():
        return len(list(slices.glob("*/*-*.npz")))

    returned, *_ = interrupted(tmp_path, command, signal.SIGKILL, lambda: known() >= 10, group=True)
    assert returned == -signal.SIGKILL
    first = known()
    returned, errors, _ = interrupted(tmp_path, command, signal.SIGINT, lambda: known() >= first + 10)
    assert returned == 130
    says = "Error: interrupted: onset.json.slices has what was found so far; the same command goes on from there."
    assert errors.splitlines()[-1] == says
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    assert not slices.exists()
    subprocess.run([*command[:-1], "whole.json"], cwd=tmp_path, check=True, capture_output=True)
    assert (tmp_path / "onset.json").read_bytes() == (tmp_path / "whole.json").read_bytes()


IN_A_LIBRARY = """
from faultgouge.guard import guarded, keeps

def work():
    import numpy, pathlib, scipy.linalg
    matrix = numpy.random.default_rng(0).normal(size=(1500, 1500))
    keeps("nothing is kept")
    pathlib.Path("begun").touch()
    scipy.linalg.eig(matrix)  # half a minute without a Python instruction

guarded(work)
"""


@pytest.mark.slow
def test_a_long_call_of_a_library_does_not_hold_the_signal(tmp_path):
    command = [sys.executable, "-c", IN_A_LIBRARY]
    begun = (tmp_path / "begun").exists
    returned, errors, seconds = interrupted(tmp_path, command, signal.SIGTERM, begun)
    assert (returned, errors) == (143, "Error: terminated: nothing is kept.\n")
    assert seconds < SOON


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


def test_an_interrupt_while_a_class_is_made_is_no_error_of_the_program(tmp_path):
    command = [sys.executable, "-c", IN_A_CLASS]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 130
    assert done.stderr == "Error: interrupted: nothing was written, and the same command begins anew.\n"


@pytest.mark.parametrize(
    ("ends", "code", "says"),
    [
        ("os.abort()", 1, "a library has ended the command (SIGABRT)"),
        ("os.kill(os.getpid(), 11)", 1, "a library has ended the command (SIGSEGV)"),
        ("os.kill(os.getpid(), 9)", 137, "killed from outside, for want of memory perhaps"),
        ("sys.exit(3)", 3, ""),
    ],
)
def test_what_a_library_ends_is_said(tmp_path, ends, code, says):
    script = f"import os, sys; from faultgouge.guard import guarded; guarded(lambda: {ends})"
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == code
    assert says in done.stderr
    assert len(done.stderr.splitlines()) == (1 if says else 0)


@pytest.mark.slow
@pytest.mark.long
def test_the_work_ends_with_its_guard_and_goes_on_to_the_bit(faultgouge, tmp_path):
    (tmp_path / "scene.toml").write_text(LAYER + toml({"ramp": {"step": 1e-3, "until": 0.024}}))
    killed, command = tmp_path / "killed.h5", [BIN / "faultgouge", "ramp", "scene.toml", "-o", "killed.h5"]
    returned, *_ = interrupted(tmp_path, command, signal.SIGKILL, lambda: equilibria(killed) > 3)
    assert returned == -signal.SIGKILL
    for name in ("killed.h5", "whole.h5"):
        faultgouge("ramp", "scene.toml", "-o", name)
    with h5py.File(killed) as one, h5py.File(tmp_path / "whole.h5") as other:
        for name in ("particles/disks/position/value", "observables/contacts/value", "observables/evaluations/value"):
            assert np.array_equal(one[name][...], other[name][...], equal_nan="evaluations" not in name)
        assert len(one["observables/fx/value"]) == 25
