"""What a LAMMPS instance says of itself: its ranks, its styles, its log, and why it has stopped."""

import ctypes
import os
import re
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from mpi4py import MPI


def communicator(lmp: Any) -> MPI.Comm:
    """The ranks of an instance."""
    if lmp.extract_setting("world_size") == 1:
        return MPI.COMM_SELF
    return getattr(lmp, "comm", None) or MPI.COMM_WORLD


class Styles(NamedTuple):
    """Pair style, styles and groups of the fixes by ID, and atom style of an instance."""

    pair: str
    fixes: dict[str, str]
    groups: dict[str, str]
    atom: str


def styles_of(lmp: Any) -> Styles:
    """The styles of an instance, as LAMMPS's `info` says them."""
    world = communicator(lmp)
    with TemporaryDirectory(prefix="faultgouge") as folder:
        path = world.bcast(f"{folder}/info", root=0)
        lmp.command(f'info fixes system out overwrite "{path}"')
        said = world.bcast(Path(path).read_text() if world.rank == 0 else None, root=0)
        world.barrier()
    fixes = re.findall(r"^ *Fix\[ *\d+\]: *(\w+), *style = ([^,\s]+), *group = (\S+)", said, re.MULTILINE)
    values = dict(re.findall(r"^ *(Atoms|Atom style) *= *(.*?) *$", said, re.MULTILINE))
    # Atoms = N, types = T, style = that of the pairs
    styles, groups = ({name: each[k] for name, *each in fixes} for k in (0, 1))
    return Styles(values["Atoms"].rpartition("style = ")[2], styles, groups, values["Atom style"])


def explain_error(error: BaseException) -> str:
    """A sentence of an error that LAMMPS has raised."""
    lines = [line.strip().removeprefix("ERROR: ") for line in str(error).splitlines() if line.strip()]
    reason = re.sub(r" \(\S+:\d+\)", "", "; ".join(lines) or type(error).__name__)
    return f"LAMMPS stopped: {reason.rstrip('.')}."


def log_path(lmp: Any) -> Path | None:
    """An instance's log, which is closed by the question; None without a log."""
    before = _open_files()  # a log of the command `log` does not begin as others do
    lmp.command("log none")
    closed = [path for descriptor, path in before.items() if descriptor not in _open_files()]
    return Path(closed[0]) if len(closed) == 1 else None


def log_of(lmp: Any) -> list[str] | None:
    """The lines of an instance's log, which is closed by the question; None without a log."""
    path = log_path(lmp)
    return None if path is None else path.read_text(errors="replace").splitlines()


def only_log() -> list[str] | None:
    """The lines of the only open log of this process; None if there is none, or there are several."""
    found = set(_open_logs().values())
    return Path(found.pop()).read_text(errors="replace").splitlines() if len(found) == 1 else None


def _open_logs() -> dict[str, str]:
    """Open files that begin as a log of LAMMPS does, by their descriptors."""
    return {name: path for name, path in _open_files().items() if _begins_as_log(path)}


def _begins_as_log(path: str) -> bool:
    try:
        with open(path, "rb") as stream:
            return stream.read(8) == b"LAMMPS ("
    except OSError:
        return False


def _open_files() -> dict[str, str]:
    """Open files by their descriptors."""
    ctypes.CDLL(None).fflush(None)
    found, listed = {}, Path("/proc/self/fd")
    for each in listed.iterdir() if listed.is_dir() else ():
        with suppress(OSError):
            path = os.readlink(each)
            if path.startswith("/") and os.path.isfile(path):
                found[each.name] = path
    return found
