"""Time per step of pair mindlin/smooth beside LAMMPS's own granular styles, on the same packing in one run.

A hexagonal packing with six contacts a disk, stirred a little so that contacts live: the same positions, radii,
velocities, neighbour settings and time step for every style. Styles take turns, so that what else the machine does
falls on all alike; medians and the spread of several turns are printed, and ratios within one turn.

    python benchmarks/time_per_step.py [--ranks 1 2] [--disks 100 10000]
"""

import argparse
import json
import platform
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

BIN = Path(sys.executable).parent

KN, KT = 2e5, 2e5 * 2 / 7
SPACING = 0.999  # of disks of diameter 1: overlaps of 1e-3

# The built-in styles have the radius in their laws: their stiffness is scaled to the same force at this overlap.
STYLES = {
    "mindlin/smooth": (f"mindlin/smooth {KN} {KT} 1.0", "", "nve/disc 0.5"),
    "mindlin/smooth, compensated": (f"mindlin/smooth {KN} {KT} 1.0 compensated", "", "nve/disc 0.5 compensated"),
    "mindlin/smooth, mu = 0": (f"mindlin/smooth {KN} {KT} 0.0", "", "nve/disc 0.5"),
    "gran/hertz/history": (f"gran/hertz/history {2 * KN} {2 * KT} 0.0 0.0 1.0 1", "", "nve/sphere disc"),
    "granular": ("granular", f"hertz {2 * KN} 0.0 tangential mindlin {2 * KT} 0.0 1.0", "nve/sphere disc"),
}
"""Pair style, its coefficients, and the integrator."""

DECK = """
units           lj
dimension       2
boundary        p p p
atom_style      sphere
atom_modify     map yes
comm_modify     vel yes
processors      * 1 1
newton          off
lattice         hex {density}
region          box block 0 {nx} 0 {ny} -0.5 0.5 units lattice
create_box      1 box
create_atoms    1 box
set             group all diameter 1.0
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


def microseconds_per_step(style: str, disks: int, ranks: int) -> float:
    """Loop time of one run over its steps, in microseconds."""
    nx = round((disks / 2 * 3**0.5) ** 0.5)
    ny = round(disks / 2 / nx)
    steps = max(200, 2_000_000 // disks)
    pair, coefficients, integrator = STYLES[style]
    deck = DECK.format(
        density=2 / 3**0.5 / SPACING**2,
        nx=nx,
        ny=ny,
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
    loops = [line.split() for line in done.stdout.splitlines() if line.startswith("Loop time of")]
    if done.returncode or len(loops) != 2:
        sys.exit(f"{style} did not run: {done.stdout[-500:]}")
    return 1e6 * float(loops[1][3]) / float(loops[1][8])


def main() -> None:
    """Print the table, and write it as JSON if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--disks", type=int, nargs="+", default=[100, 10_000])
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--output", type=Path, help="also write the numbers to this file")
    options = parser.parse_args()

    print(f"{platform.processor() or platform.machine()}; microseconds per step, median of {options.turns} [extremes]")
    rows = []
    for disks in options.disks:
        for ranks in options.ranks:
            turns = [
                {style: microseconds_per_step(style, disks, ranks) for style in STYLES} for _ in range(options.turns)
            ]
            print(f"\n{disks} disks, {ranks} rank{'s' * (ranks > 1)}" + " " * 30 + "of gran/hertz/history")
            for style in STYLES:
                times = [turn[style] for turn in turns]
                ratio = statistics.median(turn[style] / turn["gran/hertz/history"] for turn in turns)
                print(
                    f"  {style:30s}{statistics.median(times):10.2f} [{min(times):.2f}, {max(times):.2f}]{ratio:10.2f}"
                )
                rows.append({"disks": disks, "ranks": ranks, "style": style, "microseconds": times, "ratio": ratio})
    if options.output:
        options.output.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
