"""The slices of a spectrum, shared by threads and by processes that search together; and the folder that keeps results.

The eigenvectors of slices take most of the time, and one slice needs nothing of another. So each rank finds the
eigenvectors of its own slices, a run of neighbouring ones, by :mod:`~faultgouge.analysis.factors.lanczos`, and hands
the pairs that may turn complex to the other ranks. All ranks count eigenvalues together, and do the rest alike and in
step. No rank has the vectors of another, and the result is that of one process to the bit.

A slice of 100,000 disks takes 13 s, and its result is small: the motions that may grow, and the eigenvalues that
neighbouring slices must agree on. So the rank that has searched a slice writes one file for it, in one step, and a
search that was cut off goes on from these files. The name of their folder is a checksum of the loads, the operators
there, the limits, and the version of this program, so that results of another packing are never used. A
damaged file is that of a slice that is searched again.
"""

import hashlib
import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from io import BytesIO
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from uuid import uuid4
from zipfile import BadZipFile

import numpy as np
from scipy.sparse import csc_array

from ..arrays import Floats
from ..errors import FaultgougeError
from ..factors.inertia import count_places, places_of_numbers
from ..factors.lanczos import Border, Factorization, Slice, SlicedSpectrum, SliceSizes, compare_slices, factor_shifted
from ..files.atomic_write import make_folder, write_whole
from .motions import System

Mine = TypeVar("Mine")


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Ranks:
    """This process among those that search together; one by itself by default.

    Attributes
    ----------
    rank, size : int
        Number of this process, and how many there are.
    gather : callable
        Anything that pickles -> the list of what all ranks have given, by rank, on each of them.
    workers : int
        Threads of this process.
    """

    rank: int = 0
    size: int = 1
    gather: Callable[[Any], list[Any]] = lambda mine: [mine]
    workers: int = field(default_factory=cores)

    def part(self, count: int) -> slice:
        """Range of neighbouring items that this rank has."""
        return slice(self.rank * count // self.size, (self.rank + 1) * count // self.size)

    def together(self, work: Callable[[], Mine]) -> list[Mine]:
        """The results of the work of all ranks, by rank.

        Raises
        ------
        FaultgougeError
            The first one that a rank has met, on all ranks; at once one of those that end all ranks (`one_rank`).
        """
        try:
            mine: Mine | FaultgougeError = work()
        except FaultgougeError as error:
            if error.one_rank:
                raise
            mine = error
        everyone = self.gather(mine)
        for met in everyone:
            if isinstance(met, FaultgougeError):
                raise met
        return everyone


ALONE = Ranks()
"""One process."""


@dataclass(frozen=True)
class Limits(SliceSizes):
    """Sizes and tolerances of the search of large packings; the defaults are meant for packings."""

    all_windows: int = 300
    """Disks up to which all windows are sought, from all eigenvalues: half a second for a decomposition, which grows
    with the cube of the number. Beyond, the first window is sought in slices of the spectrum."""
    one_basis: int = 1000
    """Coordinates up to which the basis is one dense decomposition: less than a second. Beyond, it comes in
    slices."""
    count_spacing: int = 240
    """Eigenvalues between two places at which they are counted; shifts are interpolated in between."""
    margin: int = 30
    """Further modes of a slice on either side, coupled to its own in all orders. What is farther away changes levels by
    less than (coupling / spacing)^2 / 30 of their spacing."""
    mixing: float = 0.1
    """Typical symmetric coupling within a slice, in level spacings, up to which its basis serves at other loads."""
    reach: float = 0.1
    """Share of an increment by which slices are extrapolated, so that a motion that a slice has grow a little late is
    found in time. Announced onsets are trusted to twice that."""
    window: float = 1e-3
    """Narrowest windows of slices that are looked for, in increments: the slices' own error is larger."""
    excess: float = 0.2
    """Number added to the antisymmetric couplings of a slice, in units of mixing^2 times the spacing of its levels."""
    parts: int = 4
    """Parts of a doubtful increment: four cost little more than two while a basis passes by."""
    depth: int = 2
    """How often parts are divided again; the finest are a sixteenth."""
    largest_basis: float = 3e8
    """Numbers of a basis that is kept from increment to increment, 2.4 GB."""


LIMITS = Limits()
"""The defaults."""


def slices(
    matrix: csc_array,
    margin: int,
    limits: Limits = LIMITS,
    factorise: Callable[[csc_array, float], Factorization] = factor_shifted,
    ranks: Ranks = ALONE,
    known: Sequence[Border] = (),
) -> Iterator[Slice]:
    """Eigenvalues and eigenvectors of a symmetric matrix, slice by slice in the order of the spectrum, without `known`
    slices.

    Each slice has a `margin` of further modes on either side. `factorise` factors matrix - shift. The `ranks` share the
    slices; those of this rank are found. Its threads are also the slices at the most that are under way beyond the one
    that is asked for. All ranks must come to the end of their slices. Raises SliceError if eigenvalues do not converge,
    or neighbouring slices disagree.
    """
    from threadpoolctl import threadpool_limits  # nothing else needs it

    spectrum, size = SlicedSpectrum(matrix, limits, factorise), matrix.shape[0]
    mine: list[Border] = []
    failure: FaultgougeError | None = None
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(ranks.workers) as pool:

        def count_below(places: Floats) -> list[int]:
            own = places[ranks.part(len(places))]
            return [each for one in ranks.together(lambda: list(pool.map(spectrum.below, own))) for each in one]

        places, numbers = count_places(spectrum.matrix, count_below, (0, size), limits.count_spacing)
        pieces = max(1, round(size / limits.slice_size))
        ends = np.arange(pieces + 1) * size // pieces
        borders, found = places_of_numbers(places, numbers, ends), {each.modes for each in known}
        middles = 0.5 * (borders[:-1] + borders[1:])
        wanted = [(float(at), (int(a), int(b))) for at, (a, b) in zip(middles, pairwise(ends), strict=True)]
        wanted = [each for each in wanted if each[1] not in found]
        waiting: deque[Future[Slice]] = deque()

        def next_slice() -> Slice:
            part = waiting.popleft().result()
            mine.append(part.border)
            compare_slices(*mine[-2:])
            return part

        try:
            for shift, own in wanted[ranks.part(len(wanted))]:
                waiting.append(pool.submit(spectrum.slice_about, shift, own, margin))
                if len(waiting) > ranks.workers:
                    yield next_slice()
            while waiting:
                yield next_slice()
        except FaultgougeError as error:
            failure = error

    def borders_found() -> list[Border]:
        if failure is not None:
            raise failure
        return mine

    compare_slices(*sorted(chain(known, *ranks.together(borders_found))))


class Candidate(NamedTuple):
    """A motion that begins to grow in its slice, on the `increment` with this number between some loads.

    It grows from the load `onset` on, and still does at the load `inside`, where `value` is lambda, or s with
    dissipation, and `slope` its change over the load.
    """

    increment: int
    onset: float
    inside: float
    value: complex
    slope: complex


class SliceResult(NamedTuple):
    """What a slice has: its border, the motions that begin to grow in it, increment by increment, and whether dashpots
    couple more of its motions than a slice can hold."""

    border: Border
    candidates: list[Candidate]
    crowded: bool = False


MARK = "taken"
"""An empty file in each folder of results, which says whose it is."""


def keep_result(folder: Path, found: SliceResult) -> None:
    """Write the result of a slice; OutputError if that cannot be."""
    modes, *border = found.border
    motions, content = np.array(found.candidates, complex).reshape(-1, len(Candidate._fields)), BytesIO()
    np.savez(content, modes=modes, border=border, crowded=found.crowded, motions=motions)
    own = folder / f"{uuid4().hex}.new"  # another search may write the same file at the same time
    write_whole(own, content.getvalue())
    own.replace(folder / "{}-{}.npz".format(*modes))


def kept_results(folder: Path) -> list[SliceResult]:
    """The results in a folder by the order of the spectrum, but for those that are damaged."""
    found = []
    damaged = OSError, EOFError, ValueError, TypeError, LookupError, RuntimeError, BadZipFile
    for path in folder.glob("*-*.npz"):
        with suppress(*damaged), np.load(path) as data:
            names = ("modes", "border", "motions", "crowded")
            modes, border, motions, crowded = (data[name].tolist() for name in names)
            candidates = [Candidate(int(k.real), a.real, b.real, *rest) for k, a, b, *rest in motions]
            found.append(SliceResult(Border(tuple(modes), *border), candidates, crowded))
    return sorted(found, key=lambda each: each.border.modes)


def results_folder(parent: Path, places: Sequence[System], limits: Limits) -> Path:
    """Make the folder of the results on the increments between some loads; OutputError if that cannot be."""
    digest = hashlib.sha256(repr((version("faultgouge"), limits, [place.fx for place in places])).encode())
    for matrix in (each for place in places for each in (place.stiffness, place.damping) if each is not None):
        for array in (matrix.data, matrix.indices, matrix.indptr):
            digest.update(np.ascontiguousarray(array).data)
    folder = parent / digest.hexdigest()[:16]
    make_folder(folder)
    (folder / MARK).touch()
    return folder


def remove_results(parent: Path) -> None:
    """Remove folders of results, which have nothing else in them, and the folder that they are in if it is empty."""
    for mark in parent.glob("[0-9a-f]" * 16 + f"/{MARK}"):
        for own in (MARK, "shifts.npz", "[0-9]*-[0-9]*.npz", "[0-9a-f]" * 32 + ".new"):
            for path in mark.parent.glob(own):
                path.unlink(missing_ok=True)
        with suppress(OSError):  # it holds what others have put there
            mark.parent.rmdir()
    with suppress(OSError):
        parent.rmdir()
