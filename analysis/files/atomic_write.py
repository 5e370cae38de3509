"""Files that are complete at any moment, and in which damage is detected.

A file is written under another name and renamed, so that a reader, a kill or a full disk never leaves half a file. The
other name is unpredictable, and belongs to a file that does not exist yet: a link prepared under this name is not
followed.

No file is replaced that this program has not written. It knows its own files by a mark, which is also the number of
the format: ``faultgouge_format=1`` in a comment or another place that readers of the format skip, the key
``faultgouge_format`` of JSON, and of HDF5 the seal. A table in CSV has no place for a mark: its first line tells.

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
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from ..errors import OutputError, PackingFileError
from .plain_file import open_plain

HEADER_SIZE = 512
"""Bytes of the header: the smallest user block of HDF5."""

SEAL = b"faultgouge run file, sealed\n"
HDF5 = b"\x89HDF\r\n\x1a\n"
BEGINNINGS = HDF5, SEAL
"""How files of HDF5 begin: those of others, and those of this program."""

FORMAT = 1
"""Number of the format of all files that this program writes. Files of a later one are refused."""

FORMAT_KEY = "faultgouge_format"
"""Name of this number in a file: what has this name near its beginning or its end has been written by this program."""

OLD_DATA = b"# faultgouge sides="
"""How LAMMPS data begin that this program wrote before there was a number."""

MARK_BYTES = 1 << 16
"""Bytes at the beginning and at the end of a file among which the mark is."""

_COMMENT = f"{FORMAT_KEY}={FORMAT}".encode()
_XML = b"<!-- " + _COMMENT + b" -->\n"
_TEXT = b"tEXt" + b"Comment\0" + _COMMENT
TRAILERS = {
    **dict.fromkeys((".md", ".html", ".svg", ".vtp", ".pvd"), _XML),
    ".pdf": b"%" + _COMMENT + b"\n",
    ".gif": _COMMENT,  # behind the last block, where no reader looks
    ".mp4": (8 + len(_COMMENT)).to_bytes(4, "big") + b"free" + _COMMENT,
    ".png": (len(_TEXT) - 4).to_bytes(4, "big") + _TEXT + zlib.crc32(_TEXT).to_bytes(4, "big"),
}
"""What ends a file of these formats, as a comment; of a PNG before its last chunk. The writers of JSON, extended XYZ,
LAMMPS data and GSD give the number themselves."""

END_OF_PNG = 12
"""Bytes of the last chunk of a PNG."""

LONGEST_NAME = 200
"""Letters of a name that other names beside it begin with: file systems take 255 bytes."""

BYTES_AT_A_TIME = 1 << 20
"""Bytes that are read at a time."""


@contextmanager
def replace_whole(path: Path, head: str = "") -> Iterator[Path]:
    """Yield the name of a new file, and put this file, marked, in the place of the old one in one step.

    File and folder are on the storage device when this returns.

    Parameters
    ----------
    path : Path
        The file. A device is written to directly.
    head : str
        Of a format without a mark: how the files begin that may be replaced.

    Raises
    ------
    OutputError
        If the file cannot be written, or is read-only, or is not of this program. What it held before is still there.
    """
    target = Path(os.path.realpath(path))
    part = target.with_name(f".{target.stem[:LONGEST_NAME]}.{secrets.token_hex(8)}.part{target.suffix}")
    try:
        if target.exists() and not target.is_file():
            yield target
            return
        _check_changeable(target)
        check_own(target, head)
        with part.open("xb") as stream:  # a file of its own, or an error
            if target.exists():
                os.fchmod(stream.fileno(), stat.S_IMODE(target.stat().st_mode))
        yield part
        _add_trailer(part)
        _synchronise(part)
        os.replace(part, target)
        _synchronise(target.parent)
    except BaseException as error:
        with suppress(OSError):  # a folder that does not exist, or may not be written to, has no part
            part.unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        kept = "what it held before is kept" if target.exists() else "there is no such file now"
        raise OutputError(f"{path} cannot be written: {error.strerror or error}; {kept}.") from error


def _add_trailer(path: Path) -> None:
    """Mark a new file, in a format that ends in a mark."""
    trailer = TRAILERS.get(path.suffix.lower(), b"")
    with path.open("r+b") as stream:
        size = stream.seek(0, os.SEEK_END)
        last = b""
        if path.suffix.lower() == ".png" and size > END_OF_PNG:
            stream.seek(-END_OF_PNG, os.SEEK_END)
            last = stream.read()
            stream.seek(-END_OF_PNG, os.SEEK_END)
        stream.write(trailer + last)


def _synchronise(path: Path) -> None:
    """Have a file, or the names in a folder, on the storage device; where a file system cannot, nothing is done."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EROFS):
            raise
    finally:
        os.close(descriptor)


def is_own(path: Path, head: str = "") -> bool:
    """Whether a file may be replaced: this program has written it, or it is empty, or there is none.

    Parameters
    ----------
    head : str
        Of a format without a mark: how its files begin.
    """
    if not path.is_file():
        return True
    with path.open("rb") as stream:
        begin = stream.read(MARK_BYTES)
        stream.seek(-min(MARK_BYTES, path.stat().st_size), os.SEEK_END)
        end = stream.read()
    known = begin.startswith((SEAL, OLD_DATA)) or any(FORMAT_KEY.encode() in part for part in (begin, end))
    return not begin or known or bool(head and begin.startswith(head.encode()))


def check_own(path: Path, head: str = "") -> None:
    """Refuse to replace or to remove a file that this program has not written, with an OutputError."""
    if not is_own(path, head):
        raise OutputError(
            f"{path} is there already, and faultgouge has not written it (or a version before its files had a number "
            "of their format): give another name, or move the file away."
        )


def check_format(number: object, where: object) -> None:
    """Refuse a file of a later format with a PackingFileError; files of older versions have no number, None."""
    if number is not None and not (str(number).isdecimal() and int(str(number)) <= FORMAT):
        raise PackingFileError(
            f"{where} has format {number} of faultgouge's files, and this version knows {FORMAT}: a later version "
            "wrote it, so update faultgouge."
        )


def write_whole(path: Path, *parts: bytes, head: str = "") -> None:
    """Replace a file by new content, part after part; parameters and errors as those of `replace_whole`."""
    with replace_whole(path, head) as new, new.open("wb") as stream:
        stream.writelines(parts)


def write_text(path: Path, text: str, head: str = "") -> None:
    """Replace a text file, in one step; parameters and errors as those of `replace_whole`."""
    write_whole(path, text.encode(), head=head)


def write_json(path: Path, value: Mapping[str, Any], *, allow_nan: bool = True) -> None:
    """Replace a JSON file, in one step, with the number of its format; errors as those of `replace_whole`."""
    write_text(path, json.dumps({FORMAT_KEY: FORMAT, **value}, indent=1, allow_nan=allow_nan) + "\n")


def check_output(path: Path, *inputs: Path, head: str = "") -> None:
    """Refuse a file that cannot be written, before work starts whose result goes there.

    Raises
    ------
    OutputError
        If the folder of the file does not exist, or may not be written to, or the file is read-only, a folder, one
        of the inputs, or not of this program (see `is_own` for `head`).
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
    check_own(path, head)


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
    lock = lock_of(path)
    if lock is None:
        yield None
        return
    stream = _take_lock(lock, path)
    try:
        yield lock
    finally:
        with suppress(OSError):
            lock.unlink()
        stream.close()


def lock_of(path: Path) -> Path | None:
    """The lock file of a file or a folder; a device has none."""
    target = Path(os.path.realpath(path))
    if target.exists() and not (target.is_file() or target.is_dir()):
        return None
    return target / ".lock" if target.is_dir() else target.with_name(f".{target.name[:LONGEST_NAME]}.lock")


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


def make_folder(path: Path, *names: str) -> None:
    """Make a folder, and those above it, if need be; refuse files of these names in it that are not of this program."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path} cannot be made a folder: {error.strerror}.") from error
    for name in names:
        check_own(path / name)


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
