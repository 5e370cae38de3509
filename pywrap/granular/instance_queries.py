"""Ranks, styles and log of a LAMMPS instance, and the reason why it has stopped."""

import ctypes
import os
import re
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, NamedTuple

from mpi4py import MPI

from .granular_commands import NotTakenError


def require_instance(lmp: Any, caller: str) -> None:
    """Refuse what is no LAMMPS instance, and a closed instance."""
    if not hasattr(lmp, "extract_setting"):
        raise NotTakenError(f"{caller} takes an instance of lammps.lammps, and no {type(lmp).__name__}.")
    if getattr(lmp, "lmp", None) is None:
        raise NotTakenError(f"{caller} takes an open instance, and this one is closed: call {caller} before close().")


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
    info = said(lmp, "fixes system")
    fixes = re.findall(r"^ *Fix\[ *\d+\]: *(\w+), *style = ([^,\s]+), *group = (\S+)", info, re.MULTILINE)
    values = dict(re.findall(r"^ *(Atoms|Atom style) *= *(.*?) *$", info, re.MULTILINE))
    # Atoms = N, types = T, style = the pair style
    styles, groups = ({name: each[k] for name, *each in fixes} for k in (0, 1))
    return Styles(values["Atoms"].rpartition("style = ")[2], styles, groups, values["Atom style"])


def said(lmp: Any, topics: str) -> str:
    """What LAMMPS's command `info` says, on all ranks."""
    with TemporaryFile("w+") as answer:  # of rank 0, which alone writes and reads
        lmp.command(f'info {topics} out overwrite "{name_of(answer)}"')
        return communicator(lmp).bcast(answer.read(), root=0)


def of_lammps(error: BaseException) -> bool:
    """Whether LAMMPS has raised an error: its bindings raise the plain `Exception`, or one of theirs."""
    return type(error) is Exception or type(error).__module__.split(".")[0] == "lammps"


def explain_error(error: BaseException) -> str:
    """A sentence of an error that LAMMPS has raised."""
    lines = [re.sub(r"^ERROR( on proc \d+)?: ", "", line.strip()) for line in str(error).splitlines() if line.strip()]
    reason = re.sub(r" \(\S+:\d+\)", "", "; ".join(lines) or type(error).__name__)
    return f"LAMMPS stopped: {reason.rstrip('.')}."


def name_of(file: IO[Any]) -> str:
    """A name by which LAMMPS opens a nameless file of this process, which no end of the process can leave behind."""
    return f"/dev/fd/{file.fileno()}"


class OpenFile(NamedTuple):
    """A file that this process has open for writing, and the place in it that is written next."""

    path: str
    place: int


def open_files() -> dict[int, OpenFile]:
    """Files that are open for writing, by their descriptors, where the system has a folder /proc."""
    ctypes.CDLL(None).fflush(None)
    found, listed = {}, Path("/proc/self/fd")
    for each in listed.iterdir() if listed.is_dir() else ():
        with suppress(OSError):
            path = os.readlink(each)
            if path.startswith("/") and os.path.isfile(path):
                _, place, _, flags, *_ = Path(f"/proc/self/fdinfo/{each.name}").read_text().split()
                if int(flags, 8) & os.O_ACCMODE != os.O_RDONLY:
                    found[int(each.name)] = OpenFile(path, int(place))
    return found


def log_file(lmp: Any, files: dict[int, OpenFile]) -> OpenFile | None:
    """An instance's log among files that were open, which is closed by the question; None without a log.

    A copy of the process asks with the open files of the process itself.
    """
    lmp.command("log none")  # a log of the command `log` does not begin as others do
    closed = [file for descriptor, file in files.items() if not _is_open(descriptor)]
    return closed[0] if len(closed) == 1 else None


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


def log_of(lmp: Any, files: dict[int, OpenFile]) -> list[str] | None:
    """The lines of an instance's log, as of :func:`log_file`."""
    file = log_file(lmp, files)
    return None if file is None else _lines_of(file)


def only_log() -> list[str] | None:
    """The lines of the only open log of this process; None if there is none, or there are several."""
    found = [file for file in open_files().values() if _begins_as_log(file.path)]
    return _lines_of(found[0]) if len({file.path for file in found}) == 1 else None


def _lines_of(log: OpenFile) -> list[str]:
    """The lines of a log; a NotTakenError where another LAMMPS writes to the same file."""
    text = Path(log.path).read_text(errors="replace")
    if "\0" in text or os.path.getsize(log.path) != log.place:
        raise NotTakenError(
            f"{log.path} is the log of another LAMMPS, too: give each LAMMPS a log of its own (-log FILE), or the "
            f"lines as from_lammps(lmp, commands=[...])."
        )
    return text.splitlines()


def _begins_as_log(path: str) -> bool:
    try:
        with open(path, "rb") as stream:
            return stream.read(8) == b"LAMMPS ("
    except OSError:
        return False
