"""Text of numbers: tables made by hand, packing.json, and the text files of YADE and MercuryDPM; lines, words, frames.

**CSV**: a line of names, and a line a disk (x, y, radius; also id, mass, angle, top, type) or a contact. Heads may have
units, as in ``x [mm]`` or ``radius (µm)``. A packing has no units of its own: all lengths are brought to the unit of x,
masses and densities to one unit of mass, degrees to radians, by pint; law and load are given in these units.

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
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...configuration import Configuration
from ...errors import PackingFileError
from ...packing.packing import Packing
from ..atomic_write import write_text
from ..plain_file import open_text
from .disks import NAMES, Disks, Slips, of_columns
from .lammps_dump import CONTACT, dump_frames

NUMBER_WORDS = {"true": 1.0, "false": 0.0, "t": 1.0, "f": 0.0}
"""Words that stand for numbers."""

HEADS = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")
"""Names of columns with blanks between them, each with its unit in brackets, if there is one."""

UNIT_HEAD = re.compile(r"\s*(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]\s*")
"""A name with a unit behind it in brackets."""

DECIMAL_COMMA = re.compile(r"^(\s*[-+]?\d*),(\d*(?:[eE][-+]?\d+)?\s*)$")

NO_UNIT = ("", "-", "1")
"""Texts in brackets that are no unit."""

LENGTHS = (*NAMES["x"], *NAMES["y"], "z", "zu", *NAMES["radius"], "diameter", "x_low", "y_low", "slip", "slip_low")

PARTNERS = {"first": ("id1", "i", "first"), "second": ("id2", "j", "second"), "slip": ("slip",), "low": ("slip_low",)}
"""Columns of a table of contacts and the names that they may have."""

YADE_NAMES = {"r": "radius", "matId": "type"}
"""YADE's names of what has another name here."""

SIX_DIGITS = 7
"""Longest mantissa that YADE's %g writes, with its point."""

MERCURY_COLUMNS = {
    6: ("x", "y", None, None, "radius", None, None, "type"),
    8: ("x", "y", "z", None, None, None, "radius", *6 * [None], "type"),
}
"""MercuryDPM's columns, by the numbers in a line of time; info is its index of the species."""


def lines_of(path: Path) -> list[str]:
    """The lines of a text file."""
    try:
        with open_text(path) as stream:
            return stream.read().splitlines()
    except (OSError, EOFError, zlib.error) as error:
        raise PackingFileError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    except UnicodeDecodeError as error:
        raise PackingFileError(f"{path} is no text: {error}.") from error


def number_of(word: str, where: object) -> float:
    """A word as a number."""
    try:
        return float(word)
    except ValueError:
        if word.strip().lower() in NUMBER_WORDS:
            return NUMBER_WORDS[word.strip().lower()]
        raise PackingFileError(f"{where}: {word.strip()!r} is no number.") from None


def numbers_in(text: str, where: object) -> list[float]:
    """The numbers of a text, with blanks between them."""
    return [number_of(word, where) for word in text.split()]


def strip_comments(lines: Iterable[str], first: int) -> Iterator[tuple[int, list[str]]]:
    """Lines by number, as the words before a #; lines without a word are left out."""
    for number, line in enumerate(lines, first):
        words = line.partition("#")[0].split()
        if words:
            yield number, words


def columns_of(
    path: Path, lines: Iterable[tuple[int, list[str]]], names: Sequence[str | None], wanted: str, *, more: bool = True
) -> dict[str, Floats]:
    """The columns of some lines by name.

    Parameters
    ----------
    lines : iterable of (int, list of str)
        Number and words of each line.
    names : sequence of str or None
        Names of the columns; None for one that is skipped.
    wanted : str
        What was wanted, for a line of another length.
    more : bool
        Whether a line may have more columns than there are names.
    """
    rows = []
    for number, words in lines:
        if len(words) < len(names) or not (more or len(words) == len(names)):
            raise PackingFileError(f"{path}, line {number}: it has {len(words)} columns, and {wanted}.")
        named = (word for word, name in zip(words, names, strict=False) if name is not None)
        rows.append([number_of(word, f"{path}, line {number}") for word in named])
    found = [name for name in names if name is not None]
    return dict(zip(found, np.array(rows).reshape(-1, len(found)).T, strict=True))


def choose_frame(path: Path, counts: Sequence[int], frame: int | None) -> int:
    """The number of the chosen frame, from 0; by default the last frame, if all frames have as many disks."""
    if frame is None and len(set(counts)) > 1:
        raise PackingFileError(
            f"{path} has frames with {min(counts)} and {max(counts)} disks: choose one with --frame."
        )
    wanted = -1 if frame is None else frame
    if not -len(counts) <= wanted < len(counts):
        raise PackingFileError(f"{path} has {len(counts)} frames; there is no --frame {wanted}.")
    return wanted % len(counts)


def block_of_frame(
    path: Path, lines: list[str], head: int, count_at: Callable[[int], int], frame: int | None, format_: str
) -> tuple[int, int]:
    """First line of a frame and its number of disks, in a file of consecutive frames.

    Parameters
    ----------
    head : int
        Lines before the disks of each frame.
    count_at : callable
        Number of disks of the frame that begins at a line, counted from 0.
    frame : int, optional
        As of `choose_frame`.
    format_ : str
        What such files are called.
    """
    end = max((number for number, line in enumerate(lines, 1) if line.strip()), default=0)
    counts: dict[int, int] = {}
    at = 0
    while at < end:
        counts[at] = count_at(at)
        at += head + counts[at]
    if not counts or at > len(lines):
        raise PackingFileError(f"{path} is no complete {format_} file: it breaks off.")
    begin = list(counts)[choose_frame(path, list(counts.values()), frame)]
    return begin, counts[begin]


def read_table(path: Path) -> Disks:
    """Disks of a CSV file; commas, semicolons, tabs or blanks between the numbers. Open sides."""
    columns, length, mass = _table(path)
    masses = f" and masses in {mass}" if mass else ""
    remark = f"lengths are in {length}{masses}: give law and load in these units" if length else ""
    return of_columns(str(path), columns, remark=remark, length_unit=length)


def _table(path: Path, length: str = "") -> tuple[dict[str, Floats], str, str]:
    """The columns of a CSV file by name, and the units of its lengths and masses.

    Comments (lines that begin with # or //) may stand anywhere. If numbers follow the first of them at once, the last
    comment before them has the names.
    """
    lines = [(number, line.removeprefix("\ufeff")) for number, line in enumerate(lines_of(path), 1)]
    rows = [(number, line) for number, line in lines if line.strip()]
    comments = [line.lstrip().startswith(("#", "//")) for _, line in rows]
    first = comments.index(False) if False in comments else len(rows)
    named_by_comment = 0 < first < len(rows) and _is_number(re.split(r"[;\t\s]", rows[first][1].strip())[0])
    heads = first - 1 if named_by_comment else first
    body = [row for k, row in enumerate(rows) if k != heads and not comments[k]]
    if not body:
        raise PackingFileError(
            f"{path} is no table: it needs a line of names, such as x,y,radius, and lines of numbers."
        )
    head = rows[heads][1].strip().lstrip("#/").strip()
    mark = next((each for each in ";,\t" if each in head), None)
    named = [_split_unit(each) for each in (head.split(mark) if mark else HEADS.findall(head))]
    words = [(number, next(csv.reader([line], delimiter=mark)) if mark else line.split()) for number, line in body]
    if mark != ",":
        words = [(number, [DECIMAL_COMMA.sub(r"\1.\2", word) for word in each]) for number, each in words]
    names = [name for name, _ in named]
    columns = columns_of(path, words, names, f"the first {len(names)}", more=False)
    return _in_one_unit(str(path), columns, {name: unit for name, unit in named if unit}, length)


def _is_number(word: str) -> bool:
    """Whether a word is a number, with a decimal point or comma."""
    try:
        return bool(np.isfinite(float(DECIMAL_COMMA.sub(r"\1.\2", word))))
    except ValueError:
        return False


def _split_unit(head: str) -> tuple[str, str]:
    """Name and unit of a column, the unit empty if there is none."""
    match = UNIT_HEAD.fullmatch(head)
    name, unit = match.groups() if match else (head, "")
    return name.strip().strip('"').strip().lower(), "" if unit in NO_UNIT else unit


@cache
def unit_registry() -> Any:
    """The units that pint knows."""
    from pint import UnitRegistry

    return UnitRegistry()


def _in_one_unit(
    source: str, columns: Mapping[str, Floats], units: Mapping[str, str], length: str
) -> tuple[dict[str, Floats], str, str]:
    """Columns whose lengths are all in one unit, that of the first by default; and the units of lengths and masses."""
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
    mass = next((units[name] for name in NAMES["mass"] if name in units), "g" if "density" in units else "")
    if "density" in units and not unit:
        raise PackingFileError(f"{source}: density is in {units['density']}, and lengths have no unit: give one.")
    into = dict.fromkeys(known, unit) | dict.fromkeys(NAMES["angle"], "radian")
    into |= {"mass": mass, "density": f"{mass}/({unit})**3"}
    factors = {name: _factor(source, name, units[name], to) for name, to in into.items() if name in units}
    return {name: column * factors.get(name, 1.0) for name, column in columns.items()}, unit, mass


def _factor(source: str, name: str, unit: str, into: str) -> float:
    """Factor of the numbers of a column."""
    from pint import PintError

    try:
        # parts of ten are exact, which a product of rounded powers is not
        return float(f"{unit_registry().Quantity(1, unit).to(into).magnitude:.15g}")
    except (PintError, ValueError, TypeError, AttributeError, AssertionError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else "it is no unit"
        raise PackingFileError(
            f"{source}: the unit of {name}, {unit!r}, does not convert to {into}: {reason}."
        ) from None


def read_slips(path: Path, length: str = "") -> Slips:
    """Slips of a table of contacts, in CSV (id1, id2, slip; a second ID of 0 is the floor) or as a LAMMPS dump.

    Parameters
    ----------
    length : str
        The unit of the disks' lengths, where their table has one.
    """
    names = PARTNERS
    if next(iter(lines_of(path)), "").startswith("ITEM:"):
        *_, frame = dump_frames(path)
        columns = dict(zip(frame.columns, frame.rows.T, strict=True))
        names = {key: (*PARTNERS[key], *CONTACT.get(key, ())) for key in PARTNERS}
    else:
        columns, unit, _ = _table(path, length)
        if unit and not length:
            raise PackingFileError(f"{path}: slip is in {unit}, and the disks have no unit: leave the unit out.")
    found = {key: next((columns[each] for each in also if each in columns), None) for key, also in names.items()}
    first, second, slip = (found[key] for key in ("first", "second", "slip"))
    if first is None or second is None or slip is None:
        missing = next(key for key in ("first", "second", "slip") if found[key] is None)
        raise PackingFileError(f"{path} has no column {names[missing][0]} (its columns: {', '.join(columns)}).")
    return Slips(first.astype(np.int64), second.astype(np.int64), slip, found["low"])


def write_contacts(path: Path, packing: Packing | Configuration, known_by: str) -> str:
    """Write a row for each contact, with all digits, and return the contents in words; a table that begins as
    `known_by` is replaced."""
    columns = packing.configuration.contact_columns()
    if isinstance(packing, Packing):
        columns |= {"slip": packing.contacts.slip}
    rows = zip(*(map(repr, column.tolist()) for column in columns.values()), strict=True)
    write_text(path, "\n".join([",".join(columns), *map(",".join, rows)]) + "\n", known_by)
    return "forces, overlaps and mobilised friction; `faultgouge import --contacts` takes the slips"


def read_json(path: Path) -> Disks:
    """Disks of a packing.json, which came to rest without friction: no contact has a slip.

    It has the lists x, y, radius, and may have top (indices from 0, or true and false for each disk), mass (of each
    disk, or of all) and box_length (period along x). Other keys are ignored.
    """
    try:
        with open_text(path) as stream:
            data = json.load(stream)
        numbers = np.array([data["x"], data["y"], data["radius"]], dtype=np.float64)
        columns, disks = dict(zip(("x", "y", "radius"), numbers, strict=True)), len(numbers[0])
        if data.get("mass") is not None:
            columns["mass"] = np.broadcast_to(np.asarray(data["mass"], dtype=np.float64), disks)
        if (top := _upper_layer(data.get("top", []), disks)).any():
            columns["top"] = top.astype(np.float64)
        box_length = None if data.get("box_length") is None else float(data["box_length"])
    except (OSError, EOFError, zlib.error) as error:
        raise PackingFileError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    except KeyError as error:
        raise PackingFileError(
            f"{path} lacks the key {error}; a packing file has x, y, radius, top, box_length."
        ) from error
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        raise PackingFileError(f"{path} is not a packing file: {error}") from error
    except RecursionError as error:
        raise PackingFileError(f"{path} is not a packing file: its brackets are nested too deeply") from error
    none = np.zeros(0, dtype=np.int64)
    return of_columns(str(path), columns, box_length=box_length, slips=Slips(none, none, np.zeros(0)))


def _upper_layer(listed: object, disks: int) -> NDArray[np.bool_]:
    """The upper layer from indices of disks, or from true and false for each, shape (N,)."""
    says = np.asarray(listed)
    if says.dtype == np.bool_ and says.shape == (disks,):
        return says
    if says.size and (not np.issubdtype(says.dtype, np.integer) or says.min() < 0 or says.max() >= disks):
        raise ValueError("top must hold indices of disks, counted from 0, or true and false for each disk.")
    return np.isin(np.arange(disks), says)


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
