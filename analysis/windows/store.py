"""Results of a search in the slices of a spectrum, and the folder that keeps them.

A *pass* goes through all slices of the spectrum, for a few neighbouring loads. A slice of 100,000 disks takes 13 s, and
its result is small: the motions that may grow, and the eigenvalues that neighbouring slices must agree on. So the
rank that has searched a slice writes one file for the slice, in one step, and a search that was cut off goes on from
these files. Several searches may share a folder: each takes slices that no other has taken.

The name of a pass's folder is a checksum of the loads, the operators there, the modes, the limits, and the version of
this program, so that results of another packing or version are never used.
"""

import errno
import fcntl
import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from uuid import uuid4
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInputError
from ..factors.lanczos import Border
from ..files.atomic_write import make_folder, write_whole
from .motions import System

Shift = tuple[float, tuple[int, int]]
"""The shift of a slice, and the numbers of the first eigenvalue that belongs to it and of the first that does not."""

Take = Callable[[tuple[int, int]], bool]
"""Takes the slice of some modes, and says whether no other search has it."""

SHIFTS_FILE = "shifts.npz"
"""The file of all shifts: to find these, eigenvalues are counted, which takes minutes for 100,000 disks."""

NAMES_OF_SLICES = 16
"""Hexadecimal digits of the name of a pass's folder."""

LOCK_FILE = "taken"
"""The file whose bytes are locked, each by the search that has taken the slice which begins at so many modes."""

Read = TypeVar("Read")


class DamagedSliceError(BadInputError):
    """The file of a slice cannot be read: one sentence."""


class Candidate(NamedTuple):
    """A motion that begins to grow in its slice.

    Attributes
    ----------
    increment : int
        On which of the increments of the pass.
    onset, inside : float
        The load from which on it grows, and one at which it still does; force per top disk.
    value, slope : complex
        lambda, or s with dissipation, at the load `inside`, and its change over the load.
    """

    increment: int
    onset: float
    inside: float
    value: complex
    slope: complex


class SliceResult(NamedTuple):
    """The result of the search in a slice.

    Attributes
    ----------
    border : Border
        Which slice it is.
    candidates : list of Candidate
        The motions that begin to grow in it, increment by increment.
    crowded : bool
        Whether dashpots couple more of its motions than a slice can hold.
    """

    border: Border
    candidates: list[Candidate]
    crowded: bool = False


@dataclass(frozen=True)
class SlicePass:
    """The results of a pass so far, on all ranks, and the folder that stores them; none by default.

    Attributes
    ----------
    folder : Path or None
        Of the files.
    found : sequence of SliceResult
        The slices that need not be searched again, by the order of the spectrum.
    shifts : sequence of Shift
        Those of all slices; empty where they have to be found.
    """

    folder: Path | None = None
    found: Sequence[SliceResult] = ()
    shifts: Sequence[Shift] = ()

    @classmethod
    def read(cls, folder: Path) -> "SlicePass":
        """Read the results in a folder, if it exists; DamagedSliceError if a file has another format."""

        def result(data: Mapping[str, NDArray]) -> SliceResult:
            first, stop = (int(number) for number in data["modes"])
            motions = [(int(k.real), onset.real, inside.real, *rest) for k, onset, inside, *rest in data["motions"]]
            candidates = [Candidate(k, float(a), float(b), *map(complex, rest)) for k, a, b, *rest in motions]
            return SliceResult(Border((first, stop), *map(float, data["border"])), candidates, bool(data["crowded"]))

        def shifts(data: Mapping[str, NDArray]) -> list[Shift]:
            pairs = zip(data["shift"], data["modes"], strict=True)
            return [(float(shift), (int(first), int(stop))) for shift, (first, stop) in pairs]

        found = [_read(path, result) for path in folder.glob("*-*.npz")]
        kept = folder / SHIFTS_FILE
        found.sort(key=lambda each: each.border.modes)
        return cls(folder, found, _read(kept, shifts) if kept.exists() else ())

    @property
    def borders(self) -> list[Border]:
        """The borders of the known slices."""
        return [each.border for each in self.found]

    @contextmanager
    def lock_slices(self) -> Iterator[Take]:
        """A function that takes a slice if no other search has it; at the end all slices are given back.

        A taken slice is a locked byte of a file. The system unlocks the bytes of a process that dies. Where there are
        no locks, two searches find the same.
        """
        folder = self.folder
        if folder is None:
            yield lambda modes: True
            return
        make_folder(folder)
        with (folder / LOCK_FILE).open("ab") as taken:

            def take(modes: tuple[int, int]) -> bool:
                try:
                    fcntl.lockf(taken, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, modes[0])
                except OSError as error:
                    return error.errno not in (errno.EAGAIN, errno.EACCES)
                return not (folder / "{}-{}.npz".format(*modes)).exists()

            yield take

    def keep(self, found: SliceResult) -> None:
        """Write the results of a slice, if there is a folder; OutputError if the file cannot be written."""
        modes, *border = found.border
        motions = np.array(found.candidates, complex).reshape(-1, len(Candidate._fields))
        self._write("{}-{}.npz".format(*modes), modes=modes, border=border, crowded=found.crowded, motions=motions)

    def keep_shifts(self, shifts: Sequence[Shift]) -> None:
        """Write the shifts of all slices, if there is a folder; an OutputError if that cannot be."""
        self._write(SHIFTS_FILE, shift=[shift for shift, _ in shifts], modes=[modes for _, modes in shifts])

    def _write(self, name: str, **arrays: Any) -> None:
        if self.folder is not None:
            content = BytesIO()
            np.savez(content, **arrays)
            make_folder(self.folder)
            own = self.folder / f"{uuid4().hex}.new"  # another search may write the same file at the same time
            write_whole(own, content.getvalue())
            own.replace(self.folder / name)


def _read(path: Path, convert: Callable[[Mapping[str, NDArray]], Read]) -> Read:
    try:
        with np.load(path) as data:
            return convert(data)
    except (OSError, EOFError, ValueError, TypeError, LookupError, RuntimeError, BadZipFile) as error:
        raise DamagedSliceError(
            f"{path} is damaged: delete the file, and what it had is searched for again."
        ) from error


NEW_PASS = SlicePass()
"""A pass without results and without a folder."""


def pass_folder(parent: Path, places: Sequence[System], modes: tuple[int, int], limits: object) -> Path:
    """Folder of the results on the increments between some loads."""
    digest = hashlib.sha256(repr((version("faultgouge"), modes, limits)).encode())
    for place in places:
        digest.update(repr(place.fx).encode())
        for matrix in [each for each in (place.stiffness, place.damping) if each is not None]:
            for array in (matrix.data, matrix.indices, matrix.indptr):
                digest.update(np.ascontiguousarray(array).data)
    return parent / digest.hexdigest()[:NAMES_OF_SLICES]


def remove_passes(parent: Path) -> None:
    """Remove the folders of passes, which have nothing else in them, and the folder that they are in if it is empty."""
    for folder in parent.glob("[0-9a-f]" * NAMES_OF_SLICES):
        if (folder / LOCK_FILE).is_file():
            for path in folder.iterdir():
                if path.name in (LOCK_FILE, SHIFTS_FILE) or re.fullmatch(r"\d+-\d+\.npz|[0-9a-f]{32}\.new", path.name):
                    path.unlink(missing_ok=True)
            with suppress(OSError):  # it holds what others have put there
                folder.rmdir()
    with suppress(OSError):
        parent.rmdir()
