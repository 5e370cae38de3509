"""LAMMPS data files of atom style sphere, in and out.

The mass of a disk is that of the sphere which LAMMPS takes it for: density times 4/3 pi R^3. What the format has no
column for stands in comments, which LAMMPS skips: law and load in the first line, contacts in the header, and the mass
and the angle of a disk behind its line, since no density may give a mass to the last bit.

    # faultgouge kn=200000.0 kt=57142.857142857145 mu=1.0 fx=0.01 fy=3.0 inertia_factor=1.0
    # contact 1 2 1.25e-05          first ID, second ID (0 is the floor), slip
    1 2 1.0 1.909859317102744 0.5 0.4996 0.0 # 1.0 0.0
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...analysis import Packing, PackingFileError
from ..lammps.data_file import box_lines
from .disks import Disks, of_columns, sphere_volume
from .quantities import ModeVectors
from .record import contact_rows, given, scalars, slips_of
from .table import lines_of, number_of

MARK = "# faultgouge"
CONTACT = "# contact"
COLUMNS = ("id", "type", "diameter", "density", "x", "y", "z")
SECTIONS = ("Atoms", "Velocities", "Masses", "Bonds", "Angles", "Ellipsoids", "Lines", "Triangles", "Bodies")


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
    header = lines[:start]
    count = _header_number(path, header, "atoms")
    rows, comments = [], []
    for number, line in enumerate(lines[start + 1 :], start + 2):
        text, _, comment = line.partition("#")
        words = text.split()
        if not words:
            continue
        if words[0][0].isalpha():
            break
        if len(words) < len(COLUMNS):
            raise PackingFileError(
                f"{path}, line {number}: a disk has {len(words)} columns, and 7 are needed: {COLUMNS}."
            )
        rows.append([number_of(word, f"{path}, line {number}") for word in words[: len(COLUMNS)]])
        comments.append(comment.split())
    if len(rows) != count:
        raise PackingFileError(f"{path} announces {count} atoms, and {len(rows)} are there.")
    if not count:
        raise PackingFileError(f"{path} has no disks.")
    columns = dict(zip(COLUMNS, np.array(rows).T, strict=True))
    marked = next((line for line in header if MARK in line), None)
    if marked is None:
        return of_columns(str(path), columns, box_length=_width(path, header))
    return _own(path, header, marked, columns, comments)


def _own(path: Path, header: list[str], marked: str, columns: dict, comments: list[list[str]]) -> Disks:
    """A file that faultgouge wrote."""
    names = ("mass", "angle", "x_low", "y_low")
    extra = np.array([[number_of(word, str(path)) for word in comment] for comment in comments])
    columns |= dict(zip(names, extra.T, strict=False))
    columns["top"] = columns["type"] - 1
    values = dict(part.split("=") for part in marked.partition(MARK)[2].split() if "=" in part)
    listed = [line.split()[2:] for line in header if line.startswith(CONTACT)]
    rows = np.array([[number_of(word, str(path)) for word in row] for row in listed])
    if not len(rows):
        rows = np.zeros((0, 4 if "x_low" in columns else 3))
    period = _width(path, header) if values.get("sides") == "p" else None
    return of_columns(str(path), columns, box_length=period, given=given(values), slips=slips_of(rows))


def _header_number(path: Path, header: list[str], name: str) -> int:
    for line in header:
        words = line.split("#")[0].split()
        if words[1:] == [name] and words[0].isdecimal():
            return int(words[0])
    raise PackingFileError(f"{path} is no LAMMPS data file: its header has no line 'N {name}'.")


def _width(path: Path, header: list[str]) -> float:
    for line in header:
        words = line.split("#")[0].split()
        if words[2:] == ["xlo", "xhi"]:
            low, high = (number_of(word, str(path)) for word in words[:2])
            return high - low
        if words[3:] == ["xy", "xz", "yz"] and any(float(word) != 0 for word in words[:3]):
            raise PackingFileError(f"{path} has a tilted box: give one with right angles.")
    raise PackingFileError(f"{path} is no LAMMPS data file: its header has no line 'xlo xhi'.")


def write_data(path: Path, packing: Packing, modes: list[ModeVectors]) -> str:
    """A data file that `read_data` takes back to the bit; what LAMMPS itself reads of it is returned in words."""
    density = densities(packing)
    sides = "f" if packing.box_length is None else "p"
    lines = [f"{MARK} sides={sides} " + " ".join(f"{key}={value!r}" for key, value in scalars(packing).items())]
    lines += ["", f"{len(packing)} atoms", "2 atom types", *box_lines(packing), ""]
    # behind the numbers of the header: readers look for these in the first lines to know the format
    for first, second, *slips in contact_rows(packing).tolist():
        lines.append(" ".join([CONTACT, str(int(first)), str(int(second)), *map(repr, slips)]))
    lines += ["", "Atoms # sphere", ""]
    extra = [packing.mass, packing.angle]
    if packing.position_low is not None:
        extra += list(packing.position_low.T)
    columns = [packing.top, 2 * packing.radius, density, *packing.position.T, *extra]
    for n, (top, d, rho, x, y, *more) in enumerate(zip(*(each.tolist() for each in columns), strict=True), 1):
        lines.append(f"{n} {1 + top} {d!r} {rho!r} {x!r} {y!r} 0.0 # " + " ".join(map(repr, more)))
    path.write_text("\n".join(lines) + "\n")
    exact = density * sphere_volume(packing.radius) == packing.mass
    odd = "" if exact.all() else f" ({np.sum(~exact)} masses with a last bit of their own)"
    return f"LAMMPS reads places, radii, masses{odd} and types, and skips angles, slips, law and load in comments"


def densities(packing: Packing) -> np.ndarray:
    """Densities of which LAMMPS makes the masses, to the bit where there is one."""
    volume = sphere_volume(packing.radius)
    density = packing.mass / volume
    for candidate in (np.nextafter(density, 0), np.nextafter(density, np.inf)):
        better = (density * volume != packing.mass) & (candidate * volume == packing.mass)
        density = np.where(better, candidate, density)
    return density
