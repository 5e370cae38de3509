"""The page of the study: its template filled with its numbers, and its pictures."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.figures import render
from faultgouge.studies.modes import over_load
from research.modes.draw import collapse
from research.modes.loss import EVERY, RESTITUTIONS
from research.modes.numbers import COMPARISONS, QUALITIES, numbers
from research.modes.packing_rows import read_tables
from research.modes.sets import SIZES
from research.pictures import draw_all
from research.statistics import interval
from research.tables import write_json

GENERICITY = Path(__file__).parents[1] / "genericity" / "genericity.json"
"""The exponents of spacings and couplings."""

LOSSES = ("least_q", "critical_restitution")
"""Quantities of the picture of loss."""


def write_page(tables: Path, folder: Path) -> Path:
    """Write README.md, tables.md, modes.json and the pictures from tables.

    Parameters
    ----------
    tables : Path
        The folder of the tables.
    folder : Path
        Where to.

    Returns
    -------
    Path
        The first page.
    """
    found, package = numbers(read_tables(tables)), "research.modes"
    power = found["powers"]["load of share 0.1"]["power"]
    figures = {
        "sizes": lambda: over_load({str(disks): course for disks, course in found["sizes"].items()}),
        "collapse": lambda: collapse(found["sizes"], power[0], found["random"]),
        "loss": lambda: over_load({str(disks): course for disks, course in found["loss"].items()}, LOSSES),
    }
    ratio = json.loads(GENERICITY.read_text())["levels"]["exponents"]["coupling over spacing"]
    names = {
        "ratio": [ratio["low"], ratio["high"]],
        "planned": SIZES,
        "compared": COMPARISONS,
        "qualities": QUALITIES,
        **describe_loss(found),
    }
    formats = {"middle": interval, "exponent": partial(interval, digits=".2f"), "plain": plain, "part": part}
    page = found | names | formats | {"critical": critical}
    (folder / "tables.md").write_text(render(package, "tables.md.j2", **page))
    write_json(folder / "modes.json", finite(found))
    (folder / "pictures").mkdir(exist_ok=True)
    draw_all(figures, folder / "pictures")
    (folder / "README.md").write_text(render(package, "README.md.j2", **page))
    return folder / "README.md"


def describe_loss(found: dict[str, Any]) -> dict[str, Any]:
    """Loss in words: whether growth comes back, and how near LAMMPS is to the pencil."""
    runs = [run for each in found["runs"].values() for run in each if run["measured"] is not None]
    off = {
        kind: [run["measured"] / run["predicted"] - 1 for run in runs if (run["ct_over_cn"] == 0) == (kind == "still")]
        for kind in ("still", "both")
    }
    sizes = {kind: 100 * np.abs(each) for kind, each in off.items()}
    errors = {kind: f"{np.median(each):.2g}" for kind, each in sizes.items()}
    errors |= {f"{kind}_most": f"{each.max():.2g}" for kind, each in sizes.items()}
    returns = sum(course["returns"] for course in found["loss"].values())
    counted = "no load" if returns == 0 else f"{returns} loads"
    return {
        "run_count": len(runs),
        "run_errors": errors | {"faster": sum(each > 0 for each in off["both"]), "of": len(off["both"])},
        "returning": f"Growth that a stronger loss brings back was seen at {counted} of packings of {EVERY} disks, for "
        "which every restitution was looked at.",
    }


def finite(value: Any) -> Any:
    """The same for JSON, which has no infinite numbers: null in their place."""
    if isinstance(value, dict):
        return {str(key): finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [finite(each) for each in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def plain(value: float) -> str:
    """A number, or a word where it is infinite."""
    return "none" if np.isinf(value) else format(value, ".3g")


def part(value: dict[str, Any]) -> str:
    """A share of packings with its interval."""
    return "-" if value["share"] is None else f"{value['count']} ({value['low']:.2f} to {value['high']:.2f})"


def critical(value: list[float]) -> str:
    """A critical restitution with its interval; the strongest loss that was looked at stands for all below."""
    words = [f"under {each:.2g}" if each <= min(RESTITUTIONS) + 1e-6 else f"{each:.3g}" for each in value]
    return "-" if np.isnan(value[0]) else f"{words[0]} ({words[1]} to {words[2]})"
