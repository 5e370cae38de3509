"""What a look at a live LAMMPS costs, and its proof: seconds of the processor, copies of the process included.

Spheres of gran/hertz/history rest on a simple cubic lattice in a box that is periodic along all axes; each has six
contacts. Looks without and with the proof are taken in turns, and the medians are printed with quartiles.

    python benchmarks/look.py [--spheres 100 1000 10000] [--turns 5]
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from faultgouge.pywrap import from_lammps

LAW = "1e5 3e4 40 20 0.5 1"


def spheres(count: int, folder: str) -> Any:
    """A LAMMPS with about so many spheres at rest."""
    from mpi4py import MPI

    from faultgouge.pywrap.lammps.instance import lammps_instance

    side = round(count ** (1 / 3))
    lmp = lammps_instance(MPI.COMM_SELF, f"{folder}/log.lammps")
    for line in (
        "units lj", "atom_style sphere", "atom_modify map array", "boundary p p p", "newton off", "comm_modify vel yes",
        "lattice sc 1.0", f"region box block 0 {side} 0 {side} 0 {side}", "create_box 1 box", "create_atoms 1 box",
        "set group all diameter 1.01", "set group all density 1.0", f"pair_style gran/hertz/history {LAW}",
        "pair_coeff * *", "fix move all nve/sphere", "timestep 1e-4", "thermo 1000000", "run 0 post no",
    ):  # fmt: skip
        lmp.command(line)
    return lmp


def seconds(lmp: Any, prove: bool) -> float:
    """Of one look, with those of its copies."""
    begin = os.times()
    from_lammps(lmp, prove=prove)
    end = os.times()
    return sum(end[:4]) - sum(begin[:4])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spheres", type=int, nargs="*", default=[100, 1000, 10000])
    parser.add_argument("--turns", type=int, default=5)
    options = parser.parse_args()
    print(f"{'spheres':>8s}{'look s':>10s}{'proof s':>10s}{'proof : look':>26s}", flush=True)
    for count in options.spheres:
        with TemporaryDirectory() as folder:
            lmp = spheres(count, folder)
            seconds(lmp, True)  # laws are measured, and modules imported, once
            found = np.array([[seconds(lmp, prove) for prove in (False, True)] for _ in range(options.turns)])
            looks, proofs = found[:, 0], found[:, 1] - found[:, 0]
            low, median, high = np.percentile(proofs / looks, [25, 50, 75])
            print(
                f"{lmp.get_natoms():8.0f}{np.median(looks):10.3f}{np.median(proofs):10.3f}"
                f"{f'{median:.2f} [{low:.2f}, {high:.2f}]':>26s}",
                flush=True,
            )
            lmp.close()


if __name__ == "__main__":
    main()
