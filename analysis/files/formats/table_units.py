"""Units in the heads of a table, as in ``x [mm]`` or ``radius (µm)``: all lengths in the unit of x.

A packing has no units of its own: law and load are given in the unit of its lengths. Masses, and densities, are brought
to one unit of mass. Angles in degrees become radians. Units of columns that nobody reads are left alone. Conversions
are those of pint.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from ...arrays import Floats
from ...errors import PackingFileError

UNIT_HEAD = re.compile(r"\s*(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]\s*")
"""A name with a unit behind it in brackets."""

LENGTHS = (
    "x", "xu", "pos_x", "y", "yu", "pos_y", "z", "zu", "radius", "r", "rad", "diameter", "x_low", "y_low", "slip",
    "slip_low",
)  # fmt: skip
ANGLES = ("angle", "theta", "d_theta")
NO_UNIT = ("", "-", "1")
"""Texts in brackets that are no unit."""


@cache
def registry() -> Any:
    """The units that pint knows."""
    from pint import UnitRegistry

    return UnitRegistry()


def unit_factor(source: str, name: str, unit: str, into: str) -> float:
    """Factor of the numbers of a column.

    Raises PackingFileError if there is no such unit, or no way from one to the other.
    """
    from pint import PintError

    try:
        # parts of ten are exact, which a product of rounded powers is not
        return float(f"{registry().Quantity(1, unit).to(into).magnitude:.15g}")
    except (PintError, ValueError, TypeError, AttributeError, AssertionError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else "it is no unit"
        raise PackingFileError(
            f"{source}: the unit of {name}, {unit!r}, does not convert to {into}: {reason}."
        ) from None


def split_unit(head: str) -> tuple[str, str]:
    """Name and unit of a column, the unit empty if there is none."""
    match = UNIT_HEAD.fullmatch(head)
    name, unit = match.groups() if match else (head, "")
    return name.strip().strip('"').strip().lower(), "" if unit in NO_UNIT else unit


def in_one_unit(
    source: str, columns: Mapping[str, Floats], units: Mapping[str, str], length: str = ""
) -> tuple[dict[str, Floats], str]:
    """Columns whose lengths are all in one unit.

    Parameters
    ----------
    columns : mapping of ndarray
        By name.
    units : mapping of str
        Those of the columns that have one, by name.
    length : str
        Of the lengths that are wanted; by default that of the first length.

    Returns
    -------
    dict of ndarray
        The columns.
    str
        The unit of lengths; empty if the table names none.
    """
    lengths = [name for name in LENGTHS if name in columns]
    known = [name for name in lengths if name in units]
    if known and len(known) < len(lengths):
        lacks = next(name for name in lengths if name not in units)
        raise PackingFileError(
            f"{source}: {known[0]} is in {units[known[0]]}, and {lacks} has no unit: give every length one, or none."
        )
    if length and lengths and not known:
        raise PackingFileError(f"{source}: the disks are in {length}, and {lengths[0]} has no unit: give it one.")
    unit = length or (units[known[0]] if known else "")
    into = dict.fromkeys(known, unit) | {name: "radian" for name in ANGLES if name in units}
    mass = mass_unit(columns, units)
    if "mass" in units:
        into["mass"] = mass
    if "density" in units:
        if not unit:
            raise PackingFileError(f"{source}: density is in {units['density']}, and lengths have no unit: give one.")
        into["density"] = f"{mass}/({unit})**3"
    factors = {name: unit_factor(source, name, units[name], to) for name, to in into.items()}
    return {name: column * factors.get(name, 1.0) for name, column in columns.items()}, unit


def mass_unit(columns: Mapping[str, Floats], units: Mapping[str, str]) -> str:
    """The unit of masses, where a table has one; grams for densities alone."""
    return next((units[name] for name in ("mass", "m") if name in columns and name in units), "g")


def decimal_point(words: Sequence[str]) -> list[str]:
    """Words of a line in which decimals have a comma, as those with a point."""
    return [re.sub(r"^(\s*[-+]?\d*),(\d*(?:[eE][-+]?\d+)?\s*)$", r"\1.\2", word) for word in words]


def is_number(word: str) -> bool:
    """Whether a word is a number, with a decimal point or comma."""
    try:
        return bool(np.isfinite(float(decimal_point([word])[0])))
    except ValueError:
        return False
