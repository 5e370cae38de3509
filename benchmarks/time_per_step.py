"""Time per step of pair mindlin/smooth beside LAMMPS's own granular styles, on the same packing in one run.

A hexagonal packing with six contacts a disk; or a disordered one, of 1,000 disks of two radii that `settle` has
brought to rest, repeated along x. Stirred a little so that contacts live: the same positions, radii, velocities,
neighbour settings and time step for every style. Times are processor times, and styles take turns, so that what else
the machine does falls on all alike; medians and the spread of several turns are printed, and ratios within one turn.

    python benchmarks/time_per_step.py [--packing hexagonal disordered] [--disks 100 10000] [--ranks 1 2]
"""

import argparse
import itertools
import platform
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from faultgouge.pywrap import Scene, settle
from faultgouge.pywrap.lammps.data_file import data_file

BIN = Path(sys.executable).parent

KN, KT = 2e5, 2e5 * 2 / 7
SPACING = 0.999  # of disks of diameter 1: overlaps of 1e-3

# The built-in styles have the radius in their laws: their stiffness is scaled to the same force at this overlap.
STYLES = {
    "mindlin/smooth": (f"mindlin/smooth {KN} {KT} 1.0", "", "nve/disc 0.5"),
    "mindlin/smooth, compensated": (f"mindlin/smooth {KN} {KT} 1.0 compensated", "", "nve/disc 0.5 compensated"),
    "mindlin/smooth, rescaled": (f"mindlin/smooth {KN} {KT} 1.0 history rescaled", "", "nve/disc 0.5"),
    "mindlin/smooth, coulomb": (f"mindlin/smooth {KN} {KT} 1.0 history coulomb", "", "nve/disc 0.5"),
    "mindlin/smooth, energy": (f"mindlin/smooth {KN} {KT} 1.0 energy yes", "", "nve/disc 0.5"),
    "mindlin/smooth, mu = 0": (f"mindlin/smooth {KN} {KT} 0.0", "", "nve/disc 0.5"),
    "gran/hertz/history": (f"gran/hertz/history {2 * KN} {2 * KT} 0.0 0.0 1.0 1", "", "nve/sphere disc"),
    "granular": ("granular", f"hertz {2 * KN} 0.0 tangential mindlin {2 * KT} 0.0 1.0", "nve/sphere disc"),
}
"""Pair style, its coefficients, and the integrator."""

HEXAGONAL = """
lattice         hex {density}
region          box block 0 {nx} 0 {ny} -0.5 0.5 units lattice
create_box      1 box
create_atoms    1 box
set             group all diameter 1.0
"""

DISORDERED_SCENE = """
read_data       {data}
replicate       {times} 1 1
"""

DECK = """
units           lj
dimension       2
boundary        p {y} p
atom_style      sphere
atom_modify     map yes
comm_modify     vel yes
processors      * 1 1
newton          off
{disks}
set             group all mass 1.0
velocity        all create 1e-8 12345 loop geom
pair_style      {pair}
pair_coeff      * * {coefficients}
neighbor        0.1 bin
neigh_modify    every 1 delay 0 check yes
fix             move all {integrator}
timestep        1e-4
thermo          1000000
run             {warm}
run             {steps}
"""


def hexagonal(disks: int) -> str:
    """Input lines that make about so many disks."""
    nx = round((disks / 2 * 3**0.5) ** 0.5)
    return HEXAGONAL.format(density=2 / 3**0.5 / SPACING**2, nx=nx, ny=round(disks / 2 / nx))


def settle_data_file(folder: Path) -> Path:
    """A LAMMPS data file of 1,000 disks at rest."""
    scene = Scene.from_mapping(
        {"packing": {"disks": 1000, "top": 32, "width": 37.7, "seed": 2}, "law": {"kn": KN}, "load": {"fy": 3.0}}
    )
    path = folder / "settled.data"
    path.write_text(data_file(settle(scene).packing))
    return path


def microseconds_per_step(style: str, disks: int, ranks: int, data: Path | None = None) -> float:
    """Processor time of a step, microseconds; of the hexagonal packing, or of a data file repeated."""
    steps = max(200, 2_000_000 // disks)
    pair, coefficients, integrator = STYLES[style]
    deck = DECK.format(
        y="p" if data is None else "f",
        disks=hexagonal(disks) if data is None else DISORDERED_SCENE.format(data=data, times=max(1, disks // 1000)),
        pair=pair,
        coefficients=coefficients,
        integrator=integrator,
        warm=steps // 4,
        steps=steps,
    )
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "in"
        script.write_text(deck)
        command = [BIN / "mpiexec", "-n", str(ranks), BIN / "lmp", "-in", script, "-log", "none"]
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
    loops = re.findall(r"^Loop time of (\S+) .*?^([\d.]+)% CPU use", done.stdout, re.S | re.M)
    if done.returncode or len(loops) != 2:
        sys.exit(f"{style} did not run: {done.stdout[-500:]}")
    seconds, percent = map(float, loops[1])
    return 1e6 * seconds * percent / 100 / steps


def table(title: str, turns: list[dict[tuple[str, int], float]], all_ranks: list[int]) -> None:
    """Print one packing."""
    for ranks in all_ranks:
        print(
            f"\n{title + f', {ranks} rank' + 's' * (ranks > 1):66s}of gran/hertz/history   speed-up over {all_ranks[0]}"
        )
        for style in STYLES:
            times = [turn[style, ranks] for turn in turns]
            ratio = statistics.median(turn[style, ranks] / turn["gran/hertz/history", ranks] for turn in turns)
            gain = statistics.median(turn[style, all_ranks[0]] / turn[style, ranks] for turn in turns)
            print(
                f"  {style:30s}{statistics.median(times):12.2f} {f'[{min(times):.2f}, {max(times):.2f}]':24s}"
                f"{ratio:10.2f}{gain:20.2f}"
            )
        for what in ("compensated", "energy"):
            cost = sorted(turn[f"mindlin/smooth, {what}", ranks] / turn["mindlin/smooth", ranks] for turn in turns)
            print(f"  {what} of plain {statistics.median(cost):.2f} [{cost[0]:.2f}, {cost[-1]:.2f}]")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--disks", type=int, nargs="+", default=[100, 10_000])
    parser.add_argument(
        "--packing", nargs="+", choices=["hexagonal", "disordered"], default=["hexagonal", "disordered"]
    )
    parser.add_argument("--turns", type=int, default=5)
    options = parser.parse_args()

    print(f"{platform.processor() or platform.machine()}; microseconds per step, median of {options.turns} [extremes]")
    with tempfile.TemporaryDirectory() as folder:
        data = settle_data_file(Path(folder)) if "disordered" in options.packing else None
        for packing, disks in itertools.product(options.packing, options.disks):
            if packing == "disordered" and disks < 1000:
                continue
            turns = [
                {
                    (style, ranks): microseconds_per_step(
                        style, disks, ranks, data if packing == "disordered" else None
                    )
                    for style in STYLES
                    for ranks in options.ranks
                }
                for _ in range(options.turns)
            ]
            table(f"{packing}, {disks} disks", turns, options.ranks)


if __name__ == "__main__":
    main()
