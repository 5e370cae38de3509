"""The first window of a large packing, in slices of the spectrum.

Motions mix with their neighbours in the spectrum only. The eigenvectors X of the symmetric part of A at one load, a
slice of 120 neighbouring modes with `Limits.margin` more on either side, make A and G small: :math:`X^T A X` and
:math:`X^T G X`, which are taken as a straight line between two loads. The search of small packings finds the windows
of this small family, and so *announces* motions that begin to grow. The system itself confirms each: the same search,
with the few eigenvalues next to the announced one (`Motions.near`) in place of all. So an edge has the same digits as
in the search among all modes. A basis serves as long as its symmetric couplings are small against the spacing of
levels.

**Where slices are wrong.** Between two loads the small family is a straight line, which the system is not where
contacts open, close or slide. What is announced is then not there, or elsewhere, and the increment is divided. The
finest parts that are still in doubt are named with the result. Strong dashpots couple more motions than a slice can
hold: all loads before the window are then named.

The eigenvectors of slices take most of the time, and one slice needs nothing of another: ranks share them
(:mod:`~faultgouge.analysis.windows.slices`).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import chain, pairwise
from pathlib import Path
from typing import NoReturn

import numpy as np
from scipy.linalg import LinAlgError, eigh
from scipy.sparse import csc_array, csr_array

from ..arrays import Floats, Indices
from ..errors import NoEquilibriumError
from ..factors.lanczos import Slice
from ..progress import report_progress
from .edges import DoubtError
from .motions import Motions, System
from .onset import Increments, Window
from .quiet import Quiet
from .search import Search
from .slices import (
    ALONE,
    LIMITS,
    Candidate,
    Limits,
    Ranks,
    SliceResult,
    keep_result,
    kept_results,
    results_folder,
    slices,
)


class _LostError(Exception):
    """A motion cannot be followed to another load."""


class SlicedSearch:
    """The search for the first window of a family of large systems.

    Parameters
    ----------
    at : callable
        Load -> System.
    ranks, folder, limits
        As of :func:`~faultgouge.analysis.find_onset`.
    """

    def __init__(
        self, at: Callable[[float], System], ranks: Ranks = ALONE, folder: Path | None = None, limits: Limits = LIMITS
    ) -> None:
        self.at, self.ranks, self.folder, self.limits = at, ranks, folder, limits
        self.doubtful: list[tuple[float, float]] = []
        self.passed: list[System] = []
        self.crowded = False
        self._kept: list[Slice] = []

    def first_window(self, loads: Floats) -> tuple[Window | None, Increments]:
        """The first window along a ramp, if there is one, and the increments before it that are in doubt.

        Loads beyond the one above the onset are not asked for. The window's end is None where its motion grows at the
        next load. Raises NoEquilibriumError if a load has none before a motion is seen to grow, and SliceError if a
        part of the spectrum is not found.
        """
        here, first = self.at(float(loads[0])), None
        for load in loads[1:]:
            there = self.at(float(load))
            first = self._walk([here, there], 0)
            here = there
            if first is not None:
                break
        last = here.fx if first is None else first.fx_onset
        if self.crowded and last > loads[0]:
            self.doubtful = [(float(loads[0]), max(each.fx for each in self.passed))]
        return first, tuple(each for each in self.doubtful if each[0] < last)

    def _walk(self, places: Sequence[System], depth: int) -> Window | None:
        """The first window on some increments: parts of one that was divided `depth` times."""
        candidates = self._announced(places)
        for k, (here, there) in enumerate(pairwise(places)):
            if not self.passed or self.passed[-1].fx < here.fx:
                self.passed.append(here)
            own = sorted((each for each in candidates if each.increment == k), key=lambda each: each.onset)
            window, doubt = self._earliest(own, here, there, depth == self.limits.depth)
            parts: list[System] = []
            if doubt and depth < self.limits.depth:
                inside = here.fx + (there.fx - here.fx) * np.arange(1, self.limits.parts) / self.limits.parts
                with suppress(NoEquilibriumError):  # one of the parts has no equilibrium at its end
                    parts = [self.at(float(load)) for load in inside]
            if parts:
                window = self._walk([here, *parts, there], depth + 1) or window
            elif doubt:
                self.doubtful.append((here.fx, there.fx))
            if window is not None:
                return window
        return None

    def _earliest(
        self, candidates: list[Candidate], here: System, there: System, finest: bool
    ) -> tuple[Window | None, bool]:
        """The first window of the system itself among those announced, and whether it is in doubt.

        On the finest increments the search goes on at a doubt, and raises the error behind it if it finds no window. A
        motion that grows at the lower load already, as no slice has seen, is followed back along the loads that were
        passed.
        """
        off, first, doubt = 2 * self.limits.reach * (there.fx - here.fx), None, False
        places = [there, *(each for each in reversed(self.passed) if each.fx <= here.fx)]
        missing: NoEquilibriumError | None = None
        for candidate in candidates:
            if first is not None and candidate.onset > first.fx_onset + off:
                break
            report_progress(f"a motion that may grow from about F_x = {candidate.onset:.6g}: its onset")
            window: Window | None = None
            try:
                for above, below in pairwise(places):
                    window = next(iter(self._windows_near(candidate, below, above)), None)
                    if window is None or window.kind != "start":
                        break
            except (NoEquilibriumError, _LostError) as error:
                window, doubt = None, True
                missing = error if isinstance(error, NoEquilibriumError) else missing
            if window is not None and (first is None or window.fx_onset < first.fx_onset):
                doubt = doubt or (window.fx_onset > here.fx and abs(window.fx_onset - candidate.onset) > off)
                first = window
            if doubt and not finest:
                break
        if finest and first is None and missing is not None:
            raise missing
        return first, doubt

    def _windows_near(self, candidate: Candidate, here: System, there: System) -> Sequence[Window]:
        """The windows of the few motions next to an announced one."""
        known = {each.fx: each for each in (here, there)}

        def few(*systems: System) -> tuple[Motions, Motions]:
            values = [candidate.value + candidate.slope * (each.fx - candidate.inside) for each in systems]
            if here.damping is None:
                values = [each.real for each in values]
            try:
                below, above = (Motions.near(*each) for each in zip(systems, [[(v, 10)] for v in values], strict=True))
            except LinAlgError:
                raise DoubtError from None
            return below, above

        def lost(system: System) -> NoReturn:
            raise _LostError

        narrowest = 1e-7 * max(abs(here.fx), abs(there.fx))
        search = Search(lambda fx: known.get(fx) or self.at(fx), narrowest, few, decompose=lost)
        inside = [candidate.inside] if here.fx < candidate.inside < there.fx else []
        *_, (_, found) = search.along(np.array([here.fx, *inside, there.fx]))
        return found

    def _announced(self, places: Sequence[System]) -> list[Candidate]:
        """The motions that slices announce, of all ranks, and those that a search that was cut off has left."""
        count, folder = len(places[0].active), None
        if self.folder is not None and not self._keeps(places[0]):  # later increments need bases that are kept
            folder = results_folder(self.folder, places, self.limits)
        root = self.ranks.rank == 0
        stored = self.ranks.together(lambda: kept_results(folder) if folder is not None and root else [])[0]
        before = sum(each.border.size for each in stored)
        where = f"F_x from {places[0].fx:.6g} to {places[-1].fx:.6g}"
        report_progress(f"{where}: {before} of {count} modes are known")

        def search_slices() -> Iterator[SliceResult]:
            """Those of this rank."""
            done, wanted = (-(-modes // self.ranks.size) for modes in (before, count))
            for basis in self._bases(places[0], stored):
                done += basis.own.stop - basis.own.start
                report_progress(f"{where}: {min(done, wanted)} of {wanted} modes")
                found = self._search_slice(basis, places)
                if folder is not None:
                    keep_result(folder, found)
                yield found

        every = self.ranks.together(lambda: list(search_slices()))
        self.crowded |= any(each.crowded for each in chain(stored, *every))
        return [candidate for each in chain(stored, *every) for candidate in each.candidates]

    def _search_slice(self, basis: Slice, places: Sequence[System]) -> SliceResult:
        """The windows of the small families between the loads, of one slice's own motions."""
        blocks = [reduce_system(basis.vectors, each, places[0].active) for each in places]
        damped = len(blocks[0]) == 2
        if not damped and len(blocks[0][0]) < len(places[0].active):
            blocks = [[_with_larger_feed(block, self.limits.excess)] for (block,) in blocks]
        quiet, found = Quiet(), []
        own, spacing = basis.values[basis.own], basis.border.spacing
        for k, (here, there) in enumerate(pairwise(places)):
            span = there.fx - here.fx

            def small(fx: float, k: int = k, begin: float = here.fx, span: float = span) -> System:
                share = (fx - begin) / span
                return System(fx, *((1 - share) * a + share * b for a, b in zip(*blocks[k : k + 2], strict=True)))

            last = there.fx + self.limits.reach * span
            search = Search(small, self.limits.window * span, quiet if damped else None)
            *_, (_, windows) = search.along(np.array([here.fx, last]))
            for window in windows:
                if not own[0] - spacing <= window.frequency**2 <= own[-1] + spacing:
                    continue  # twice is better than not at all, where two slices meet
                end = last if window.fx_end is None else window.fx_end
                inside = there.fx if window.fx_onset < there.fx <= end else 0.5 * (window.fx_onset + end)
                state = Motions.of(small(inside))
                growing = np.flatnonzero(state.grows)
                if len(growing):
                    apart = state.values[growing] - window.onset.eigenvalue
                    j = growing[np.argmin(np.abs(apart.imag if damped else apart.real))]
                    slope = state.slopes(small(here.fx if inside > here.fx else last))[j]
                    found.append(Candidate(k, window.fx_onset, inside, complex(state.values[j]), complex(slope)))
        return SliceResult(basis.border, found, quiet.crowded)

    def _keeps(self, place: System) -> bool:
        """Whether there is memory for the bases of all modes."""
        count = len(place.active)
        margins = 2 * self.limits.margin * max(1, round(count / self.limits.slice_size))
        return (count + margins) * count <= self.limits.largest_basis

    def _bases(self, place: System, stored: Sequence[SliceResult]) -> Iterator[Slice]:
        """The bases of this rank's slices; those of an earlier load as long as those of all ranks serve."""
        mine = [_mixing(each, place) for each in self._kept]
        mixing = [each for one in self.ranks.together(lambda: mine) for each in one]
        if mixing and max(mixing) < np.inf and np.median(mixing) < self.limits.mixing:
            yield from self._kept
            return
        self._kept, keeps = [], self._keeps(place)  # its memory is free before that for the next ones is taken
        matrix = csr_array(place.inner[0])
        symmetric, count = csc_array(0.5 * (matrix + matrix.T)), len(place.active)
        bases: Iterator[Slice] = iter(())
        if count > self.limits.one_basis:
            borders = [each.border for each in stored]
            bases = slices(symmetric, self.limits.margin, self.limits, ranks=self.ranks, known=borders)
        elif self.ranks.rank == 0 and not stored:  # a small operator has one
            values, vectors = eigh(symmetric.toarray(), driver="evd", overwrite_a=True, check_finite=False)
            bases = iter([Slice(0, values, vectors, slice(0, count))])
        if keeps:
            self._kept = list(bases)
        yield from self._kept if keeps else bases


def reduce_system(vectors: Floats, system: System, active: Indices) -> list[Floats]:
    """X^T A X and, with dissipation, X^T G X."""
    matrices = [system.stiffness] if system.damping is None else [system.stiffness, system.damping]
    return [vectors.T @ (csr_array(each)[active][:, active] @ vectors) for each in matrices]


def _mixing(basis: Slice, place: System) -> float:
    """The typical symmetric coupling of a basis over the spacing of its levels; a new basis has none."""
    if len(basis.vectors) != len(place.active):
        return np.inf
    block = reduce_system(basis.vectors, System(place.fx, place.stiffness), place.active)[0]
    symmetric = 0.5 * (block + block.T)
    symmetric -= np.diag(np.diag(symmetric))
    shares = []
    for each in np.array_split(np.arange(len(block)), max(1, len(block) // 60)):
        width = max(float(np.ptp(basis.values[each])), np.finfo(float).tiny)
        shares.append(np.linalg.norm(symmetric[np.ix_(each, each)]) / width)
    return float(np.median(shares))


def _with_larger_feed(block: Floats, excess: float) -> Floats:
    """A in a slice with its antisymmetric couplings enlarged by their error, so that pairs are announced early.

    Modes beyond the slice, and its third order, change the difference of symmetric and antisymmetric couplings by a
    tenth of mixing^2 times the spacing of levels (360 disks).
    """
    levels = np.diag(block)
    width = max(float(np.ptp(levels)), np.finfo(float).tiny)
    mixing = float(np.linalg.norm(block - np.diag(levels))) / width
    return np.asarray(block + excess * mixing**2 * width / len(block) * np.sign(block - block.T))
