"""Files that are complete at any moment, and in which damage is detected.

A file is written under another name and renamed, so that a reader, a kill or a full disk never leaves half a file. The
other name is unpredictable, and belongs to a file that does not exist yet: a link prepared under this name is not
followed.

A *sealed* file begins with a text header of 512 bytes: a description of the file, the SHA-256 of all following bytes,
and its length. A single flipped byte is then detected. HDF5 looks for its superblock at the bytes 0, 512, 1024, ...
(the header is a user block in the terms of HDF5), so that every reader of HDF5 can open a sealed file.
"""

import errno
import fcntl
import hashlib
import json
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from ..errors import OutputError, PackingFileError
from .plain_file import open_plain

HEADER_SIZE = 512
"""Bytes of the header: the smallest user block of HDF5."""

SEAL = b"faultgouge run file, sealed\n"
HDF5 = b"\x89HDF\r\n\x1a\n"
BEGINNINGS = HDF5, SEAL
"""How files of HDF5 begin: those of others, and those of this program."""

LONGEST_NAME = 200
"""Letters of a name that other names beside it begin with: file systems take 255 bytes."""

BYTES_AT_A_TIME = 1 << 20
"""Bytes that are read at a time."""


@contextmanager
def replace_whole(path: Path) -> Iterator[Path]:
    """Yield the name of a new file, and put this file in the place of the old one in one step.

    Parameters
    ----------
    path : Path
        The file. A device is written to directly.

    Raises
    ------
    OutputError
        If the file cannot be written, or is read-only. What it held before is still there.
    """
    target = Path(os.path.realpath(path))
    part = target.with_name(f".{target.stem[:LONGEST_NAME]}.{secrets.token_hex(8)}.part{target.suffix}")
    try:
        if target.exists() and not target.is_file():
            yield target
            return
        _check_changeable(target)
        with part.open("xb") as stream:  # a file of its own, or an error
            if target.exists():
                os.fchmod(stream.fileno(), stat.S_IMODE(target.stat().st_mode))
        yield part
        os.replace(part, target)
    except BaseException as error:
        with suppress(OSError):  # a folder that does not exist, or may not be written to, has no part
            part.unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        kept = "what it held before is kept" if target.exists() else "there is no such file now"
        raise OutputError(f"{path} cannot be written: {error.strerror or error}; {kept}.") from error


def write_whole(path: Path, *parts: bytes) -> None:
    """Replace a file by new content, part after part; errors as those of `replace_whole`."""
    with replace_whole(path) as new, new.open("wb") as stream:
        stream.writelines(parts)


def write_text(path: Path, text: str) -> None:
    """Replace a text file, in one step; errors as those of `replace_whole`."""
    write_whole(path, text.encode())


def write_json(path: Path, value: object) -> None:
    """Replace a JSON file, in one step; errors as those of `replace_whole`."""
    write_text(path, json.dumps(value, indent=1) + "\n")


def check_output(path: Path, *inputs: Path) -> None:
    """Refuse a file that cannot be written, before work starts whose result goes there.

    Raises
    ------
    OutputError
        If the folder of the file does not exist, or may not be written to, or the file is read-only, a folder, or one
        of the inputs.
    """
    for each in inputs:
        if path.exists() and each.exists() and path.samefile(each):
            raise OutputError(f"{path} is read by this command, and its result would replace it: give another name.")
    if path.is_dir():
        raise OutputError(f"{path} is a folder: give the name of a file.")
    try:
        _check_changeable(path)
    except OSError as error:
        raise OutputError(
            f"{path} cannot be written: {error.strerror}; make it writeable, or give another name."
        ) from None
    folder = path.absolute().parent
    if not folder.is_dir():
        raise OutputError(f"{path} cannot be written: there is no folder {folder}; make it first.")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"{path} cannot be written: the folder {folder} may not be written to.")


def _check_changeable(path: Path) -> None:
    """Refuse to replace a file that is read-only, also to root, whom the system lets."""
    if path.is_file() and not (path.stat().st_mode & 0o222 and os.access(path, os.W_OK)):
        raise PermissionError(errno.EACCES, "it is read-only", str(path))


@contextmanager
def lock_output(path: Path) -> Iterator[Path | None]:
    """Keep other processes from writing a file, or into a folder: they find a lock, which goes with this process.

    The lock is a file beside the file, or in the folder, which is yielded and removed in the end. A device has none.
    Raises OutputError if another process has it.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not (target.is_file() or target.is_dir()):
        yield None
        return
    lock = target / ".lock" if target.is_dir() else target.with_name(f".{target.name[:LONGEST_NAME]}.lock")
    stream = _take_lock(lock, path)
    try:
        yield lock
    finally:
        with suppress(OSError):
            lock.unlink()
        stream.close()


def _take_lock(lock: Path, path: Path) -> IO[bytes]:
    """The lock file, locked, and still under its name: who had it before may just have removed it."""
    while True:
        try:
            stream = os.fdopen(os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666), "r+b")
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror} ({lock}).") from None
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if lock.exists() and os.path.samestat(os.fstat(stream.fileno()), lock.stat()):
                return stream
        except BlockingIOError:
            stream.close()
            says = "another run is writing it: wait for its end, or give another name"
            raise OutputError(f"{path} cannot be written, since {says}.") from None
        except OSError:  # a file system without locks
            return stream
        stream.close()


def make_folder(path: Path) -> None:
    """Make a folder, and those above it, if need be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path} cannot be made a folder: {error.strerror}.") from error


def add_checksum(content: bytes) -> bytes:
    """The header of a content."""
    return _header(hashlib.sha256(content).hexdigest(), len(content))


def check_checksum(path: Path) -> None:
    """Refuse a file without a header, or whose content has not the checksum of the header, with a PackingFileError."""
    try:
        with open_plain(path) as stream:
            header = stream.read(HEADER_SIZE)
            if header.startswith(HDF5):
                raise PackingFileError(
                    f"{path} is an HDF5 file, and no run of faultgouge: it lacks the lines with which these begin."
                )
            if not header.startswith(SEAL):
                convert = f"a packing of another code is converted by `faultgouge import {path} -o packing.h5`"
                raise PackingFileError(f"{path} is not a readable HDF5 file, as it begins like none: {convert}.")
            digest, size = hashlib.sha256(), 0
            while block := stream.read(BYTES_AT_A_TIME):
                digest.update(block)
                size += len(block)
    except OSError as error:
        raise PackingFileError(f"{path} cannot be read: {error.strerror}.") from error
    if header != _header(digest.hexdigest(), size):
        raise PackingFileError(
            f"{path} is damaged: its {size} bytes do not have the checksum that was written with them; take a copy of "
            "the file, or make it again."
        )


def _header(digest: str, size: int) -> bytes:
    words = SEAL + f"sha256 {digest}\nbytes {size}\nHDF5 from byte {HEADER_SIZE} on\n".encode()
    return words.ljust(HEADER_SIZE - 1) + b"\n"
