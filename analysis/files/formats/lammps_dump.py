r"""LAMMPS text dumps: those of the decks (NAME.disks, a packing), and those of any other run (dump custom).

Two files make one packing. The disks' dump (``dump custom``) has one row per disk; its box line says whether x is
periodic. The contacts' dump (``dump local``) has one row per pair, with the slip. Columns are found by name
(`ALIASES`), in any order; additional columns are ignored. With ``%.17g`` all numbers are read back bitwise.

Disks of type 2 form the upper layer. The slip on the floor is in the dump of disks, because a floor contact belongs to
one disk. LAMMPS also lists pairs that do not overlap, up to its cutoff; these are not contacts. Without friction there
are neither slips nor angles, and their columns may be missing. Low parts are there in compensated arithmetic alone.

Law, load and inertia are in a file of the same name with the suffix ".params", which has one ``key value`` a line, of
kn, kt, mu, exponent, rescaled, coulomb, cn, ct, tau, fx, fy, inertia_factor. A law from the caller takes precedence.

Of a dump custom, columns are x or xu, radius or diameter, and, if present, id, type, mass, theta.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from ...arrays import Floats
from ...errors import PackingFileError
from ...packing.compensated import exact_sum
from ...packing.geometry import nearest_image
from ...packing.law import MindlinLaw
from ...packing.packing import Packing
from ..atomic_write import FORMAT_KEY, check_format, open_text, read_plain_text, telling
from ..runfile import law_of_parameters
from .disks import Disks, Slips, choose_frame, in_plane, packing_of, particles_of, places_of, standard_names

TOP_TYPE = 2
"""LAMMPS atom type of the disks of the upper layer."""


class DumpFrame(NamedTuple):
    """One snapshot of a LAMMPS text dump.

    It has its time step, boundary flags of the box such as ("pp", "ff", "pp"), lower and upper bounds of the box with
    the tilts xy, xz, yz, length, names of the columns, and the numbers, shape (R, columns).
    """

    step: int
    boundary: tuple[str, ...]
    bounds: Floats
    columns: tuple[str, ...]
    rows: Floats

    @property
    def by_name(self) -> dict[str, Floats]:
        """The columns by name."""
        return dict(zip(self.columns, self.rows.T, strict=True))


def dump_frames(path: str | PathLike[str]) -> Iterator[DumpFrame]:
    """The snapshots of a LAMMPS text dump, one after the other; a PackingFileError if the file is missing, breaks off,
    or is malformed before the snapshot asked for is complete."""
    unread, broken = telling(path, "cannot be read", OSError), telling(path, "is not a complete LAMMPS text dump")
    with unread, open_text(path) as file, broken:
        while (frame := _next_frame(file)) is not None:
            yield frame


def _next_frame(file: TextIO) -> DumpFrame | None:
    """The next snapshot: lines after an ITEM, one or, of the box, three; the rows come last."""
    about: dict[str, list[str]] = {"BOX": ["", "0 0", "0 0", "0 0"]}
    for line in file:
        item = line.split()
        if item[:1] != ["ITEM:"]:
            raise ValueError(f"expected ITEM:, found {line.strip()!r}")
        if item[1] not in ("ATOMS", "ENTRIES"):
            about[item[1]] = [line, *(next(file) for _ in range(3 if item[1] == "BOX" else 1))]
            continue
        count, names = int(about["NUMBER"][1]), tuple(item[2:])
        lines = list(islice(file, count))
        rows = np.array([row.split() for row in lines], dtype=np.float64).reshape(len(lines), len(names))
        if len(lines) < count:
            raise ValueError(f"{count} rows are announced and {len(lines)} are there")
        bounds = np.array([each.split() for each in about["BOX"][1:]], dtype=np.float64)
        return DumpFrame(int(about["TIMESTEP"][1]), tuple(about["BOX"][0].split()[-3:]), bounds, names, rows)
    if "TIMESTEP" in about:
        raise ValueError("it breaks off")
    return None


def snapshot(path: Path, frame: int) -> DumpFrame:
    """A snapshot by its number."""
    count, kept = 0, deque[DumpFrame](maxlen=max(-frame, 1))  # of a long file no more than is needed
    for count, shown in enumerate(dump_frames(path), 1):
        kept.append(shown)
        if count - 1 == frame:
            break
    choose_frame(path, count, frame)
    return kept[0]


def _disks(path: Path, shown: DumpFrame, columns: dict[str, Floats]) -> Disks:
    """Columns in the box of a snapshot, whose bounds are those of a box around the tilted one."""
    low, high = shown.bounds[:, :2].T.copy()
    xy, xz, yz = shown.bounds[:, 2] if shown.bounds.shape[1] > 2 else np.zeros(3)
    low -= [min(0.0, xy, xz, xy + xz), min(0.0, yz), 0.0]
    high -= [max(0.0, xy, xz, xy + xz), max(0.0, yz), 0.0]
    box = np.array([[high[0] - low[0], 0, 0], [xy, high[1] - low[1], 0], [xz, yz, high[2] - low[2]]])
    sides = [each.startswith("p") for each in shown.boundary] if len(shown.boundary) == 3 else None
    return particles_of(f"{path} (step {shown.step})", columns, box, origin=low, periodic=sides)


def read_custom_dump(path: Path, frame: int) -> Disks:
    """A snapshot of `dump custom`."""
    shown = snapshot(path, frame)
    return _disks(path, shown, shown.by_name)


def read_dump(disks: str | PathLike[str], *, frame: int = -1, law: MindlinLaw | None = None) -> Packing:
    """Read a packing from the dumps of an input deck.

    Parameters
    ----------
    disks : path
        The dump of disks; that of contacts has its name and the suffix ".contacts".
    frame : int
        Number of the snapshot; negative numbers count from the end. Contacts are read from the snapshot of the same
        time step.
    law : MindlinLaw, optional
        By default that of the file ``.params``, as load, drag and inertia are; without this file there is no load, and
        the inertia factor is 1.

    Raises
    ------
    PackingFileError
        If a file is missing or broken, a column is missing, the snapshots do not match, or no law is given.
    """
    found = in_plane(read_deck_dump(Path(disks), frame, law))
    assert found.top is not None
    names = {"fx": "fx", "fy": "fy", "inertia_factor": "inertia_factor", "tau": "drag_time"}
    load = {name: found.given[key] for key, name in names.items() if key in found.given}
    return packing_of(found, law or law_of_parameters(found.given), found.top, **load)


def read_deck_dump(path: Path, frame: int, law: MindlinLaw | None = None) -> Disks:
    """Read a dump of write.in, with the slips of all contacts in its .contacts, and the numbers in its .params."""
    beside, sidecar = path.with_suffix(".contacts"), path.with_suffix(".params")
    shown, given = snapshot(path, frame), _numbers_in(sidecar)
    try:
        law = law or law_of_parameters(given)
    except KeyError as error:
        raise PackingFileError(f"The law of {path} is not given: {sidecar} does not name {error}.") from None
    pairs = next((each for each in dump_frames(beside) if each.step == shown.step), None)
    if pairs is None:
        raise PackingFileError(f"{beside} has no snapshot of step {shown.step}.")
    slips = ("angle", "floor_slip", "slip") if law.frictional else ()
    disk = standard_names(path, shown.by_name, "id", "type", "x", "y", "radius", "mass", *slips[:2])
    pair = standard_names(beside, pairs.by_name, "id1", "id2", *slips[2:])
    disk.setdefault("floor_slip", 0 * disk["id"])
    pair.setdefault("slip", 0 * pair["id1"])
    disk = {name: column[np.argsort(disk["id"])] for name, column in disk.items()}
    if "x_low" in disk:
        place, low = exact_sum(*(np.column_stack([disk[f"{axis}{part}"] for axis in "xy"]) for part in ("", "_low")))
        disk |= dict(zip(("x", "y", "x_low", "y_low"), (*place.T, *low.T), strict=True))
    found = _disks(path, shown, disk | {"top": disk["type"] == TOP_TYPE})
    ids, radius, position = found.id, found.radius, found.position[:, :2]
    i, j = places_of(np.array([pair["id1"], pair["id2"]]), ids, beside)
    # LAMMPS lists pairs up to its cutoff
    touch = np.hypot(*nearest_image(position[i] - position[j], found.box_length).T) < radius[i] + radius[j]
    floor = radius > position[:, 1]
    first, second = np.append(ids[i[touch]], ids[floor]), np.append(ids[j[touch]], 0 * ids[floor])
    parts = {part: name for part, name in (("slip", "slip"), ("low", "slip_low")) if name in pair}
    slip = {part: np.append(pair[name][touch], disk[f"floor_{name}"][floor]) for part, name in parts.items()}
    return replace(found, given=given, slips=Slips(first, second, **slip, complete=True))


def _numbers_in(path: Path) -> dict[str, float]:
    """The numbers of a sidecar file; none where there is no such file."""
    if not path.is_file():
        return {}
    with telling(path, "must have one key and one number a line", ValueError):
        found = {key: float(value) for key, value in map(str.split, read_plain_text(path).strip().splitlines())}
    check_format(found.pop(FORMAT_KEY, None), path)
    return found
