"""Files that users name, opened for reading: plain files alone.

A pipe or a device has no end that is certain to come, and no second reading: a program that opens it may wait for ever.
"""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO


def open_plain(path: str | Path) -> BinaryIO:
    """A plain file, opened for reading its bytes.

    Parameters
    ----------
    path : path
        The file, or a link to it.

    Raises
    ------
    OSError
        If the file cannot be read, or is a folder, a pipe, a socket or a device.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # a pipe without a writer opens at once
    kind = os.fstat(descriptor).st_mode
    if stat.S_ISREG(kind):
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise OSError(errno.EINVAL, "it is a pipe or a device, and no plain file", str(path))


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
