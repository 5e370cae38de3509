"""YADE's text of spheres, as yade.export.textExt writes it: a line with the names of the columns, and a line a sphere.

    #format x_y_z_r_matId
    1.25    0.5    0    0.5    1

The names are put together by underscores. YADE's own export has six digits, so that overlaps are rounded.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...analysis import PackingFileError
from .disks import Disks, of_columns
from .table import lines_of, number_of

NAMES = {"r": "radius", "matId": "type"}
"""YADE's names of what has another name here."""

SIX_DIGITS = 7
"""Longest mantissa that YADE's %g writes, with its point."""


def read_yade(path: Path) -> Disks:
    """Spheres of a text file of YADE; the sides are open."""
    lines = lines_of(path)
    says = lines[0].split()
    wanted = [NAMES.get(name, name) for name in says[1].split("_")] if len(says) > 1 else []
    wanted = wanted[: wanted.index("attrs")] if "attrs" in wanted else wanted  # of any number, at the end
    if not {"x", "y", "z", "radius"} <= set(wanted):
        raise PackingFileError(
            f"{path}, line 1: {lines[0]!r} names no columns x, y, z and r: export x_y_z_r from YADE."
        )
    rows, short = [], True
    for number, line in enumerate(lines[1:], 2):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if len(words) < len(wanted):
            raise PackingFileError(
                f"{path}, line {number}: it has {len(words)} columns, and line 1 announces {len(wanted)}."
            )
        rows.append([number_of(word, f"{path}, line {number}") for word in words[: len(wanted)]])
        short = short and all(len(word.lstrip("-0.").partition("e")[0]) <= SIX_DIGITS for word in words[:4])
    if not rows:
        raise PackingFileError(f"{path} has no spheres.")
    columns = dict(zip(wanted, np.array(rows).T, strict=True))
    if "id" in columns:
        columns["id"] = columns["id"] + 1  # YADE counts from 0, and here 0 is the floor
    remark = "its numbers have six digits, as YADE writes them: overlaps are lost below that" if short else ""
    return of_columns(str(path), columns, remark=remark)
