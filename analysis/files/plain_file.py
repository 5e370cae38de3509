"""Open files that users name for reading: only plain files.

A pipe or a device may never end and cannot be read twice: a program that opens it may wait for ever.
"""

import errno
import gzip
import os
import stat
from io import TextIOWrapper
from os import PathLike
from pathlib import Path
from typing import BinaryIO, TextIO

GZIP = b"\x1f\x8b"
"""How a file begins that is compressed by gzip: LAMMPS compresses a dump whose name ends in .gz."""


def open_plain(path: str | Path) -> BinaryIO:
    """A plain file, opened for reading its bytes.

    Raises OSError if the file cannot be read, or is a folder, a pipe, a socket or a device.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # a pipe without a writer opens at once
    kind = os.fstat(descriptor).st_mode
    if stat.S_ISREG(kind):
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise OSError(errno.EINVAL, "it is a pipe or a device, and no plain file", str(path))


def open_text(path: str | PathLike[str]) -> TextIO:
    """The text of a plain file in UTF-8, for reading; decompressed if its first bytes are those of gzip.

    Raises
    ------
    OSError
        As of `open_plain`. What reads from the text meets an EOFError, a zlib.error or an OSError where it is damaged.
    """
    stream = open_plain(Path(path))
    compressed = stream.read(len(GZIP)) == GZIP
    stream.seek(0)
    return gzip.open(stream, "rt", encoding="utf-8") if compressed else TextIOWrapper(stream, encoding="utf-8")


def check_plain(path: str | Path) -> None:
    """Raise the errors of `open_plain`, for a file that a library opens."""
    open_plain(path).close()


def read_plain(path: str | Path) -> bytes:
    """The bytes of a plain file; errors as those of `open_plain`."""
    with open_plain(path) as stream:
        return stream.read()


def read_plain_text(path: str | Path) -> str:
    """The text of a plain file in UTF-8, its lines ended by line feeds; errors as those of `open_plain`."""
    return read_plain(path).decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
