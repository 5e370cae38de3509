"""Every number of a run.h5 lies in the file itself, whose checksum covers it, and unpacks into memory.

The checksum says that the content is what this program wrote (:mod:`.atomic_write`). It does not cover other files to
which HDF5 may link, nor what a few bytes unpack to.
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

from ..errors import PackingFileError
from .atomic_write import FORMAT_KEY, check_format

if TYPE_CHECKING:
    import h5py

LARGEST_CHUNK = 1 << 30
"""Bytes of a chunk, unpacked: a frame of ten million disks has a quarter of these."""

LARGEST_SHAPE = 1 << 45
"""Bytes that a dataset would have with all of its rows written, 35 TB."""


def check_places(file: h5py.File) -> None:
    """Refuse a later format, links to other files, and what unpacks to more than the memory of this machine."""
    try:
        check_format(file.attrs.get(FORMAT_KEY), "it")
        _check_places(file)
    except PackingFileError:
        raise
    except Exception as error:  # h5py raises nearly every exception there is
        raise PackingFileError(f"it cannot be read: {str(error).strip() or type(error).__name__}") from error


def _check_places(file: h5py.File) -> None:
    import h5py

    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    unpacked, seen, groups = 0, set[int](), [file]
    while groups:
        here = groups.pop()
        for name in here:
            link = here.get(name, getlink=True)
            _require(not isinstance(link, h5py.ExternalLink), f"{here.name}/{name} is a link to another file")
            item = here[name]
            address = h5py.h5o.get_info(item.id).addr
            if address in seen:
                continue
            seen.add(address)
            if isinstance(item, h5py.Group):
                groups.append(item)
            elif isinstance(item, h5py.Dataset):
                _require(not item.external and not item.is_virtual, f"{item.name} has its numbers in another file")
                _require(item.nbytes <= LARGEST_SHAPE, f"{item.name} has the shape {item.shape}")
                chunk = math.prod(item.chunks or ()) * item.dtype.itemsize
                _require(chunk <= LARGEST_CHUNK, f"{item.name} has chunks of {chunk} bytes")
                unpacked += item.id.get_num_chunks() * chunk if item.chunks else 0
    _require(unpacked <= memory, f"its datasets unpack to {unpacked} bytes, more than this machine has memory")


def _require(sound: bool, says: str) -> None:
    if not sound:
        raise PackingFileError(says)
