"""Time and memory of `stability` for 10,000 spheres with contacts at Coulomb's bound, on one thread.

Fifty spheres are poured on a slope in LAMMPS, come to rest, and are copied side by side: a bed whose motion is known
from that of the fifty, which are followed in smaller steps from more pushes. One of the two beds rests, and the other
one grows. Beds of as many spheres as one likes are poured, too, and a bed of a thousand spheres, ten deep, with a
restitution of 0.8, comes to rest and is copied. The columns are: contacts at the bound; the verdict;
the growth rate of D, or the largest D over the square of the push; how long the motion was followed; the rate below
which linear growth may not have been seen; seconds of the processor; and memory.

    python benchmarks/verdict.py [--copies 15 16] [--poured 2000] [--deep 10]

Without the copies, `--copies 0 0`, it has the beds that are poured alone.
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import multiprocessing
import resource
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mpi4py import MPI

from faultgouge.analysis import Configuration, LinearisedContacts, Stability, stability
from faultgouge.analysis.contacts import PER_CONTACT
from faultgouge.pywrap import from_lammps, lammps_instance, relax

sys.path.insert(0, str(Path(__file__).parent.parent))
from research.lammps_laws.compute import pour, rest

BEDS = {
    "rests": ("granular hertz, mindlin/force", 0.3, 40.0),
    "grows": ("gran/hertz/history", 0.3, 4.0),
}
"""Law, slope and dashpots of the fifty spheres."""

POURED = ("gran/hertz/history", 0.0, (40.0, 4.0))
"""Those of beds that are poured as a whole: on a slope one or the other of thousands of spheres rolls on for ever."""


DEEP = """
units lj
atom_style sphere
boundary p p f
newton off
comm_modify vel yes
region box block 0 {width} 0 {width} 0 60
create_box 2 box
{places}
set type 1 diameter 0.8
set type 2 diameter 1.0
set group all density 1.0
pair_style granular
pair_coeff * * hertz/material 1e5 0.8 0.3 tangential mindlin NULL 1.0 0.5 damping tsuji
fix floor all wall/gran granular hertz/material 1e5 0.8 0.3 tangential mindlin NULL 1.0 0.5 damping tsuji &
  zplane 0 NULL contacts
fix load all gravity 1.0 vector 0 0 -1
fix move all nve/sphere
timestep 1e-3
fix drag all viscous 0.5
run 15000 post no
fix drag all viscous 4.0
fix spin all viscous/sphere 0.4
run 10000 post no
"""
"""Deck of the bed that is ten deep."""


def bed(law: str, count: int, slope: float, dashpot: float) -> Configuration:
    """Spheres at rest on a slope."""
    with TemporaryDirectory() as folder:
        lmp = pour(law, 3, count, 0.5, 1, Path(folder) / "log", dashpot)
        lmp.command(f"variable slope equal {slope}")
        found = rest(lmp)
        lmp.close()
    if found is None:
        raise SystemExit(f"{count} spheres on a slope of {slope} do not come to rest: take a smaller slope.")
    return found


def deep_bed(across: int = 10, deep: int = 10) -> Configuration:
    """Spheres of two sizes that fall into a periodic box with a floor, in as many layers, and come to rest."""
    random, width = np.random.default_rng(1), 1.05 * across
    places = []
    for k in range(across**2 * deep):
        x, y = (np.array(divmod(k % across**2, across)) + 0.5) * 1.05 + random.uniform(-0.1, 0.1, 2)
        z = 0.6 + 1.05 * (k // across**2) + random.uniform(0, 0.02)
        places.append(f"create_atoms {random.integers(1, 3)} single {x} {y} {z}")
    with TemporaryDirectory() as folder:
        lmp = lammps_instance(MPI.COMM_SELF, str(Path(folder) / "log"))
        lmp.commands_string(DEEP.format(width=width, places="\n".join(places)))
        relax(lmp, balance=1e-9)
        found = from_lammps(lmp)
        lmp.close()
    return found


def tiled(cell: Configuration, across: int, deep: int) -> Configuration:
    """Copies of spheres that are periodic in x and y, side by side, in balance as they are."""
    c, copies, edges = cell.contacts, across * deep, np.diag(cell.box)[:2]
    branch = np.where(np.isfinite(c.distance), c.distance, 0.0)[:, None] * c.normal
    apart = (cell.position[c.i] - np.where(c.wall[:, None], cell.position[c.i], cell.position[c.j] + branch))[:, :2]
    image = np.round(apart / edges).astype(int)  # of j, which the contact is with
    x, y = (place.ravel()[:, None] for place in np.divmod(np.arange(copies), deep))
    other = (x + image[:, 0]) % across * deep + (y + image[:, 1]) % deep
    given = {name: np.concatenate([getattr(c, name)] * copies) for name in PER_CONTACT}
    given["i"] = (c.i + len(cell) * np.arange(copies)[:, None]).ravel()
    given["j"] = np.where(c.wall, c.j, c.j + len(cell) * other).ravel()
    shift = np.column_stack([edges[0] * x, edges[1] * y, 0 * x])
    each = {name: np.concatenate([getattr(cell, name)] * copies) for name in ("radius", "mass", "inertia", "load")}
    return Configuration(
        dimension=3,
        position=(cell.position + shift[:, None]).reshape(-1, 3),
        contacts=LinearisedContacts(**given),
        box=cell.box * np.array([across, deep, 1])[:, None],
        origin=cell.origin,
        periodic=cell.periodic,
        **each,
    )


def measured(configuration: Configuration) -> tuple[Stability, float, float]:
    """A verdict with its seconds and GB, in a process of its own."""
    with multiprocessing.get_context("fork").Pool(1) as pool:
        return pool.apply(_measure, (configuration,))


def _measure(configuration: Configuration) -> tuple[Stability, float, float]:
    begin = time.process_time()
    found = stability(configuration)
    return found, time.process_time() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def show(name: str, configuration: Configuration) -> None:
    """Print a row."""
    found, seconds, memory = measured(configuration)
    verdict = {True: "rests", False: "grows", None: "not known"}[found.stable]
    told = found.one_sided or {"growth_rate": found.growth_rate, "amplification": np.nan, "time": 0.0}
    size = f"exp({told['growth_rate']:.3g} t)" if found.stable is False else f"{told['amplification']:.3g}"
    print(
        f"{name:24s}{len(configuration):8d}{found.at_bound:9d}{verdict:>11s}{size:>14s}{told['time']:8.3g}"
        f"{found.sticking.searched:9.2g}{seconds:8.0f}{memory:6.2f}",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--copies", type=int, nargs=2, default=[15, 16], help="along x and along y; 0 0 for none")
    parser.add_argument("--poured", type=int, nargs="*", default=[], help="spheres of beds that are poured")
    parser.add_argument("--deep", type=int, default=0, help="copies of a bed of a thousand spheres, ten deep")
    options = parser.parse_args()
    print(
        f"{'':24s}{'spheres':>8s}{'at bound':>9s}{'':>11s}{'D':>14s}{'t':>8s}{'sought':>9s}{'s':>8s}{'GB':>6s}",
        flush=True,
    )
    for name, (law, slope, dashpot) in BEDS.items() if min(options.copies) else ():
        cell = bed(law, 50, slope, dashpot)
        show(f"fifty, one that {name}", cell)
        show("copies of these", tiled(cell, *options.copies))
    for count in options.poured:
        law, slope, dashpots = POURED
        for dashpot in dashpots:
            show(f"poured, dashpots {dashpot:g}", bed(law, count, slope, dashpot))
    if options.deep:
        cell = deep_bed()
        show("a thousand, ten deep", cell)
        show("copies of these", tiled(cell, options.deep, 1))


if __name__ == "__main__":
    main()
