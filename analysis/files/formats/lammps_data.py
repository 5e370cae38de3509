"""LAMMPS data files of atom style sphere, in and out.

LAMMPS treats a disk as a sphere: its mass is density times 4/3 pi R^3. Quantities without a column are in comments,
which LAMMPS skips: law and load in the first line, contacts in the header, and the mass and the angle of a disk at the
end of its line, because there may be no density that gives the mass to the last bit.

    # faultgouge kn=200000.0 kt=57142.857142857145 mu=1.0 fx=0.01 fy=3.0 inertia_factor=1.0
    # contact 1 2 1.25e-05          first ID, second ID (0 is the floor), slip
    1 2 1.0 1.909859317102744 0.5 0.4996 0.0 # 1.0 0.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import takewhile
from pathlib import Path
from typing import Any, cast

import numpy as np

from ...errors import PackingFileError
from ...packing.packing import Packing
from ..atomic_write import FORMAT, FORMAT_KEY, write_text
from .disks import Disks, particles_of, sphere_volume
from .exported import Exported, read_back
from .tables import columns_of, lines_of, numbers_in, strip_comments

HEADER_COMMENT = "# faultgouge"
CONTACT_COMMENT = "# contact"
HEADER = re.compile(r"^([-+.\deE\s]+?)\s+([a-z][a-z ]*?)\s*(?:#.*)?$", re.MULTILINE)
SPHERE_COLUMNS = ("id", "type", "diameter", "density", "x", "y", "z")


def read_data(path: Path) -> Disks:
    """Particles of a data file. The file does not say whether x is periodic: it is taken to be, with its width."""
    lines = lines_of(path)
    start = next((k for k, line in enumerate(lines) if line.split()[:1] == ["Atoms"]), None)
    if start is None:
        raise PackingFileError(f"{path} is no LAMMPS data file with disks: it has no section Atoms.")
    style = lines[start].partition("#")[2].strip() or "sphere"
    if style != "sphere":
        raise PackingFileError(f"{path} is of atom style {style}, which has no radii: write it with atom_style sphere.")
    header = {names: numbers_in(numbers, path) for numbers, names in HEADER.findall("\n".join(lines[:start]))}
    rows = list(takewhile(lambda row: not row[1][0][0].isalpha(), strip_comments(lines[start + 1 :], start + 2)))
    columns = columns_of(path, rows, SPHERE_COLUMNS, f"7 are needed: {', '.join(SPHERE_COLUMNS)}")
    if len(rows) != header["atoms"][0]:
        raise PackingFileError(f"{path} announces {header['atoms'][0]:g} atoms, and {len(rows)} are there.")
    low, high = np.transpose([header[f"{axis}lo {axis}hi"] for axis in "xyz"])
    box, more = np.diag(high - low), dict[str, Any]()
    box[1, 0], *box[2, :2] = header.get("xy xz yz", np.zeros(3))
    marked = next((line for line in lines[:start] if f"{HEADER_COMMENT} " in line), None)
    if marked is not None:  # a file that faultgouge wrote
        comments = [(number, lines[number - 1].partition("#")[2].split()) for number, _ in rows]
        names = ["mass", "angle", "x_low", "y_low"][: len(comments[0][1])]
        columns |= columns_of(path, comments, names, f"{len(names)} behind the #") | {"top": columns["type"] - 1}
        values = dict(part.split("=") for part in marked.split() if "=" in part)
        contacts = [line.removeprefix(CONTACT_COMMENT) for line in lines[:start] if line.startswith(CONTACT_COMMENT)]
        more = read_back(path, values, numbers_in(" ".join(contacts), path), "x_low" in columns)
        more["periodic"] = (values.get("sides") == "p", False, False)
    return particles_of(path, columns, box, origin=low, **more)


def write_data(path: Path, frames: Iterable[tuple[float, Exported]]) -> str:
    """Write a data file; returned is, in words, which part LAMMPS reads.

    That of a Packing is read back to the bit by `read_data`; of a Configuration it has the particles alone.
    """
    [(_, e)] = frames
    mass, radius = e.particles["mass"], e.particles["radius"]
    density = mass / sphere_volume(radius)  # no other double gives LAMMPS the mass to the bit where this one does not
    kinds = 1 + e.particles["top"] if e.rows is not None else e.particles["type"]
    columns = [e.particles["id"], kinds, 2 * radius, density, *e.position.T]
    rows = [" ".join(map(repr, row)) for row in zip(*(each.tolist() for each in columns), strict=True)]
    if e.rows is None:
        low = (np.zeros(3) if e.origin is None else e.origin).tolist()
        box = _sides((a, a + size) for a, size in zip(low, np.diag(e.box).tolist(), strict=True))
        tilts = e.box[[1, 2, 2], [0, 0, 1]].tolist()
        box += [f"{' '.join(map(repr, tilts))} xy xz yz"] if any(tilts) else []
        head, contacts, types = f"# {FORMAT_KEY}={FORMAT}", [], kinds.max()
        says = "LAMMPS reads places, radii, masses and types; contacts, laws and loads are not in it"
    else:
        numbers = " ".join(f"{key}={value!r}" for key, value in e.numbers.items() if key != "box_length")
        head = f"{HEADER_COMMENT} {FORMAT_KEY}={FORMAT} sides={'p' if e.periodic[0] else 'f'} {numbers}"
        box, types = box_lines(cast("Packing", e.source)), 2
        # behind the numbers of the header: readers look for these in the first lines to know the format
        contacts = [f"{CONTACT_COMMENT} {int(i)} {int(j)} {' '.join(map(repr, s))}" for i, j, *s in e.rows.tolist()]
        contacts.append("")
        behind = [mass, *(e.particles[name] for name in ("angle", "x_low", "y_low") if name in e.particles)]
        more = zip(*(each.tolist() for each in behind), strict=True)
        rows = [f"{row} # {' '.join(map(repr, each))}" for row, each in zip(rows, more, strict=True)]
        says = "LAMMPS reads places, radii, masses and types, and skips angles, slips, law and load in comments"
    lines = [head, "", f"{len(rows)} atoms", f"{types} atom types", *box, "", *contacts, "Atoms # sphere", "", *rows]
    write_text(path, "\n".join(lines) + "\n")
    return says


def box_lines(packing: Packing) -> list[str]:
    """The box of a data file, with room around the disks."""
    x, period, margin = packing.position[:, 0], packing.box_length, 4 * packing.radius.max()
    across = (0.0, period) if period is not None else (x.min() - margin, x.max() + margin)
    # LAMMPS makes bins along z, too: the disks lie in the plane z = 0, in a box as thick as one of them
    return _sides((across, box_heights(packing), (-packing.radius.min(), packing.radius.min())))


def _sides(ends: Iterable[tuple[float, float]]) -> list[str]:
    return [f"{float(low)!r} {float(high)!r} {axis}lo {axis}hi" for axis, (low, high) in zip("xyz", ends, strict=True)]


def box_heights(packing: Packing) -> tuple[float, float]:
    """Lower and upper end of the box, length: a layer that erupts has room for its own height twice more."""
    margin = 4 * packing.radius.max()
    return -float(margin), float(3 * (packing.position[:, 1].max() + margin))
