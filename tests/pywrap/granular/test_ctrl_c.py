"""Ctrl-C while copies of the process work: it goes to the program and to its copies, of which none is left."""

import subprocess
import sys
from pathlib import Path

import pytest
from granular_packings import DECKS

SET_UP = """
import os, signal, threading, time
from contextlib import suppress
from pathlib import Path
from mpi4py import MPI
from faultgouge.pywrap import compare_motion, from_lammps, lammps_instance, lammps_path
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
lmp = lammps_instance(MPI.COMM_SELF, Path("log.lammps"))
lmp.file("{deck}")
ctrl_c = lambda: os.killpg(os.getpgid(0), signal.SIGINT)
"""

MOTION = """
found = from_lammps(lmp, balance=1e9)
fork = os.fork


def fork_before_ctrl_c():
    child = fork()
    if child:
        ctrl_c()
        time.sleep(0.1)
    return child


if at_the_fork:
    os.fork = fork_before_ctrl_c
else:
    threading.Timer(0.5, ctrl_c).start()
with suppress(KeyboardInterrupt):
    compare_motion(lmp, found, 1e6, 1e-5, timestep=1e-3)
    print("not interrupted")
with suppress(ChildProcessError):
    print("a copy is left:", os.waitpid(-1, 0))
print("ends")
"""

PATH = """
def tilt(lmp, value):
    if value > 0.15:
        time.sleep(60)
    lmp.command(f"fix load all gravity 1.0 vector {value} 0 -1")


with lammps_path(lmp, tilt) as path:
    first = path(0.1)
    threading.Timer(1.0, ctrl_c).start()
    began = time.monotonic()
    with suppress(KeyboardInterrupt):
        path(0.2)
    print(time.monotonic() - began < 30)
    print(path(0.1) == first, abs(path(0.05).fx - 0.05) < 1e-12)
time.sleep(0.2)
alive = []
for each in Path("/proc").glob("[0-9]*/stat"):
    with suppress(OSError):
        state, _, of = each.read_text().rpartition(")")[2].split()[:3]
        alive += [each] * (int(of) == os.getpgid(0) and state != "Z" and each.parent.name != str(os.getpid()))
print(alive)
"""


def lines_of(folder: Path, script: str) -> list[str]:
    """What a script prints, as a program with a group of processes of its own."""
    words = [sys.executable, "-c", f"{SET_UP.format(deck=DECKS / 'ball.in')}\n{script}"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=100, start_new_session=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.long
@pytest.mark.parametrize("at_the_fork", [False, True])
def test_ctrl_c_ends_the_copy(tmp_path, at_the_fork):
    """A copy that would run for days."""
    assert lines_of(tmp_path, f"at_the_fork = {at_the_fork}\n{MOTION}") == ["ends"]


@pytest.mark.long
def test_ctrl_c_ends_a_relaxation_and_leaves_the_path(tmp_path):
    """Loads that were reached stay."""
    assert lines_of(tmp_path, PATH)[-3:] == ["True", "True True", "[]"]
