"""Files that are complete at any moment, and in which damage is detected.

A file is written under another name, of a file that does not exist yet, and renamed, so that a reader, a kill or a full
disk never leaves half a file. No file is replaced that this program has not written. It knows its own files by a mark,
which is also the number of the format: ``faultgouge_format=1`` in a comment or another place that readers of the format
skip, the key ``faultgouge_format`` of JSON, and of HDF5 the seal. A table in CSV has no place for a mark: its first
line tells.

A *sealed* file of HDF5 begins with a text header of 512 bytes: a description of the file, the SHA-256 of all following
bytes, and its length. A single flipped byte is then detected. HDF5 looks for its superblock at the bytes 0, 512, 1024,
... (the header is a user block in the terms of HDF5), so that every reader of HDF5 can open a sealed file. Other files
to which HDF5 may link are not covered by the checksum: these are refused.

Files that users name for reading must be plain: a pipe or a device may never end, and cannot be read twice.
"""

from __future__ import annotations

import errno
import fcntl
import gzip
import hashlib
import json
import os
import secrets
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TextIO

from ..errors import OutputError, PackingFileError

if TYPE_CHECKING:
    import h5py

HEADER_SIZE = 512
"""Bytes of the header: the smallest user block of HDF5."""

SEAL, HDF5 = b"faultgouge run file, sealed\n", b"\x89HDF\r\n\x1a\n"
"""How files of HDF5 begin: those of this program, and those of others."""

FORMAT, FORMAT_KEY = 1, "faultgouge_format"
"""Number of the format of all files that this program writes, of which later ones are refused; and its name in a file:
what has this name near its beginning or its end has been written by this program."""

MARK = f"{FORMAT_KEY}={FORMAT}"
TRAILERS = {
    **dict.fromkeys((".md", ".html", ".svg", ".vtp", ".pvd"), f"<!-- {MARK} -->\n".encode()),
    ".pdf": f"%{MARK}\n".encode(),
    ".gif": MARK.encode(),  # behind the last block, where no reader looks
    ".mp4": (8 + len(MARK)).to_bytes(4, "big") + b"free" + MARK.encode(),
}
"""What ends a file of these formats, as a comment. The writers of PNG, JSON, extended XYZ, LAMMPS data and GSD give the
number themselves."""


@contextmanager
def telling(path: object, says: str, errors: type[Exception] = Exception) -> Iterator[None]:
    """Tell in one sentence, a PackingFileError, what fails within, unless a sentence tells it already.

    `path` is the file, or another source; `says` what of it, as in "is no readable GSD file"; the reason of the error
    follows. `errors` are what is told; by default all that readers meet in files that are damaged, or of another format
    than their name says.
    """
    try:
        yield
    except (PackingFileError, MemoryError):
        raise
    except errors as error:
        reason = str(getattr(error, "strerror", None) or error).strip().partition("\n")[0].rstrip(".")
        reason = "its brackets are nested too deeply" if isinstance(error, RecursionError) else reason
        lacks = "it lacks " if isinstance(error, KeyError) else ""
        raise PackingFileError(f"{path} {says}: {lacks}{reason or 'it breaks off'}.") from error


def open_plain(path: str | PathLike[str]) -> BinaryIO:
    """A plain file, opened for reading its bytes; an OSError of a folder, a pipe, a socket or a device."""
    if Path(path).exists() and not Path(path).is_file():
        raise OSError(errno.EINVAL, "it is a folder, a pipe or a device, and no plain file", str(path))
    return open(path, "rb")


def begins_with(path: Path, *beginnings: bytes) -> bool:
    """Whether a file begins in one of some ways; OSError if it cannot be read."""
    with open_plain(path) as stream:
        return stream.read(64).startswith(beginnings)


def open_text(path: str | PathLike[str]) -> TextIO:
    """The text of a plain file in UTF-8, decompressed if it begins like gzip; if damaged, reading raises an EOFError, a
    zlib.error or an OSError."""
    stream = open_plain(path)
    compressed = stream.read(2) == b"\x1f\x8b"  # LAMMPS compresses a dump whose name ends in .gz
    stream.seek(0)
    return gzip.open(stream, "rt", encoding="utf-8") if compressed else TextIOWrapper(stream, encoding="utf-8")


def read_plain(path: str | PathLike[str]) -> bytes:
    """The bytes of a plain file; errors as those of `open_plain`."""
    with open_plain(path) as stream:
        return stream.read()


def read_plain_text(path: str | PathLike[str]) -> str:
    """The text of a plain file in UTF-8, its lines ended by line feeds; errors as those of `open_plain`."""
    return read_plain(path).decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")


@contextmanager
def replace_whole(path: Path, head: str = "") -> Iterator[Path]:
    """Yield the name of a new file, and put this file, marked, in the place of the old one in one step.

    File and folder are on the storage device when this returns. `head` is how the files of a format without a mark
    begin that may be replaced. An OutputError if the file cannot be written, or is read-only, or is not of this
    program; what it held before is still there.
    """
    target = Path(os.path.realpath(path))  # names of files may have 255 bytes
    part = target.with_name(f".{target.stem[:200]}.{secrets.token_hex(8)}.part{target.suffix}")
    try:
        check_own(target, head)
        part.open("xb").close()  # a file of its own, or an error
        if target.exists():
            part.chmod(stat.S_IMODE(target.stat().st_mode))
        yield part
        with part.open("ab") as stream:
            stream.write(TRAILERS.get(part.suffix.lower(), b""))
        _synchronise(part)
        os.replace(part, target)
        _synchronise(target.parent)
    except OSError as error:
        kept = "what it held before is kept" if target.exists() else "there is no such file now"
        raise OutputError(f"{path} cannot be written: {error.strerror or error}; {kept}.") from error
    finally:
        with suppress(OSError):  # a folder that does not exist, or may not be written to, has no part
            part.unlink(missing_ok=True)


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


def check_own(path: Path, head: str = "") -> None:
    """Refuse, by an OutputError, to replace or to remove a file that is read-only, or not written by this program, or a
    folder, a pipe or a device. `head` is how files of a format without a mark begin; an empty file is anybody's.
    """
    if not path.exists():
        return
    if not path.is_file():
        raise OutputError(f"{path} cannot be written: it is a folder, a pipe or a device: give the name of a file.")
    if not (path.stat().st_mode & 0o222 and os.access(path, os.W_OK)):  # root may write what is read-only
        raise OutputError(f"{path} cannot be written: it is read-only; make it writeable, or give another name.")
    with path.open("rb") as stream:
        begin = stream.read(1 << 16)
        stream.seek(max(0, path.stat().st_size - (1 << 16)))
        both = begin + b"\n" + stream.read()
    own = begin.startswith(SEAL) or bool(head and begin.startswith(head.encode())) or FORMAT_KEY.encode() in both
    if begin and not own:
        says = f"{path} is there already, and faultgouge has not written it (or a version without numbers of formats)"
        raise OutputError(f"{says}: give another name, or move the file away.")


def check_format(number: object, where: object) -> None:
    """Refuse a file of a later format with a PackingFileError; files of older versions have no number, None."""
    known = str(number).removesuffix(".0")
    if number is not None and not (known.isdecimal() and int(known) <= FORMAT):
        says = f"{where} has format {known} of faultgouge's files, and this version knows {FORMAT}"
        raise PackingFileError(f"{says}: a later version wrote it, so update faultgouge.")


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

    An OutputError if the folder of the file does not exist, or may not be written to, or the file is one of the inputs,
    or none that `check_own` lets replace.
    """
    if any(path.exists() and each.exists() and path.samefile(each) for each in inputs):
        raise OutputError(f"{path} is read by this command, and its result would replace it: give another name.")
    if not (folder := path.absolute().parent).is_dir() or not os.access(folder, os.W_OK):
        raise OutputError(f"{path} cannot be written: there is no folder {folder} that may be written to.")
    check_own(path, head)


def make_folder(path: Path, *names: str) -> None:
    """Make a folder, and those above it, if need be; refuse files of these names in it that are not of this program."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path} cannot be made a folder: {error.strerror}.") from error
    for name in names:
        check_own(path / name)


@contextmanager
def lock_output(path: Path) -> Iterator[None]:
    """Keep other processes from writing a file, or into a folder, by a lock beside it, or in it, which goes with this
    process. Raises OutputError if another has it."""
    lock = lock_of(path)
    try:
        stream = lock.open("ab")
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror} ({lock}).") from None
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            held = os.path.samestat(os.fstat(stream.fileno()), lock.stat())  # or who had it before has just removed it
        except OSError as error:  # another has it, or there are no locks on this file system
            held = not isinstance(error, BlockingIOError | FileNotFoundError)
        if not held:
            raise OutputError(f"{path} cannot be written, since another run is writing it: give another name, or wait.")
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)


def lock_of(path: Path) -> Path:
    """The lock file of a file or a folder."""
    target = Path(os.path.realpath(path))
    return target / ".lock" if target.is_dir() else target.with_name(f".{target.name[:200]}.lock")


def new_sealed() -> h5py.File:
    """An empty file of HDF5 in memory, with checksums on HDF5's own tables."""
    import h5py

    return h5py.File("new", "w", driver="core", backing_store=False, block_size=1 << 20, libver=("v110", "v110"))


def write_sealed(path: Path, file: h5py.File) -> None:
    """Write a file that is kept in memory, with its checksum and the number of its format."""
    file.attrs[FORMAT_KEY] = FORMAT
    file.flush()
    image = file.id.get_file_image()
    write_whole(path, _header(image), image)


def _header(image: bytes) -> bytes:
    words = f"sha256 {hashlib.sha256(image).hexdigest()}\nbytes {len(image)}\nHDF5 from byte {HEADER_SIZE} on\n"
    return (SEAL + words.encode()).ljust(HEADER_SIZE - 1) + b"\n"


def open_sealed(path: Path, writable: bool = False) -> h5py.File:
    """Open a file that has been checked whole; its content is in memory. A PackingFileError if the file is missing,
    damaged, of a later format, or has numbers that are not in it."""
    if not path.is_file():
        raise PackingFileError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    import h5py

    with telling(path, "cannot be read", OSError), open_plain(path) as stream:
        header, image = stream.read(HEADER_SIZE), stream.read()
    if not header.startswith(SEAL):
        kind = "an HDF5 file" if header.startswith(HDF5) else "no HDF5 file"
        convert = f"`faultgouge import {path} -o packing.h5` converts files of other codes"
        raise PackingFileError(f"{path} is {kind}, and no run of faultgouge: {convert}.")
    if header != _header(image):
        raise PackingFileError(f"{path} is damaged, as its checksum is another: take a copy of it.")
    with telling(path, "is damaged, or is none of this program's files"):
        file = h5py.File(h5py.h5f.open_file_image(image, flags=h5py.h5f.FILE_IMAGE_OPEN_RW if writable else 0))
        names = list[str]()
        file.visit_links(names.append)
        for name in names:
            outside = isinstance(file.get(name, getlink=True), h5py.ExternalLink)
            if outside or (isinstance(item := file[name], h5py.Dataset) and (item.external or item.is_virtual)):
                file.close()
                raise ValueError(f"/{name} has its numbers in another file")
        check_format(file.attrs.get(FORMAT_KEY), path)
        return file
