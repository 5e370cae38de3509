"""Text files of YADE and MercuryDPM.

**YADE**, from yade.export.textExt: a line with the names of the columns, and one line for each sphere.

    #format x_y_z_r_matId
    1.25    0.5    0    0.5    1

Underscores join the names. YADE's own export has six digits, so that overlaps are rounded.

**MercuryDPM**, data files: for each time a line "N time bounds", and one line for each particle. In two dimensions
there are four bounds, and a line is x y vx vy radius angle spin info. In three dimensions there are six bounds, and a
line is x y z vx vy vz radius, three angles, three spins, info. The file has no masses, and does not say whether x is
periodic: x is assumed periodic with the width of the bounds, as for LAMMPS data.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import PackingFileError
from .disks import Disks, of_columns
from .text_columns import block_of_frame, columns_of, lines_of, numbers_in, strip_comments

YADE_NAMES = {"r": "radius", "matId": "type"}
"""YADE's names of what has another name here."""

SIX_DIGITS = 7
"""Longest mantissa that YADE's %g writes, with its point."""

MERCURY_COLUMNS = {
    6: ("x", "y", None, None, "radius", None, None, "type"),
    8: ("x", "y", "z", None, None, None, "radius", *6 * [None], "type"),
}
"""MercuryDPM's columns, by the numbers in a line of time; info is its index of the species."""


def read_yade(path: Path) -> Disks:
    """Spheres of a text file of YADE; the sides are open."""
    lines = lines_of(path)
    says = lines[0].split()
    names = [YADE_NAMES.get(name, name) for name in says[1].split("_")] if len(says) > 1 else []
    names = names[: names.index("attrs")] if "attrs" in names else names  # of any number, at the end
    if not {"x", "y", "z", "radius"} <= set(names):
        raise PackingFileError(
            f"{path}, line 1: {lines[0]!r} names no columns x, y, z and r: export x_y_z_r from YADE."
        )
    rows = list(strip_comments(lines[1:], 2))
    if not rows:
        raise PackingFileError(f"{path} has no spheres.")
    columns = columns_of(path, rows, names, f"line 1 announces {len(names)}")
    if "id" in columns:
        columns["id"] = columns["id"] + 1  # YADE counts from 0, and here 0 is the floor
    short = all(len(word.lstrip("-0.").partition("e")[0]) <= SIX_DIGITS for _, words in rows for word in words[:4])
    remark = "its numbers have six digits, as YADE writes them: overlaps are lost below that" if short else ""
    return of_columns(str(path), columns, remark=remark)


def read_mercury(path: Path, frame: int | None = None) -> Disks:
    """Particles at one time; the last one by default, if all times have as many particles."""
    lines = lines_of(path)

    def count_at(at: int) -> int:
        words = lines[at].split()
        if not words or not words[0].isdecimal() or len(words) not in MERCURY_COLUMNS:
            raise PackingFileError(f"{path}, line {at + 1}: {lines[at]!r} is no line 'N time bounds' of MercuryDPM.")
        return int(words[0])

    begin, count = block_of_frame(path, lines, 1, count_at, frame, "MercuryDPM")
    head = numbers_in(lines[begin], f"{path}, line {begin + 1}")
    if not count:
        raise PackingFileError(f"{path} has no particles at time {head[1]:g}.")
    names = MERCURY_COLUMNS[len(head)]
    rows = [(number + 1, lines[number].split()) for number in range(begin + 1, begin + 1 + count)]
    columns = columns_of(path, rows, names, f"{len(names)} are needed")
    if not np.array_equal(columns["type"], np.rint(columns["type"])):
        del columns["type"]  # info may be any number that the user wants to look at
    width = head[2 + (len(head) - 2) // 2] - head[2]
    return of_columns(str(path), columns, box_length=width if width > 0 else None)
