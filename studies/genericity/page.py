"""The page of the study: its template filled with its numbers, and its pictures."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..frame import leave, save_png
from ..statistics import interval
from .draw import mechanism_figure, modes_figure, onsets_figure, size_figure
from .numbers import LOADS, numbers, read_tables
from .sets import PACKINGS, SIZES
from .tables import Table


def write_page(folder: Path, say: Callable[[str], None] = print) -> Path:
    """Write genericity.md, genericity.json and the pictures from the tables of a folder.

    Parameters
    ----------
    folder : Path
        With a folder for each set, and results.csv in each.
    say : callable
        Told of a picture that could not be drawn.

    Returns
    -------
    Path
        The page.
    """
    tables = read_tables(folder)
    found = numbers(tables)
    onsets, levels = tables.get("onsets", Table()), found["levels"]
    predicted = 3.0 * np.array(levels["f0"])[np.array(levels["disks"]) == 100]
    figures = {
        "onsets": lambda: onsets_figure(onsets, predicted),
        "modes": lambda: modes_figure(onsets),
        "size": lambda: size_figure(found),
        "mechanism": lambda: mechanism_figure(found["surrogates"]),
    }
    made = folder / "made.json"
    names = {
        "loads": LOADS,
        "made": json.loads(made.read_text()) if made.exists() else {},
        "planned": PACKINGS,
        "planned_sizes": SIZES,
        "predicted_share": [float(np.mean(1 - np.exp(-((load / predicted) ** 2)))) for load in LOADS]
        if len(predicted)
        else None,
    }
    formats = {"percent": percent, "median": median, "between": between, "mean": mean}
    return leave(folder, __package__ or "", "genericity", found, found | names | formats, figures, say, save_png)


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
