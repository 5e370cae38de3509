"""Read and write extended XYZ, the format of OVITO and ASE, in full precision: `import` reads an export back bitwise.

The second line has the box (Lattice, pbc), the columns (Properties), law and load by name, and the contacts as one list
of numbers. One line for each disk follows.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import PackingFileError
from ..atomic_write import FORMAT, FORMAT_KEY, check_format, replace_whole
from . import export_quantities
from .disks import Disks, of_columns
from .export_quantities import Frame, ModeVectors
from .text_columns import block_of_frame, columns_of, lines_of, numbers_in

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
    slips = None if listed is None else export_quantities.slips_of(numbers_in(listed, path), "x_low" in columns)
    period = lattice[0] if periodic else None
    return of_columns(
        str(path), columns, species, box_length=period, given=export_quantities.pick_numbers(values), slips=slips
    )


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


def _write_columns(frame: Frame, modes: list[ModeVectors]) -> list[tuple[str, str, np.ndarray]]:
    """Name, kind and numbers of each column; a row is a disk."""
    packing = frame.packing
    n, force = len(packing), export_quantities.disk_force(packing)
    columns: list[tuple[str, str, np.ndarray]] = [
        # first, for readers of plain XYZ
        ("pos", "R", export_quantities.in_space(packing.position)),
        ("id", "I", np.arange(1, n + 1)),
        ("radius", "R", packing.radius),
        ("mass", "R", packing.mass),
        ("top", "I", packing.top.astype(int)),
        ("normal_force", "R", export_quantities.disk_pressure(packing)),
    ]
    if frame.whole:
        columns += [
            ("angle", "R", packing.angle),
            ("forces", "R", export_quantities.in_space(force[:, :2])),
            ("torque_over_radius", "R", force[:, 2]),
            ("mobilised", "R", export_quantities.disk_mobilised(packing)),
        ]
    if frame.displacement is not None:
        columns.append(("displacement", "R", export_quantities.in_space(frame.displacement)))
    if packing.position_low is not None:
        columns += [("x_low", "R", packing.position_low[:, 0]), ("y_low", "R", packing.position_low[:, 1])]
    columns += [(name, "R", values) for mode in modes for name, values in mode.fields().items()]
    return columns


def write_xyz(path: Path, frames: Iterable[Frame], modes: list[ModeVectors]) -> str:
    """Write one frame or several as extended XYZ, and return the contents in words."""
    with replace_whole(path) as new, new.open("w") as stream:
        stream.writelines(_text(frame, modes) for frame in frames)
    return "all of the packing is in it, to the bit"


def _text(frame: Frame, modes: list[ModeVectors]) -> str:
    packing, columns = frame.packing, _write_columns(frame, modes)
    rows = np.column_stack([array if array.ndim == 2 else array[:, None] for *_, array in columns])
    whole = np.concatenate([[kind == "I"] * (1 if a.ndim == 1 else a.shape[1]) for _, kind, a in columns])
    species = species_of(packing.top)
    lines = [str(len(packing)), _head(frame, columns)]
    for name, row in zip(species, rows.tolist(), strict=True):
        words = (str(int(value)) if is_whole else repr(value) for value, is_whole in zip(row, whole, strict=True))
        lines.append(f"{name} " + " ".join(words))
    return "\n".join(lines) + "\n"


def species_of(top: NDArray[np.bool_]) -> list[str]:
    """U for the upper layer and B for the bed: ASE takes symbols of elements alone, and these are two."""
    return np.where(top, "U", "B").tolist()


def _head(frame: Frame, columns: list[tuple[str, str, np.ndarray]]) -> str:
    """The second line."""
    packing = frame.packing
    box = packing.box_length
    width = box if box is not None else 2 * np.ptp(packing.position[:, 0]) + 2 * packing.radius.max()
    height = (packing.position[:, 1] + packing.radius).max()
    properties = ":".join(f"{name}:{kind}:{1 if array.ndim == 1 else array.shape[1]}" for name, kind, array in columns)
    says = [
        f'Lattice="{float(width)!r} 0.0 0.0 0.0 {float(height)!r} 0.0 0.0 0.0 {2 * float(packing.radius.max())!r}"',
        f'pbc="{"F" if box is None else "T"} F F"',
        f"Properties=species:S:1:{properties}",
        f"{FORMAT_KEY}={FORMAT}",
        *(f"{key}={float(value)!r}" for key, value in (export_quantities.scalars(packing) | frame.number).items()),
    ]
    if frame.whole:
        numbers = " ".join(repr(value) for value in export_quantities.contact_rows(packing).ravel().tolist())
        says.append(f'contacts="{numbers}"')
    return " ".join(says)
