"""The tables of the page on LAMMPS's laws computed, the page made from them, or a packing in ten computed again.

python -m research.lammps_laws.make compute    what the tables lack of all cells, on one core, resumable; hours
python -m research.lammps_laws.make growth     the packings that are let go without loss; minutes
python -m research.lammps_laws.make weak       the weak pairs of mindlin/force followed; an hour
python -m research.lammps_laws.make page       README.md from the tables
python -m research.lammps_laws.make check      the first packings of 50 particles of each law once more, compared

From the folder of the repository.
"""

import sys
from collections.abc import Iterable
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from faultgouge.figures import render
from faultgouge.studies.statistics import median, share
from research.lammps_laws.compute import (
    CELLS,
    LAWS,
    MU,
    STEEP,
    TILTS,
    TO,
    Cell,
    compute,
    compute_growth,
    let_go,
    read,
)
from research.lammps_laws.energy_cycle import energy_cycle
from research.lammps_laws.weak_pairs import compute_weak

HERE = Path(__file__).parent
TABLES = HERE / "tables"
PACKINGS, GROWTH, WEAK = "packings.jsonl", "growth.jsonl", "weak_pairs.jsonl"

USUAL = (50, MU)
"""Particles and friction of the packings of which most is known."""

AGREES = 1e-6
"""Relative difference of numbers that are computed again: the motion of a packing that comes to rest is repeated to the
bit on one machine, and its rounding ends at the balance of forces, 1e-8."""


STAYS = "granular hertz, mindlin/force"
"""The law of the large packings whose tangential force at constant slip does not follow the overlap."""

FEWEST = 2
"""Weak pairs of the packings with the fewest contacts at the bound: those with none and two, the next one has eight."""

GROWTH_BOUND = TO / 10
"""D beyond which a packing that has been let go has grown: a decade below the end of a run, twelve above the push."""


def cell(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts of some packings of one law at one tilt, with intervals of 95 %."""
    good = [row for row in rows if row["rests"]]
    least = [row["least_q"] for row in good if row["least_q"] is not None]
    return {
        "packings": len(good),
        "restless": len(rows) - len(good),
        "with_pairs": share(sum(row["pairs"] > 0 for row in good), len(good)),
        "share": median([row["share"] for row in good]) if good else None,
        "growth": median([row["growth_rate"] for row in good]) if good else None,
        "least_q": median(least) if len(least) > 1 else None,
        "bound": sum(row["at_bound"] > 0 for row in good),
    }


def by_tilt(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Counts of each law at each tilt, in both dimensions."""
    return [
        {"law": law, "d": d, "tilt": tilt}
        | cell([row for row in rows if (row["law"], row["d"], row["tilt"]) == (law, d, tilt)])
        for d in (2, 3)
        for law in LAWS
        for tilt in TILTS
    ]


def by_law(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """How far LAMMPS's motion is from K's, and which dashpots the laws ask for, in both dimensions."""
    found = []
    for d in (2, 3):
        for law in LAWS:
            own = [row for row in rows if (row["law"], row["d"]) == (law, d)]
            moved = [row["motion"] for row in own if "motion" in row]
            asked = [row["damping"] for row in own if row.get("growth_rate") and row.get("damping")]
            found.append(
                {
                    "law": law,
                    "d": d,
                    "compared": len(moved),
                    "motion": float(np.median(moved)) if moved else None,
                    "asked": len(asked),
                    "restitution": min((each["restitution"] for each in asked), default=None),
                }
            )
    return found


def numbers(tables: Path = TABLES) -> dict[str, Any]:
    """All numbers of the page."""
    every = read(tables / PACKINGS)
    rows = [row for row in every if (row["count"], row["mu"]) == USUAL]
    steep = to_flow(every)
    return {
        "cells": by_tilt(rows),
        "laws": by_law(rows),
        "others": other_cells(every),
        "tilts": STEEP,
        "steep": steep,
        "shown": max(k + 1 for each in steep for k, count in enumerate(each["packings"]) if count),
        "rare": rare_pairs([row for row in every if row["law"] == STAYS and row["rests"]]),
        "seeds": full_seeds(rows),
        "rows": len(every),
        "restless": sum(not row["rests"] for row in every),
        "flowing": sum(flows(row) for row in every),
        "negative": sum(row["negative"] > 0 for row in every if row["rests"]),
        "pushed": growth(read(tables / GROWTH)),
        "weak": weak_pairs(read(tables / WEAK)),
        "cycles": [energy_cycle(law) for law in LAWS],
        "wall": wall_alone(),
    }


def rare_pairs(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """How seldom a law has complex pairs, and how weak these are."""
    small, large = ([row for row in rows if (row["count"] > USUAL[0]) == beyond] for beyond in (False, True))
    having = [row for row in rows if row["pairs"]]
    return {
        "rows": len(large),
        "having": sum(row["pairs"] > 0 for row in large),
        "small_rows": len(small),
        "small": [row for row in small if row["pairs"]],
        "most": max((row["pairs"] for row in having), default=0),
        "growth": max((row["growth_rate"] for row in having), default=0.0),
        "least_q": min((row["least_q"] for row in having), default=np.inf),
    }


def full_seeds(rows: list[dict[str, Any]]) -> int:
    """The last seed that all laws have in both dimensions."""
    return min(max(row["seed"] for row in rows if row["law"] == law and row["d"] == d) for law in LAWS for d in (2, 3))


def other_cells(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The first and the last tilt of the cells of other sizes and other friction, as far as they have been computed."""
    found, key_of = [], itemgetter("count", "mu", "d", "law", "tilt")
    for count, mu, _, laws, dimensions, _ in CELLS:
        for d in dimensions if (count, mu) != USUAL else ():
            for law in laws:
                for tilt in (TILTS[0], TILTS[-1]):
                    key = (count, mu, d, law, tilt)
                    own = [row for row in rows if key_of(row) == key]
                    if own:
                        found.append({"count": count, "mu": mu, "d": d, "law": law, "tilt": tilt} | cell(own))
    return found


def flows(row: dict[str, Any]) -> bool:
    """Whether most particles of a packing move at the end."""
    return bool(row.get("moving", 0.0) > 0.5)


def to_flow(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Packings that are tilted until they flow: how many have pairs, and of how many modes, at each tilt."""
    found, key_of = [], itemgetter("count", "mu", "d", "law")
    for tilted in (each for each in CELLS if each.tilts == STEEP):
        for d in tilted.dimensions:
            for law in tilted.laws:
                key = (tilted.particles, tilted.mu, d, law)
                own = [row for row in rows if key_of(row) == key]
                at = [[row for row in own if row["tilt"] == tilt and row["rests"]] for tilt in STEEP]
                flowing = [row["tilt"] for row in own if flows(row)]
                found.append(
                    {
                        "mu": tilted.mu,
                        "d": d,
                        "law": law,
                        "packings": [len(each) for each in at],
                        "with_pairs": [sum(row["pairs"] > 0 for row in each) for each in at],
                        "share": [float(np.median([row["share"] for row in each])) if each else None for each in at],
                        "flowing": len(flowing),
                        "flows": float(np.median(flowing)) if flowing else None,
                    }
                )
    return found


def growth(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Packings that are let go: growth in LAMMPS over that of the linearised packing, and beyond small motion."""
    good = [row for row in rows if row["rests"]]
    free = [row for row in good if not row["at_bound"]]
    return {
        "law": rows[0]["law"],
        "d": rows[0]["d"],
        "tilt": rows[0]["tilt"],
        "packings": len(good),
        "restless": len(rows) - len(good),
        "pairs": sum(row["pairs"] > 0 for row in good),
        "grown": sum(row["last"] > GROWTH_BOUND for row in good),
        "rows": good,
        "free": len(free),
        "ratio": _middle(row["rate"] / row["linear"] for row in free),
        "late": _middle(row["late"] / row["predicted"] for row in good),
    }


def weak_pairs(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """How many packings have a weak pair, and the rates of each."""
    samples = []
    for count, mu in sorted({(row["count"], row["mu"]) for row in rows}):
        own = [row for row in rows if (row["count"], row["mu"]) == (count, mu)]
        seeds, good = max(row["seed"] for row in own), sum(row["rests"] for row in own)
        samples.append({"count": count, "mu": mu, "seeds": seeds, "rows": good})
    pairs = sorted((row for row in rows if row.get("pairs")), key=lambda row: row["at_bound"])
    few = [run["grows"] / run["predicted"] for row in pairs[:FEWEST] for run in row["runs"]]
    return {"samples": samples, "pairs": pairs, "few": [min(few), max(few)]}


def _middle(values: Iterable[float]) -> list[float]:
    """Median, least and largest."""
    each = sorted(values)
    return [float(np.median(each)), each[0], each[-1]]


def wall_alone() -> dict[str, Any]:
    """The deck of the page: two spheres on the wall of hooke/history, in LAMMPS, and with a stiffness that stays."""
    from mpi4py import MPI

    from faultgouge.analysis import spectrum
    from faultgouge.pywrap import from_lammps, lammps_instance

    with TemporaryDirectory() as folder:
        lmp = lammps_instance(MPI.COMM_SELF, Path(folder) / "log")
        deck = (HERE / "wall.in").read_text()
        for line in deck.splitlines():
            lmp.command(line)
        found = from_lammps(lmp)
        lmp.close()
    c, s = found.contacts, spectrum(found)
    b = np.linalg.norm(c.closing, axis=1)[c.wall] / np.linalg.norm(c.tangential_force, axis=1)[c.wall]
    return {
        "deck": deck.strip(),
        "power": float(np.mean(b * c.overlap[c.wall])),
        "pairs": len(s.pairs),
        "least_q": s.least_q if s.pairs else None,
        "growth": s.growth_rate(),
    }


def format_range(value: list[float] | None, digits: str = ".2g") -> str:
    """A median with its interval."""
    return "-" if value is None else "{} ({} to {})".format(*(format(each, digits) for each in value))


def three(value: list[float]) -> str:
    """A median with its range, to hundredths."""
    return format_range(value, ".2f")


def format_signed(value: float) -> str:
    """A number with its sign; a number that is zero to eight digits has none."""
    return "0" if abs(value) < 1e-8 else f"{value:+.4g}"


def write_page(folder: Path = HERE, tables: Path = TABLES) -> Path:
    """Write README.md of a folder from the tables."""
    formats = {"ranged": format_range, "three": three, "signed": format_signed}
    text = render("research.lammps_laws", "README.md.j2", **numbers(tables), **formats)
    (folder / "README.md").write_text(text)
    return folder / "README.md"


def check(cells: Iterable[Cell] = CELLS) -> list[str]:
    """Packings of the first seed and 50 particles computed again that differ from the tables."""
    with TemporaryDirectory() as folder:
        again = Path(folder) / PACKINGS
        known = {_key(row): row for row in read(TABLES / PACKINGS)}
        there = {(count, mu) for _, _, count, mu, _, _ in known if count == USUAL[0]}
        compute(again, [cell._replace(seeds=1) for cell in cells if cell[:2] in there])
        new = [row for row in read(again) if _key(row) in known]
    wrong = [
        f"{row['law']}, d = {row['d']}, N = {row['count']}, mu = {row['mu']}, tilt {row['tilt']}"
        for row in new
        if row["rests"] != known[_key(row)]["rests"]
        or not np.isclose(row.get("growth_rate", 0), known[_key(row)].get("growth_rate", 0), rtol=AGREES)
    ]
    first = read(TABLES / GROWTH)[0]
    if not np.isclose(let_go(1)["rate"], first["rate"], rtol=AGREES):
        wrong.append("growth of seed 1")
    return wrong


def _key(row: dict[str, Any]) -> tuple[Any, ...]:
    return tuple(row[name] for name in ("law", "d", "count", "mu", "seed", "tilt"))


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compute"]:
            compute(TABLES / PACKINGS)
        case ["growth"]:
            compute_growth(TABLES / GROWTH)
        case ["weak"]:
            compute_weak(TABLES / WEAK)
        case ["page"]:
            print(write_page())
        case ["check"]:
            print(check() or "the same")
        case _:
            sys.exit(__doc__)
