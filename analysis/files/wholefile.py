"""Files that are whole at any moment, and that tell damage.

A file is written under another name and renamed, so that a reader, a kill or a full disk never meets half of one. A
*sealed* file begins with a header of 512 bytes, in words: what the file is, the SHA-256 of everything behind it, and
its length. One flipped byte anywhere is then noticed. HDF5 looks for its superblock at the bytes 0, 512, 1024, ...
(the header is what HDF5 calls a user block), so that every reader of HDF5 opens a sealed file as it is.
"""

import hashlib
import json
import os
from contextlib import suppress
from pathlib import Path

from ..errors import OutputError, PackingFileError

HEADER_SIZE = 512
"""Bytes of the header: the smallest user block of HDF5."""

MAGIC = b"faultgouge run file, sealed\n"
HDF5 = b"\x89HDF\r\n\x1a\n"
BEGINNINGS = HDF5, MAGIC
"""How a run.h5 begins: without a seal, as version 0.1.0 wrote it, and with one."""

BLOCK = 1 << 20
"""Bytes that are read at a time."""


def write_whole(path: Path, *parts: bytes) -> None:
    """Replace a file by new content, in one step.

    Parameters
    ----------
    path : Path
        The file. A device is written to directly.
    *parts : bytes
        Its content, part after part.

    Raises
    ------
    OutputError
        If the file cannot be written. What it held before is still there.
    """
    target = path.resolve()
    part = target.with_name(target.name + ".part")
    try:
        if target.exists() and not target.is_file():
            target.write_bytes(b"".join(parts))
            return
        with part.open("wb") as stream:
            stream.writelines(parts)
        os.replace(part, target)
    except BaseException as error:
        with suppress(OSError):  # a folder that does not exist, or may not be written to, has no part
            part.unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        raise OutputError(f"{path} cannot be written: {error.strerror}; what it held before is kept.") from error


def write_text(path: Path, text: str) -> None:
    """Replace a text file, in one step; errors as those of `write_whole`."""
    write_whole(path, text.encode())


def write_json(path: Path, value: object) -> None:
    """Replace a JSON file, in one step; errors as those of `write_whole`."""
    write_text(path, json.dumps(value, indent=1) + "\n")


def check_folder(path: Path) -> None:
    """Refuse a file whose folder does not exist, before work starts whose result goes there."""
    folder = path.absolute().parent
    if not folder.is_dir():
        raise OutputError(f"{path} cannot be written: there is no folder {folder}; make it first.")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"{path} cannot be written: the folder {folder} may not be written to.")


def make_folder(path: Path) -> None:
    """Make a folder, and those above it, if need be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path} cannot be made a folder: {error.strerror}.") from error


def seal(content: bytes) -> bytes:
    """The header of a content."""
    return _header(hashlib.sha256(content).hexdigest(), len(content))


def is_sealed(path: Path) -> bool:
    """Whether a file has a header, and its content is the one that was sealed.

    Returns
    -------
    bool
        False for an HDF5 file without a header: whether it is whole is not known.

    Raises
    ------
    PackingFileError
        If the file cannot be read, or has changed since it was sealed.
    """
    try:
        with path.open("rb") as stream:
            header = stream.read(HEADER_SIZE)
            if header.startswith(HDF5):
                return False
            if not header.startswith(MAGIC):
                raise PackingFileError(f"{path} is not a readable HDF5 file: it begins like none.")
            digest, size = hashlib.sha256(), 0
            while block := stream.read(BLOCK):
                digest.update(block)
                size += len(block)
    except OSError as error:
        raise PackingFileError(f"{path} cannot be read: {error.strerror}.") from error
    if header != _header(digest.hexdigest(), size):
        raise PackingFileError(
            f"{path} is damaged: its {size} bytes do not have the checksum that was written with them; take a copy of "
            "the file, or make it again."
        )
    return True


def _header(digest: str, size: int) -> bytes:
    words = MAGIC + f"sha256 {digest}\nbytes {size}\nHDF5 from byte {HEADER_SIZE} on\n".encode()
    return words.ljust(HEADER_SIZE - 1) + b"\n"
