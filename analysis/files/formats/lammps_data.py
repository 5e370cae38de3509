"""LAMMPS data files of atom style sphere, in and out.

LAMMPS treats a disk as a sphere: its mass is density times 4/3 pi R^3. Quantities without a column are in comments,
which LAMMPS skips: law and load in the first line, contacts in the header, and the mass and the angle of a disk at the
end of its line, because there may be no density that gives the mass to the last bit.

    # faultgouge kn=200000.0 kt=57142.857142857145 mu=1.0 fx=0.01 fy=3.0 inertia_factor=1.0
    # contact 1 2 1.25e-05          first ID, second ID (0 is the floor), slip
    1 2 1.0 1.909859317102744 0.5 0.4996 0.0 # 1.0 0.0
"""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path

import numpy as np

from ...configuration import Configuration
from ...errors import PackingFileError
from ...packing.packing import Packing
from ..atomic_write import FORMAT, FORMAT_KEY, check_format, write_text
from .disks import Disks, of_columns, sphere_volume
from .exported import contact_rows, pick_numbers, scalars, slips_of
from .tables import columns_of, lines_of, numbers_in, strip_comments

HEADER_COMMENT = "# faultgouge"
CONTACT_COMMENT = "# contact"
SPHERE_COLUMNS = ("id", "type", "diameter", "density", "x", "y", "z")


def read_data(path: Path) -> Disks:
    """Disks of a data file. The file does not say whether x is periodic: it is taken to be, with the box's width."""
    lines = lines_of(path)
    heads = {line.split("#")[0].strip().split(" ")[0]: k for k, line in enumerate(lines) if line.strip()}
    if "Atoms" not in heads:
        raise PackingFileError(f"{path} is no LAMMPS data file with disks: it has no section Atoms.")
    start = heads["Atoms"]
    style = lines[start].partition("#")[2].strip() or "sphere"
    if style != "sphere":
        raise PackingFileError(f"{path} is of atom style {style}, which has no radii: write it with atom_style sphere.")
    header = _header(path, lines[:start])
    rows = list(takewhile(lambda row: not row[1][0][0].isalpha(), strip_comments(lines[start + 1 :], start + 2)))
    columns = columns_of(path, rows, SPHERE_COLUMNS, f"7 are needed: {', '.join(SPHERE_COLUMNS)}")
    if len(rows) != header["atoms"][0]:
        raise PackingFileError(f"{path} announces {header['atoms'][0]:g} atoms, and {len(rows)} are there.")
    if not rows:
        raise PackingFileError(f"{path} has no disks.")
    low, high = header["xlo xhi"]
    marked = next((line for line in lines[:start] if f"{HEADER_COMMENT} " in line), None)
    if marked is None:
        return of_columns(str(path), columns, box_length=high - low)
    # a file that faultgouge wrote
    comments = [(number, lines[number - 1].partition("#")[2].split()) for number, _ in rows]
    names = ("mass", "angle", "x_low", "y_low")[: len(comments[0][1])]
    columns |= columns_of(path, comments, names, f"{len(names)} behind the #")
    columns["top"] = columns["type"] - 1
    values = dict(part.split("=") for part in marked.partition(HEADER_COMMENT)[2].split() if "=" in part)
    check_format(values.get(FORMAT_KEY), path)
    contacts = " ".join(
        line.removeprefix(CONTACT_COMMENT) for line in lines[:start] if line.startswith(CONTACT_COMMENT)
    )
    slips = slips_of(numbers_in(contacts, path), "x_low" in columns)
    period = high - low if values.get("sides") == "p" else None
    return of_columns(str(path), columns, box_length=period, given=pick_numbers(values), slips=slips)


def _header(path: Path, lines: list[str]) -> dict[str, list[float]]:
    """The numbers of the header by the names behind them."""
    found = {}
    for line in lines:
        words = line.partition("#")[0].split()
        first = next((k for k, word in enumerate(words) if word[0].isalpha()), len(words))
        if 0 < first < len(words):
            found[" ".join(words[first:])] = numbers_in(" ".join(words[:first]), path)
    for name in ("atoms", "xlo xhi"):
        if name not in found:
            says = f"N {name}" if name == "atoms" else name
            raise PackingFileError(f"{path} is no LAMMPS data file: its header has no line '{says}'.")
    if any(found.get("xy xz yz", ())):
        raise PackingFileError(f"{path} has a tilted box: give one with right angles.")
    return found


def write_spheres(path: Path, configuration: Configuration) -> str:
    """Write the particles of a Configuration; returned is, in words, which part of it is there."""
    c = configuration
    (xx, *_), (xy, yy, _), (xz, yz, zz) = c.box.tolist()
    low, rest = c.origin.tolist(), np.pad(c.position, ((0, 0), (0, 3 - c.dimension)))
    box = [f"{a!r} {a + size!r} {axis}lo {axis}hi" for axis, a, size in zip("xyz", low, (xx, yy, zz), strict=True)]
    tilt = [f"{xy!r} {xz!r} {yz!r} xy xz yz"] if any((xy, xz, yz)) else []
    lines = [f"# {FORMAT_KEY}={FORMAT}", "", f"{len(c)} atoms", f"{c.kind.max()} atom types", *box, *tilt, ""]
    columns = [c.ids, c.kind, 2 * c.radius, c.mass / sphere_volume(c.radius), *rest.T]
    rows = [" ".join(map(repr, row)) for row in zip(*(each.tolist() for each in columns), strict=True)]
    write_text(path, "\n".join([*lines, "Atoms # sphere", "", *rows]) + "\n")
    return "places, radii, masses and types; contacts, laws and loads are not in it"


def write_data(path: Path, packing: Packing) -> str:
    """Write a data file that `read_data` reads back to the bit; returned is, in words, which part LAMMPS reads."""
    volume = sphere_volume(packing.radius)
    density = packing.mass / volume  # no other double gives LAMMPS the mass to the bit where this one does not
    sides = "f" if packing.box_length is None else "p"
    lines = [
        f"{HEADER_COMMENT} {FORMAT_KEY}={FORMAT} sides={sides} "
        + " ".join(f"{key}={value!r}" for key, value in scalars(packing).items())
    ]
    lines += ["", f"{len(packing)} atoms", "2 atom types", *box_lines(packing), ""]
    # behind the numbers of the header: readers look for these in the first lines to know the format
    for first, second, *slips in contact_rows(packing).tolist():
        lines.append(" ".join([CONTACT_COMMENT, str(int(first)), str(int(second)), *map(repr, slips)]))
    lines += ["", "Atoms # sphere", ""]
    extra = [packing.mass, packing.angle]
    if packing.position_low is not None:
        extra += list(packing.position_low.T)
    columns = [packing.top, 2 * packing.radius, density, *packing.position.T, *extra]
    for n, (top, d, rho, x, y, *more) in enumerate(zip(*(each.tolist() for each in columns), strict=True), 1):
        lines.append(f"{n} {1 + top} {d!r} {rho!r} {x!r} {y!r} 0.0 # " + " ".join(map(repr, more)))
    write_text(path, "\n".join(lines) + "\n")
    exact = density * volume == packing.mass
    odd = "" if exact.all() else f" ({np.sum(~exact)} masses with a last bit of their own)"
    return f"LAMMPS reads places, radii, masses{odd} and types, and skips angles, slips, law and load in comments"


def box_lines(packing: Packing) -> list[str]:
    """The box of a data file, with room around the disks."""
    x = packing.position[:, 0]
    period = packing.box_length
    margin = 4 * packing.radius.max()
    left, right = (0.0, period) if period is not None else (x.min() - margin, x.max() + margin)
    bottom, top = box_heights(packing)
    # LAMMPS makes bins along z, too: the disks lie in the plane z = 0, in a box as thick as one of them
    thickness = float(packing.radius.min())
    return [
        f"{float(left)!r} {float(right)!r} xlo xhi",
        f"{bottom!r} {top!r} ylo yhi",
        f"{-thickness!r} {thickness!r} zlo zhi",
    ]


def box_heights(packing: Packing) -> tuple[float, float]:
    """Lower and upper end of the box, length: a layer that erupts has room for its own height twice more."""
    margin = 4 * packing.radius.max()
    return -float(margin), float(3 * (packing.position[:, 1].max() + margin))
