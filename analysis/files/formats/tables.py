"""Text of numbers: tables made by hand, packing.json, and the text files of YADE and MercuryDPM; lines, words, frames.

**CSV**: a line of names, and a line a disk (x, y, radius; also id, mass, angle, top, type) or a contact. A packing has
no units of its own, and nothing is converted: names with a unit are refused.

**YADE**, from yade.export.textExt: a line with the names of the columns, as in ``#format x_y_z_r_matId``, and one line
for each sphere. YADE's own export has six digits, so that overlaps are rounded.

**MercuryDPM**, data files: for each time a line "N time bounds", and one line for each particle. In two dimensions
there are four bounds, and a line is x y vx vy radius angle spin info. In three dimensions there are six bounds, and a
line is x y z vx vy vz radius, three angles, three spins, info. The file has no masses, and does not say whether x is
periodic: x is assumed periodic with the width of the bounds, as for LAMMPS data.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from ...arrays import Floats
from ...errors import BadInputError, PackingFileError
from ..atomic_write import open_text, telling, write_text
from .disks import Disks, Slips, choose_frame, particles_of, standard_names
from .exported import Exported
from .lammps_dump import snapshot

NUMBER_WORDS = {"true": 1.0, "false": 0.0, "t": 1.0, "f": 0.0}
"""Words that stand for numbers."""

MERCURY_ROWS = {
    8: ["x", "y", None, None, "radius", None, None, "type"],
    14: ["x", "y", "z", None, None, None, "radius", *6 * [None], "type"],
}
"""MercuryDPM's columns, by their number; info is its index of the species."""

HEAD_OF_CONTACTS = "id1,id2,n_x,n_y,n_z,f_n,f_t,"
"""How a table of contacts begins."""


def lines_of(path: Path) -> list[str]:
    """The lines of a text file."""
    with telling(path, "cannot be read"), open_text(path) as stream:
        return stream.read().removeprefix("\ufeff").splitlines()


def number_of(word: str, where: object) -> float:
    """A word as a finite number."""
    with suppress(ValueError):
        value = NUMBER_WORDS.get(word.strip().lower())
        if math.isfinite(value := float(word) if value is None else value):
            return value
    raise PackingFileError(f"{where}: {word.strip()!r} is no number.")


def numbers_in(text: str, where: object) -> list[float]:
    """The numbers of a text, with blanks between them."""
    return [number_of(word, where) for word in text.split()]


def strip_comments(lines: Iterable[str], first: int) -> Iterator[tuple[int, list[str]]]:
    """Lines by number, as the words before a #; lines without a word are left out."""
    rows = ((number, line.partition("#")[0].split()) for number, line in enumerate(lines, first))
    return (row for row in rows if row[1])


def columns_of(
    path: Path, lines: Iterable[tuple[int, list[str]]], names: Sequence[str | None], wanted: str, *, more: bool = True
) -> dict[str, Floats]:
    """The columns of some lines, their numbers and words, by name; a column whose name is None is skipped.

    `wanted` is said of a line of another length; with `more`, a line may have more columns than there are names.
    """
    kept, rows = [k for k, name in enumerate(names) if name is not None], []
    for number, words in lines:
        if len(words) < len(names) or not (more or len(words) == len(names)):
            raise PackingFileError(f"{path}, line {number}: it has {len(words)} columns, and {wanted}.")
        rows.append([number_of(words[k], f"{path}, line {number}") for k in kept])
    return {str(names[k]): column for k, column in zip(kept, np.array(rows).reshape(-1, len(kept)).T, strict=True)}


def block_of_frame(path: Path, lines: list[str], head: int, frame: int) -> tuple[int, int]:
    """First line of a frame and its number of particles, which follow after `head` lines, in a file of frames."""
    counts, at, end = dict[int, int](), 0, len("\n".join(lines).rstrip().split("\n"))
    while at < end:
        counts[at] = int(lines[at].split()[0])
        at += head + counts[at]
    if not counts or at > len(lines):
        raise PackingFileError(f"{path} is no complete file of frames: it breaks off.")
    begin = list(counts)[choose_frame(path, len(counts), frame)]
    return begin, counts[begin]


def read_table(path: Path) -> Disks:
    """Particles of a CSV file; commas, semicolons, tabs or blanks between the numbers. Open sides."""
    return particles_of(path, _table(path))


def _table(path: Path) -> dict[str, Floats]:
    """The columns of a CSV file by name.

    Comments (lines that begin with # or //) may stand anywhere. If numbers follow the first of them at once, the last
    comment before them has the names.
    """
    lines = [(number, line.strip()) for number, line in enumerate(lines_of(path), 1) if line.strip()]
    body = [row for row in lines if not row[1].startswith(("#", "//"))]
    first = lines.index(body[0]) if body else 0
    if first and re.match(r"[-+.,\d]", body[0][1]):
        body.insert(0, (0, lines[first - 1][1].lstrip("#/")))
    if len(body) < 2:
        raise PackingFileError(f"{path} is no table: give a line of names, as x,y,radius, and lines of numbers.")
    mark = next((each for each in ";,\t" if each in body[0][1]), None)
    (_, names), *rows = [(number, [word.strip(' "') for word in line.split(mark)]) for number, line in body]
    for unit in (name for name in names if "[" in name or "(" in name):
        cure = "give all lengths in one unit, angles in radians, and leave units out of the line of names"
        raise PackingFileError(f"{path}: nothing is converted, and the names have a unit, {unit}: {cure}.")
    if mark != ",":  # decimals may have a comma
        rows = [(number, [word.replace(",", ".") for word in words]) for number, words in rows]
    return columns_of(path, rows, [name.lower() for name in names], f"the first {len(names)}", more=False)


def contact_columns(path: Path, *needed: str, frame: int = -1, names: Sequence[str] | None = None) -> dict[str, Floats]:
    """The columns of a table of contacts, in CSV or a frame of a LAMMPS dump local, by standard names.

    `needed` must be there; `names` stand in place of those of the file.
    """
    of_lammps = next(iter(lines_of(path)), "").startswith("ITEM:")
    columns = snapshot(path, frame).by_name if of_lammps else _table(path)
    if names is not None:
        if len(names) != len(columns):
            raise BadInputError(f"--columns names {len(names)} columns, and {path} has {len(columns)}.")
        columns = dict(zip(names, columns.values(), strict=True))
    return standard_names(f"{path} (--columns names those of a dump)", columns, *needed)


def read_slips(path: Path) -> Slips:
    """Slips of a table of contacts: id1, id2 (0 is the floor) and slip, in the unit of the disks' lengths."""
    c = contact_columns(path, "id1", "id2", "slip")
    return Slips(c["id1"].astype(np.int64), c["id2"].astype(np.int64), c["slip"], c.get("slip_low"))


def write_contacts(path: Path, frames: Iterable[tuple[float, Exported]]) -> str:
    """Write a row for each contact, with all digits, and return the contents in words."""
    [(_, e)] = frames
    columns = e.source.configuration.contact_columns()
    columns |= {"slip": e.contacts["contact_slip"]} if "contact_slip" in e.contacts else {}
    rows = zip(*(map(repr, column.tolist()) for column in columns.values()), strict=True)
    write_text(path, "\n".join([",".join(columns), *map(",".join, rows)]) + "\n", HEAD_OF_CONTACTS)
    return "forces, overlaps and mobilised friction; `faultgouge import --contacts` takes the slips"


def read_json(path: Path) -> Disks:
    """Disks of a packing.json, which came to rest without friction: no contact has a slip.

    It has the lists x, y, radius, and may have top (indices from 0, or true and false for each disk), mass (of each
    disk, or of all) and box_length (period along x). Other keys are ignored.
    """
    data = json.loads("\n".join(lines_of(path)))
    x, y, radius = np.array([data[name] for name in ("x", "y", "radius")], dtype=np.float64)
    columns, top = {"x": x, "y": y, "radius": radius}, np.zeros(len(x))
    if data.get("mass") is not None:
        columns["mass"] = np.broadcast_to(np.asarray(data["mass"], dtype=np.float64), len(x))
    with telling(path, "has a wrong top, which holds indices of disks from 0, or true and false", IndexError):
        given = data.get("top") or []
        if min(given, default=0) < 0:
            raise IndexError(f"{min(given)} is none")
        top[given] = 1.0
    if top.any():
        columns["top"] = top
    box, none = np.diag([float(data.get("box_length") or 0.0), 1.0, 1.0]), np.zeros(0, dtype=np.int64)
    return particles_of(path, columns, box if box[0, 0] else None, slips=Slips(none, none, np.zeros(0)))


def read_yade(path: Path) -> Disks:
    """Spheres of a text file of YADE, which counts from 0; the sides are open."""
    head, *lines = lines_of(path)
    names = head.split()[-1].partition("_attrs")[0].split("_")  # attributes are of any number, at the end
    if not {"x", "y", "z", "r"} <= set(names):
        raise PackingFileError(f"{path}, line 1: {head!r} names no columns x, y, z and r: export x_y_z_r from YADE.")
    columns = columns_of(path, strip_comments(lines, 2), names, f"line 1 announces {len(names)}")
    return particles_of(path, columns, first_id=0)


def read_mercury(path: Path, frame: int) -> Disks:
    """Particles at one time, counted from 0."""
    lines = lines_of(path)
    begin, count = block_of_frame(path, lines, 1, frame)
    low, high = np.array(numbers_in(lines[begin], f"{path}, line {begin + 1}")[2:]).reshape(2, -1)
    rows = [(number + 1, lines[number].split()) for number in range(begin + 1, begin + 1 + count)]
    names = MERCURY_ROWS[8 if len(low) == 2 else 14]
    columns = columns_of(path, rows, names, f"{len(names)} are needed")
    if not np.array_equal(columns["type"], np.rint(columns["type"])):
        del columns["type"]  # info may be any number that the user wants to look at
    low, high = (np.append(side, [end])[:3] for side, end in ((low, 0.0), (high, 1.0)))
    return particles_of(path, columns, np.diag(high - low), origin=low, first_id=0)
