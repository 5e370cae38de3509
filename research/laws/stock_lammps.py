r"""Does motion grow with loss at a fifth of the overburden? Stock LAMMPS, and both laws of this program beside it.

    python -m research.laws.stock_lammps [SEED ...]     rows of stock_lammps.jsonl that the table lacks

The disks of an equilibrium of the smoothed law at F_x/F_y = 0.2 are given to LAMMPS with the force of each contact.
From there on LAMMPS is the only code: pair_style granular and fix wall/gran with hertz and mindlin_rescale/force, or
mindlin/smooth with either history; fix nve/sphere disc, whose moment of inertia is m R^2/2. LAMMPS's stiffnesses have
the root of the effective radius, R_i R_j/(R_i + R_j) or R_i at the wall, and its viscoelastic dashpots the effective
mass besides: both are divided out, type by type.

**The forces.** A tangential force is what a contact remembers of its slip. So the disks are given velocities and
rotations for some steps without an integrator: nothing moves, and each contact slips by what it has to remember, the
stretch of its spring or the slip of the smoothed law. Velocities that do so are the least of T v = s, where a row of T
makes the slip of a contact of the velocities of its disks. There are fewer contacts than coordinates, so that such
velocities exist. With `history coulomb` a contact that parts has less force, so that slips are taken up with `history
total` and the pair style is given its history afterwards; disks on the floor, which is a fix, keep their height.

**Rest.** The lever arm of a torque of pair granular ends in the middle of the overlap, and with it the balance of
torques is off by a thousandth; mindlin/smooth turns a contact by half of what it thinks is a step. So the disks come to
rest again with a drag of 1/tau = `DRAG`, which stops any pair here.

**Growth.** Dashpots of a restitution act and nothing else. Disks have random velocities of `PUSH`, three draws, and D
is followed as in :mod:`.growth`. What the spectrum foresees is that of the same instance, `from_lammps`: K and the
pencil with its dashpots.
"""

import sys
from collections.abc import Iterator, Sequence
from functools import partial
from math import isclose
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.linalg import eigvals

from faultgouge.analysis import (
    Configuration,
    Floats,
    Indices,
    Packing,
    damping_matrix,
    dynamical_matrix,
    mass_weighted,
    spectrum,
)
from faultgouge.analysis.files.formats.lammps_data import box_lines
from faultgouge.pywrap import Scene, dashpot, from_lammps, in_a_copy, lammps_instance, ramp, settle
from faultgouge.studies.result_rows import append_row
from research.laws.both_laws import as_slider
from research.laws.growth import DRAWS, LOOK, TIME, TO, growth_of_course
from research.laws.sets import sets
from research.modes.loss import TANGENTIAL, impact_velocity
from research.tables import read_rows

TABLE = Path(__file__).with_name("stock_lammps.jsonl")
SEEDS = range(1, 13)
SHARE, RESTITUTION = 0.2, 0.9

DRAG = 40.0
"""1/tau with which stock LAMMPS comes to rest: twice what the fastest pair of the smoothed law needs at this load."""

SLOW = 1e-11
"""Largest velocity at rest: rounding of coordinates leaves some 1e-12. A drag of 40 then holds forces of 4e-10."""

REST, LONGEST = 10.0, 200.0
"""Time between looks whether the disks rest, and the longest time that they are given."""

SLIPS, SLOWLY = 1000, 1e6
"""Steps in which contacts take up their slips, and how long each is: so long that dashpots feel nothing."""

PUSH = 1e-9
"""Standard deviation of velocities: displacements of some 1e-11, as those of `growth`."""

STEP = 5e-4
"""Time step, a twentieth of the limit of stability: the largest frequency is 220."""

DECK = """
units           lj
dimension       2
boundary        p f p
atom_style      sphere
atom_modify     map yes sort 0 0
comm_modify     vel yes
neighbor        0.1 bin
neigh_modify    every 1 delay 0 check yes
read_data       "{data}"
set             group all mass 1.0
group           small type 1
group           large type 2
group           top id {top}
{law}
timestep        {slowly}
"""


def data_file(packing: Packing) -> str:
    """The disks with one type for each radius."""
    kinds = np.unique(packing.radius, return_inverse=True)[1] + 1
    lines = ["packing", "", f"{len(packing)} atoms", "2 atom types", *box_lines(packing), "", "Atoms # sphere", ""]
    rows = zip(kinds.tolist(), packing.radius.tolist(), *packing.position.T.tolist(), strict=True)
    lines += [f"{n} {kind} {2 * r!r} 1.0 {x!r} {y!r} 0.0" for n, (kind, r, x, y) in enumerate(rows, 1)]
    return "\n".join(lines) + "\n"


def granular(packing: Packing, cn: float) -> list[str]:
    """LAMMPS's own law: pair_coeff of each pair of types and the floor of each, with a dashpot."""
    law, radii = packing.law, np.unique(packing.radius)

    def model(effective_radius: float, effective_mass: float) -> str:
        root = np.sqrt(effective_radius)
        normal = f"hertz {law.kn / root:.17g} {cn / root / effective_mass:.17g}"
        tangent = f"mindlin_rescale/force {law.kt / root:.17g} {TANGENTIAL:.17g} {law.mu}"
        return f"{normal} tangential {tangent} damping viscoelastic"

    lines = ["pair_style granular"]
    for i, one in enumerate(radii, 1):
        for j, other in enumerate(radii[i - 1 :], i):
            lines.append(f"pair_coeff {i} {j} {model(one * other / (one + other), 0.5)}")
    for name, radius in zip(("small", "large"), radii, strict=True):
        lines.append(f"fix floor_{name} {name} wall/gran granular {model(radius, 1.0)} yplane 0.0 NULL contacts")
    return lines


def plugin(packing: Packing, cn: float, history: str) -> list[str]:
    """One of the two laws of this program, with a dashpot."""
    law = f"{packing.law.kn} {packing.law.kt:.17g} {packing.law.mu}"
    options = f"history {history} damping {cn:.17g} {TANGENTIAL * cn:.17g}"
    pair = f"pair_style mindlin/smooth {law} {options}"
    return [pair, "pair_coeff * *", f"fix floor all wall/mindlin/smooth {law} ylo 0.0 {options}"]


LAWS = {
    "granular": granular,
    "coulomb": lambda packing, cn: plugin(packing, cn, "coulomb"),
    "smooth": lambda packing, cn: plugin(packing, cn, "total"),
}
"""Stock LAMMPS, the standard law of this program, the smoothed law."""


def equilibrium(seed: int) -> tuple[Scene, Packing]:
    """The equilibrium of the smoothed law at `SHARE` of the set "force 100"."""
    given = sets()["force 100"].scene
    scene = Scene.from_mapping(given | {"packing": given["packing"] | {"seed": seed}})
    for each in ramp(scene, settle(scene), MPI.COMM_SELF):
        if isclose(each.fx, SHARE * scene.load.fy, rel_tol=1e-9):
            return scene, each.packing
    raise ValueError(f"seed {seed} has no equilibrium at F_x/F_y = {SHARE}")


def slip_velocities(packing: Packing, slip: Floats) -> tuple[Floats, Floats]:
    """The least velocities and angular velocities of the disks with which contacts slip by this in a unit of time."""
    c, count, tangent = packing.contacts, len(packing), packing.geometry.tangent
    matrix = np.zeros((len(c), 3 * count))
    rows, pairs = np.arange(len(c)), c.j >= 0
    for axis in (0, 1):
        matrix[rows, axis * count + c.i] = tangent[:, axis]
        matrix[rows[pairs], axis * count + c.j[pairs]] = -tangent[pairs, axis]
    matrix[rows, 2 * count + c.i] = -packing.radius[c.i]
    matrix[rows[pairs], 2 * count + c.j[pairs]] = -packing.radius[c.j[pairs]]
    matrix[:, count + c.i[~pairs]] = 0.0  # the height of disks on the floor
    found = np.asarray(np.linalg.lstsq(matrix, slip, rcond=None)[0], dtype=np.float64)
    if np.abs(matrix @ found - slip).max() > 1e-12 * np.abs(slip).max():  # rounding of a well-conditioned T
        raise ValueError("no velocities give all contacts their forces")
    return found[: 2 * count].reshape(2, count).T, found[2 * count :]


def arrays(lmp: Any, *names: str) -> list[Floats]:
    """Views of arrays of the disks by ID."""
    ids = lmp.numpy.extract_atom("id")[: lmp.extract_setting("nlocal")]
    if np.any(np.diff(ids) != 1):
        raise ValueError("LAMMPS has sorted the disks, in spite of the deck")
    return [lmp.numpy.extract_atom(name)[: len(ids)] for name in names]


def stand(lmp: Any, law: str, packing: Packing, cn: float, folder: Path) -> None:
    """Set the packing up in an instance, with the forces of its contacts, its load and its dashpots."""
    (folder / "packing.data").write_text(data_file(packing))
    top = " ".join(str(n + 1) for n in np.flatnonzero(packing.top))
    pair, *lines = LAWS[law](packing, cn)
    own = "\n".join([pair.replace("history coulomb", "history total"), *lines])
    lmp.commands_string(DECK.format(data=folder / "packing.data", top=top, law=own, slowly=SLOWLY))
    slips = (packing if law == "smooth" else as_slider(packing)).contacts.slip
    velocity, spin = slip_velocities(packing, slips / (SLIPS * SLOWLY))
    v, omega = arrays(lmp, "v", "omega")
    v[:, :2], omega[:, 2] = velocity, spin
    lmp.command(f"run {SLIPS} post no")
    v, omega = arrays(lmp, "v", "omega")
    v[:], omega[:] = 0.0, 0.0
    lmp.commands_list(
        [
            *([pair, "pair_coeff * *"] if law == "coulomb" else []),
            f"fix load top addforce {packing.fx!r} {-packing.fy!r} 0.0",
            "fix move all nve/sphere disc",
            "fix plane all enforce2d",
            f"timestep {STEP}",
        ]
    )


def come_to_rest(lmp: Any, radii: Floats) -> float:
    """Let the disks come to rest with drag; the largest velocity that is left, length / time."""
    lmp.command(f"fix drag all viscous {DRAG}")
    for name, radius in zip(("small", "large"), radii, strict=True):
        lmp.command(f"fix spin_{name} {name} viscous/sphere {DRAG * radius**2 / 2:.17g}")
    fastest, elapsed = np.inf, 0.0
    while fastest > SLOW and elapsed < LONGEST:
        lmp.command(f"run {round(REST / STEP)} post no")
        elapsed += REST
        fastest = max(np.abs(each).max() for each in arrays(lmp, "v", "omega"))
    for name in ("drag", "spin_small", "spin_large"):
        lmp.command(f"unfix {name}")
    return float(fastest)


def fastest_damped(found: Configuration) -> float:
    """Largest Re s of s^2 M + s C + K, 1 / time."""
    matrix, active = dynamical_matrix(found)
    g = mass_weighted(damping_matrix(found), found)[active][:, active].toarray()
    a, size = matrix.toarray(), len(active)
    return float(eigvals(np.block([[np.zeros((size, size)), np.eye(size)], [-a, -g]])).real.max())


def let_go(lmp: Any, bearing: Indices, draw: int) -> dict[str, Any]:
    """D after the push, in a copy of the process: at the end over that of the first look, and its rate of growth."""
    lmp.command("log none")
    noise = PUSH * np.random.default_rng(draw).standard_normal((len(bearing), 2))
    (v, x) = arrays(lmp, "v", "x")
    start = x.copy()
    v[bearing, :2] += noise
    steps = round(LOOK / STEP)
    times: list[float] = []
    squares: list[float] = []
    period = lmp.extract_box()[1][0]
    while len(times) * LOOK < TIME and (not squares or squares[-1] < TO):
        lmp.command(f"run {steps} post no")
        (x,) = arrays(lmp, "x")
        times.append((len(times) + 1) * steps * STEP)
        away = (x - start)[bearing, :2]
        away[:, 0] -= period * np.round(away[:, 0] / period)
        squares.append(float(np.mean(np.sum(away**2, axis=1))))
    return growth_of_course(times, squares)


def rows(seed: int) -> Iterator[dict[str, Any]]:
    """One packing with each law."""
    scene, packing = equilibrium(seed)
    cn = dashpot(scene.law.kn, RESTITUTION, 1.0, impact_velocity(scene))
    for law in LAWS:
        with TemporaryDirectory() as name:
            lmp = lammps_instance(MPI.COMM_SELF, Path(name) / "log")
            stand(lmp, law, packing, cn, Path(name))
            before = arrays(lmp, "x")[0].copy()
            fastest = come_to_rest(lmp, np.unique(packing.radius))
            found = from_lammps(lmp)
            moved = float(np.abs(found.position - before[:, :2]).max())
            said = spectrum(found)
            bearing = np.setdiff1d(np.arange(len(packing)), found.rattlers)
            yield {
                "seed": seed, "law": law, "fx_over_fy": SHARE, "contacts": len(found.contacts),
                "at_bound": int(found.contacts.at_bound.sum()), "fastest": fastest, "moved": moved,
                "residual": found.residual, "pairs": len(said.pairs), "undamped": said.growth_rate(),
                "predicted": 2 * fastest_damped(found),
                "draws": [in_a_copy(partial(let_go, lmp, bearing, draw)) for draw in range(DRAWS)],
            }  # fmt: skip
            lmp.close()


def compute(seeds: Sequence[int]) -> None:
    """Add the rows that the table lacks."""
    known = {row["seed"] for row in read_rows(TABLE)} if TABLE.exists() else set()
    for seed in seeds:
        if seed not in known:
            for row in list(rows(seed)):
                append_row(TABLE, row)
                print(row, flush=True)


if __name__ == "__main__":
    compute([int(each) for each in sys.argv[1:]] or SEEDS)
