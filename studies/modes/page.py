"""The page of the study: its template filled with its numbers, and its pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.files.wholefile import write_text
from ...figures.pages import render
from ...figures.style import save_as
from .draw import collapse, over_load
from .numbers import COMPARED, numbers
from .sets import FEWER, KINDS, SIZES
from .tables import read_tables


def write_page(tables: Path, folder: Path) -> Path:
    """Write modes.md, modes.json and the pictures from tables.

    Parameters
    ----------
    tables : Path
        The folder of the tables.
    folder : Path
        Where to.

    Returns
    -------
    Path
        The page.
    """
    found = numbers(read_tables(tables))
    save_as(over_load({str(disks): course for disks, course in found["sizes"].items()}), folder / "sizes.png")
    power = found["powers"]["load of share 0.1"]["power"]
    save_as(collapse(found["sizes"], power[0], found["random"]), folder / "collapse.png")
    write_text(folder / "modes.json", json.dumps(finite(found), indent=1) + "\n")
    page = folder / "modes.md"
    names = {"planned": SIZES, "fewer": FEWER, "kinds": KINDS, "compared": COMPARED}
    write_text(
        page, render(__package__ or "", "modes.md.j2", **found, **names, middle=middle, plain=plain, exponent=exponent)
    )
    return page


def finite(value: Any) -> Any:
    """The same for JSON, which has no infinite numbers: null in their place."""
    if isinstance(value, dict):
        return {str(key): finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [finite(each) for each in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def middle(value: list[float], digits: str = ".2g", factor: float = 1.0) -> str:
    """A median with its interval: "0.15 (0.14 to 0.18)"; words where it has none."""
    if np.isnan(value[0]):
        return "-"
    words = ["none" if np.isinf(each) else format(each * factor, digits) for each in value]
    return f"{words[0]} ({words[1]} to {words[2]})"


def plain(value: float) -> str:
    """A number, or a word where it is infinite."""
    return "none" if np.isinf(value) else format(value, ".3g")


def exponent(value: list[float] | None) -> str:
    """An exponent with its interval."""
    return "-" if value is None else f"{value[0]:.2f} ({value[1]:.2f} to {value[2]:.2f})"
