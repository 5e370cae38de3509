"""The page of the study: its template filled with its numbers, and its pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.files.wholefile import write_text
from ...figures.pages import render
from ...figures.style import save_as
from ..statistics import interval
from .draw import mechanism_figure, modes_figure, onsets_figure, size_figure
from .numbers import LOADS, numbers, read_tables
from .sets import PACKINGS, SIZES
from .tables import Table


def write_page(folder: Path) -> Path:
    """Write genericity.md, genericity.json and the pictures from the tables of a folder.

    Parameters
    ----------
    folder : Path
        With a folder for each set, and results.csv in each.

    Returns
    -------
    Path
        The page.
    """
    tables = read_tables(folder)
    found = numbers(tables)
    onsets = tables.get("onsets", Table(()))
    predicted = np.array(
        [3.0 * f0 for f0, disks in zip(found["levels"]["f0"], found["levels"]["disks"], strict=True) if disks == 100]
    )
    figures = {
        "onsets": onsets_figure(onsets, predicted),
        "modes": modes_figure(onsets),
        "size": size_figure(found),
        "mechanism": mechanism_figure(found["surrogates"]),
    }
    for name, figure in figures.items():
        save_as(figure, folder / f"{name}.png")
    write_text(folder / "genericity.json", json.dumps(found, indent=1) + "\n")
    made = json.loads((folder / "made.json").read_text()) if (folder / "made.json").exists() else {}
    page = folder / "genericity.md"
    write_text(
        page,
        render(
            __package__ or "",
            "genericity.md.j2",
            **found,
            loads=LOADS,
            made=made,
            planned=PACKINGS,
            planned_sizes=SIZES,
            percent=percent,
            median=median,
            between=between,
            mean=mean,
            predicted_share=[float(np.mean(1 - np.exp(-((load / predicted) ** 2)))) for load in LOADS]
            if len(predicted)
            else None,
        ),
    )
    return page


def percent(found: dict[str, Any]) -> str:
    """A share with its interval: "62 % (55 to 69 %; 124 of 200)"."""
    if not found["of"]:
        return "none yet"
    low, high = 100 * found["low"], 100 * found["high"]
    return f"{100 * found['share']:.0f} % ({low:.0f} to {high:.0f} %; {found['count']} of {found['of']})"


def median(value: list[float | None], digits: str = ".3g") -> str:
    """A median with its interval."""
    return interval(value, digits, "beyond reach")


def between(value: dict[str, float] | None) -> str:
    """A fitted number with its interval."""
    return "not known" if value is None else interval([*value.values()], ".2f")


def mean(value: dict[str, float | None]) -> str:
    """A mean with half of its interval."""
    error = "" if value["error"] is None else f" ± {value['error']:.1g}"
    return f"{value['value']:.3g}{error}"
