"""Packings of LAMMPS's own contact laws on a slope, and the spectrum of each: one row a packing and tilt."""

import json
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eig, eigvals

from faultgouge.analysis import (
    Configuration,
    Floats,
    damping_matrix,
    dynamical_matrix,
    mass_weighted,
    spectrum,
)
from faultgouge.pywrap import compare_motion, from_lammps, in_a_copy

KN, KT, GAMMA = 1e5, 2e5 / 7, 40.0
MU = 0.5
"""Friction of most packings; `CELLS` has those of the others."""

NONE = 1e-12
"""Dashpot in place of 0, with which fix wall/gran hertz/history has no forces (NaN)."""

HOOKE = 2e-2
"""Stiffness of the linear laws as a share of that of Hertz's: overlaps are alike, some thousandth of a diameter."""

TILTS = (0.0, 0.1, 0.15)
STEEP = (*TILTS, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6)
"""Tangents of the slope: of large packings, and of small ones until they do not come to rest any more."""

MOVES = 1e-3
"""Speed of a particle that moves at the end: a particle that nothing holds rolls a hundred times faster."""

BALANCE = 1e-8
"""Residual over the mean contact force of a packing at rest: far below the couplings that make pairs (1e-3)."""


@dataclass(frozen=True)
class Law:
    """A contact law of LAMMPS: a style of gran, or the models of granular."""

    style: str
    model: str = ""

    def lines(self, mu: float = MU, gamma: float = GAMMA, kn: float = KN) -> tuple[str, str]:
        """Pair style with coefficients, and the same words for fix wall/gran."""
        hertz = "hertz" in self.style
        kn, kt = (kn, kn / KN * KT) if hertz else (HOOKE * kn, HOOKE * kn / KN * KT)
        if not self.model:
            words = f"{self.style}/history {kn} {kt} {gamma} {gamma / 2} {mu} 1"
            return f"pair_style gran/{words}\npair_coeff * *", words
        damping = "viscoelastic" if hertz else "mass_velocity"
        line = f"{self.style} {kn} {gamma} tangential {self.model} {kt} 0.5 {mu} damping {damping}"
        return f"pair_style granular\npair_coeff * * {line}", f"granular {line}"


MODELS = ("mindlin", "mindlin/force", "mindlin_rescale", "mindlin_rescale/force")
LAWS = {
    "gran/hooke/history": Law("hooke"),
    "granular hooke, linear_history": Law("hooke", "linear_history"),
    "gran/hertz/history": Law("hertz"),
    **{f"granular hertz, {model}": Law("hertz", model) for model in MODELS},
}


class Cell(NamedTuple):
    """Packings of one size and friction: with which laws, in which dimensions, up to which seed, at which tilts."""

    particles: int
    mu: float
    seeds: int
    laws: tuple[str, ...] = tuple(LAWS)
    dimensions: tuple[int, ...] = (2, 3)
    tilts: tuple[float, ...] = TILTS


HERTZ = tuple(f"granular hertz, {model}" for model in MODELS)
CELLS = (
    Cell(50, MU, 20, tilts=STEEP),
    Cell(50, 0.3, 20, HERTZ, tilts=STEEP),
    Cell(50, 0.9, 20, HERTZ, tilts=STEEP),
    Cell(200, MU, 20, HERTZ),
    Cell(400, MU, 20, HERTZ),
)
"""All cells, each of the seeds 1, 2, ..., M, in two and three dimensions. The first rounds had fewer seeds; M grew by
what a packing costs, and not by what came out."""

LARGE = 50
"""Particles beyond which packings come after all others: one takes minutes."""


def pour(law: str, d: int, count: int, mu: float, seed: int, log: Path, gamma: float = GAMMA, kn: float = KN) -> Any:
    """LAMMPS with a layer of particles of two sizes above a plane floor, five or six particles deep."""
    from mpi4py import MPI

    from faultgouge.pywrap import lammps_instance

    rng = np.random.default_rng(seed)
    across = round((count / 5.5) ** (1 / (d - 1)))
    width, layer = 1.05 * across, across ** (d - 1)
    high = f"0 {width} 0 {width} 0 60" if d == 3 else f"0 {width} 0 60 -0.5 0.5"
    lmp = lammps_instance(MPI.COMM_SELF, log)
    pair, wall = LAWS[law].lines(mu, gamma, kn)
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


def rest(lmp: Any, most: int = 25) -> Configuration | None:
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


def rows(
    law: str, d: int, count: int, mu: float, seed: int, tilts: tuple[float, ...] = TILTS
) -> Iterator[dict[str, Any]]:
    """One packing at all tilts, settled at none and tilted further and further."""
    looked_at = seed <= 4 and count <= 50
    with TemporaryDirectory() as folder:
        lmp = pour(law, d, count, mu, seed, Path(folder) / "log")
        for tilt in tilts:
            begin = time.process_time()
            lmp.command(f"variable slope equal {tilt}")
            row = {"law": law, "d": d, "count": count, "mu": mu, "seed": seed, "tilt": tilt}
            found = rest(lmp)
            if found is None:
                speed = np.linalg.norm(lmp.numpy.extract_atom("v")[: lmp.extract_setting("nlocal")], axis=1)
                row |= {"rests": False, "moving": float(np.mean(speed > MOVES))}
                yield row | {"cpu_seconds": time.process_time() - begin}
                break
            row |= describe(found) | {"rests": True}
            if looked_at and not row["at_bound"]:
                row["motion"] = motion(lmp, found)
            if tilt == TILTS[-1] and looked_at:
                row["damping"] = damping_needed(found)
            yield row | {"cpu_seconds": time.process_time() - begin}
        lmp.close()


def describe(found: Configuration) -> dict[str, Any]:
    """The numbers of a packing's spectrum."""
    s, c = spectrum(found), found.contacts
    size = np.linalg.norm(c.tangential_force, axis=1) / c.friction
    return {
        "modes": len(s.eigenvalues), "pairs": len(s.pairs), "negative": len(s.negative),
        "share": 2 * len(s.pairs) / len(s.eigenvalues), "growth_rate": s.growth_rate(), "omega": s.omega_max,
        "least_q": s.least_q if s.pairs else None, "contacts": len(c), "at_bound": int(c.at_bound.sum()),
        "rattlers": len(found.rattlers), "mobilisation": float(size.mean()),
        "residual": found.residual / float(c.normal_force.mean()),
    }  # fmt: skip


def motion(lmp: Any, found: Configuration) -> float:
    """LAMMPS's motion beside exp(t G), half a unit of time."""
    return float(compare_motion(lmp, found, 0.5, 3e-7, timestep=1e-4).difference)


def damping_needed(found: Configuration) -> dict[str, float] | None:
    """The least dashpots, as a share of those of the deck, with which nothing grows; None if nothing does without.

    And the restitution of a head-on collision of two particles with the mean stiffness and the mean dashpot.
    """
    matrix, active = dynamical_matrix(found)
    a = matrix.toarray()
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


PUSH_SIZE = ("gran/hertz/history", 3, 50, 0.1)
"""Law, dimension, particles and tilt of the packings that are let go without loss, those of the seeds 1 to `LET_GO`."""

LET_GO, PUSH = 12, 1e-11
"""Packings, and standard deviation of the velocities with which they are let go."""

LONGEST, LOOK, STEP = 80.0, 0.1, 5e-4
"""Longest time, time between looks, time step: a fortieth of the shortest period."""

FROM, LINEAR, TO = 1e-22, 1e-18, 1e-11
"""D from which growth is fitted, up to where, and at which a run ends. Beyond `LINEAR` contacts that are near the bound
begin to slide, and D grows faster or more slowly than the linearised packing."""


def let_go(seed: int) -> dict[str, Any]:
    """Growth of D in LAMMPS without any dashpot, from rest with noise, while D is below `LINEAR` and beyond ("late").

    "linear" is the growth of the linearised packing after the same push in the same time, "predicted" the rate of its
    fastest pair alone.
    """
    law, d, count, tilt = PUSH_SIZE
    begin = time.process_time()
    row: dict[str, Any] = {"law": law, "d": d, "count": count, "mu": MU, "seed": seed, "tilt": tilt, "rests": False}
    with TemporaryDirectory() as folder:
        lmp = pour(law, d, count, MU, seed, Path(folder) / "log", NONE)
        found = None
        for slope in TILTS[: TILTS.index(tilt) + 1]:
            lmp.command(f"variable slope equal {slope}")
            found = rest(lmp)
            if found is None:
                break
        if found is None:
            return row
        said = describe(found)
        row |= {"rests": True, "at_bound": said["at_bound"], "pairs": said["pairs"], "predicted": said["growth_rate"]}
        for name in ("drag", "spin"):
            lmp.command(f"unfix {name}")
        push = PUSH * np.random.default_rng(seed).standard_normal((count, 3))
        times, course = in_a_copy(lambda: _follow(lmp, push))
        small = slice(beyond(course, FROM), beyond(course, LINEAR))
        linear = linear_motion(found, push, times)
        row |= {
            "rate": fit_rate(times[small], course[small]),
            "linear": fit_rate(times[small], linear[small]),
            "late": fit_rate(times[small.stop :], course[small.stop :]),
            "last": float(course[-1]),
            "time": float(times[-1]),
        }
        lmp.close()
    return row | {"cpu_seconds": time.process_time() - begin}


def _follow(lmp: Any, push: Floats) -> tuple[Floats, Floats]:
    """Times and D of the particles after a push, up to `TO` or `LONGEST`."""
    lmp.commands_list(["log none", f"timestep {STEP}"])
    low, high, *_ = lmp.extract_box()
    size = np.subtract(high, low)

    def by_id(name: str) -> tuple[Floats, Any]:
        order = np.argsort(lmp.numpy.extract_atom("id")[: len(push)])
        return lmp.numpy.extract_atom(name)[: len(push)], order

    lmp.numpy.extract_atom("omega")[: len(push)] = 0.0  # what drag has left is of the size of the push
    velocity, order = by_id("v")
    velocity[order] = push
    x, order = by_id("x")
    start = x[order]
    squares: list[float] = []
    while len(squares) * LOOK < LONGEST and (not squares or squares[-1] < TO):
        lmp.command(f"run {round(LOOK / STEP)} post no")
        x, order = by_id("x")
        away = x[order] - start
        away -= size * np.round(away / size)
        squares.append(float(np.mean(np.sum(away**2, axis=1))))
    return LOOK * np.arange(1, len(squares) + 1, dtype=float), np.array(squares, dtype=float)


def linear_motion(found: Configuration, push: Floats, times: Floats) -> Floats:
    """D of the linearised packing at some times after a push from rest, without dashpots."""
    count = len(push)
    root = np.sqrt(found.coordinate_mass)
    start = np.zeros(found.coordinates)
    start[: 3 * count] = push.T.ravel()
    a, active = dynamical_matrix(found)
    squares, vectors = eig(a.toarray())
    omega = np.sqrt(squares.astype(complex))
    share = np.linalg.solve(vectors, (start * root)[active].astype(complex))
    motion = np.zeros((found.coordinates, len(times)))
    motion[active] = (vectors @ (share[:, None] * np.sin(np.outer(omega, times)) / omega[:, None])).real
    motion = (motion / root[:, None])[: 3 * count]
    return np.asarray(np.sum(motion**2, axis=0) / count)


def beyond(course: Floats, bound: float) -> int:
    """The look from which on D stays above a bound."""
    below = np.flatnonzero(course < bound)
    return int(below[-1]) + 1 if len(below) else 0


def fit_rate(times: Floats, course: Floats) -> float | None:
    """Rate at which D grows, 1 / time; None of fewer than three looks."""
    return float(np.polyfit(times, np.log(course), 1)[0]) if len(times) > 2 else None


def compute(table: Path, cells: Iterable[Cell] = CELLS, watch: Any = print) -> None:
    """Add the rows that a table lacks, seed by seed: all laws of a seed in all cells before the next."""
    known = {_key(row) for row in read(table)}
    wanted = [
        (cell.particles > LARGE, seed, law, d, cell.particles, cell.mu, cell.tilts)
        for cell in cells
        for seed in range(1, cell.seeds + 1)
        for d in cell.dimensions
        for law in cell.laws
    ]
    for _, seed, law, d, count, mu, tilts in sorted(wanted, key=itemgetter(0, 1)):
        if (law, d, count, mu, seed) not in known:
            made = list(rows(law, d, count, mu, seed, tilts))
            with table.open("a") as file:
                file.writelines(json.dumps(row) + "\n" for row in made)
            pairs = [row.get("pairs") for row in made]
            watch(f"{law}, d = {d}, N = {count}, mu = {mu}, seed {seed}: {pairs}", flush=True)


def compute_growth(table: Path, watch: Any = print) -> None:
    """Add the packings that a table of those that are let go lacks."""
    known = {row["seed"] for row in read(table)}
    for seed in range(1, LET_GO + 1):
        if seed not in known:
            row = let_go(seed)
            with table.open("a") as file:
                file.write(json.dumps(row) + "\n")
            watch(row, flush=True)


def _key(row: dict[str, Any]) -> tuple[Any, ...]:
    return row["law"], row["d"], row["count"], row["mu"], row["seed"]


def read(table: Path) -> list[dict[str, Any]]:
    """The rows of a table."""
    return [json.loads(line) for line in table.read_text().splitlines()] if table.exists() else []
