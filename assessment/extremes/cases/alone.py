"""Input that LAMMPS must refuse, run by the programs ``lmp`` or ``faultgouge`` in a separate process.

An error on one rank alone ends MPI, and an error inside the set-up can cause a crash when the instance closes. Neither
may end the study. Rank 0 runs the program, and all ranks receive its output.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from mpi4py import MPI

from .case import Outcome, refusal

SECONDS = 60.0
"""Longest time that a program may take for a handful of disks, s; more is a hang."""

PLACE = re.compile(r" \([^ ()]*:\d+\)$")
"""File and line of LAMMPS's errors."""

HEAD = """
units           lj
dimension       2
boundary        p f p
atom_style      sphere
comm_modify     vel yes
region          box block 0 10 -2 12 -0.5 0.5
create_box      1 box
"""

LAW = """
set             group all diameter 1.0
set             group all mass 1.0
pair_style      mindlin/smooth 2e5 5e4 1.0
pair_coeff      * *
fix             floor all wall/mindlin/smooth 2e5 5e4 1.0 ylo 0.0
fix             move all nve/disc 1.0
"""


def refused_by_lammps(disks: list[tuple[float, float]], commands: str, words: str) -> Outcome:
    """Disks of diameter one at given places, and commands that must end with an error which says the words."""
    placed = "".join(f"create_atoms 1 single {x!r} {y!r} 0.0\n" for x, y in disks)
    return expect_refusal("lmp -in FILE -log none", HEAD + placed + LAW + commands, words)


def expect_refusal(command: str, text: str, words: str) -> Outcome:
    """A program that must refuse a FILE with this text, with an error which says the words."""
    world = MPI.COMM_WORLD
    said = _last_error(command.split(), text) if world.rank == 0 else None
    return refusal(world.bcast(said), words)


def _last_error(command: list[str], text: str) -> str:
    """The error of a program that reads a FILE with this text, or what happened instead."""
    program = str(Path(sys.executable).with_name(command[0]))
    # a process of its own must not think that it belongs to the ranks that started it
    own = {key: value for key, value in os.environ.items() if not key.startswith(("PMI", "HYDR", "MPI"))}
    with tempfile.TemporaryDirectory(prefix="faultgouge-") as folder:
        (Path(folder) / "FILE").write_text(text)
        try:
            done = subprocess.run(
                [program, *command[1:]], cwd=folder, env=own, capture_output=True, text=True, timeout=SECONDS
            )
        except subprocess.TimeoutExpired:
            return f"no end\nwithin {SECONDS:g} seconds"
    if done.returncode < 0:
        return f"a crash\nwith signal {-done.returncode}"
    errors = [line for line in (done.stdout + done.stderr).splitlines() if line.lower().startswith("error")]
    if not errors:
        return f"no error\nwith exit code {done.returncode}"
    return PLACE.sub("", errors[0].split(": ", 1)[1])
