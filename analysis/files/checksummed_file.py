"""A growing HDF5 file that is sealed and complete at any moment (:mod:`.atomic_write`).

The file is kept in memory. When it is saved, all of it replaces the stored file. Saving takes at most a fixed share of
the time, so that a file that grows for a long time is not written too often.

The checksum says that the content is what this program wrote. It does not cover other files to which HDF5 may link, nor
what a few bytes unpack to: `check_places` refuses both.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from numpy.typing import NDArray

from ..errors import PackingFileError
from .atomic_write import FORMAT, FORMAT_KEY, HEADER_SIZE, add_checksum, check_checksum, check_format, write_whole
from .plain_file import read_plain

if TYPE_CHECKING:
    import h5py

Self = TypeVar("Self", bound="SealedFile")

LIBVER = "v110", "v110"
"""HDF5's format with checksums on its own tables, which HDF5 1.10 and all later versions read."""

MEMORY_BLOCK = 1 << 20
"""Bytes by which the file grows in memory."""

SHARE_OF_SAVING = 0.05
"""Share of the time that saving takes, at the most: a frame or a part of a series waits that long to be saved."""


LARGEST_CHUNK = 1 << 30
"""Bytes of a chunk, unpacked: a frame of ten million disks has a quarter of these."""

LARGEST_SHAPE = 1 << 45
"""Bytes that a dataset would have with all of its rows written, 35 TB."""


class SealedFile:
    """A run.h5 as a file: opened, checked whole, changed and saved; a context manager.

    Raises
    ------
    PackingFileError
        If the file is missing or damaged, or no run of this program.
    """

    def __init__(self, path: str | PathLike[str], mode: Literal["r", "a"] = "r") -> None:
        self.path = Path(path)
        self._unsaved, self._sound, self._next_save = False, True, 0.0
        self._writable = mode == "a"
        self._file = open_sealed(self.path, self._writable)
        if "snapshot" in self._file:
            self._file.close()
            raise PackingFileError(
                f"{self.path} holds a packing as LAMMPS left it, and no run of this program's own: the commands "
                "spectrum, draw, movie, view and export take it."
            )

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the root: scene, versions, seed, ranks."""
        return {name: getattr(value, "tolist", lambda value=value: value)() for name, value in self._file.attrs.items()}

    def put_attribute(self, name: str, value: str) -> None:
        """Set an attribute of the root."""
        with self.change():
            self._file.attrs[name] = value

    @property
    def complete(self) -> bool:
        """Whether the run has come to its end."""
        return bool(self._file.attrs["complete"])

    @complete.setter
    def complete(self, value: bool) -> None:
        if bool(self._file.attrs["complete"]) != value:
            self._file.attrs["complete"] = value
            self._unsaved = True

    @property
    def saved(self) -> bool:
        """Whether the stored file has all changes."""
        return not self._unsaved

    def save(self) -> None:
        """Write all changes to the file on the disk."""
        if self._writable and self._unsaved and self._sound:
            begin = monotonic()
            write(self.path, self._file)
            self._unsaved, self._next_save = False, monotonic() + (monotonic() - begin) / SHARE_OF_SAVING

    @contextmanager
    def change(self) -> Iterator[None]:
        """Changes that belong together: all of them are saved, or none.

        What an error leaves is not saved any more.
        """
        if not self._writable:
            raise ValueError(f"{self.path} is open for reading alone.")
        outer, self._sound, self._unsaved = self._sound, False, True
        yield
        self._sound = outer
        if outer and monotonic() >= self._next_save:
            self.save()

    def put_checkpoint(self, **arrays: NDArray | int) -> None:
        """Keep the state of a run that is under way, in place of the last one; none for a run that is over."""
        with self.change():
            if "checkpoint" in self._file:
                del self._file["checkpoint"]
            for name, value in arrays.items():
                self._file[f"checkpoint/{name}"] = value

    @property
    def checkpoint(self) -> dict[str, NDArray]:
        """The state of a run that is under way, by name; empty if there is none."""
        return {name: item[()] for name, item in self._file.get("checkpoint", {}).items()}

    def close(self) -> None:
        """Save and close the file."""
        if self._file:
            self.save()
            self._file.close()

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def new_file() -> h5py.File:
    """An empty file in memory."""
    import h5py

    return h5py.File("new", "w", driver="core", backing_store=False, block_size=MEMORY_BLOCK, libver=LIBVER)


def write(path: Path, file: h5py.File) -> None:
    """Write a file that is kept in memory, with its checksum and the number of its format."""
    file.attrs[FORMAT_KEY] = FORMAT
    file.flush()
    image = file.id.get_file_image()
    write_whole(path, add_checksum(image), image)


def open_sealed(path: Path, writable: bool = False) -> h5py.File:
    """Open a file that has been checked whole; its content in memory, if it is to be changed.

    Raises PackingFileError if the file is missing, damaged, of a later format, or unpacks to what is not in it.
    """
    import h5py

    if not path.is_file():
        raise PackingFileError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    check_checksum(path)
    try:
        if writable:
            image = read_plain(path)[HEADER_SIZE:]
            file = h5py.File(h5py.h5f.open_file_image(image, flags=h5py.h5f.FILE_IMAGE_OPEN_RW))
        else:
            try:
                file = h5py.File(path, "r", locking=False)
            except OSError:  # another reader in this process, such as MDAnalysis, has it open with locks
                file = h5py.File(path, "r")
    except OSError as error:
        raise PackingFileError(f"{path} is not a readable HDF5 file: {error}.") from error
    try:
        check_format(file.attrs.get(FORMAT_KEY), "it")
        _check_places(file)
    except Exception as error:  # h5py raises nearly every exception there is
        file.close()
        said = str(error).strip().rstrip(".") or type(error).__name__
        cannot = "" if isinstance(error, PackingFileError) else "it cannot be read: "
        raise PackingFileError(f"{path} is refused: {cannot}{said}.") from error
    return file


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
