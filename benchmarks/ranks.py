"""Dynamics on several ranks: what each of them sends and holds, of crystals of 100,000 and 1,000,000 disks.

A hexagonal crystal with friction on the floor, under the load, as wide as high, in the box that the driver would give
it, by the deck system.in. The ranks may be more than the cores: what is counted does not depend on them.

    disks, ghosts   of a rank, the most of all ranks
    messages, kB    that a rank sends in a time step, mean over the steps, the most of all ranks
    reductions      over all ranks, in a time step
    memory          of a rank beyond that before LAMMPS starts, the most of all ranks at their peaks; MB
    a disk          that memory, of all ranks, over the disks; bytes
    time            of a rank's processor in a time step, the most of all ranks; ms

    python benchmarks/ranks.py [--disks 100000 1000000] [--ranks 1 2 4] [--decks FOLDER] [--steps 50]

`--decks` names another folder with system.in and friction.in, to be compared. Needs a C compiler.
"""

import argparse
import ctypes
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

BIN = Path(sys.executable).parent
HERE = Path(__file__).parent
COLUMNS = ("disks", "ghosts", "messages", "kB", "reductions", "memory", "time")


def one_rank(data: str, decks: str, steps: int) -> None:
    """What a process of mpiexec does; rank 0 prints the row."""
    from mpi4py import MPI

    from faultgouge.pywrap.lammps.instance import lammps_instance

    counts = [ctypes.c_long.in_dll(ctypes.CDLL(None), name) for name in ("messages_sent", "bytes_sent", "collectives")]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    lammps = lammps_instance(MPI.COMM_WORLD, None)
    lammps.commands_list([f"variable decks index {decks}", f"variable data index {data}", f"include {decks}/system.in"])
    lammps.commands_list(["fix move all nve/disc 1.0", "timestep 1e-4", "run 1"])
    start, spent = [count.value for count in counts], time.process_time()
    lammps.command(f"run {steps} pre no")
    spent = time.process_time() - spent
    messages, sent, reductions = ((now.value - then) / steps for now, then in zip(counts, start, strict=True))
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    row = [lammps.extract_setting("nlocal"), lammps.extract_setting("nghost"), messages, sent / 1e3, reductions, memory]
    rows = MPI.COMM_WORLD.gather([*row, 1e3 * spent / steps])
    if rows:
        a_disk = sum(each[5] for each in rows) * 2**20 / lammps.get_natoms()
        print(json.dumps({**dict(zip(COLUMNS, np.max(rows, axis=0), strict=True)), "a disk": a_disk}))
    lammps.close()


def measured(data: Path, ranks: int, decks: Path, steps: int, library: Path) -> dict[str, float]:
    """One row of the table."""
    command = [BIN / "mpiexec", "-n", str(ranks), "-genv", "LD_PRELOAD", library, sys.executable, __file__]
    done = subprocess.run(
        [*command, "--one", data, "--decks", decks, "--steps", str(steps)], capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    """Print the table."""
    from faultgouge.assessment.stability.cases.packings import crystal
    from faultgouge.pywrap.lammps.data_file import data_file
    from faultgouge.pywrap.lammps.decks import DECKS

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--disks", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--decks", type=Path, default=Path(DECKS))
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one_rank(options.one, str(options.decks), options.steps)
        return
    with TemporaryDirectory() as folder:
        library = Path(folder) / "count.so"
        headers = next(Path(sys.prefix).glob("include/mpi.h")).parent
        subprocess.run(
            [os.environ.get("CC", "cc"), "-shared", "-fPIC", f"-I{headers}", HERE / "count_messages.c", "-o", library],
            check=True,
        )
        print(f"{'all disks':>10s}{'ranks':>6s}" + "".join(f"{name:>11s}" for name in (*COLUMNS, "a disk")))
        for disks in options.disks:
            data = Path(folder) / "crystal.data"
            columns = round((disks * 0.75**0.5) ** 0.5)
            data.write_text(data_file(crystal(columns, round(disks / columns))))
            for ranks in options.ranks:
                row = measured(data, ranks, options.decks, options.steps, library)
                print(f"{disks:10d}{ranks:6d}" + "".join(f"{value:11.4g}" for value in row.values()), flush=True)


if __name__ == "__main__":
    main()
