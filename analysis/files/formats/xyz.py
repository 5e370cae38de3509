"""Extended XYZ, the format of OVITO and ASE, in full precision: `import` reads an export of a Packing back bitwise.

The second line has the box (Lattice, pbc), the columns (Properties), law and load by name, and the contacts as one list
of numbers. One line for each disk follows.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ...errors import PackingFileError
from ..atomic_write import FORMAT, FORMAT_KEY, check_format, replace_whole
from .disks import Disks, of_columns
from .exported import Exported, pick_numbers, slips_of
from .tables import block_of_frame, columns_of, lines_of, numbers_in

PAIR = re.compile(r'([\w./-]+)=(?:"([^"]*)"|(\S+))')
VECTORS = {"pos": ("x", "y", "z"), "position": ("x", "y", "z")}


def read_xyz(path: Path, frame: int | None = None) -> Disks:
    """A frame of an extended XYZ file; the last one by default, if all are of as many disks."""
    lines = lines_of(path)

    def count_at(at: int) -> int:
        if not lines[at].strip().isdecimal():
            raise PackingFileError(f"{path}, line {at + 1}: {lines[at].strip()!r} is no number of disks.")
        return int(lines[at])

    begin, count = block_of_frame(path, lines, 2, count_at, frame, "XYZ")
    values = {key: quoted or plain for key, quoted, plain in PAIR.findall(lines[begin + 1])}
    check_format(values.get(FORMAT_KEY), path)
    if "Properties" not in values:
        raise PackingFileError(
            f"{path}, line {begin + 2}: it has no Properties=..., so that this is no extended XYZ file."
        )
    names = _columns(values["Properties"])
    rows = [(number + 1, lines[number].split()) for number in range(begin + 2, begin + 2 + count)]
    columns = columns_of(path, rows, names, f"Properties {len(names)}", more=False)
    place = _species_column(values["Properties"])
    species = [] if place is None else [words[place] for _, words in rows]
    lattice = numbers_in(values.get("Lattice", ""), path)
    periodic = len(lattice) == 9 and values.get("pbc", "T T T").split()[0] in ("T", "1", "True")
    listed = values.get("contacts")
    slips = None if listed is None else slips_of(numbers_in(listed, path), "x_low" in columns)
    period = lattice[0] if periodic else None
    return of_columns(str(path), columns, species, box_length=period, given=pick_numbers(values), slips=slips)


def _columns(properties: str) -> list[str | None]:
    """Names of the columns, None for text; components of a vector other than the position are numbered."""
    words = properties.lower().split(":")
    names: list[str | None] = []
    for name, kind, count in zip(words[::3], words[1::3], words[2::3], strict=False):
        size = int(count) if count.isdecimal() else 1
        own = VECTORS.get(name, tuple(f"{name}_{k}" for k in range(size))) if size > 1 else (name,)
        names += size * [None] if kind == "s" else own[:size]
    return names


def _species_column(properties: str) -> int | None:
    """Where the names of types stand in a row; None if there are none."""
    words, place = properties.split(":"), 0
    for name, kind, count in zip(words[::3], words[1::3], words[2::3], strict=False):
        if name.lower() in ("species", "type", "element") and kind.lower() == "s":
            return place
        place += int(count) if count.isdecimal() else 1
    return None


def write_xyz(path: Path, frames: Iterable[tuple[float, Exported]]) -> str:
    """Write one frame or several, and return the contents in words."""
    with replace_whole(path) as new, new.open("w") as stream:
        stream.writelines(_text(frame) for _, frame in frames)
    return "all of the packing is in it, to the bit"


def _text(frame: Exported) -> str:
    # the places first, for readers of plain XYZ; ASE calls the forces so, and takes symbols of elements as species
    columns = {"pos": frame.position} | {
        "forces" if name == "net_force" else name: values for name, values in frame.particles.items()
    }
    properties, words = ["species:S:1"], [np.where(frame.top, "U", "B").tolist()]
    for name, values in columns.items():
        kind, size = "I" if values.dtype.kind == "i" else "R", 1 if values.ndim == 1 else values.shape[1]
        properties.append(f"{name}:{kind}:{size}")
        words += [list(map(repr, part)) for part in values.reshape(len(values), size).T.tolist()]
    lattice = " ".join(map(repr, frame.box.ravel().tolist()))
    says = [
        f'Lattice="{lattice}"',
        *([] if frame.origin is None else [f'Origin="{" ".join(map(repr, frame.origin.tolist()))}"']),
        f'pbc="{" ".join("T" if each else "F" for each in frame.periodic)}"',
        f"Properties={':'.join(properties)}",
        f"{FORMAT_KEY}={FORMAT}",
        *(f"{key}={float(value)!r}" for key, value in frame.numbers.items()),
    ]
    if frame.rows is not None:
        says.append(f'contacts="{" ".join(map(repr, frame.rows.ravel().tolist()))}"')
    lines = [str(len(frame.top)), " ".join(says), *map(" ".join, zip(*words, strict=True))]
    return "\n".join(lines) + "\n"
