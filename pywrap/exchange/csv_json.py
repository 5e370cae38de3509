"""Packings made by hand. CSV: a line of names, and a line a disk (x, y, radius; also id, mass, angle, top, type) or a
contact. JSON: packing.json."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from ...analysis import MindlinLaw, PackingFileError, read_packing
from ...analysis.arrays import Floats
from ...analysis.files.dumps import CONTACT, dump_frames
from .disks import Disks, Slips, of_columns
from .text_columns import columns_of, lines_of

PARTNERS = {"first": ("id1", "i", "first"), "second": ("id2", "j", "second"), "slip": ("slip",), "low": ("slip_low",)}
"""Columns of a table of contacts and the names that they may have."""


def read_table(path: Path) -> Disks:
    """Disks of a CSV file; commas, semicolons, tabs or blanks between the numbers. Open sides."""
    return of_columns(str(path), _table(path))


def _table(path: Path) -> dict[str, Floats]:
    """The columns of a CSV file by name."""
    rows = [(number, line) for number, line in enumerate(lines_of(path), 1) if line.strip()]
    if len(rows) < 2:
        raise PackingFileError(
            f"{path} is no table: it needs a line of names, such as x,y,radius, and lines of numbers."
        )
    head = rows[0][1].lstrip("#").strip()
    mark = next((each for each in ";,\t" if each in head), None)
    names = [name.strip().strip('"').lower() for name in (head.split(mark) if mark else head.split())]
    words = [(number, next(csv.reader([line], delimiter=mark)) if mark else line.split()) for number, line in rows[1:]]
    return columns_of(path, words, names, f"the first {len(names)}", more=False)


def read_json(path: Path) -> Disks:
    """Disks of a packing.json."""
    packing = read_packing(path, MindlinLaw(kn=1.0, kt=0.0, mu=0.0))  # the file says nothing about forces
    return Disks(
        str(path),
        packing.position,
        packing.radius,
        np.arange(1, len(packing) + 1),
        packing.mass,
        top=packing.top if packing.top.any() else None,
        box_length=packing.box_length,
    )


def read_slips(path: Path) -> Slips:
    """Slips of a table of contacts, in CSV (id1, id2, slip; a second ID of 0 is the floor) or as a LAMMPS dump."""
    names = PARTNERS
    if next(iter(lines_of(path)), "").startswith("ITEM:"):
        *_, frame = dump_frames(path)
        columns = dict(zip(frame.columns, frame.rows.T, strict=True))
        names = {key: (*PARTNERS[key], *CONTACT.get(key, ())) for key in PARTNERS}
    else:
        columns = _table(path)
    found = {key: next((columns[each] for each in also if each in columns), None) for key, also in names.items()}
    first, second, slip = (found[key] for key in ("first", "second", "slip"))
    if first is None or second is None or slip is None:
        missing = next(key for key in ("first", "second", "slip") if found[key] is None)
        raise PackingFileError(f"{path} has no column {names[missing][0]} (its columns: {', '.join(columns)}).")
    return Slips(first.astype(np.int64), second.astype(np.int64), slip, found["low"])
