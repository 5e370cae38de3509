r"""Does motion grow with loss at a fifth of the overburden? Stock LAMMPS, and this program's laws beside it.

    python research/laws/stock_lammps.py [--seeds 1 2 3] [--laws granular coulomb smooth] [-o FILE.jsonl]

A packing of 100 disks that has settled without friction is given to LAMMPS as a data file. From there on the deck
below is the only code: pair_style granular and fix wall/gran with hertz and mindlin_rescale/force, fix nve/sphere
disc, or the same deck with mindlin/smooth. F_x rises to 0.2 F_y while fix viscous damps, stays until the disks rest,
and then nothing damps but the dashpots of the contacts (a restitution of about 0.9). Small random velocities are
added, and the kinetic energy says whether motion grows. LAMMPS's stiffnesses have the root of the effective radius,
R_i R_j/(R_i + R_j) or R_i at the wall, and its viscoelastic dashpots the effective mass besides: both are divided out,
type by type.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from faultgouge.analysis import Packing
from faultgouge.pywrap import Scene, settle
from faultgouge.pywrap.lammps.data_file import box_lines

KN, KT, MU, FY = 2e5, 2e5 * 2 / 7, 1.0, 3.0
DASHPOT = 171.0
"""C_N = C_T; the C_N of quartz with a restitution of 0.9 at 1 m/s, in these units (docs/units.md)."""

DECK = """
units           lj
dimension       2
boundary        p f p
atom_style      sphere
atom_modify     map yes
comm_modify     vel yes
neighbor        0.1 bin
neigh_modify    every 1 delay 0 check yes
read_data       packing.data
set             group all mass 1.0
group           small type 1
group           large type 2
group           top id {top}
{law}
variable        fx equal ramp(0.0,{fx})
fix             load top addforce v_fx -{fy} 0.0
fix             drag all viscous 2.0
fix             move all nve/sphere disc
fix             plane all enforce2d
timestep        1e-3
compute         motion all ke
thermo_style    custom step c_motion
thermo          1000000
run             300000 post no
variable        fx equal {fx}
run             200000 post no
unfix           drag
run             20000 post no
print           "rest $(c_motion:%.17g)" append energies screen no
velocity        all create {noise} 4928459 sum yes loop geom
fix             energies all ave/time 1 1 500 c_motion file growth
run             100000
"""
NOISE = 1e-22
"""Temperature of the velocities that are added: 1e-11, above what rounding leaves and far below the overlaps."""


def data_file(packing: Packing) -> str:
    """The disks with one type for each radius."""
    kinds = np.unique(packing.radius, return_inverse=True)[1] + 1
    lines = ["packing", "", f"{len(packing)} atoms", "2 atom types", *box_lines(packing), "", "Atoms # sphere", ""]
    rows = zip(kinds.tolist(), packing.radius.tolist(), *packing.position.T.tolist(), strict=True)
    lines += [f"{n} {kind} {2 * r!r} 1.0 {x!r} {y!r} 0.0" for n, (kind, r, x, y) in enumerate(rows, 1)]
    return "\n".join(lines) + "\n"


def granular(radii: np.ndarray) -> str:
    """LAMMPS's own law, with the stiffnesses of each pair of types."""

    def model(effective_radius: float, effective_mass: float) -> str:
        root = np.sqrt(effective_radius)
        normal = f"hertz {KN / root:.17g} {DASHPOT / root / effective_mass:.17g}"
        return f"{normal} tangential mindlin_rescale/force {KT / root:.17g} 1.0 {MU} damping viscoelastic"

    lines = ["pair_style granular"]
    for i, one in enumerate(radii, 1):
        for j, other in enumerate(radii[i - 1 :], i):
            lines.append(f"pair_coeff {i} {j} {model(one * other / (one + other), 0.5)}")
    for name, radius in zip(("small", "large"), radii, strict=True):
        lines.append(f"fix floor_{name} {name} wall/gran granular {model(radius, 1.0)} yplane 0.0 NULL")
    return "\n".join(lines)


def smooth(radii: np.ndarray, history: str = "total") -> str:
    """The law of this plugin."""
    law = f"{KN} {KT:.17g} {MU}"
    options = f"history {history} damping {DASHPOT} {DASHPOT}"
    pair = f"pair_style mindlin/smooth {law} {options}\npair_coeff * *"
    return f"{pair}\nfix floor all wall/mindlin/smooth {law} ylo 0.0 {options}"


LAWS = {"granular": granular, "smooth": smooth, "coulomb": lambda radii: smooth(radii, "coulomb")}


def grow(seed: int, law: str, share: float) -> dict:
    """The kinetic energy after the push, at two times, of one packing and one law."""
    scene = {"packing": {"disks": 100, "width": 11.9, "seed": seed}, "law": {"kn": KN, "mu": MU}, "load": {"fy": FY}}
    packing = settle(Scene.from_mapping(scene)).packing
    top = " ".join(str(n + 1) for n in np.flatnonzero(packing.top))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "packing.data").write_text(data_file(packing))
        deck = DECK.format(top=top, law=LAWS[law](np.unique(packing.radius)), fx=share * FY, fy=FY, noise=NOISE)
        (folder / "deck.in").write_text(deck)
        command = [str(Path(sys.executable).parent / "lmp"), "-in", "deck.in", "-log", "none"]
        run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if run.returncode:
            return {
                "seed": seed,
                "law": law,
                "fx_over_fy": share,
                "failed": " ".join(line for line in run.stdout.splitlines() if "ERROR" in line),
            }
        rest = float((folder / "energies").read_text().split()[1])
        energy = np.loadtxt(folder / "growth")[:, 1]
    early, late = energy[:20].mean(), energy[-20:].mean()
    return {
        "seed": seed,
        "law": law,
        "fx_over_fy": share,
        "rest": rest,
        "early": early,
        "late": late,
        "largest": energy.max(),
        "grows": bool(late > 10 * early),
    }


def main() -> None:
    """A row for each packing and law, as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=["granular", "coulomb", "smooth"])
    parser.add_argument("--share", type=float, default=0.2, help="F_x/F_y")
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args()
    for seed in given.seeds:
        for law in given.laws:
            row = json.dumps(grow(seed, law, given.share))
            print(row, flush=True)
            if given.output:
                with given.output.open("a") as file:
                    file.write(row + "\n")


if __name__ == "__main__":
    main()
