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
from collections.abc import Callable, Iterator
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


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """A new folder of a plain name, which goes when it is left. Raises FaultgougeError if there is no place for one."""
    for place in (tempfile.gettempdir(), "/tmp", "/var/tmp", "/dev/shm"):
        if PLAIN.fullmatch(place) and os.access(place, os.W_OK | os.X_OK):
            return tempfile.TemporaryDirectory(prefix="faultgouge-", dir=place)
    name = f"{tempfile.gettempdir()!r}, a name that LAMMPS would not read as one word"
    cure = "set TMPDIR to a folder whose name has letters, digits and _ . / + : @ = ~ - alone."
    raise FaultgougeError(f"temporary files cannot lie in {name}: {cure}")


@contextmanager
def shared_folder(communicator: MPI.Comm, fill: Callable[[Path], object] | None = None) -> Iterator[Path]:
    """A temporary folder of rank 0, of a plain name, that all ranks know, with the files that rank 0 puts there."""
    keeper = temporary_folder() if communicator.rank == 0 else None
    try:
        if keeper and fill:
            fill(Path(keeper.name))
        yield Path(communicator.bcast(keeper.name if keeper else None))
        communicator.barrier()  # not after an error, which one rank may be alone with
    finally:
        if keeper:
            keeper.cleanup()


@contextmanager
def plain_name(path: Path) -> Iterator[Path]:
    """A plain name of an existing file: its own name, or the name of a link to the file."""
    whole = Path(os.path.realpath(path))
    if PLAIN.fullmatch(str(whole)):
        yield whole
        return
    with temporary_folder() as folder:
        link = Path(folder) / f"file{whole.suffix if PLAIN.fullmatch(whole.suffix) else ''}"
        link.symlink_to(whole)
        yield link


@cache
def decks_folder() -> Path:
    """The folder of the deck parts, or a link to it that lasts as long as this process."""
    kept = ExitStack()
    atexit.register(kept.close)
    return kept.enter_context(plain_name(DECKS))


def move_files(folder: Path, stem: Path) -> None:
    """Move the files of a folder, KIND each by its suffix, to STEM.KIND; the parameters, which have a mark, first.

    Raises OutputError if a file of such a name is there, and no parameters beside it that this program has written.
    """
    moved = {file: Path(f"{stem}{file.suffix}") for file in sorted(folder.iterdir(), reverse=True)}
    marked = [target for target in moved.values() if target.suffix == ".params" and target.exists()]
    for target in marked or moved.values():
        check_own(target)
    for file, target in moved.items():
        shutil.move(file, target)
