"""Time per step of pair mindlin/smooth beside LAMMPS's own granular styles: `time_per_step.py [--fast]`.

Hexagonal packings have six contacts a disk; the disordered one is of disks of two radii that `settle` has brought to
rest, repeated along x. All are stirred a little so that contacts live. Positions, radii, velocities, neighbour settings
and time step are the same for every style, and styles take turns, so that what else the machine does falls on all.
"""

import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from faultgouge.pywrap import Scene, settle
from faultgouge.pywrap.lammps.data_file import data_file

HEAD = """## A time step

The pair style beside LAMMPS's own granular styles on the same packing, in {turns} turns: a step on one rank, median and
extremes; the median of its ratio to a step of `gran/hertz/history` in the same turn; and that of a step on one rank to
a step on two.

| disks | style | µs a step | of gran/hertz/history | one rank : two |
|---|---|---|---|---|"""

BIN = Path(sys.executable).parent
KN, KT = 2e5, 2e5 * 2 / 7
SPACING = 0.999  # of disks of diameter 1: overlaps of 1e-3

# The built-in styles have the radius in their laws: their stiffness is scaled to the same force at this overlap.
STYLES = {
    "mindlin/smooth": (f"mindlin/smooth {KN} {KT} 1.0", "", "nve/disc 0.5"),
    "mindlin/smooth, compensated": (f"mindlin/smooth {KN} {KT} 1.0 compensated", "", "nve/disc 0.5 compensated"),
    "mindlin/smooth, rescaled": (f"mindlin/smooth {KN} {KT} 1.0 history rescaled", "", "nve/disc 0.5"),
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


def disordered(disks: int, data: Path) -> str:
    """Input lines that repeat 1,000 disks at rest, which are written to a data file."""
    packing = {"disks": 1000, "top": 32, "width": 37.7, "seed": 2}
    scene = Scene.from_mapping({"packing": packing, "law": {"kn": KN}, "load": {"fy": 3.0}})
    data.write_text(data_file(settle(scene).packing))
    return f"read_data {data}\nreplicate {disks // 1000} 1 1\n"


def microseconds_per_step(style: str, lines: str, disks: int, ranks: int) -> float:
    """Processor time of a step on a rank, microseconds."""
    steps = max(200, 2_000_000 // disks)
    pair, coefficients, integrator = STYLES[style]
    deck = DECK.format(
        y="f" if "read_data" in lines else "p",
        disks=lines,
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


def main() -> None:
    """Print the section."""
    turns, many = (1, 1000) if "--fast" in sys.argv else (5, 10_000)
    print(HEAD.format(turns=turns))
    with tempfile.TemporaryDirectory() as folder:
        packings = (
            ("hexagonal", 100, hexagonal(100)),
            ("disordered", many, disordered(many, Path(folder) / "settled.data")),
        )
        for name, disks, lines in packings:
            found = [
                {(s, r): microseconds_per_step(s, lines, disks, r) for s in STYLES for r in (1, 2)}
                for _ in range(turns)
            ]
            for style in STYLES:
                times = [turn[style, 1] for turn in found]
                ratio = statistics.median(turn[style, 1] / turn["gran/hertz/history", 1] for turn in found)
                gain = statistics.median(turn[style, 1] / turn[style, 2] for turn in found)
                median = f"{statistics.median(times):.2f} [{min(times):.2f}, {max(times):.2f}]"
                print(f"| {name}, {disks} | {style} | {median} | {ratio:.2f} | {gain:.2f} |", flush=True)


if __name__ == "__main__":
    main()
