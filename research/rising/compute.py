r"""What becomes of packings at rest once contacts at Coulomb's bound slide on ahead and stick on the way back.

Each row is the verdict of :func:`faultgouge.analysis.stability` on one packing: its linear motion with all contacts at
the bound sticking and with all of them sliding on, its one-sided motion from random pushes, and its one-sided motion
under a load that rises.

**Which packings.** *Ramps*: layers of 100 disks (k_n = 2e5, F_y = 3, mu = 1) that settle without friction and are then
loaded in increments of 1e-3 F_y, either with the slider from the beginning (law "coulomb") or with the smoothed law
("total"), at 0.1, 0.2 and 0.3 F_y, with dashpots of the restitutions 0.9 and 0.97 (C_T = 2/7 C_N). *Poured*: layers of
50 spheres under LAMMPS's own laws on slopes of 0.2 and 0.3, with three stiffnesses and dashpots of one restitution.

**The rule.** Packings are those of the seeds 1, 2, 3, ... in this order but for `FIRST`, none left out: first all
`SEEDS` at `COMPARED`, then all other loads and restitutions of one seed before the next, as many seeds as the time
allows. Of the poured packings all that is asked of one seed comes before the next.

**Beside LAMMPS.** LAMMPS integrates what one-sided motion follows, from the same two starts and over the same spans
(:mod:`.windows`): each layer of the slider at the smallest of `RATES`, at 0.2 F_y and the restitution 0.9 at all
of these and with so large a friction that no contact is at the bound.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from faultgouge.analysis import Configuration, Packing, Stability, stability
from faultgouge.pywrap import Scene, dashpot, settle
from faultgouge.studies.result_rows import append_row
from research.lammps_laws.compute import GAMMA, KN, MU, pour, rest
from research.laws.both_laws import as_slider, at_loads
from research.modes.loss import impact_velocity, with_dashpots
from research.modes.sets import sets
from research.rising.windows import FADE_WINDOWS, Windows, drift_and_vibration, follow_one_sided, rise_in_plugin
from research.tables import known_rows

SEEDS = 20
APART = (11, 15)
"""The seeds that vibrated in LAMMPS otherwise than one-sided motion from one start."""

FIRST = (1, *APART)
"""The seeds that come first."""

LOADS = (0.1, 0.2, 0.3)
RESTITUTIONS = (0.9, 0.97)
HISTORIES = ("coulomb", "total")

COMPARED = (0.2, 0.9)
"""F_x/F_y and restitution of the layers that LAMMPS integrates at all rates, and without contacts at the bound."""

RATES = (3e-4, 3e-5, 3e-6)
"""Rates of the load in LAMMPS, force / time: over 100 units of time, the longest run, it rises by 3e-2 at the most."""

STARTS = (True, False)
"""Whether the drag that fades out acts on rotations."""

FOLLOWED = 60
"""Windows for which the layers of `APART` are followed: more than twice as many as those of the other rows."""

POURED_LAWS = (
    "granular hertz, mindlin/force",
    "granular hertz, mindlin_rescale/force",
    "granular hooke, linear_history",
)
STIFFNESSES = (KN, KN / 10**1.5, KN / 10**2.25)
"""Overlaps of Hertz's laws go as k_n^(-2/3): some 6e-4, 6e-3 and 2e-2 of a diameter; dashpots go as k_n^(2/3), with one
restitution. Those of the linear law go as 1/k_n, and dashpots as its root."""

SLOPES, POURED_SEEDS = (0.2, 0.3), 5


def at_rest(seed: int, history: str, loads: Sequence[float]) -> tuple[Scene, dict[float, Packing], dict[str, Any]]:
    """The scene of a layer, its equilibria by the load, F_x/F_y, and how its ramp ended."""
    base = sets()["force 100"].scene
    fy = base["load"]["fy"]
    changes = {
        "packing": base.get("packing", {}) | {"seed": seed},
        "ramp": {"step": 1e-3 * fy, "until": loads[-1] * fy},
    }
    scene = Scene.from_mapping(base | changes | {"modes": {"fx_over_fy": list(loads)}})
    start, law = settle(scene), scene.law.model_copy(update={"history": history})
    if history == "coulomb":
        start = replace(start, packing=as_slider(start.packing))
    found = list[Packing]()

    def keep(packing: Packing) -> dict[str, Any]:
        found.append(packing)
        return {}

    told = at_loads(scene.model_copy(update={"law": law}), start, keep)
    return scene, {load["fx_over_fy"]: each for load, each in zip(told["loads"], found, strict=True)}, told


def with_restitution(packing: Packing, scene: Scene, restitution: float) -> Packing:
    """A layer with the dashpots of a restitution."""
    return with_dashpots(packing, dashpot(scene.law.kn, restitution, 1.0, impact_velocity(scene)))


def layers(seed: int, cells: Sequence[tuple[float, float]]) -> Iterator[dict[str, Any]]:
    """The rows of the layers of one seed, of some loads and restitutions; and where a ramp ended before them."""
    loads = sorted({load for load, _ in cells})
    for history in HISTORIES:
        key = {"seed": seed, "law": history}
        scene, at, told = at_rest(seed, history, loads)
        for load, restitution in cells:
            if load in at:
                begin = time.process_time()
                lossy = with_restitution(at[load], scene, restitution)
                row = verdict(stability(lossy, rise="fx"), lossy.configuration)
                if history == "coulomb" and row["rising"]:
                    compared = (load, restitution) == COMPARED
                    row |= beside(lossy, row["rising"], RATES if compared else RATES[-1:], control=compared)
                where = {"fx_over_fy": load, "restitution": restitution}
                yield key | where | row | {"cpu_seconds": time.process_time() - begin}
        if len(at) < len(loads):
            yield key | {"ends": told["ends"], "reach": told["reach"]}


def compute_layers(table: Path, watch: Any = print) -> None:
    """Add the layers that a table lacks, in the order of the rule, whole seeds at a time."""
    others = [cell for cell in product(LOADS, RESTITUTIONS) if cell != COMPARED]
    for cells in ([COMPARED], others):
        known = {row["seed"] for row in known_rows(table) if (row.get("fx_over_fy"), row.get("restitution")) in cells}
        for seed in sorted(range(1, SEEDS + 1), key=lambda seed: (seed not in FIRST, seed)):
            if seed not in known:
                for row in list(layers(seed, cells)):
                    append_row(table, row)
                watch(f"seed {seed}, {len(cells)} cells", flush=True)


def verdict(found: Stability, configuration: Configuration) -> dict[str, Any]:
    """The numbers of a verdict that a row has."""
    told = found.as_dict()
    kept = {
        name: told[name]
        for name in ("stable", "growth_rate", "at_bound", "one_sided", "rising", "not_followed", "reasons")
    }
    overlap = configuration.contacts.overlap
    return kept | {
        "contacts": found.contacts,
        "overlap": float(overlap.mean()) if len(overlap) else None,
        "sticking": found.sticking.growth_rate,
        "sliding": found.sliding.growth_rate,
        "undamped": found.undamped.growth_rate,
        "pairs": found.undamped.pairs,
    }


def beside(packing: Packing, rising: dict[str, Any], rates: Sequence[float], control: bool) -> dict[str, Any]:
    """LAMMPS's motion from both starts at each rate; and at the smallest one with so large a friction that none slides.

    The time is that for which one-sided motion was followed, and so are its spans.
    """
    windows = Windows.of(packing.configuration, rising)

    def lammps(packing: Packing, rate: float, spins: bool) -> dict[str, float]:
        parts = rise_in_plugin(packing, rate, windows, spins)[-windows.span :]
        return drift_and_vibration(parts, windows.length, rate)

    found: dict[str, Any] = {
        "windows": [windows.count, windows.span],
        "lammps": {str(rate): [lammps(packing, rate, spins) for spins in STARTS] for rate in rates},
    }
    if control:
        found["control"] = lammps(replace(packing, law=replace(packing.law, mu=100.0)), min(rates), True)
    return found


def follow_longer(seed: int) -> Iterator[dict[str, Any]]:
    """The row of a layer at `COMPARED` that is followed for a longer time: vibration in each window, of both starts."""
    begin, (load, restitution) = time.process_time(), COMPARED
    scene, at, _ = at_rest(seed, "coulomb", [load])
    packing = with_restitution(at[load], scene, restitution)
    length, windows = follow_one_sided(packing, FOLLOWED)
    followed_there = Windows(length, FOLLOWED, FOLLOWED - FADE_WINDOWS)
    motions = [rise_in_plugin(packing, min(RATES), followed_there, spins) for spins in STARTS]
    lammps = [[drift_and_vibration([part], length, min(RATES)) for part in motion] for motion in motions]
    yield {
        "seed": seed,
        "chunk": length,
        "one_sided": {"drift": windows[:, 0].T.tolist(), "vibration": windows[:, 1].T.tolist()},
        "lammps": {name: [[part[name] for part in motion] for motion in lammps] for name in ("drift", "vibration")},
        "cpu_seconds": time.process_time() - begin,
    }


def poured(law: str, kn: float, slope: float, seed: int) -> dict[str, Any]:
    """The row of one packing of spheres."""
    begin = time.process_time()
    key = {"law": law, "kn": kn, "slope": slope, "seed": seed}
    with TemporaryDirectory() as folder:
        gamma = GAMMA * (kn / KN) ** (1 / 2 if "hooke" in law else 2 / 3)
        lmp = pour(law, 3, 50, MU, seed, Path(folder) / "log", gamma, kn)
        lmp.command(f"variable slope equal {slope}")
        found = rest(lmp)
        lmp.close()
    row = {"rests": False} if found is None else {"rests": True} | verdict(stability(found), found)
    return key | row | {"cpu_seconds": time.process_time() - begin}


def compute_poured(table: Path, watch: Any = print) -> None:
    """Add the packings of spheres that a table lacks, seed by seed."""
    names = ("law", "kn", "slope", "seed")
    known = {tuple(row[name] for name in names) for row in known_rows(table)}
    for seed in range(1, POURED_SEEDS + 1):
        for law, kn, slope in product(POURED_LAWS, STIFFNESSES, SLOPES):
            if (law, kn, slope, seed) not in known:
                append_row(table, poured(law, kn, slope, seed))
                watch(f"{law}, kn = {kn:g}, slope {slope}, seed {seed}", flush=True)
