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
from ..atomic_write import FORMAT, FORMAT_KEY, replace_whole
from .disks import Disks, particles_of
from .exported import Exported, read_back
from .tables import block_of_frame, columns_of, lines_of, numbers_in

PAIR = re.compile(r'([\w./-]+)=(?:"([^"]*)"|(\S+))')
NAMES_OF_TYPES = ("species", "type", "element")


def read_xyz(path: Path, frame: int) -> Disks:
    """A frame of an extended XYZ file."""
    lines = lines_of(path)
    begin, count = block_of_frame(path, lines, 2, frame)
    values = {key: quoted or plain for key, quoted, plain in PAIR.findall(lines[begin + 1])}
    words = values.get("Properties", "").lower().split(":")
    if len(words) < 3:
        raise PackingFileError(f"{path}, line {begin + 2}: it has no Properties=..., as extended XYZ has.")
    # components of a vector other than the position are numbered; a column of text has no name
    names, place = list[str | None](), None
    for name, kind, size in zip(words[::3], words[1::3], words[2::3], strict=False):
        width = int(size) if size.isdecimal() else 1
        place = len(names) if kind == "s" and name in NAMES_OF_TYPES and place is None else place
        parts = ["x", "y", "z"] if name in ("pos", "position") else [f"{name}_{k}" for k in range(width)]
        names += [None] * width if kind == "s" else [name] if width == 1 else parts[:width]
    rows = [(number + 1, lines[number].split()) for number in range(begin + 2, begin + 2 + count)]
    columns = columns_of(path, rows, names, f"Properties {len(names)}", more=False)
    lattice, listed = numbers_in(values.get("Lattice", ""), path), values.get("contacts")
    more = read_back(path, values, None if listed is None else numbers_in(listed, path), "x_low" in columns)
    more["origin"] = np.array(numbers_in(values.get("Origin", "0 0 0"), path))
    more["periodic"] = [each in ("T", "1", "True") for each in values.get("pbc", "T T T").split()]
    more["type_names"] = [] if place is None else [row[place] for _, row in rows]
    return particles_of(path, columns, np.reshape(lattice, (3, 3)) if len(lattice) == 9 else None, **more)


def write_xyz(path: Path, frames: Iterable[tuple[float, Exported]]) -> str:
    """Write one frame or several, and return in words what of a Packing is there."""
    says = ""
    with replace_whole(path) as new, new.open("w") as stream:
        for _, frame in frames:
            stream.write(_text(frame))
            says = "all of the packing is in it, to the bit" if frame.rows is not None else ""
    return says


def _text(frame: Exported) -> str:
    # the places first, for readers of plain XYZ; ASE calls the forces so, and takes symbols of elements as species
    columns = {"pos": frame.position} | frame.particles
    properties, words = ["species:S:1"], [np.where(frame.source.top, "U", "B").tolist()]
    for name, values in columns.items():
        kind, size = "I" if values.dtype.kind == "i" else "R", 1 if values.ndim == 1 else values.shape[1]
        properties.append(f"{'forces' if name == 'net_force' else name}:{kind}:{size}")
        words += [list(map(repr, part)) for part in values.reshape(len(values), size).T.tolist()]
    lists = {"Lattice": frame.box, "Origin": frame.origin, "contacts": frame.rows}
    text = {name: " ".join(map(repr, each.ravel().tolist())) for name, each in lists.items() if each is not None}
    says = [f'{name}="{text[name]}"' for name in ("Lattice", "Origin") if name in text]
    says += [f'pbc="{" ".join("T" if each else "F" for each in frame.periodic)}"', f"Properties={':'.join(properties)}"]
    says += [f"{key}={value!r}" for key, value in {FORMAT_KEY: FORMAT, **frame.numbers}.items()]
    says += [f'contacts="{text["contacts"]}"'] if "contacts" in text else []
    return "\n".join([str(len(frame.position)), " ".join(says), *map(" ".join, zip(*words, strict=True)), ""])
