"""Packings of LAMMPS's own granular styles, and of ours, as a user's script sets them up."""

from pathlib import Path

import numpy as np
import pytest

RESCALED = ("mindlin_rescale", "mindlin_rescale/force")
_, *ROWS = (Path(__file__).parent / "laws.txt").read_text().splitlines()
LAWS = {law: (style, each.split("; "), wall) for law, style, each, wall in (row.split(" | ") for row in ROWS)}
"""Pair style, coefficients and wall, with dashpots g and w, or a restitution e.

The coefficient of friction is 3, so that no contact comes to rest at Coulomb's bound. They are soft: overlaps are a
hundredth of a radius, so that velocities of 1e-5 are small beside them and large beside rounding."""

ALMOST_NONE = "1e-12"
"""A dashpot: LAMMPS's walls have forces that are no numbers with one of 0."""


DECKS = Path(__file__).parent / "decks"


def head(box: str, boundary: str = "f f f", *, kinds: int = 1, dimension: int = 3) -> str:
    """The first commands of a deck: spheres, or disks, in a box."""
    return f"""
units lj
dimension {dimension}
atom_style sphere
boundary {boundary}
newton off
comm_modify vel yes
region box {box} units box
create_box {kinds} box
"""


def deck(
    places, law: str, wall: str = "", *, box: str = "block -4 4 -4 4 -2 8", boundary: str = "f f f", dimension: int = 3,
    kinds=(), diameters=(1.0,), load: str = "0 0 -1", more: str = "fix move all nve/sphere", timestep: float = 1e-3,
    run: str = "run 0", fill: str = "",
) -> str:  # fmt: skip
    """Particles at some places, or by the commands of `fill`, with one law for pairs and for the plane of a wall, as a
    wall names it."""
    granular, placed = law.startswith("granular "), zip(kinds or [1] * len(places), places, strict=True)
    return "\n".join([
        head(box, boundary, kinds=len(diameters), dimension=dimension), fill,
        *(f"create_atoms {k} single {x:.17g} {y:.17g} {z:.17g} units box" for k, (x, y, z) in placed),
        *(f"set type {k} diameter {d}" for k, d in enumerate(diameters, 1)), "set group all density 1.0",
        "pair_style granular" if granular else f"pair_style gran/{law}",
        f"pair_coeff * * {law.removeprefix('granular ') if granular else ''}",
        f"fix floor all wall/gran {law} {wall}" if wall else "",
        f"fix load all gravity 1.0 vector {load}" if load else "",
        f"timestep {timestep}", "thermo 1000000", "thermo_style custom step", "thermo_modify lost ignore", more, run,
        "",
    ])  # fmt: skip


TWO = (DECKS / "two.in").read_text()
MOVES = "\nfix move all nve/sphere"
HERTZ = "gran/hertz/history 1e5 NULL 1 1 0.5 1"


def instance(log=None):
    """LAMMPS on the ranks of this process, with the plugin."""
    from mpi4py import MPI

    from faultgouge.pywrap import lammps_instance

    return lammps_instance(MPI.COMM_WORLD, log)


def refused(says: str):
    """Expects that a packing is refused with these words."""
    from faultgouge.pywrap import NotTakenError

    return pytest.raises(NotTakenError, match=says)


def command(lmp, lines: str) -> None:
    for line in lines.strip().splitlines():
        lmp.command(line)


def start(lmp, d: int, count: int) -> None:
    """Particles of two sizes above a floor, in a sheared box of spheres, or one of disks."""
    rng, width = np.random.default_rng(5), 3.0 if d == 3 else 4.4
    box = "prism 0 3 0 3 0 40 0.5 0 0" if d == 3 else "block 0 4.4 0 40 -0.5 0.5"
    command(lmp, head(box, "p p f" if d == 3 else "p f p", kinds=2, dimension=d))
    command(lmp, "neighbor 0.2 bin\nneigh_modify every 1 delay 0 check yes")
    across = int(width // 1.05)
    layer = across ** (d - 1)
    for k in range(count):
        x, y = (np.array([k % layer % across, k % layer // across]) + 0.5) * width / across + rng.uniform(-0.1, 0.1, 2)
        height = 0.55 + 1.02 * (k // layer)
        place = (x, y, height) if d == 3 else (x, height, 0.0)
        lmp.command(f"create_atoms {1 + k % 2} single {' '.join(f'{p:.17g}' for p in place)} units box")
    command(lmp, "set type 1 diameter 0.8\nset type 2 diameter 1.0\nset group all density 1.5")


def with_law(lmp, law: str, d: int, g: str, w: str, e: tuple[str, str], mu: str = "3.0") -> None:
    style, coefficients, wall = LAWS[law]
    lines = [f"pair_style {style.format(g=g)}", *(f"pair_coeff {each.format(g=g, e=e[0])}" for each in coefficients)]
    if w:
        lines.append(f"fix floor all wall/gran {wall.format(w=w, e=e[1])} {'zy'[d == 2]}plane 0 NULL contacts")
    command(lmp, "\n".join(lines).replace(" 3.0", f" {mu}"))


def on_slope(log, law: str, d: int, slope, dashpots=("40", "40"), e=("", ""), mu: str = "3.0", run: int = 0):
    """LAMMPS with particles that come to rest on a slope."""
    lmp = instance(log)
    start(lmp, d, 20 if d == 3 else 18)
    with_law(lmp, law, d, *dashpots, e, mu)
    command(lmp, f"""
fix load all gravity 1.0 vector {slope} {"0 -1" if d == 3 else "-1 0"}
fix move all nve/sphere
fix drag all viscous 1.5
timestep 0.002
thermo 100000
run {run} post no
""")  # fmt: skip
    return lmp


def is_proved(found, operators: str, error: float = 1e-5) -> None:
    """K and C are those of laws, or differences, and LAMMPS moves as they say."""
    assert found.operators == operators
    assert max(found.operator_error, found.proof) < error


def agree(found, other, of_k: float = 1e-5, of_c: float = 1e-6) -> None:
    """K and C are those of another configuration, as shares of the largest entry."""
    from faultgouge.analysis import damping_matrix, stiffness_matrix

    for matrix, share in ((stiffness_matrix, of_k), (damping_matrix, of_c)):
        one, expected = matrix(found), matrix(other)
        assert abs(one - expected).max() <= share * abs(expected).max()


def of_particle(lmp, name: str, number: int) -> np.ndarray:
    """The row of an array that belongs to the particle with this ID, which can be changed."""
    row = int(np.flatnonzero(lmp.numpy.extract_atom("id")[: lmp.extract_setting("nlocal")] == number)[0])
    return lmp.numpy.extract_atom(name)[row]
