"""Packings with contacts at the bound as they are, under a load that is held and one that rises: tables and page.

python -m research.rising.make layers    what the table of layers lacks, on one core, resumable; an hour
python -m research.rising.make poured    what the table of poured spheres lacks; ten minutes
python -m research.rising.make loaded SEEDS   what the table of layers that are loaded at a rate lacks; a minute a seed
python -m research.rising.make starts    what the table of two layers for a longer time lacks; a minute
python -m research.rising.make onsets SEEDS   what the table of onsets lacks; ten seconds a seed
python -m research.rising.make page      README.md from the tables
python -m research.rising.make check     the first seed of the layers and a tenth of the spheres once more, compared

From the folder of the repository.
"""

import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from faultgouge.analysis.motion.rising_load import FADE_WINDOWS, HALVES_DIFFERENCE
from faultgouge.figures import render, save, styled
from faultgouge.studies.statistics import share
from research.laws.both_laws import RESTITUTIONS as WEAKEST_FIRST
from research.modes.loss import GROWS as LINEAR
from research.modes.sets import STANDARD
from research.rising import onsets
from research.rising.compute import (
    APART,
    COMPARED,
    FIRST,
    HISTORIES,
    LOADS,
    POURED_LAWS,
    POURED_SEEDS,
    RATES,
    RESTITUTIONS,
    SEEDS,
    SLOPES,
    STIFFNESSES,
    compute_layers,
    compute_poured,
    follow_longer,
    layers,
    poured,
)
from research.rising.loaded import SLIP, VIBRATES, compute_loaded, starts_of, summaries
from research.statistics import count_of
from research.tables import add_seeds, differing, known_rows

HERE = Path(__file__).parent
LAYERS, ONE_START, POURED, STARTS, ONSETS, LOADED = (
    HERE / "tables" / f"{name}.jsonl" for name in ("layers", "layers_one_start", "poured", "starts", "onsets", "loaded")
)
"""Rows of `ONE_START` stand for those that `LAYERS` lacks still: drift and vibration from one start, over windows."""

LAWS = HERE.parent / "laws" / "tables" / "force_100.jsonl"

QUALITIES = (50, 100, 200, 300)
"""Q of a loss that takes omega/Q of each mode; rock has 50 to 300."""

FY = float(STANDARD["load"]["fy"])

LAST_WINDOWS = 8
"""Windows over which the vibration of a start is a mean, and which are compared with as many before."""

GROWTH_FROM = 1e-4
"""Growth rate of D, 1 / time, from which linear motion is said to grow: fifty times the rounding of eigenvalues."""

SAME_RATE = 1e-3
"""Relative difference of rates that are computed again: those of motions repeat to the last digits on one machine."""

Row = dict[str, Any]


def outcomes(rows: list[Row]) -> dict[str, Any]:
    """How many packings do what, with contacts at the bound stuck, sliding on, and as they are."""
    found: dict[str, Any] = {
        "packings": len(rows),
        "bound": sum(row["at_bound"] > 0 for row in rows),
        "sticking": share(sum(row["sticking"] > GROWTH_FROM for row in rows), len(rows)),
        "sliding": share(sum(row["sliding"] > GROWTH_FROM for row in rows), len(rows)),
    }
    found["unknown"] = sum(row["stable"] is None for row in rows)
    for name, stable in (("rests", True), ("grows", False)):
        found[name] = share(sum(row["stable"] is stable for row in rows), len(rows), found["unknown"])
    sizes = [row["one_sided"]["amplification"] for row in rows if row["one_sided"] and row["stable"]]
    found["amplification"] = [float(np.median(sizes)), max(sizes)] if sizes else None
    return found


def outcome_of(rising: Row) -> str:
    """Whether a layer vibrates, from one of its starts at least, follows the load from all, or is not known to."""
    steady = [_vibrates(each) for each in starts_of(rising) if each["steady"]]
    if any(steady):
        return "vibrate"
    return "follow" if len(steady) == len(starts_of(rising)) else "open"


def under_the_load(rows: list[Row]) -> dict[str, Any]:
    """How many layers vibrate under a load that rises, and how much: the most of both starts."""
    known = [row["rising"] for row in rows if row["rising"]]
    done = [outcome_of(each) for each in known]
    steady = [
        max(each["vibration"] / each["drift"] for each in starts_of(rising) if each["steady"])
        for rising, what in zip(known, done, strict=True)
        if what == "vibrate"
    ]
    return {
        "asked": len(known),
        "two_starts": sum("span" in each for each in known),
        "vibrate": share(done.count("vibrate"), len(known), done.count("open")),
        "follow": share(done.count("follow"), len(known), done.count("open")),
        "open": done.count("open"),
        "ratio": [float(np.median(steady)), min(steady), max(steady)] if steady else None,
    }


def vibration_in_lammps(rows: list[Row]) -> Row:
    """How many layers vibrate in LAMMPS at the smallest rate, from a start at least, and with a large friction."""
    slow = [row["lammps"][str(min(RATES))] for row in rows]
    motions = [each if isinstance(each, list) else [each] for each in slow]
    return {
        "layers": len(rows),
        "vibrate": sum(any(_vibrates(each) for each in starts) for starts in motions),
        "control": sum(_vibrates(row["control"]) for row in rows),
    }


def _vibrates(motion: Row) -> bool:
    return bool(motion["vibration"] > VIBRATES * motion["drift"])


def starts_beside_lammps(rows: list[Row]) -> list[Row]:
    """Motion from each start beside LAMMPS's from the same start and over the same span, at all rates.

    `risen` is by how much the load rises in the run at each rate, as a share of what changes the first contact.
    """
    found = []
    for row in rows:
        rising = row["rising"]
        for number, one_sided in enumerate(starts_of(rising)):
            lammps = {rate: each[number] for rate, each in row["lammps"].items()}
            slow = lammps[str(min(RATES))]["vibration"]
            found.append(
                {name: row[name] for name in ("seed", "at_bound", "fx_over_fy", "restitution")}
                | {
                    "start": number,
                    "one_sided": one_sided,
                    "lammps": lammps,
                    "vibrates": one_sided["steady"] and _vibrates(one_sided),
                    "ratio": slow / one_sided["vibration"],
                    "within": abs(slow - one_sided["vibration"]) <= 2 * one_sided["vibration_error"],
                    "next_change": rising["next_change"],
                    "risen": {rate: float(rate) * rising["time"] / rising["next_change"] for rate in lammps},
                    "control": row.get("control"),
                }
            )
    return found


def vibrating(rows: list[Row]) -> dict[str, Any]:
    """LAMMPS's vibration at the smallest rate over that of one-sided motion, of all starts that vibrate."""
    own = [row for row in rows if row["vibrates"]]
    ratio = [row["ratio"] for row in own]
    return {
        "within": share(sum(row["within"] for row in own), len(own)),
        "ratio": [float(np.median(ratio)), min(ratio), max(ratio)] if ratio else None,
    }


def over_loss(laws: list[Row], cells: list[Row]) -> list[Row]:
    """How many packings move by themselves, over load and restitution: both laws, contacts at the bound in three ways.

    Sticking contacts, and both laws, are those of the tables of research/laws, each law on its own ramp.
    """
    found = []
    for load in LOADS:
        at = {name: [each[name] for row in laws for each in row["loads"] if each["fx_over_fy"] == load and name in each]
              for name in ("smooth", "loaded")}  # fmt: skip
        for restitution in WEAKEST_FIRST:
            grown = {name: [dict(map(tuple, each["damped"]))[restitution] > LINEAR for each in states]
                     for name, states in at.items()}  # fmt: skip
            own = [c for c in cells if (c["law"], c["load"], c["restitution"]) == ("coulomb", load, restitution)]
            found.append(
                {"load": load, "restitution": restitution, "as_they_are": own[0] if own else None}
                | {name: share(sum(values), len(values)) for name, values in grown.items()}
            )
    return found


def over_quality(laws: list[Row]) -> list[Row]:
    """How many packings have a pair that a loss of each Q does not stop, over the load, of both laws."""
    found = []
    for load in sorted({each["fx_over_fy"] for row in laws for each in row["loads"]}):
        for name in ("smooth", "loaded"):
            least = [each[name]["least_q"] or np.inf for row in laws for each in row["loads"]
                     if each["fx_over_fy"] == load and name in each]  # fmt: skip
            counts = {q: share(sum(each < q for each in least), len(least)) for q in QUALITIES}
            found.append({"load": load, "law": name, "counts": counts, "none": sum(np.isinf(least))})
    return found


def onsets_over_undamped(rows: list[Row]) -> list[Row]:
    """Damped over undamped onsets of each restitution: how many there are, their quartiles and range."""
    found = []
    for restitution in onsets.RESTITUTIONS:
        both = [(row[str(restitution)], row["undamped"]) for row in rows if row["undamped"] is not None]
        ratios = np.array([damped / undamped for damped, undamped in both if damped is not None])
        found.append(
            {
                "restitution": restitution,
                "found": share(len(ratios), len(both)),
                "below": int(np.sum(ratios < 1)),
                "quartiles": np.quantile(ratios, [0.25, 0.5, 0.75]).tolist() if len(ratios) else None,
                "range": [float(ratios.min()), float(ratios.max())] if len(ratios) else None,
                "largest": max((damped for damped, _ in both if damped is not None), default=0.0) / FY,
            }
        )
    return found


def longer_runs(rows: list[Row]) -> list[Row]:
    """Vibration of each start at the end, one-sided and in LAMMPS, and whether it is steady."""
    found = []
    for row in rows:
        ends = {}
        for name in ("one_sided", "lammps"):
            windows = np.array(row[name]["vibration"])
            last, before = (
                windows[:, part].mean(axis=1)
                for part in (slice(-LAST_WINDOWS, None), slice(-2 * LAST_WINDOWS, -LAST_WINDOWS))
            )
            ends[name] = [
                {"vibration": float(now), "steady": bool(abs(now - then) <= HALVES_DIFFERENCE * now)}
                for now, then in zip(last, before, strict=True)
            ]
        found.append({"seed": row["seed"], "time": row["chunk"] * (windows.shape[1] + FADE_WINDOWS)} | ends)
    return found


@styled
def figure_of_starts(rows: list[Row]) -> Figure:
    """Vibration over the rate in one window after the other, of two starts, of the layers of `APART`."""
    shown = [row for row in rows if row["seed"] in APART]
    figure = Figure(figsize=(6.2, 2.6), layout="constrained")
    panels = figure.subplots(1, len(shown), squeeze=False)[0]
    for axes, row in zip(panels, shown, strict=True):
        for start, (colour, words) in enumerate((("C0", "drag on all"), ("C3", "drag on translations"))):
            one, lammps = (np.array(row[name]["vibration"][start]) for name in ("one_sided", "lammps"))
            times = row["chunk"] * (FADE_WINDOWS + 0.5 + np.arange(len(one)))
            axes.plot(times, one, color=colour, linewidth=1.0, label=words)
            axes.plot(times[::2], lammps[::2], ".", color=colour, markersize=4)
        axes.set_yscale("log")
        axes.set_title(f"seed {row['seed']}", fontsize=8)
        axes.set_xlabel("$t$")
    panels[0].set_ylabel("vibration over the rate")
    panels[0].legend(fontsize=6, loc="lower right")
    return figure


def key_of(row: Row) -> tuple[Any, ...]:
    """Seed, law, load and restitution of a row of the layers."""
    return tuple(row.get(name) for name in ("seed", "law", "fx_over_fy", "restitution"))


def rows_of_layers() -> tuple[list[Row], list[Row]]:
    """The rows from two starts, and those that are from one start still."""
    new = known_rows(LAYERS)
    done = {key_of(row) for row in new}
    return new, [row for row in known_rows(ONE_START) if key_of(row) not in done]


def cells_of_layers(rows: list[Row]) -> list[Row]:
    """The outcomes of the layers of each load, law and restitution."""
    found = []
    for key in product(LOADS, HISTORIES, RESTITUTIONS):
        own = [row for row in rows if (row["fx_over_fy"], row["law"], row["restitution"]) == key]
        cell = dict(zip(("load", "law", "restitution"), key, strict=True)) | outcomes(own)
        found.append(cell | ({"rising": under_the_load(own)} if cell["law"] == "coulomb" else {}))
    return found


def piles_of_spheres(rows: list[Row]) -> list[Row]:
    """The outcomes of the poured spheres of each law, stiffness and slope."""
    found = []
    for law, kn, slope in product(POURED_LAWS, STIFFNESSES, SLOPES):
        tried = [row for row in rows if (row["law"], row["kn"], row["slope"]) == (law, kn, slope)]
        good = [row for row in tried if row["rests"]]
        cell: Row = {"law": law, "kn": kn, "slope": slope, "tried": len(tried)} | outcomes(good)
        cell["overlap"] = float(np.median([row["overlap"] for row in good])) if good else None
        cell["pairs"] = sum(row["pairs"] > 0 for row in good)
        found.append(cell)
    return found


def numbers() -> dict[str, Any]:
    """All numbers of the page."""
    spheres, starts, laws, firsts = (known_rows(table) for table in (POURED, STARTS, LAWS, ONSETS))
    new, old = rows_of_layers()
    every = new + old
    rows = [row for row in every if "stable" in row]
    from_both = starts_beside_lammps([row for row in new if "lammps" in row])
    cells = cells_of_layers(rows)
    return {
        "cells": cells,
        "usual": {cell["load"]: cell for cell in cells if (cell["law"], cell["restitution"]) == ("coulomb", 0.9)},
        "smoothed": {cell["load"]: cell for cell in cells if (cell["law"], cell["restitution"]) == ("total", 0.9)},
        "seeds": max((row["seed"] for row in every), default=0),
        "asked": SEEDS,
        "ended": [row for row in every if "stable" not in row],
        "renewed": [sum("stable" in row for row in new), len(rows)],
        "both_starts": [row for row in from_both if (row["fx_over_fy"], row["restitution"]) == COMPARED],
        "elsewhere": [row for row in from_both if (row["fx_over_fy"], row["restitution"]) != COMPARED],
        "vibrating": vibrating(from_both),
        "in_lammps": vibration_in_lammps([row for row in rows if "control" in row]),
        "loaded": summaries(known_rows(LOADED), [row for row in rows if key_of(row)[1:] == ("coulomb", *COMPARED)]),
        "first": FIRST,
        "rates": RATES,
        "starts": longer_runs(starts),
        "over_loss": over_loss(laws, cells),
        "over_quality": over_quality(laws),
        "qualities": QUALITIES,
        "onsets": onsets_over_undamped(firsts),
        "onset_seeds": [row["seed"] for row in firsts],
        "without_onset": sum(row["undamped"] is None for row in firsts),
        "poured": piles_of_spheres(spheres),
        "poured_seeds": max((row["seed"] for row in spheres), default=0),
        "poured_rows": len(spheres),
        "poured_asked": POURED_SEEDS * len(POURED_LAWS) * len(STIFFNESSES) * len(SLOPES),
    }


def count(value: dict[str, Any]) -> str:
    """A count of so many."""
    return f"{value['count']} of {value['of']}"


def thousandths(value: float) -> str:
    """A number in units of 1e-3."""
    return format(1e3 * value, ".3g")


def plus_minus(motion: Row, name: str) -> str:
    """Drift or vibration with its error, in units of 1e-3."""
    return f"{thousandths(motion[name])} \u00b1 {1e3 * motion[f'{name}_error']:.1g}"


def spread(value: list[float] | None, digits: str = ".2g") -> str:
    """A median with its range; or a median with the largest."""
    if value is None:
        return "-"
    middle, *ends = (format(each, digits) for each in value)
    return f"{middle} ({' to '.join(ends)})" if len(ends) > 1 else f"{middle} ({ends[0]})"


def write_page(folder: Path = HERE) -> Path:
    """Write README.md of a folder from the tables."""
    found = numbers()
    at = {each["law"]: each["counts"] for each in found["over_quality"] if each["load"] == COMPARED[0]}
    contrast = [at[law][q] for q in (QUALITIES[0], QUALITIES[-1]) for law in ("smooth", "loaded")]
    words = {
        "thousandths": thousandths,
        "plus_minus": plus_minus,
        "count": count,
        "spread": spread,
        "in_thousandths": lambda value: spread(value and [1e3 * each for each in value]),
        "part": count_of,
        "vibrates": VIBRATES,
        "slip": SLIP,
        "contrast": contrast,
        "at": COMPARED,
    }
    text = render("research.rising", "README.md.j2", **found, **words)
    (folder / "README.md").write_text(text)
    (folder / "pictures").mkdir(exist_ok=True)
    _, vectors = save(figure_of_starts(known_rows(STARTS)), folder / "pictures" / "starts")
    vectors.unlink()  # the page shows dots, and the lines of this file are many
    return folder / "README.md"


def check() -> list[str]:
    """The rows of the first seed, and the first tenth of the spheres, computed again, that differ from the tables."""
    known = {key_of(row): row for row in known_rows(LAYERS) if row["seed"] == 1 and "stable" in row}
    cells = sorted({(load, restitution) for _, _, load, restitution in known})
    pairs = [(known[key_of(row)], row) for row in layers(1, cells) if "stable" in row]
    spheres = known_rows(POURED)
    for old in spheres[: len(spheres) // 10]:
        pairs.append((old, poured(*(old[name] for name in ("law", "kn", "slope", "seed")))))
    return [
        f"{key_of(old)}: {each}"
        for old, new in pairs
        for each in differing(old, new, ("rests", "stable", "sticking"), SAME_RATE)
    ]


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["layers"]:
            compute_layers(LAYERS)
        case ["loaded", seeds]:
            compute_loaded(LOADED, int(seeds))
        case ["poured"]:
            compute_poured(POURED)
        case ["starts"]:
            add_seeds(STARTS, APART, follow_longer)
        case ["onsets", seeds]:
            add_seeds(ONSETS, range(1, int(seeds) + 1), onsets.rows_of)
        case ["page"]:
            print(write_page())
        case ["check"]:
            print(check() or "the same")
        case _:
            sys.exit(__doc__)
