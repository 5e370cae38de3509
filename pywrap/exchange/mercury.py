"""MercuryDPM's data files: for each time a line "N time bounds", and a line a particle.

In two dimensions there are four bounds, and a line is x y vx vy radius angle spin info. In three there are six, and it
is x y z vx vy vz radius, three angles, three spins, info. The file has no masses, and does not say whether x is
periodic: it is taken to be, with the width of the bounds, as for LAMMPS data.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...analysis import PackingFileError
from .disks import Disks, of_columns
from .table import lines_of, number_of

COLUMNS = {
    6: {"x": 0, "y": 1, "radius": 4, "type": 7},
    8: {"x": 0, "y": 1, "z": 2, "radius": 6, "type": 13},
}
"""Where the columns stand, by the numbers in a line of time; info is MercuryDPM's index of the species."""


def read_mercury(path: Path, frame: int | None = None) -> Disks:
    """Particles at one time; the last one by default, if all times have as many particles."""
    lines = lines_of(path)
    while lines and not lines[-1].strip():
        lines.pop()
    begins, at = [], 0
    while at < len(lines):
        words = lines[at].split()
        if not words or not words[0].isdecimal() or len(words) not in COLUMNS:
            raise PackingFileError(f"{path}, line {at + 1}: {lines[at]!r} is no line 'N time bounds' of MercuryDPM.")
        begins.append(at)
        at += int(words[0]) + 1
    if at > len(lines):
        raise PackingFileError(f"{path} is no complete MercuryDPM file: it breaks off.")
    counts = {int(lines[begin].split()[0]) for begin in begins}
    if frame is None and len(counts) > 1:
        raise PackingFileError(
            f"{path} has times with {min(counts)} and {max(counts)} particles: choose one with --frame."
        )
    wanted = -1 if frame is None else frame
    if not -len(begins) <= wanted < len(begins):
        raise PackingFileError(f"{path} has {len(begins)} frames; there is no --frame {frame}.")
    return _at(path, lines, begins[wanted])


def _at(path: Path, lines: list[str], begin: int) -> Disks:
    head = [number_of(word, f"{path}, line {begin + 1}") for word in lines[begin].split()]
    places = COLUMNS[len(head)]
    rows = []
    for number, line in enumerate(lines[begin + 1 : begin + 1 + int(head[0])], begin + 2):
        words = line.split()
        if len(words) <= max(places.values()):
            needed = max(places.values()) + 1
            raise PackingFileError(f"{path}, line {number}: it has {len(words)} columns, and {needed} are needed.")
        rows.append([number_of(words[place], f"{path}, line {number}") for place in places.values()])
    if not rows:
        raise PackingFileError(f"{path} has no particles at time {head[1]:g}.")
    columns = dict(zip(places, np.array(rows).T, strict=True))
    if not np.array_equal(columns["type"], np.rint(columns["type"])):
        del columns["type"]  # info may be any number that the user wants to look at
    width = head[2 + (len(head) - 2) // 2] - head[2]
    return of_columns(str(path), columns, box_length=width if width > 0 else None)
