"""Packings from and to other codes: LAMMPS, MercuryDPM, YADE, GSD, extended XYZ, CSV, VTK.

`READERS` has a line for each format that is read, and `WRITERS` one for each that is written: the function of the
module that does it, imported when a file of the format is used. A reader returns `Disks`; `packing_of` makes a packing
of them, and `upper_layer` finds the layer that carries the load. `settling.relax` brings a packing out of balance to
rest. A writer takes `Exported`, the columns of a Packing or of a Configuration.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from ...arrays import Floats
from ...configuration import Configuration
from ...counted import counted
from ...errors import BadInputError, PackingFileError
from ...packing.packing import Packing
from ..atomic_write import HDF5, SEAL, begins_with, open_text, telling
from .disks import Disks, Slips, in_plane, packing_of, upper_layer
from .exported import Exported, ModeVectors, choose_frames, exported, frames_of

__all__ = [
    "Disks", "ModeVectors", "Slips", "choose_frames", "format_of",
    "frames_of", "is_hdf5", "packing_of", "read_disks", "upper_layer", "write_frames", "write_packing",
]  # fmt: skip

Columns: TypeAlias = Mapping[str, Floats]

RESTART_BEGINNING = b"LammpS RestartT"
"""How restarts of LAMMPS begin."""


class Format(NamedTuple):
    """A format that is read: what it is, module and function of its reader, and whether a file may have several frames.

    Restarts are read by LAMMPS itself, in pywrap.
    """

    words: str
    reader: str
    frames: bool = False


DATA = Format("LAMMPS data (atom style sphere)", "lammps_data.read_data")
DUMP = Format("LAMMPS dump", "lammps_dump.read_custom_dump", frames=True)
RESTART = Format("LAMMPS restart", "")
XYZ = Format("extended XYZ", "xyz.read_xyz", frames=True)
TABLE = Format("table", "tables.read_table")
YADE = Format("YADE's text", "tables.read_yade")
MERCURY = Format("MercuryDPM's data", "tables.read_mercury", frames=True)
READERS = {
    ".disks": Format("dumps of the decks", "lammps_dump.read_deck_dump", frames=True),
    ".xyz": XYZ, ".extxyz": XYZ, ".data": DATA, ".dump": DUMP, ".lammpstrj": DUMP, ".restart": RESTART,
    ".csv": TABLE, ".txt": TABLE, ".json": Format("packing.json", "tables.read_json"),
    ".gsd": Format("GSD", "gsd_file.read_gsd", frames=True),
}  # fmt: skip
"""Formats by suffix. LAMMPS has none of its own: data.NAME, dump.NAME and restart.NAME are known as well. YADE and
MercuryDPM are told by the first line, whatever the name is; MercuryDPM's files have the suffix of LAMMPS's."""

WRITERS = {
    ".vtp": "vtp.write_vtp", ".xyz": "xyz.write_xyz", ".gsd": "gsd_file.write_gsd", ".data": "lammps_data.write_data",
    ".csv": "tables.write_contacts", ".pvd": "vtp.write_pvd",
}  # fmt: skip
"""Module and function by suffix; of one packing all but the last, and `FILMS` of several frames."""
FILMS = ".xyz", ".gsd", ".pvd"


def is_hdf5(path: Path) -> bool:
    """Whether a file begins like HDF5 or like a run.h5; OSError if it cannot be read."""
    return begins_with(path, HDF5, SEAL)


def format_of(path: Path) -> Format:
    """The format of a file, by its first line, its suffix, or its prefix for LAMMPS files.

    Raises PackingFileError if no reader knows it, OSError if the file cannot be read.
    """
    words, name = list[str](), path.name.lower().removesuffix(".gz")
    with suppress(OSError, UnicodeDecodeError, EOFError, zlib.error), open_text(path) as stream:
        words = stream.readline(400).split()
    if words[:1] == ["#format"]:
        return YADE
    if len(words) in (6, 8) and ".data" in name and all(re.fullmatch(r"[-+.\deE]+", word) for word in words):
        return MERCURY
    found = READERS.get(Path(name).suffix) or {"data": DATA, "dump": DUMP}.get(name.split(".")[0])
    if found is None and begins_with(path, RESTART_BEGINNING):
        return RESTART
    if found is None:
        names = f"{', '.join(READERS)}, data.NAME, dump.NAME, YADE's text, MercuryDPM's data"
        needs = "LAMMPS decks (.in, in.NAME); a run.h5 needs no import: packing.file, draw and spectrum take it"
        raise PackingFileError(f"{path} is of no format that is read: give {names}, {needs}.")
    return found


def read_particles(path: Path, frame: int | None = None) -> Disks:
    """Read the particles in a file of another code, disks or spheres, of the frame of a number, by default the last.

    Raises PackingFileError if the file is missing, has no known format, is a restart, or has no particles.
    """
    if not path.is_file():
        raise PackingFileError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    found = format_of(path)
    if not found.frames and frame not in (None, 0, -1):
        raise PackingFileError(f"{path} has one frame; there is no --frame {frame}.")
    if found is RESTART:
        raise PackingFileError(f"{path} is a restart: LAMMPS itself reads it, in faultgouge import.")
    with telling(path, f"is not read as {found.words}"):
        read: Disks = _function(found.reader)(path, *([-1 if frame is None else frame] if found.frames else []))
    return read


def read_disks(path: Path, frame: int | None = None) -> Disks:
    """Read the disks in a file of another code; as `read_particles`, and they must lie in a plane."""
    return in_plane(read_particles(path, frame))


def _function(name: str) -> Any:
    module, function = name.split(".")
    return getattr(import_module(f".{module}", __package__), function)


def check_writer(path: Path, modes: bool = False, frames: bool = False) -> None:
    """Refuse a name that no writer takes, of several frames or of one packing with or without modes."""
    one = tuple(WRITERS)[:-1]
    if path.suffix not in (FILMS if frames else one):
        ways = f"exports are {', '.join(one)}, and with --frames {', '.join(FILMS)}"
        raise BadInputError(f"-o {path}: {ways}; give it one of these suffixes.")
    if modes and path.suffix in (".data", ".csv"):
        raise BadInputError(f"-o {path}: it has no room for modes; leave --mode out, or export .vtp or .xyz.")


def write_packing(
    path: Path, packing: Packing | Configuration, modes: Sequence[ModeVectors] = (), values: Columns | None = None
) -> str:
    """Write a packing for another code, with modes, and with further columns of the particles (.vtp, .xyz, .gsd).

    The suffix is the format. Returned are, in words, the contents, and what the format cannot store. Raises
    BadInputError if the suffix is none of an export, or the format has no modes; OutputError if the file cannot be
    written.
    """
    check_writer(path, bool(modes))
    found = exported(packing, modes)
    found.particles.update(values or {})
    says: str = _function(WRITERS[path.suffix])(path, [(0.0, found)])
    noun = "disk" if packing.dimension == 2 else "sphere"
    what = {noun: len(packing), "contact": len(found.ends), "mode": len(modes)}
    text = ", ".join(counted(count, noun) for noun, count in what.items())
    return f"{text}; {says}" if says else text


def write_frames(path: Path, frames: Iterable[tuple[float, Exported]]) -> None:
    """Write the frames of a ramp or of an undamped run (`frames_of`) for another code; the suffix is the format.

    Raises BadInputError if it is not in `FILMS`, OutputError if the file cannot be written.
    """
    check_writer(path, frames=True)
    _function(WRITERS[path.suffix])(path, frames)
