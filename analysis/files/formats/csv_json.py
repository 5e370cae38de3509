"""Packings made by hand. CSV: a line of names, and a line a disk (x, y, radius; also id, mass, angle, top, type) or a
contact. JSON: packing.json."""

from __future__ import annotations

import csv
import json
import re
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...errors import PackingFileError
from ..dumps import CONTACT, dump_frames
from ..plain_file import open_text
from .disks import Disks, Slips, of_columns
from .table_units import decimal_point, in_one_unit, is_number, mass_unit, split_unit
from .text_columns import columns_of, lines_of

HEADS = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")
"""Names of columns with blanks between them, each with its unit in brackets, if there is one."""

PARTNERS = {"first": ("id1", "i", "first"), "second": ("id2", "j", "second"), "slip": ("slip",), "low": ("slip_low",)}
"""Columns of a table of contacts and the names that they may have."""


def read_table(path: Path) -> Disks:
    """Disks of a CSV file; commas, semicolons, tabs or blanks between the numbers. Open sides."""
    columns, units = _table(path)
    columns, length = in_one_unit(str(path), columns, units)
    masses = f" and masses in {mass_unit(columns, units)}" if {"mass", "m", "density"} & units.keys() else ""
    remark = f"lengths are in {length}{masses}: give law and load in these units" if length else ""
    return of_columns(str(path), columns, remark=remark, length_unit=length)


def _table(path: Path) -> tuple[dict[str, Floats], dict[str, str]]:
    """The columns of a CSV file by name, and the units in their heads.

    Comments (lines that begin with # or //) may stand anywhere. If numbers follow the first of them at once, the last
    comment before them has the names.
    """
    lines = [(number, line.removeprefix("\ufeff")) for number, line in enumerate(lines_of(path), 1)]
    rows = [(number, line) for number, line in lines if line.strip()]
    first = next((k for k, (_, line) in enumerate(rows) if not _is_comment(line)), len(rows))
    named_by_comment = first > 0 and first < len(rows) and is_number(re.split(r"[;\t\s]", rows[first][1].strip())[0])
    head = rows.pop(first - 1 if named_by_comment else first)[1] if first < len(rows) else ""
    rows = [(number, line) for number, line in rows if not _is_comment(line)]
    if not rows:
        raise PackingFileError(
            f"{path} is no table: it needs a line of names, such as x,y,radius, and lines of numbers."
        )
    head = head.strip().lstrip("#/").strip()
    mark = next((each for each in ";,\t" if each in head), None)
    heads = [split_unit(each) for each in (head.split(mark) if mark else HEADS.findall(head))]
    words = [(number, next(csv.reader([line], delimiter=mark)) if mark else line.split()) for number, line in rows]
    if mark != ",":
        words = [(number, decimal_point(each)) for number, each in words]
    names = [name for name, _ in heads]
    return columns_of(path, words, names, f"the first {len(names)}", more=False), {name: u for name, u in heads if u}


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "//"))


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
    slips = Slips(none, none, np.zeros(0))
    return of_columns(str(path), columns, box_length=box_length, slips=slips)


def _upper_layer(listed: object, disks: int) -> NDArray[np.bool_]:
    """The upper layer from indices of disks, or from true and false for each, shape (N,)."""
    says = np.asarray(listed)
    if says.dtype == np.bool_ and says.shape == (disks,):
        return says
    if says.size and (not np.issubdtype(says.dtype, np.integer) or says.min() < 0 or says.max() >= disks):
        raise ValueError("top must hold indices of disks, counted from 0, or true and false for each disk.")
    top = np.zeros(disks, dtype=np.bool_)
    top[says.astype(np.int64)] = True
    return top


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
        columns, units = _table(path)
        columns, unit = in_one_unit(str(path), columns, units, length)
        if unit and not length:
            raise PackingFileError(f"{path}: slip is in {unit}, and the disks have no unit: leave the unit out.")
    found = {key: next((columns[each] for each in also if each in columns), None) for key, also in names.items()}
    first, second, slip = (found[key] for key in ("first", "second", "slip"))
    if first is None or second is None or slip is None:
        missing = next(key for key in ("first", "second", "slip") if found[key] is None)
        raise PackingFileError(f"{path} has no column {names[missing][0]} (its columns: {', '.join(columns)}).")
    return Slips(first.astype(np.int64), second.astype(np.int64), slip, found["low"])
