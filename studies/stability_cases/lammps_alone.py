"""Input that LAMMPS must refuse, run by the program ``lmp`` in a process of its own.

An error that one rank alone meets ends MPI, and one inside of the set-up can end in a crash when the instance closes:
nothing of that may take the study along. Rank 0 runs the program, all know what it said.
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
"""What LAMMPS may take for a handful of disks; more is a hang."""

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
    world = MPI.COMM_WORLD
    said = _said(HEAD + placed + LAW + commands) if world.rank == 0 else None
    return refusal(world.bcast(said), words)


def _said(script: str) -> str:
    """The error of a script, or what happened instead."""
    # a process of its own must not think that it belongs to the ranks that started it
    alone = {key: value for key, value in os.environ.items() if not key.startswith(("PMI", "HYDR", "MPI", "PMIX"))}
    with tempfile.TemporaryDirectory(prefix="faultgouge-") as folder:
        file = Path(folder) / "in"
        file.write_text(script)
        command = [str(Path(sys.executable).with_name("lmp")), "-in", str(file), "-log", "none"]
        try:
            done = subprocess.run(command, cwd=folder, env=alone, capture_output=True, text=True, timeout=SECONDS)
        except subprocess.TimeoutExpired:
            return f"LAMMPS did not end\nwithin {SECONDS:g} seconds"
    if done.returncode < 0:
        return f"LAMMPS crashed\nwith signal {-done.returncode}"
    errors = [line for line in (done.stdout + done.stderr).splitlines() if line.startswith("ERROR")]
    if not errors:
        return f"LAMMPS did not complain\n(exit code {done.returncode})"
    return PLACE.sub("", errors[0].split(": ", 1)[1])
