"""Extended XYZ, in and out: what OVITO and ASE read. Full precision: `import` takes an export back to the bit.

The second line has the box (Lattice, pbc), the columns (Properties), law and load by name, and the contacts as one list
of numbers; a line a disk follows.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ...analysis import Packing, PackingFileError
from .disks import Disks, of_columns
from .quantities import Frame, ModeVectors, disk_force, disk_mobilised, disk_pressure
from .record import contact_rows, given, scalars, slips_of
from .table import lines_of, number_of

PAIR = re.compile(r'([\w./-]+)=(?:"([^"]*)"|(\S+))')
VECTORS = {"pos": ("x", "y", "z"), "position": ("x", "y", "z")}


def read_xyz(path: Path, frame: int | None = None) -> Disks:
    """A frame of an extended XYZ file; the last one by default, if all are of as many disks."""
    lines = lines_of(path)
    begins, at = [], 0
    while at < len(lines) and lines[at].strip():
        if not lines[at].strip().isdecimal():
            raise PackingFileError(f"{path}, line {at + 1}: {lines[at].strip()!r} is no number of disks.")
        begins.append(at)
        at += int(lines[at]) + 2
    if not begins or at > len(lines):
        raise PackingFileError(f"{path} is no complete XYZ file: it breaks off.")
    counts = {int(lines[begin]) for begin in begins}
    if frame is None and len(counts) > 1:
        raise PackingFileError(
            f"{path} has frames with {min(counts)} and {max(counts)} disks: choose one with --frame."
        )
    wanted = -1 if frame is None else frame
    if not -len(begins) <= wanted < len(begins):
        raise PackingFileError(f"{path} has {len(begins)} frames; there is no --frame {frame}.")
    begin = begins[wanted]
    return _frame(path, lines[begin + 1], lines[begin + 2 : begin + 2 + int(lines[begin])], begin + 3)


def _frame(path: Path, comment: str, lines: list[str], line: int) -> Disks:
    values = {key: quoted or plain for key, quoted, plain in PAIR.findall(comment)}
    if "Properties" not in values:
        raise PackingFileError(
            f"{path}, line {line - 1}: it has no Properties=..., so that this is no extended XYZ file."
        )
    columns: dict[str, list[float]] = {}
    names = list(_columns(values["Properties"]))
    for number, text in enumerate(lines, line):
        words = text.split()
        if len(words) != len(names):
            raise PackingFileError(f"{path}, line {number}: it has {len(words)} columns, and Properties {len(names)}.")
        for (name, kind), word in zip(names, words, strict=True):
            if kind != "S":
                word = {"T": "1", "F": "0"}.get(word, word)
                columns.setdefault(name, []).append(number_of(word, f"{path}, line {number}"))
    period = None
    lattice = [number_of(word, str(path)) for word in values.get("Lattice", "").split()]
    if len(lattice) == 9 and values.get("pbc", "T T T").split()[0] in ("T", "1", "True"):
        period = lattice[0]
    slips = None
    if "contacts" in values:
        numbers = np.array([number_of(word, str(path)) for word in values["contacts"].split()])
        slips = slips_of(numbers.reshape(-1, 4 if "x_low" in columns else 3))
    arrays = {name: np.array(column) for name, column in columns.items()}
    return of_columns(str(path), arrays, box_length=period, given=given(values), slips=slips)


def _columns(properties: str) -> list[tuple[str, str]]:
    """Names and kinds of the columns; those of a vector have a number behind them, but for positions."""
    words = properties.split(":")
    names = []
    for name, kind, count in zip(words[::3], words[1::3], words[2::3], strict=False):
        size = int(count) if count.isdecimal() else 1
        own = VECTORS.get(name.lower(), tuple(f"{name.lower()}_{k}" for k in range(size)))
        names += [(name.lower(), kind)] if size == 1 else [(each, kind) for each in own[:size]]
    return names


def _written(packing: Packing, modes: list[ModeVectors], frame: Frame | None) -> list[tuple[str, str, np.ndarray]]:
    """Names, kinds and numbers of what stands in a row for each disk."""
    n, force = len(packing), disk_force(packing)
    columns: list[tuple[str, str, np.ndarray]] = [
        # first, for readers of plain XYZ
        ("pos", "R", np.column_stack([packing.position, np.zeros(n)])),
        ("id", "I", np.arange(1, n + 1)),
        ("radius", "R", packing.radius),
        ("mass", "R", packing.mass),
        ("top", "I", packing.top.astype(int)),
        ("normal_force", "R", disk_pressure(packing)),
    ]
    if frame is None or frame.whole:
        columns += [
            ("angle", "R", packing.angle),
            ("forces", "R", np.column_stack([force[:, :2], np.zeros(n)])),
            ("torque_over_radius", "R", force[:, 2]),
            ("mobilised", "R", disk_mobilised(packing)),
        ]
    if frame is not None:
        columns.append(("displacement", "R", np.column_stack([frame.displacement, np.zeros(n)])))
    if packing.position_low is not None:
        columns += [("x_low", "R", packing.position_low[:, 0]), ("y_low", "R", packing.position_low[:, 1])]
    for mode in modes:
        moved = mode.displacement
        for part, values in (("", moved.real), ("_imag", moved.imag)):
            if not part or np.any(values):
                columns.append((f"{mode.name}{part}", "R", np.column_stack([values[0], values[1], np.zeros(n)])))
                columns.append((f"{mode.name}{part}_rotation", "R", values[2]))
    return columns


def write_xyz(path: Path, packing: Packing, modes: list[ModeVectors]) -> str:
    """An extended XYZ file; what is in it, in words."""
    path.write_text(_text(packing, modes))
    return "all of the packing is in it, to the bit"


def write_xyz_frames(path: Path, frames: Iterable[Frame]) -> None:
    """An extended XYZ file of several frames."""
    with path.open("w") as stream:
        stream.writelines(_text(frame.packing, [], frame) for frame in frames)


def _text(packing: Packing, modes: list[ModeVectors], frame: Frame | None = None) -> str:
    columns = _written(packing, modes, frame)
    rows = np.column_stack([array if array.ndim == 2 else array[:, None] for *_, array in columns])
    whole = np.concatenate([[kind == "I"] * (1 if a.ndim == 1 else a.shape[1]) for _, kind, a in columns])
    species = np.where(packing.top, "T", "B").tolist()
    lines = [str(len(packing)), _head(packing, columns, frame)]
    for name, row in zip(species, rows.tolist(), strict=True):
        words = (str(int(value)) if is_whole else repr(value) for value, is_whole in zip(row, whole, strict=True))
        lines.append(f"{name} " + " ".join(words))
    return "\n".join(lines) + "\n"


def _head(packing: Packing, columns: list[tuple[str, str, np.ndarray]], frame: Frame | None) -> str:
    """The second line."""
    box = packing.box_length
    width = box if box is not None else 2 * np.ptp(packing.position[:, 0]) + 2 * packing.radius.max()
    height = (packing.position[:, 1] + packing.radius).max()
    properties = ":".join(f"{name}:{kind}:{1 if array.ndim == 1 else array.shape[1]}" for name, kind, array in columns)
    says = [
        f'Lattice="{float(width)!r} 0.0 0.0 0.0 {float(height)!r} 0.0 0.0 0.0 {2 * float(packing.radius.max())!r}"',
        f'pbc="{"F" if box is None else "T"} F F"',
        f"Properties=species:S:1:{properties}",
        *(f"{key}={float(value)!r}" for key, value in scalars(packing).items()),
    ]
    if frame is not None:
        says += [f"{key}={float(value)!r}" for key, value in frame.number.items()]
    if frame is None or frame.whole:
        numbers = " ".join(repr(value) for value in contact_rows(packing).ravel().tolist())
        says.append(f'contacts="{numbers}"')
    return " ".join(says)
