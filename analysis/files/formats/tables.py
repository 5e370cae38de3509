"""Text of numbers: tables made by hand, packing.json, and the text files of YADE and MercuryDPM; lines, words, frames.

**CSV**: a line of names, and a line a disk (x, y, radius; also id, mass, angle, top, type) or a contact. Heads may have
units, as in ``x [mm]``. A packing has no units of its own, and nothing is converted: lengths in two units are refused.

**YADE**, from yade.export.textExt: a line with the names of the columns, joined by underscores, and one line for each
sphere. YADE's own export has six digits, so that overlaps are rounded.

    #format x_y_z_r_matId
    1.25    0.5    0    0.5    1

**MercuryDPM**, data files: for each time a line "N time bounds", and one line for each particle. In two dimensions
there are four bounds, and a line is x y vx vy radius angle spin info. In three dimensions there are six bounds, and a
line is x y z vx vy vz radius, three angles, three spins, info. The file has no masses, and does not say whether x is
periodic: x is assumed periodic with the width of the bounds, as for LAMMPS data.
"""

from __future__ import annotations

import csv
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
from .disks import ALIASES, Disks, Slips, choose_frame, particles_of, standard_names
from .exported import Exported
from .lammps_dump import dump_frames

NUMBER_WORDS = {"true": 1.0, "false": 0.0, "t": 1.0, "f": 0.0}
"""Words that stand for numbers."""

HEADS = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")
"""Names of columns with blanks between them, each with its unit in brackets, if there is one."""

DECIMAL_COMMA = re.compile(r"^(\s*[-+]?\d*),(\d*(?:[eE][-+]?\d+)?\s*)$")

LENGTHS = "x", "y", "z", "radius", "diameter"
WITHOUT_UNIT = {"angle", "density", "slip"}
"""Columns whose unit follows from others, or is the radian."""

SIX_DIGITS = 7
"""Longest mantissa that YADE's %g writes, with its point."""

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
    """The columns of some lines, their numbers and words, by name.

    Parameters
    ----------
    names : sequence of str or None
        Names of the columns; None for one that is skipped.
    wanted : str
        What was wanted, for a line of another length.
    more : bool
        Whether a line may have more columns than there are names.
    """
    kept, rows = [k for k, name in enumerate(names) if name is not None], []
    for number, words in lines:
        if len(words) < len(names) or not (more or len(words) == len(names)):
            raise PackingFileError(f"{path}, line {number}: it has {len(words)} columns, and {wanted}.")
        rows.append([number_of(words[k], f"{path}, line {number}") for k in kept])
    return {str(names[k]): column for k, column in zip(kept, np.array(rows).reshape(-1, len(kept)).T, strict=True)}


def block_of_frame(path: Path, lines: list[str], head: int, frame: int | None) -> tuple[int, int]:
    """First line of a frame and its number of particles, in a file of consecutive frames.

    A frame begins with its number of particles; they follow after `head` lines. `frame` is as of `choose_frame`.
    """
    counts, at, end = dict[int, int](), 0, len("\n".join(lines).rstrip().split("\n"))
    while at < end:
        counts[at] = int(lines[at].split()[0])
        at += head + counts[at]
    if not counts or at > len(lines):
        raise PackingFileError(f"{path} is no complete file of frames: it breaks off.")
    begin = list(counts)[choose_frame(path, list(counts.values()), frame)]
    return begin, counts[begin]


def read_table(path: Path) -> Disks:
    """Particles of a CSV file; commas, semicolons, tabs or blanks between the numbers. Open sides."""
    return particles_of(path, _table(path))


def _table(path: Path) -> dict[str, Floats]:
    """The columns of a CSV file by name.

    Comments (lines that begin with # or //) may stand anywhere. If numbers follow the first of them at once, the last
    comment before them has the names.
    """
    rows = [(number, line.strip()) for number, line in enumerate(lines_of(path), 1) if line.strip()]
    body = [row for row in rows if not row[1].startswith(("#", "//"))]
    first = rows.index(body[0]) if body else 0
    named = first and re.match(r"[-+.,\d]", body[0][1])  # in a comment before the numbers
    head, body = (rows[first - 1][1].lstrip("#/"), body) if named else ("".join(row[1] for row in body[:1]), body[1:])
    if not body:
        raise PackingFileError(f"{path} is no table: give a line of names, as x,y,radius, and lines of numbers.")
    mark = next((each for each in ";,\t" if each in head), None)
    words = [(number, next(csv.reader([line], delimiter=mark)) if mark else line.split()) for number, line in body]
    if mark != ",":
        words = [(number, [DECIMAL_COMMA.sub(r"\1.\2", word) for word in each]) for number, each in words]
    heads = [re.split(r"[\[(]", each) for each in (head.split(mark) if mark else HEADS.findall(head))]
    names = [name.strip(' "').lower() for name, *_ in heads]
    units = {ALIASES.get(name, name): unit.strip(' ])"') for name, (_, *has) in zip(names, heads, strict=True)
             for unit in has if unit.strip(' ])"') not in ("", "-", "1")}  # fmt: skip
    columns = standard_names(columns_of(path, words, names, f"the first {len(names)}", more=False))
    lengths = {name: units.get(name, "no unit") for name in LENGTHS if name in columns}
    if len(set(lengths.values())) > 1 or units.keys() & columns.keys() & WITHOUT_UNIT:
        says = ", ".join(f"{name} has {unit}" for name, unit in (units | lengths).items() if name in columns)
        cure = "give all lengths in one unit, angles in radians, and densities and slips in the unit of the lengths"
        raise PackingFileError(f"{path}: nothing is converted, and {says}: {cure}, without a unit in their head.")
    return columns


def contact_columns(path: Path, *needed: str, frame: int = -1, names: Sequence[str] | None = None) -> dict[str, Floats]:
    """The columns of a table of contacts, in CSV or as a LAMMPS dump local, by standard names.

    Parameters
    ----------
    *needed : str
        Columns that must be there.
    frame : int
        Of a dump.
    names : sequence of str, optional
        Names of the columns, in place of those of the file.
    """
    if next(iter(lines_of(path)), "").startswith("ITEM:"):
        frames = list(dump_frames(path))
        shown = frames[choose_frame(path, [0] * len(frames), frame)]
        columns = dict(zip(shown.columns, shown.rows.T, strict=True))
    else:
        columns = _table(path)
    if names is not None:
        if len(names) != len(columns):
            raise BadInputError(f"--columns names {len(names)} columns, and {path} has {len(columns)}.")
        columns = dict(zip(names, columns.values(), strict=True))
    columns = standard_names(columns)
    for name in (each for each in needed if each not in columns):
        has = ", ".join(columns)
        raise PackingFileError(f"{path} has no column {name} (its columns: {has}; --columns names those of a dump).")
    return columns


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
    columns, disks = {"x": x, "y": y, "radius": radius}, len(x)
    if data.get("mass") is not None:
        columns["mass"] = np.broadcast_to(np.asarray(data["mass"], dtype=np.float64), disks)
    top, period = np.asarray(data.get("top", [])), data.get("box_length")
    if top.dtype != np.bool_ or top.shape != (disks,):
        if top.size and (not np.issubdtype(top.dtype, np.integer) or top.min() < 0 or top.max() >= disks):
            raise ValueError("top must hold indices of disks, counted from 0, or true and false for each disk")
        top = np.isin(np.arange(disks), top)
    if top.any():
        columns["top"] = top.astype(np.float64)
    box, none = None if period is None else np.diag([float(period), 1.0, 1.0]), np.zeros(0, dtype=np.int64)
    return particles_of(path, columns, box, slips=Slips(none, none, np.zeros(0)))


def read_yade(path: Path) -> Disks:
    """Spheres of a text file of YADE, which counts from 0; the sides are open."""
    head, *lines = lines_of(path)
    names = head.split()[-1].partition("_attrs")[0].split("_")  # attributes are of any number, at the end
    if not {"x", "y", "z", "r"} <= set(names):
        raise PackingFileError(f"{path}, line 1: {head!r} names no columns x, y, z and r: export x_y_z_r from YADE.")
    rows = list(strip_comments(lines, 2))
    columns = columns_of(path, rows, names, f"line 1 announces {len(names)}")
    short = all(len(word.lstrip("-0.").partition("e")[0]) <= SIX_DIGITS for _, words in rows for word in words[:4])
    remark = "its numbers have six digits, as YADE writes them: overlaps are lost below that" if short else ""
    return particles_of(path, columns, first_id=0, remark=remark)


def read_mercury(path: Path, frame: int | None = None) -> Disks:
    """Particles at one time, counted from 0; the last one by default, if all times have as many particles."""
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
