"""Which writer makes which file, by its suffix."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path

from ...analysis import BadInputError, OutputError, Packing
from .quantities import Frame, ModeVectors

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
    module, name = FRAMES[path.suffix]
    writer = getattr(import_module(f".{module}", __package__), name)
    try:
        writer(path, frames)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}.") from error


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
    module, name = WRITERS[path.suffix]
    writer = getattr(import_module(f".{module}", __package__), name)
    try:
        return str(writer(path, packing, list(modes)))
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}.") from error
