"""Text, compressed or not: LAMMPS compresses a dump whose name ends in .gz."""

import gzip
from os import PathLike
from pathlib import Path
from typing import TextIO

GZIP = b"\x1f\x8b"
"""How a file begins that is compressed by gzip."""


def open_text(path: str | PathLike[str]) -> TextIO:
    """A text file for reading, decompressed if its first bytes are those of gzip.

    Raises
    ------
    OSError
        If it cannot be read. What reads from it meets an EOFError, a zlib.error or an OSError where it is damaged.
    """
    with Path(path).open("rb") as stream:
        compressed = stream.read(len(GZIP)) == GZIP
    return gzip.open(path, "rt", encoding="utf-8") if compressed else Path(path).open(encoding="utf-8")
