"""The formats of other codes: for each the module that reads and writes it, and the quantities that it cannot store.

A module is imported only when a file of its format is used.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from ...errors import BadInputError, PackingFileError
from ...packing.packing import Packing
from ..atomic_write import BEGINNINGS
from ..plain_file import open_plain, open_text
from .disks import Disks
from .export_quantities import Frame, ModeVectors

RESTART_BEGINNING = b"LammpS RestartT"
"""How restarts of LAMMPS begin."""

WORD_OF_NUMBER = re.compile(r"[-+.\deE]+")


class Format(NamedTuple):
    """A format.

    Attributes
    ----------
    words : str
        What it is.
    module : str
        The module of this package.
    suffixes : tuple of str
        Of files that are read; a file that is written has the first. Of a format that the first line tells, what that
        line is.
    reader, writer : str
        Functions in the module; empty for what is not done. Restarts are read by LAMMPS itself, in pywrap.
    frames : bool
        Whether a file that is read may hold several frames.
    text : bool
        Whether a file that is read may be compressed by gzip, and its name end in .gz.
    alone, film : bool
        Whether one packing is written, and whether several frames are.
    modes : bool
        Whether a file has room for modes.
    """

    words: str
    module: str
    suffixes: tuple[str, ...]
    reader: str = ""
    writer: str = ""
    frames: bool = False
    text: bool = True
    alone: bool = True
    film: bool = False
    modes: bool = True


DATA = Format("LAMMPS data (atom style sphere)", "lammps_data", (".data",), "read_data", "write_data", modes=False)
DUMP = Format("LAMMPS dump", "lammps_dump", (".dump", ".lammpstrj"), "read_custom_dump", frames=True)
RESTART = Format("LAMMPS restart", "", (".restart",), "LAMMPS itself", text=False)
YADE = Format("YADE's text", "yade_mercury", ("line 1 is #format x_y_z_r",), "read_yade")
MERCURY = Format("MercuryDPM's data", "yade_mercury", (".data, line 1 is N time bounds",), "read_mercury", frames=True)
MDANALYSIS = Format("what MDAnalysis reads with radii", "mdanalysis_import", (), "read_universe", frames=True)

FORMATS = (
    Format("VTK", "vtp", (".vtp",), writer="write_vtp"),
    Format("dumps of the decks", "lammps_dump", (".disks",), "read_deck_dump", frames=True, text=False),
    Format("extended XYZ", "xyz", (".xyz", ".extxyz"), "read_xyz", "write_xyz", frames=True, film=True),
    DATA,
    DUMP,
    RESTART,
    Format("tables", "csv_json", (".csv", ".txt"), "read_table"),
    Format("packing.json", "csv_json", (".json",), "read_json"),
    Format("GSD", "gsd_file", (".gsd",), "read_gsd", "write_gsd", frames=True, text=False, film=True),
    Format("ParaView's list of frames", "vtp", (".pvd",), writer="write_pvd", alone=False, film=True),
    YADE,
    MERCURY,
)
"""LAMMPS has no suffixes of its own: data.NAME, dump.NAME and restart.NAME are known as well. YADE and MercuryDPM are
told by the first line, whatever the name is; MercuryDPM's files have the suffix of LAMMPS's."""

READERS = {suffix: each for each in FORMATS if each.reader for suffix in each.suffixes}
WRITERS = {each.suffixes[0]: each for each in FORMATS if each.writer and each.alone}
FILMS = {each.suffixes[0]: each for each in FORMATS if each.film}
"""Formats by suffix, for reading, for writing, and for writing several frames."""


def list_formats() -> str:
    """All formats that are read, in words."""
    listed = [f"{each.words} ({', '.join(each.suffixes)})" for each in FORMATS if each.reader]
    return ", ".join(
        [*listed, "each text also as .gz", "run.h5", "LAMMPS decks (.in, in.NAME)", f"and {MDANALYSIS.words}"]
    )


def is_restart(path: Path) -> bool:
    """Whether a file begins as LAMMPS restarts do."""
    try:
        with open_plain(path) as stream:
            return stream.read(len(RESTART_BEGINNING)) == RESTART_BEGINNING
    except OSError:
        return False


def is_hdf5(path: Path) -> bool:
    """Whether a file begins like HDF5 or like a run.h5."""
    with open_plain(path) as stream:
        return stream.read(64).startswith(BEGINNINGS)


def format_of(path: Path) -> Format:
    """Find the format of a file by its suffix, or by its prefix for LAMMPS files.

    Raises
    ------
    PackingFileError
        If no reader knows the format.
    """
    begun = _by_beginning(path)
    if begun is not None:
        return begun
    suffix = Path(path.stem).suffix if path.suffix.lower() == ".gz" else path.suffix
    found = READERS.get(suffix.lower())
    if found is not None and (suffix == path.suffix or found.text):
        return found
    begin = path.name.split(".")[0].lower()
    if is_restart(path):
        return RESTART
    if begin in ("data", "dump"):
        return DATA if begin == "data" else DUMP
    if is_hdf5(path):
        raise PackingFileError(f"{path} is HDF5 and needs no import: packing.file, draw and spectrum take a run.h5.")
    from .mdanalysis_import import has_parser

    own = path.suffix.lower() == ".h5"  # MDAnalysis has a parser of it once `mdanalysis` is imported
    if path.suffix and not own and has_parser(path):
        return MDANALYSIS
    raise PackingFileError(f"{path} is of no format that is read: give {list_formats()}.")


def _by_beginning(path: Path) -> Format | None:
    """YADE and MercuryDPM, which the first line tells."""
    try:
        with open_text(path) as stream:
            words = stream.readline(400).split()
    except (OSError, UnicodeDecodeError, EOFError, zlib.error):
        return None
    if words[:1] == ["#format"]:
        return YADE
    numbers = len(words) in (6, 8) and all(WORD_OF_NUMBER.fullmatch(word) for word in words)
    return MERCURY if numbers and ".data" in path.name.lower() else None


def read_disks(path: Path, frame: int | None = None) -> Disks:
    """Read the disks in a file of another code.

    Parameters
    ----------
    path : Path
        The file; see `list_formats`.
    frame : int, optional
        Number of the frame; negative numbers count from the last.

    Raises
    ------
    PackingFileError
        If the file is missing, has no known format, is a restart, or does not contain disks in a plane.
    """
    if not path.is_file():
        raise PackingFileError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    found = format_of(path)
    if not found.frames and frame not in (None, 0, -1):
        raise PackingFileError(f"{path} has one frame; there is no --frame {frame}.")
    if found is RESTART:
        raise PackingFileError(f"{path} is a restart: LAMMPS itself reads it, in faultgouge import.")
    disks: Disks = _import_module(found, found.reader)(path, *([frame] if found.frames else []))
    return disks


def _import_module(format_: Format, function: str) -> Any:
    return getattr(import_module(f".{format_.module}", __package__), function)


def check_frames_writer(path: Path) -> None:
    """Refuse a name that no writer of several frames takes."""
    if path.suffix not in FILMS:
        raise BadInputError(f"-o {path}: several frames go into {', '.join(FILMS)}; give it one of these suffixes.")


def write_frames(path: Path, frames: Iterable[Frame]) -> None:
    """Write the frames of a ramp or of an undamped run for another code.

    Parameters
    ----------
    path : Path
        The file; its suffix is the format.
    frames : iterable of Frame
        See :func:`~faultgouge.analysis.files.formats.frames.frames_of`.

    Raises
    ------
    BadInputError
        If the suffix is not in `FILMS`.
    OutputError
        If the file cannot be written.
    """
    check_frames_writer(path)
    _write(FILMS[path.suffix], path, frames, [])


def check_writer(path: Path, modes: bool = False) -> None:
    """Refuse a name that no writer takes, or modes in a format that has no room for them."""
    if path.suffix == ".pvd":
        raise BadInputError(f"-o {path}: a .pvd is a list of frames; add --frames all, or export a .vtp.")
    if path.suffix not in WRITERS:
        raise BadInputError(f"-o {path}: exports are {', '.join(WRITERS)}; give it one of these suffixes.")
    if modes and not WRITERS[path.suffix].modes:
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
        Modes to write with the packing.

    Returns
    -------
    str
        Description of the contents, and of what the format cannot store.

    Raises
    ------
    BadInputError
        If the suffix is not in `WRITERS`, or the format has no modes.
    OutputError
        If the file cannot be written.
    """
    check_writer(path, bool(modes))
    return _write(WRITERS[path.suffix], path, [Frame(packing)], list(modes))


def _write(format_: Format, path: Path, frames: Iterable[Frame], modes: list[ModeVectors]) -> str:
    return str(_import_module(format_, format_.writer)(path, frames, modes))
