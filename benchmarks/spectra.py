"""Time and memory of `spectrum`: LAPACK's dense solver beside slices of the spectrum, for packings of growing size.

Square packings of disks after `LOADS` increments of F_x by 2/N, as of benchmarks/scale.py, and beds of spheres of two
sizes on a slope in LAMMPS, gran/hertz/history. Each spectrum is computed in a process of its own on one thread, and the
time is that of the processor. LAPACK is left out beyond some coordinates, as its time grows with their cube. The last
columns compare all complex pairs of both, relative to each.

    python benchmarks/spectra.py [--disks 100 300 1000 3000] [--spheres 150 500 1000] [--lapack 4000]

The packings of the largest sizes take minutes to settle.
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import multiprocessing
import resource
import time
from tempfile import TemporaryDirectory

import numpy as np
from scale import scene

import faultgouge.analysis.motion.spectrum as spectrum_module
from faultgouge.analysis import Configuration, Packing, Spectrum, dynamical_matrix, spectrum
from faultgouge.analysis.has_configuration import HasConfiguration
from faultgouge.pywrap import Engine, equilibrate, from_lammps, settle

LOADS = 10
"""Increments of F_x, after which packings of all sizes have complex pairs."""

LAW = "hertz/history 1e5 3e4 40 20 0.5 1"

RUNS = 10
"""Runs of 10,000 steps at the most, until the residual force is 1e-8 of the mean normal force."""


def disks(count: int) -> Packing:
    """A settled packing under F_x."""
    here = settle(scene(count, 1))
    with Engine(here.packing) as engine:
        for k in range(1, LOADS + 1):
            here = equilibrate(engine, here, 2 * k / count)
    return here.packing


def spheres(count: int) -> Configuration:
    """A bed on a slope, in a box that is a little lower than wide."""
    from mpi4py import MPI

    from faultgouge.pywrap.lammps.instance import lammps_instance

    side = round(count ** (1 / 3))
    rng, k = np.random.default_rng(1), np.arange(count)
    places = np.stack([k % side, k // side % side, k // side**2], axis=1) * [1, 1, 1.02] + [0.5, 0.5, 0.55]
    places[:, :2] += rng.uniform(-0.1, 0.1, (count, 2))
    with TemporaryDirectory() as folder:
        lmp = lammps_instance(MPI.COMM_WORLD, f"{folder}/log.lammps")
        for line in (
            "units lj", "dimension 3", "atom_style sphere", "atom_modify map array", "boundary p p f", "newton off",
            "comm_modify vel yes", f"region box block 0 {side} 0 {side} 0 {3 * side + 5}", "create_box 2 box",
            "neighbor 0.1 bin", "neigh_modify every 1 delay 0 check yes",
        ):  # fmt: skip
            lmp.command(line)
        lmp.create_atoms(count, None, rng.integers(1, 3, count).tolist(), places.ravel())
        for line in (
            "set type 1 diameter 0.8", "set type 2 diameter 1.0", "set group all density 1.0", f"pair_style gran/{LAW}",
            "pair_coeff * *", f"fix floor all wall/gran {LAW} zplane 0 NULL contacts",
            "fix load all gravity 1.0 vector 0.1 0 -1", "fix move all nve/sphere", "fix drag all viscous 1.0",
            "timestep 1e-3",
        ):  # fmt: skip
            lmp.command(line)
        for _ in range(RUNS):
            lmp.command("run 10000 post no")
            found = from_lammps(lmp, balance=np.inf)
            if found.residual < 1e-8 * found.contacts.normal_force.mean():
                break
        lmp.close()
    return found


def measured(packing: HasConfiguration, sliced: float) -> tuple[Spectrum, float, float]:
    """A spectrum, in slices from so many coordinates on, with its seconds and GB; in a process of its own."""
    with multiprocessing.get_context("fork").Pool(1) as pool:
        return pool.apply(_measure, (packing, sliced))


def _measure(packing: HasConfiguration, sliced: float) -> tuple[Spectrum, float, float]:
    spectrum_module.SLICED = sliced  # type: ignore[assignment]  # infinity: no slices at all
    begin = time.process_time()
    found = spectrum(packing)
    return found, time.process_time() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def difference(one: Spectrum, other: Spectrum) -> float:
    """The largest difference of a pair, relative to the pair, and infinite if there are more of one kind."""
    a, b = (np.array([pair.eigenvalue for pair in each.pairs]) for each in (one, other))
    if len(a) != len(b):
        return np.inf
    return float((np.abs(a[:, None] - b).min(axis=1) / np.abs(a)).max(initial=0.0))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--disks", type=int, nargs="*", default=[100, 300, 1000, 3000])
    parser.add_argument("--spheres", type=int, nargs="*", default=[150, 500, 1000])
    parser.add_argument("--lapack", type=int, default=4000, help="coordinates up to which LAPACK is asked, too")
    options = parser.parse_args()
    print(
        f"{'':14s}{'coordinates':>12s}{'pairs':>7s}{'LAPACK s':>10s}{'GB':>6s}{'slices s':>10s}{'GB':>6s}{'apart':>9s}"
    )
    for make, counts in ((disks, options.disks), (spheres, options.spheres)):
        for count in counts:
            packing = make(count)
            size = dynamical_matrix(packing)[0].shape[0]
            found, seconds, memory = measured(packing, 0)
            dense = f"{'-':>10s}{'-':>6s}"
            apart = "-"
            if size <= options.lapack:
                known, lapack_seconds, lapack_memory = measured(packing, np.inf)
                dense = f"{lapack_seconds:10.2f}{lapack_memory:6.2f}"
                apart = f"{difference(known, found):.0e}"
            name = f"{count} {make.__name__}"
            print(
                f"{name:14s}{size:12d}{len(found.pairs):7d}{dense}{seconds:10.2f}{memory:6.2f}{apart:>9s}", flush=True
            )


if __name__ == "__main__":
    main()
