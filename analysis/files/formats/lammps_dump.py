r"""LAMMPS text dumps of disks: those of the decks (NAME.disks, a packing), and those of any other run (dump custom).

Two files make one packing. The disks' dump (``dump custom``) has one row per disk; its box line says whether x is
periodic. The contacts' dump (``dump local``) has one row per pair, with the slip. Columns are found by name, under any
of the names listed in `DISK` and `CONTACT`, in any order; additional columns are ignored. With ``%.17g`` all numbers
are read back bitwise.

Disks of type 2 form the upper layer. The slip on the floor is in the dump of disks, because a floor contact belongs to
one disk. LAMMPS also lists pairs that do not overlap, up to its cutoff; these are not contacts. Without friction there
are neither slips nor angles, and their columns may be missing.

Law, load and inertia are not part of a dump. They are given by the caller or by a file of the same name with the suffix
".params", which has one ``key value`` per line from kn, kt, mu, exponent, rescaled, coulomb, cn, ct, tau, fx, fy,
inertia_factor. Values from the caller take precedence.

Of a dump custom, columns are x or xu or xs, radius or diameter, and, if present, id, type, mass, theta. Several
snapshots in a file must have the same disks; otherwise a snapshot must be chosen.
"""

import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import TextIO

import numpy as np

from ...arrays import Floats
from ...errors import PackingFileError
from ...packing.compensated import exact_sum
from ...packing.geometry import nearest_image
from ...packing.law import MindlinLaw
from ...packing.packing import Packing
from ..atomic_write import FORMAT_KEY, check_format
from ..plain_file import open_text, read_plain_text
from ..runfile import law_of_parameters
from .disks import Disks, Slips, of_columns, packing_of

DISK = {
    "id": ("id",),
    "type": ("type",),
    "x": ("x",),
    "y": ("y",),
    "radius": ("radius",),
    "mass": ("mass",),
    "angle": ("theta", "d_theta"),
    "floor_slip": ("floor_slip", "f_floor[3]"),
    "x_low": ("x_low", "f_low[1]"),
    "y_low": ("y_low", "f_low[2]"),
    "floor_slip_low": ("floor_slip_low", "f_floor[8]"),
}
"""Columns of the disks' dump and the names that they may have. Low parts are there in compensated arithmetic alone."""

CONTACT = {
    "first": ("id1", "c_ids[1]"),
    "second": ("id2", "c_ids[2]"),
    "slip": ("slip", "c_contact[3]"),
    "slip_low": ("slip_low", "c_contact[4]"),
}
"""Columns of the contacts' dump and the names that they may have."""

LOW_PARTS = ("x_low", "y_low", "floor_slip_low", "slip_low")

TOP_TYPE = 2
"""LAMMPS atom type of the disks of the upper layer."""


@dataclass(frozen=True, eq=False)
class DumpFrame:
    """One snapshot of a LAMMPS text dump.

    Attributes
    ----------
    step : int
        LAMMPS's time step.
    boundary : tuple of str
        Boundary flags of the box, such as ("pp", "ff", "pp").
    bounds : ndarray, shape (3, 2)
        Lower and upper bounds of the box, length.
    columns : tuple of str
        Names of the columns.
    rows : ndarray, shape (R, len(columns))
        The numbers.
    """

    step: int
    boundary: tuple[str, ...]
    bounds: Floats
    columns: tuple[str, ...]
    rows: Floats


def read_dump(
    disks: str | PathLike[str],
    contacts: str | PathLike[str] | None = None,
    *,
    frame: int = -1,
    law: MindlinLaw | None = None,
    fx: float | None = None,
    fy: float | None = None,
    inertia_factor: float | None = None,
) -> Packing:
    """Read a packing from the dumps of an input deck.

    Parameters
    ----------
    disks : path
        The dump of disks.
    contacts : path, optional
        The dump of contacts; by default the file with the name of the dump of disks and the suffix ".contacts".
    frame : int
        Number of the snapshot; negative numbers count from the end. Contacts are read from the snapshot of the same
        time step.
    law, fx, fy, inertia_factor
        As in :class:`~faultgouge.analysis.Packing`; by default those of the file ``.params``; without this file, no
        load and inertia factor 1. The law then has no default.

    Raises
    ------
    PackingFileError
        If a file is missing or broken, a column is missing, the snapshots do not match, or no law is given.
    """
    disks = Path(disks)
    found, law = _deck_disks(disks, contacts, frame, law)
    assert found.top is not None
    given = found.given
    values = {"fx": fx, "fy": fy, "inertia_factor": inertia_factor}
    known = {key: given[key] if value is None else value for key, value in values.items() if key in given or value}
    return packing_of(found, law, found.top, drag_time=given.get("tau"), **known)


def read_deck_dump(path: Path, frame: int | None = None) -> Disks:
    """Read a dump of write.in, with its .contacts and .params."""
    return _deck_disks(path, None, -1 if frame is None else frame, None)[0]


def _law(given: Mapping[str, float], disks: Path) -> MindlinLaw:
    """The law of a sidecar file."""
    try:
        return law_of_parameters(given)
    except KeyError as error:
        sidecar = disks.with_suffix(".params")
        raise PackingFileError(f"The law of {disks} is not given: {sidecar} does not name {error}.") from None


def _deck_disks(
    path: Path, contacts: str | PathLike[str] | None, frame: int, law: MindlinLaw | None
) -> tuple[Disks, MindlinLaw]:
    """The disks of a dump of the decks, with the slips of all contacts, and the law; that of the file by default."""
    beside = path.with_suffix(".contacts") if contacts is None else Path(contacts)
    shown = _snapshot(path, frame)
    given = _sidecar(path.with_suffix(".params"))
    law = law or _law(given, path)
    absent = () if law.frictional else ("angle", "floor_slip", "slip")
    disk = _columns(path, shown, DISK, absent)
    disk = {name: column[np.argsort(disk["id"])] for name, column in disk.items()}
    pair = _columns(beside, _snapshot_of_step(beside, shown.step), CONTACT, absent)
    if "x_low" in disk:
        place, low = exact_sum(*(np.column_stack([disk[f"{axis}{part}"] for axis in "xy"]) for part in ("", "_low")))
        disk |= dict(zip(("x", "y", "x_low", "y_low"), (*place.T, *low.T), strict=True))
    periodic = shown.boundary[0].startswith("p")
    found = of_columns(
        str(path),
        disk | {"top": disk["type"] == TOP_TYPE},
        box_length=float(np.ptp(shown.bounds[0, :2])) if periodic else None,
        given=given,
    )
    i, j = (np.minimum(np.searchsorted(found.id, pair[each]), len(found) - 1) for each in ("first", "second"))
    if np.any(found.id[i] != pair["first"]) or np.any(found.id[j] != pair["second"]):
        raise PackingFileError(f"{beside} has a contact of a disk that {path} does not have.")
    apart = nearest_image(found.position[i] - found.position[j], found.box_length)
    touch = np.hypot(*apart.T) < found.radius[i] + found.radius[j]
    floor = found.radius > found.position[:, 1]
    first, second = np.append(found.id[i[touch]], found.id[floor]), np.append(found.id[j[touch]], 0 * found.id[floor])
    slip, low_slip = (
        np.append(pair[of_pair][touch], disk[of_floor][floor]) if of_pair in pair and of_floor in disk else None
        for of_pair, of_floor in (("slip", "floor_slip"), ("slip_low", "floor_slip_low"))
    )
    assert slip is not None
    return replace(found, slips=Slips(first, second, slip, low_slip, complete=True)), law


def dump_frames(path: str | PathLike[str]) -> Iterator[DumpFrame]:
    """The snapshots of a LAMMPS text dump, one after the other.

    Raises PackingFileError if the file is missing, or breaks off or is malformed before the snapshot asked for is
    complete.
    """
    try:
        with open_text(path) as file:
            while True:
                frame = _next_frame(file)
                if frame is None:
                    return
                yield frame
    except OSError as error:
        raise PackingFileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except (ValueError, IndexError, StopIteration, EOFError, zlib.error) as error:
        raise PackingFileError(f"{path} is not a complete LAMMPS text dump: {error or 'it breaks off'}.") from error


def _next_frame(file: TextIO) -> DumpFrame | None:
    step, count, bounds = -1, -1, np.zeros((3, 2))
    boundary: tuple[str, ...] = ()
    for line in file:
        item = line.split()
        if item[:1] != ["ITEM:"]:
            raise ValueError(f"expected ITEM:, found {line.strip()!r}")
        if item[1] == "TIMESTEP":
            step = int(next(file))
        elif item[1:3] == ["NUMBER", "OF"]:
            count = int(next(file))
        elif item[1:3] == ["BOX", "BOUNDS"]:
            boundary = tuple(item[-3:])
            bounds = np.array([[float(value) for value in next(file).split()] for _ in range(3)])
        elif item[1] in ("ATOMS", "ENTRIES"):
            columns = tuple(item[2:])
            lines = list(islice(file, count))
            rows = np.array([row.split() for row in lines], dtype=np.float64).reshape(len(lines), len(columns))
            if len(lines) < count:
                raise ValueError(f"{count} rows are announced and {len(lines)} are there")
            return DumpFrame(step, boundary, bounds, columns, rows)
        else:
            next(file)
    if step >= 0:
        raise ValueError("it breaks off")
    return None


def _snapshot(path: Path, frame: int) -> DumpFrame:
    frames = dump_frames(path)
    found = list(islice(frames, frame, frame + 1)) if frame >= 0 else list(deque(frames, -frame))
    if not found or (frame < 0 and len(found) < -frame):
        raise PackingFileError(f"{path} has no snapshot {frame}.")
    return found[0]


def _snapshot_of_step(path: Path, step: int) -> DumpFrame:
    for frame in dump_frames(path):
        if frame.step == step:
            return frame
    raise PackingFileError(f"{path} has no snapshot of step {step}.")


def _columns(
    path: Path, frame: DumpFrame, names: Mapping[str, tuple[str, ...]], absent: tuple[str, ...]
) -> dict[str, Floats]:
    """Columns by field; of the fields that may be absent, zeros."""
    columns = {}
    for field, candidates in names.items():
        present = [name for name in candidates if name in frame.columns]
        if present:
            columns[field] = frame.rows[:, frame.columns.index(present[0])]
        elif field in absent:
            columns[field] = np.zeros(len(frame.rows))
        elif field not in LOW_PARTS:
            raise PackingFileError(f"{path} has no column {' or '.join(candidates)}.")
    return columns


def _sidecar(path: Path) -> dict[str, float]:
    if not path.is_file():
        return {}
    try:
        lines = (line.split() for line in read_plain_text(path).splitlines() if line.strip())
        found = {key: float(value) for key, value in lines}
    except ValueError as error:
        raise PackingFileError(f"{path} must have one key and one number a line.") from error
    number = found.pop(FORMAT_KEY, None)
    check_format(None if number is None else f"{number:g}", path)
    return found


def read_custom_dump(path: Path, frame: int | None = None) -> Disks:
    """A snapshot of `dump custom`; the last one by default, if all are of the same disks."""
    shown = _custom_snapshot(path, frame)
    source = f"{path} (step {shown.step})"
    if shown.bounds.shape[1] > 2 and np.any(shown.bounds[:, 2]):
        raise PackingFileError(f"{source} has a tilted box: give one with right angles.")
    columns = dict(zip(shown.columns, shown.rows.T, strict=True))
    for axis, (low, high) in zip("xyz", shown.bounds[:, :2], strict=True):
        for scaled in (f"{axis}s", f"{axis}su"):
            if scaled in columns and axis not in columns and f"{axis}u" not in columns:
                columns[axis] = low + (high - low) * columns[scaled]
    if not len(shown.rows):
        raise PackingFileError(f"{source} has no disks.")
    periodic = shown.boundary[:1] == ("pp",)
    return of_columns(source, columns, box_length=float(np.ptp(shown.bounds[0, :2])) if periodic else None)


def _custom_snapshot(path: Path, frame: int | None) -> DumpFrame:
    """The snapshot that is meant; by default the last one, if all are of the same disks."""
    frames: list[DumpFrame] = []
    first: tuple[int, tuple[float, ...]] | None = None
    for shown in dump_frames(path):
        disks = _ids(shown)
        first = first or (shown.step, disks)
        if frame is None and disks != first[1]:
            raise PackingFileError(
                f"{path} has other disks at step {shown.step} ({len(shown.rows)}) than at step {first[0]} "
                f"({len(first[1])}): choose a snapshot with --frame; -1 is the last."
            )
        # of a long file the last one alone is kept, unless another is wanted
        frames = [shown] if frame is None else [*frames, shown]
    if not frames:
        raise PackingFileError(f"{path} is not a complete LAMMPS text dump: it is empty.")
    at = -1 if frame is None else frame
    if not -len(frames) <= at < len(frames):
        raise PackingFileError(f"{path} has {len(frames)} frames; there is no --frame {at}.")
    return frames[at]


def _ids(shown: DumpFrame) -> tuple[float, ...]:
    if "id" not in shown.columns:
        return tuple(range(len(shown.rows)))
    return tuple(sorted(shown.rows[:, shown.columns.index("id")].tolist()))
