"""What a look at a live LAMMPS costs, and its proof, copies of the process included: `look.py [--fast]`."""

import os
import sys
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mpi4py import MPI

from faultgouge.pywrap import from_lammps, lammps_instance

HEAD = """## A look at a live LAMMPS, and its proof

`from_lammps` without and with the proof of the result by a few of LAMMPS's own steps, in {turns} turns, with quartiles
of the ratio. Spheres of `gran/hertz/history` rest on a simple cubic lattice, with six contacts each.

| spheres | look, s | proof, s | proof : look |
|---|---|---|---|"""

LAW = "1e5 3e4 40 20 0.5 1"


def spheres(count: int, folder: str) -> Any:
    """A LAMMPS with about so many spheres at rest."""
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
    """Print the section."""
    few = "--fast" in sys.argv
    turns = 3 if few else 7
    print(HEAD.format(turns=turns))
    for count in (125,) if few else (125, 1000, 10_648):
        with TemporaryDirectory() as folder:
            lmp = spheres(count, folder)
            seconds(lmp, True)  # laws are measured, and modules imported, once
            found = np.array([[seconds(lmp, prove) for prove in (False, True)] for _ in range(turns)])
            looks, proofs = found[:, 0], found[:, 1] - found[:, 0]
            low, median, high = np.percentile(proofs / looks, [25, 50, 75])
            print(
                f"| {lmp.get_natoms():.0f} | {np.median(looks):.2f} | {np.median(proofs):.2f} | "
                f"{median:.2f} [{low:.2f}, {high:.2f}] |",
                flush=True,
            )
            lmp.close()


if __name__ == "__main__":
    main()
