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
from typing import Any, NamedTuple
from uuid import uuid4
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInputError
from ..factors.lanczos import Border
from ..files.atomic_write import make_folder, write_whole
from .limits import Limits
from .system import System

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


class DamagedSliceError(BadInputError):
    """The file of a slice cannot be read: one sentence."""


class Candidate(NamedTuple):
    """A motion that begins to grow in its slice.

    Attributes
    ----------
    onset, inside : float
        The load from which on it grows, and one at which it still does; force per top disk.
    value, slope : complex
        lambda, or s with dissipation, at the load `inside`, and its change over the load.
    """

    onset: float
    inside: float
    value: complex
    slope: complex

    def expected(self, fx: float, real: bool) -> complex:
        """Where its eigenvalue is at another load, or the real part of a pair."""
        value = self.value + self.slope * (fx - self.inside)
        return value.real if real else value


@dataclass(frozen=True, eq=False)
class SliceResult:
    """The result of the search in a slice.

    Attributes
    ----------
    border : Border
        Which slice it is.
    candidates : sequence of sequence of Candidate
        The motions that begin to grow in it, increment by increment.
    crowded : bool
        Whether dashpots couple more of its motions than a slice can hold.
    """

    border: Border
    candidates: Sequence[Sequence[Candidate]]
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
        found = sorted((_read_candidates(path) for path in folder.glob("*-*.npz")), key=lambda each: each.border.modes)
        shifts = folder / SHIFTS_FILE
        return cls(folder, found, _shifts(shifts) if shifts.exists() else ())

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
                return not (folder / _name(modes)).exists()

            yield take

    def keep(self, found: SliceResult) -> None:
        """Write the results of a slice, if there is a folder; OutputError if the file cannot be written."""
        flat = [(k, each) for k, candidates in enumerate(found.candidates) for each in candidates]
        self._write(
            _name(found.border.modes),
            modes=found.border.modes,
            border=found.border[1:],
            crowded=found.crowded,
            increments=len(found.candidates),
            increment=[k for k, _ in flat],
            motions=np.array([each for _, each in flat], complex),
        )

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


NEW_PASS = SlicePass()
"""A pass without results and without a folder."""


def pass_folder(parent: Path, places: Sequence[System], modes: tuple[int, int], limits: Limits) -> Path:
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


def _name(modes: tuple[int, int]) -> str:
    """The file of a slice."""
    return f"{modes[0]}-{modes[1]}.npz"


def _read_candidates(path: Path) -> SliceResult:
    with _open_slice(path) as data:
        first, stop = (int(number) for number in data["modes"])
        candidates: list[list[Candidate]] = [[] for _ in range(int(data["increments"]))]
        for k, (onset, inside, *motion) in zip(data["increment"], data["motions"], strict=True):
            candidates[int(k)].append(Candidate(float(onset.real), float(inside.real), *map(complex, motion)))
        border = Border((first, stop), *(float(each) for each in data["border"]))
        return SliceResult(border, candidates, bool(data["crowded"]))


def _shifts(path: Path) -> list[Shift]:
    with _open_slice(path) as data:
        pairs = zip(data["shift"], data["modes"], strict=True)
        return [(float(shift), (int(first), int(stop))) for shift, (first, stop) in pairs]


@contextmanager
def _open_slice(path: Path) -> Iterator[Mapping[str, NDArray]]:
    try:
        with np.load(path) as data:
            yield data
    except (OSError, EOFError, ValueError, TypeError, LookupError, RuntimeError, BadZipFile) as error:
        raise DamagedSliceError(
            f"{path} is damaged: delete the file, and what it had is searched for again."
        ) from error
