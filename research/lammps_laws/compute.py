"""Packings of LAMMPS's own contact laws on a slope, and the spectrum of each: one row a packing and tilt."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.linalg import eigvals

from faultgouge.analysis import Snapshot, damping_matrix, spectrum, stiffness_matrix
from faultgouge.analysis.spectrum.spectrum import active_coordinates, mass_weighted
from faultgouge.pywrap import compare_motion, from_lammps

KN, KT, MU, GAMMA = 1e5, 2e5 / 7, 0.5, 40.0
HOOKE = 2e-2
"""Stiffness of the linear laws as a share of that of Hertz's: overlaps are alike, some thousandth of a diameter."""

TILTS = (0.0, 0.1, 0.15)
BALANCE = 1e-8
"""Residual over the mean contact force of a packing at rest: far below the couplings that make pairs (1e-3)."""


def _granular(normal: float, model: str, word: str) -> tuple[str, str]:
    kt = KT if word == "hertz" else HOOKE * KT
    damping = "viscoelastic" if word == "hertz" else "mass_velocity"
    line = f"{word} {normal} {GAMMA} tangential {model} {kt} 0.5 {MU} damping {damping}"
    return f"pair_style granular\npair_coeff * * {line}", f"granular {line}"


def _gran(word: str, kn: float, kt: float) -> tuple[str, str]:
    words = f"{word}/history {kn} {kt} {GAMMA} {GAMMA / 2} {MU} 1"
    return f"pair_style gran/{words}\npair_coeff * *", words


LAWS = {
    "gran/hooke/history": _gran("hooke", HOOKE * KN, HOOKE * KT),
    "granular hooke, linear_history": _granular(HOOKE * KN, "linear_history", "hooke"),
    "gran/hertz/history": _gran("hertz", KN, KT),
    **{
        f"granular hertz, {model}": _granular(KN, model, "hertz")
        for model in ("mindlin", "mindlin/force", "mindlin_rescale", "mindlin_rescale/force")
    },
}
"""Pair style and wall by name."""


def pour(law: str, d: int, count: int, seed: int, log: Path) -> Any:
    """LAMMPS with a layer of particles of two sizes above a plane floor, five or six particles deep."""
    from mpi4py import MPI

    from faultgouge.pywrap.lammps.instance import lammps_instance

    rng = np.random.default_rng(seed)
    across = round((count / 5.5) ** (1 / (d - 1)))
    width, layer = 1.05 * across, across ** (d - 1)
    high = f"0 {width} 0 {width} 0 60" if d == 3 else f"0 {width} 0 60 -0.5 0.5"
    lmp = lammps_instance(MPI.COMM_SELF, log)
    pair, wall = LAWS[law]
    places = []
    for k in range(count):
        x, y = (np.array([k % layer % across, k % layer // across]) + 0.5) * 1.05 + rng.uniform(-0.1, 0.1, 2)
        height = 0.6 + 1.05 * (k // layer) + rng.uniform(0, 0.02)
        place = (x, y, height) if d == 3 else (x, height, 0.0)
        places.append(f"create_atoms {rng.integers(1, 3)} single {' '.join(f'{p:.17g}' for p in place)} units box")
    lines = [
        "units lj", f"dimension {d}", "atom_style sphere", "atom_modify map array",
        f"boundary {'p p f' if d == 3 else 'p f p'}", "newton off", "comm_modify vel yes",
        f"region box block {high} units box", "create_box 2 box", "neighbor 0.2 bin",
        "neigh_modify every 1 delay 0 check yes", *places, "set type 1 diameter 0.8", "set type 2 diameter 1.0",
        f"set group all density{'' if d == 3 else '/disc'} 1.0", *pair.splitlines(),
        f"fix floor all wall/gran {wall} {'zplane' if d == 3 else 'yplane'} 0 NULL contacts",
        "variable slope equal 0.0", f"fix load all gravity 1.0 vector v_slope {'0 -1' if d == 3 else '-1 0'}",
        f"fix move all nve/sphere{'' if d == 3 else ' disc'}", *(["fix plane all enforce2d"] if d == 2 else []),
        "timestep 1e-3", "thermo 1000000", "fix drag all viscous 0.5", "run 15000 post no",
        "fix drag all viscous 4.0", "fix spin all viscous/sphere 0.4",
    ]  # fmt: skip
    for line in lines:
        lmp.command(line)
    return lmp


def rest(lmp: Any, most: int = 25) -> Snapshot | None:
    """The packing as soon as it balances; None if it does not come to rest in 250 units of time."""
    for _ in range(most):
        lmp.command("run 10000 post no")
        count = lmp.extract_setting("nlocal")
        force = np.linalg.norm(lmp.numpy.extract_atom("f")[:count], axis=1).max()
        speed = np.linalg.norm(lmp.numpy.extract_atom("v")[:count], axis=1).max()
        if max(force, 4 * speed) < BALANCE:  # a particle weighs 0.3 to 0.8
            found = from_lammps(lmp, balance=np.inf)
            if found.residual < BALANCE * found.contacts.normal_force.mean():
                return found
    return None


def rows(law: str, d: int, count: int, seed: int) -> Iterator[dict[str, Any]]:
    """One packing at all tilts, settled at none and tilted further and further."""
    with TemporaryDirectory() as folder:
        lmp = pour(law, d, count, seed, Path(folder) / "log")
        for tilt in TILTS:
            begin = time.process_time()
            lmp.command(f"variable slope equal {tilt}")
            row = {"law": law, "d": d, "count": count, "seed": seed, "tilt": tilt}
            found = rest(lmp)
            if found is None:
                yield row | {"rests": False, "cpu_seconds": time.process_time() - begin}
                break
            row |= describe(found) | {"rests": True}
            if seed <= 4 and not row["at_bound"]:
                row["motion"] = motion(lmp, found)
            if tilt == TILTS[-1] and seed <= 4:
                row["damping"] = damping_needed(found)
            yield row | {"cpu_seconds": time.process_time() - begin}
        lmp.close()


def describe(found: Snapshot) -> dict[str, Any]:
    """What the spectrum says of a packing."""
    s, c = spectrum(found), found.contacts
    size = np.linalg.norm(c.tangential_force, axis=1) / c.friction
    return {
        "modes": len(s.eigenvalues), "pairs": len(s.pairs), "negative": len(s.negative),
        "share": 2 * len(s.pairs) / len(s.eigenvalues), "growth_rate": s.growth_rate(), "omega": s.omega_max,
        "least_q": s.least_q if s.pairs else None, "contacts": len(c), "at_bound": int(c.at_bound.sum()),
        "rattlers": len(found.rattlers), "mobilisation": float(size.mean()),
        "residual": found.residual / float(c.normal_force.mean()),
    }  # fmt: skip


def motion(lmp: Any, found: Snapshot) -> float:
    """LAMMPS's motion beside exp(t G), half a unit of time."""
    return float(compare_motion(lmp, found, 0.5, 3e-7, timestep=1e-4).difference)


def damping_needed(found: Snapshot) -> dict[str, float] | None:
    """The least dashpots, as a share of those of the deck, with which nothing grows; None if nothing does without.

    And the restitution of a head-on collision of two particles with the mean stiffness and the mean dashpot.
    """
    a = mass_weighted(stiffness_matrix(found), found)
    active = active_coordinates(a)
    a = a[active][:, active].toarray()
    g = mass_weighted(damping_matrix(found), found)[active][:, active].toarray()
    size, omega = len(a), float(np.sqrt(np.abs(a).sum(axis=1).max()))

    def grows(share: float) -> bool:
        pencil = np.block([[np.zeros((size, size)), omega * np.eye(size)], [-a / omega, -share * g]])
        # rounding of a double zero, of motions that no contact feels, is the root of 1e-16
        return bool(eigvals(pencil).real.max() > 3e-8 * omega)

    if not grows(0.0):
        return None
    low, high = 1e-6, 1e-2
    while grows(high) and high < 100:
        low, high = high, 10 * high
    while high > 1.2 * low:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if grows(middle) else (low, middle)
    c = found.contacts
    ratio = high * c.normal_dashpot.mean() / 2 / np.sqrt(c.normal_stiffness.mean() * found.mass.mean() / 2)
    return {
        "share": float(high),
        "restitution": float(np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2))) if ratio < 1 else 0.0,
    }


def compute(table: Path, count: int, seeds: range, watch: Any = print) -> None:
    """Add the rows that a table lacks, seed by seed, all laws of a seed before the next."""
    known = {(row["law"], row["d"], row["count"], row["seed"]) for row in read(table)}
    for seed in seeds:
        for d in (2, 3):
            for law in LAWS:
                if (law, d, count, seed) not in known:
                    made = list(rows(law, d, count, seed))
                    with table.open("a") as file:
                        file.writelines(json.dumps(row) + "\n" for row in made)
                    watch(f"{law}, d = {d}, N = {count}, seed {seed}: {[row.get('pairs') for row in made]}")


def read(table: Path) -> list[dict[str, Any]]:
    """The rows of a table."""
    return [json.loads(line) for line in table.read_text().splitlines()] if table.exists() else []
