"""Which module reads and writes which file, by its suffix; modules are imported when such a file is met."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from ...analysis import BadInputError, OutputError, Packing, PackingFileError
from ...analysis.files.wholefile import BEGINNINGS
from .disks import Disks
from .quantities import Frame, ModeVectors

NUMBER = re.compile(rb"[-+.\deE]+")


class Format(NamedTuple):
    """A format that is read.

    Attributes
    ----------
    words : str
        What it is.
    module, reader : str
        The module of this package, and the function in it.
    frames : bool
        Whether a file may hold several frames.
    """

    words: str
    module: str
    reader: str
    frames: bool


DATA = Format("LAMMPS data (atom style sphere)", "data", "read_data", False)
DUMP = Format("LAMMPS dump", "dump", "read_custom_dump", True)
YADE = Format("YADE's text", "grains", "read_yade", False)
MERCURY = Format("MercuryDPM's data", "grains", "read_mercury", True)
RESTART = Format("LAMMPS restart", "restart", "read_restart", False)
OTHER = Format("what MDAnalysis reads with radii", "universe", "read_universe", True)

FORMATS: dict[str, Format] = {
    ".disks": Format("dumps of the decks", "dump", "read_deck_dump", True),
    ".data": DATA,
    ".dump": DUMP,
    ".lammpstrj": DUMP,
    ".restart": RESTART,
    ".csv": Format("CSV", "table", "read_table", False),
    ".xyz": Format("extended XYZ", "xyz", "read_xyz", True),
    ".extxyz": Format("extended XYZ", "xyz", "read_xyz", True),
    ".json": Format("packing.json", "json_file", "read_json", False),
    ".gsd": Format("GSD", "gsd_file", "read_gsd", True),
}
"""By suffix. LAMMPS has no suffixes of its own: data.NAME, dump.NAME and restart.NAME are known as well."""

BY_BEGINNING: dict[str, Format] = {"line 1 is #format x_y_z_r": YADE, ".data, line 1 is N time bounds": MERCURY}
"""What the first line tells, whatever the name is; MercuryDPM's files have the suffix of LAMMPS's."""

WRITERS = {
    ".vtp": ("vtp", "write_vtp"),
    ".xyz": ("xyz", "write_xyz"),
    ".data": ("data", "write_data"),
    ".gsd": ("gsd_file", "write_gsd"),
}
"""Module of this package and function, by suffix."""

FRAMES = {
    ".xyz": ("xyz", "write_xyz_frames"),
    ".gsd": ("gsd_file", "write_gsd_frames"),
    ".pvd": ("vtp", "write_pvd"),
}
"""The same for files of several frames."""


def known_formats() -> str:
    """All formats that are read, in words."""
    words: dict[str, list[str]] = {}
    for suffix, each in {**FORMATS, **BY_BEGINNING}.items():
        words.setdefault(each.words, []).append(suffix)
    listed = [f"{what} ({', '.join(suffixes)})" for what, suffixes in words.items()]
    return ", ".join([*listed, "run.h5", f"and {OTHER.words} (pip install 'faultgouge[export]')"])


def is_hdf5(path: Path) -> bool:
    """Whether a file begins as HDF5 does, or as a run.h5."""
    with path.open("rb") as stream:
        return stream.read(64).startswith(BEGINNINGS)


def format_of(path: Path) -> Format:
    """The format of a file, by its suffix, or by its beginning as LAMMPS's users name files.

    Raises
    ------
    PackingFileError
        If no reader takes it.
    """
    from .restart import is_restart

    begun = _by_beginning(path)
    if begun is not None:
        return begun
    if path.suffix.lower() in FORMATS:
        return FORMATS[path.suffix.lower()]
    begin = path.name.split(".")[0].lower()
    if is_restart(path):
        return RESTART
    if begin in ("data", "dump"):
        return DATA if begin == "data" else DUMP
    if is_hdf5(path):
        raise PackingFileError(f"{path} is HDF5 and needs no import: packing.file, draw and spectrum take a run.h5.")
    from .universe import known

    own = path.suffix.lower() == ".h5"  # MDAnalysis has a parser of it once `mdanalysis` is imported
    if path.suffix and not own and known(path):
        return OTHER
    raise PackingFileError(f"{path} is of no format that is read: give {known_formats()}.")


def _by_beginning(path: Path) -> Format | None:
    """YADE and MercuryDPM, which the first line tells."""
    try:
        with path.open("rb") as stream:
            words = stream.readline(400).split()
    except OSError:
        return None
    if words[:1] == [b"#format"]:
        return YADE
    numbers = len(words) in (6, 8) and all(NUMBER.fullmatch(word) for word in words)
    return MERCURY if numbers and ".data" in path.name.lower() else None


def read_disks(path: Path, frame: int | None = None) -> Disks:
    """Disks of a file of another code.

    Parameters
    ----------
    path : Path
        The file; see `known_formats`.
    frame : int, optional
        Which of several frames; negative ones count from the last.

    Raises
    ------
    PackingFileError
        If the file is missing, is of no known format, or does not hold disks in a plane.
    """
    if not path.is_file():
        raise PackingFileError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    found = format_of(path)
    if not found.frames and frame not in (None, 0, -1):
        raise PackingFileError(f"{path} has one frame; there is no --frame {frame}.")
    disks: Disks = _imported(found.module, found.reader)(path, *([frame] if found.frames else []))
    return disks


def _imported(module: str, function: str) -> Any:
    return getattr(import_module(f".{module}", __package__), function)


def check_frames_writer(path: Path) -> None:
    """Refuse a name that no writer of several frames takes."""
    if path.suffix not in FRAMES:
        raise BadInputError(f"-o {path}: several frames go into {', '.join(FRAMES)}; give it one of these suffixes.")


def write_frames(path: Path, frames: Iterable[Frame]) -> None:
    """Write the frames of a ramp or of an undamped run for another code.

    Parameters
    ----------
    path : Path
        The file; its suffix is the format.
    frames : iterable of Frame
        See :func:`~faultgouge.pywrap.exchange.frames.frames_of`.

    Raises
    ------
    BadInputError
        If the suffix is none of `FRAMES`.
    OutputError
        If the file cannot be written.
    """
    check_frames_writer(path)
    _write(FRAMES, path, frames)


def check_writer(path: Path, modes: bool = False) -> None:
    """Refuse a name that no writer takes, or modes in a format that has no room for them."""
    if path.suffix == ".pvd":
        raise BadInputError(f"-o {path}: a .pvd is a list of frames; add --frames all, or export a .vtp.")
    if path.suffix not in WRITERS:
        raise BadInputError(f"-o {path}: exports are {', '.join(WRITERS)}; give it one of these suffixes.")
    if modes and path.suffix == ".data":
        raise BadInputError(f"-o {path}: LAMMPS data has no room for modes; leave --mode out, or export .vtp or .xyz.")


def write_packing(path: Path, packing: Packing, modes: Sequence[ModeVectors] = ()) -> str:
    """Write a packing for another code.

    Parameters
    ----------
    path : Path
        The file; its suffix is the format.
    packing : Packing
        The packing.
    modes : sequence of ModeVectors
        To go with it.

    Returns
    -------
    str
        What the file has, and what its format cannot hold.

    Raises
    ------
    BadInputError
        If the suffix is none of `WRITERS`, or the format has no modes.
    OutputError
        If the file cannot be written.
    """
    check_writer(path, bool(modes))
    return str(_write(WRITERS, path, packing, list(modes)))


def _write(writers: Mapping[str, tuple[str, str]], path: Path, *content: object) -> object:
    try:
        return _imported(*writers[path.suffix])(path, *content)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}.") from error
