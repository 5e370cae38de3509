"""Names of files for commands of LAMMPS.

In a line of input LAMMPS separates words at blanks and interprets quotes, ``$``, ``#`` and ``&``, and in names of files
also ``*`` and ``%``. No quoting protects a name that reaches the line through a variable. LAMMPS therefore never
receives a name from the user. Files that LAMMPS reads are linked, and files that LAMMPS writes are created, under plain
names in a temporary folder with a plain name.
"""

import atexit
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib.resources import files
from pathlib import Path

from mpi4py import MPI

from ...analysis import FaultgougeError
from ...analysis.files.atomic_write import check_own

DECKS = Path(str(files("faultgouge.lammps_inputs")))

PLAIN = re.compile(r"[A-Za-z0-9_./+:@=~-]*")
"""Characters that mean themselves in every command of LAMMPS."""

OTHER_FOLDERS = "/tmp", "/var/tmp", "/dev/shm"
"""Where temporary files lie if the name of Python's own place is not plain."""


def is_plain(text: str) -> bool:
    """Whether LAMMPS reads a text as one word that means itself."""
    return PLAIN.fullmatch(text) is not None


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """A new folder of a plain name, which goes when it is left. Raises FaultgougeError if there is no place for one."""
    for place in (tempfile.gettempdir(), *OTHER_FOLDERS):
        if is_plain(place) and os.access(place, os.W_OK | os.X_OK):
            return tempfile.TemporaryDirectory(prefix="faultgouge-", dir=place)
    raise FaultgougeError(
        f"temporary files cannot lie in {tempfile.gettempdir()!r}, a name that LAMMPS would not read as one word: set "
        "TMPDIR to a folder whose name has letters, digits and _ . / + : @ = ~ - alone."
    )


@contextmanager
def shared_folder(communicator: MPI.Comm) -> Iterator[Path]:
    """A temporary folder of rank 0, of a plain name, that all ranks know."""
    keeper = temporary_folder() if communicator.rank == 0 else None
    try:
        yield Path(communicator.bcast(keeper.name if keeper else None))
        communicator.barrier()  # not after an error, which one rank may be alone with
    finally:
        if keeper:
            keeper.cleanup()


@contextmanager
def plain_name(path: Path) -> Iterator[Path]:
    """A plain name of an existing file: its own name, or the name of a link to the file."""
    whole = Path(os.path.realpath(path))
    with ExitStack() as kept:
        name = whole
        if not is_plain(str(whole)):
            name = (
                Path(kept.enter_context(temporary_folder())) / f"file{whole.suffix if is_plain(whole.suffix) else ''}"
            )
            name.symlink_to(whole)
        yield name


@cache
def decks_folder() -> Path:
    """The folder of the deck parts, or a link to it that lasts as long as this process."""
    kept = ExitStack()
    atexit.register(kept.close)
    return kept.enter_context(plain_name(DECKS))


def move_files(folder: Path, stem: Path) -> None:
    """Move the files of a folder, KIND each by its suffix, to STEM.KIND.

    Raises OutputError if a file of such a name is there that does not begin as the new one: of dumps, with the columns.
    """
    moved = {file: Path(f"{stem}{file.suffix}") for file in sorted(folder.iterdir())}
    for file, target in moved.items():
        if target.exists() and _head(target) != _head(file):
            check_own(target)
    for file, target in moved.items():
        shutil.move(file, target)


def _head(path: Path) -> list[bytes]:
    """How a dump begins, or a file of parameters: the names that are in it."""
    with path.open("rb") as stream:
        lines = [stream.readline(1 << 16) for _ in range(9)]
    return [line.strip() for line in lines if line.startswith(b"ITEM:")] or [line.split()[:1][0] for line in lines[:3]]
