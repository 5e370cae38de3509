"""The search for the first window of a large packing, in slices of the spectrum.

Modes mix with their neighbours in the spectrum only. In the eigenbasis of one load, slice by slice
(:mod:`~faultgouge.analysis.windows.slices.eigenbasis`), perturbation theory names the motions that may change, few of
thousands. The *cluster* of neighbouring modes about each of these, interpolated between two loads, is a small system
whose windows the search of small packings finds. What clusters announce is confirmed with the system itself; so an edge
has the same digits as in the search among all modes.

**Where the clusters are wrong.** Between two loads the projected system is taken to be a straight line, which it is not
where contacts open, close or slide. The system itself then contradicts the clusters: the announced motion is not there,
cannot be followed, or begins to grow elsewhere. The increment is divided. The finest parts that are still in doubt are
named with the result. Elsewhere the onsets of clusters were within a tenth of an increment of the confirmed ones
(packings of 1,000 disks, increments of 1e-3).
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial
from itertools import chain, pairwise
from pathlib import Path

import numpy as np

from ...arrays import Floats
from ...errors import FaultgougeError, NoEquilibriumError
from ...progress import report_progress
from ..edges import (
    DoubtError,
    Edge,
    Increments,
    LostPairError,
    SystemOfLoad,
    Window,
    edge_from_inside,
    follow_to,
    leads_back,
)
from ..limits import LIMITS, Limits
from ..space import Space
from ..system import System
from .eigenbasis import Bases, Basis, Levels
from .ranks import ALONE, Ranks
from .store import NEW_PASS, Candidate, SlicePass, SliceResult, pass_folder


class SliceSearch(ABC):
    """The search for the first window of a family of large systems.

    Parameters
    ----------
    at : callable
        Load -> System.
    modes, ranks, folder, limits
        As of :func:`~faultgouge.analysis.find_onset`.
    """

    locates = True
    """Whether clusters tell where a window begins, and not only that it does."""

    def __init__(
        self,
        at: SystemOfLoad,
        modes: tuple[int, int] | None = None,
        ranks: Ranks = ALONE,
        folder: Path | None = None,
        limits: Limits = LIMITS,
    ) -> None:
        self.at, self.limits, self.ranks = at, limits, ranks
        self.folder = folder
        self.bases = Bases(modes, ranks, limits)
        self.first: Window | None = None
        self.doubtful: list[tuple[float, float]] = []
        self.passed: list[System] = []

    @abstractmethod
    def look_at_basis(self, basis: Basis, levels: Levels, places: Sequence[System]) -> SliceResult:
        """The motions that a basis announces between some loads; `levels` are A at the first load."""

    @abstractmethod
    def growing_motion(self, candidate: Candidate, there: System) -> Space | None:
        """The announced motion of the system itself at a load where the motion grows; None if it surely never grows.

        `there` is the end of the increment. A DoubtError, a LostPairError or a NoEquilibriumError says that this is
        open.
        """

    @property
    def finished(self) -> bool:
        """Whether the first window has been found."""
        return self.first is not None

    def ahead(self, done: int) -> int:
        """Increments that are looked at while bases that are not kept pass by, after so many others."""
        return self.limits.increments_ahead

    def along(self, loads: Floats) -> None:
        """Walk along a ramp, to the first window or to the last load.

        Loads beyond the one above the onset are not asked for, except those of `Limits.increments_ahead` increments; a
        NoEquilibriumError at one of them is raised if no window has been found before.
        """
        here = self.at(float(loads[0]))
        done = 1
        while done < len(loads) and not self.finished:
            ahead = 1 if self.bases.keeps(here.matrices[0]) else self.ahead(done)
            places = [here, *self._reach_loads(loads[done : done + ahead])]
            self._walk(places, 0)
            here = places[-1]
            done += len(places) - 1

    def first_window(self, loads: Floats) -> tuple[Window | None, Increments]:
        """The first window along a ramp, and the increments before it that are in doubt."""
        self.along(loads)
        first = self.first
        return first, tuple(each for each in self.doubtful if first is None or each[0] < first.fx_onset)

    def _reach_loads(self, loads: Floats) -> list[System]:
        """The systems at loads as far as there are equilibria; the error if there is none at the first."""
        places: list[System] = []
        for load in loads:
            try:
                places.append(self.at(float(load)))
            except NoEquilibriumError:
                if not places:
                    raise
                break
        return places

    def _walk(self, places: Sequence[System], depth: int) -> None:
        """Go from the first to the last of two or more places: parts of an increment that was divided `depth` times."""
        for (here, there), candidates in zip(pairwise(places), self.candidates(places, depth), strict=True):
            window, between = self._confirm(candidates, here, there, depth)
            if between:
                self._walk([here, *between, there], depth + 1)
            if window is not None and (self.first is None or window.fx_onset < self.first.fx_onset):
                self.first = window
            if self.finished:
                return

    # What clusters announce

    def candidates(self, places: Sequence[System], depth: int) -> list[list[Candidate]]:
        """The motions that the clusters of all ranks announce on each increment, by increasing onset."""
        increments = zip(*(each.candidates for each in self.found_by_all(places)), strict=True)
        return [sorted(chain(*each), key=lambda candidate: candidate.onset) for each in increments]

    def found_by_all(self, places: Sequence[System]) -> list[SliceResult]:
        """Results of the slices of all ranks, in the order of the spectrum; waits for the slices of other searches."""
        first, stop = self.bases.range(places[0].matrices[0])
        while True:
            stored = self._stored_slices(places)
            fresh = self.ranks.together(partial(self._search_slices, places, stored))
            found = sorted(chain(stored.found, *fresh), key=lambda each: each.border.modes)
            if stored.folder is None or sum(each.border.size for each in found) == stop - first:
                return found
            if not any(fresh):
                time.sleep(self.limits.wait_seconds)

    def _stored_slices(self, places: Sequence[System]) -> SlicePass:
        """Results that other searches have left; none if bases are kept, since later increments need them."""
        matrix = places[0].matrices[0]
        if self.folder is None or self.bases.keeps(matrix):
            return NEW_PASS
        folder = pass_folder(self.folder, places, self.bases.range(matrix), self.limits)
        return self.ranks.together(lambda: SlicePass.read(folder) if self.ranks.rank == 0 else NEW_PASS)[0]

    def _search_slices(self, places: Sequence[System], stored: SlicePass) -> list[SliceResult]:
        """Results of this rank's slices, without the slices that are stored."""
        found: list[SliceResult] = []
        first, stop = self.bases.range(places[0].matrices[0])
        before = sum(each.size for each in stored.borders)
        done, wanted = (-(-modes // self.ranks.size) for modes in (before, stop - first))
        failure: FaultgougeError | None = None
        where = f"F_x from {places[0].fx:.6g} to {places[-1].fx:.6g}"
        report_progress(
            f"{where}: {f'{before} of {stop - first} modes are known' if stored.shifts else 'modes are counted'}"
        )
        for basis, levels in self.bases.at(places[0].matrices[0], stored):
            done += basis.own.stop - basis.own.start
            report_progress(f"{where}: {min(done, wanted)} of {wanted} modes")
            try:
                found.append(self.look_at_basis(basis, levels, places))
            except FaultgougeError as error:
                failure = failure or error  # it waits: the ranks meet at the end of their bases
                continue
            stored.keep(found[-1])
        if failure is not None:
            raise failure
        return found

    # What the system itself has

    def _confirm(
        self, candidates: list[Candidate], here: System, there: System, depth: int
    ) -> tuple[Window | None, list[System]]:
        """The first window of the candidates; and parts of the increment, if that window is in doubt."""
        if not self.passed or self.passed[-1].fx != here.fx:
            self.passed.append(here)
        finest = depth == self.limits.depth
        window, doubt = self._earliest(candidates, there, finest)
        between = self._parts(here, there) if doubt and not finest else []
        if doubt and not between:
            self.doubtful.append((here.fx, there.fx))
        return window, between

    def _parts(self, here: System, there: System) -> list[System]:
        """Where an increment is divided; nowhere if one of the parts has no equilibrium at its end."""
        loads = here.fx + (there.fx - here.fx) * np.arange(1, self.limits.parts) / self.limits.parts
        try:
            return [self.at(load) for load in loads]
        except NoEquilibriumError:
            return []

    def _earliest(self, candidates: list[Candidate], there: System, finest: bool) -> tuple[Window | None, bool]:
        """The first window of the system itself, and whether it is in doubt.

        The search ends at a doubt. On the finest increments the search goes on, and raises the error behind the doubt
        if it finds no window.
        """
        here = self.passed[-1]
        # error of loads that clusters locate, as a share of the way or of the increment
        off = 2 * self.limits.cluster_reach
        first: Window | None = None
        lost: Exception | None = None
        doubt = False
        for candidate in candidates:
            beyond = first is not None and candidate.onset - here.fx > (1 + off) * (first.fx_onset - here.fx)
            if self.locates and beyond:
                break
            try:
                window = self._window_of(candidate, there, first)
            except (NoEquilibriumError, LostPairError, DoubtError) as error:
                window, doubt = None, True
                lost = lost if isinstance(error, DoubtError) else error
            if window is not None:
                elsewhere = self.locates and abs(window.fx_onset - candidate.onset) > off * (there.fx - here.fx)
                doubt = doubt or (elsewhere and window.fx_onset > here.fx)
                if first is None or window.fx_onset < first.fx_onset:
                    first = window
            if doubt and not finest:
                break
        if finest and first is None and lost is not None:
            raise lost
        return first, doubt

    def _window_of(self, candidate: Candidate, there: System, first: Window | None) -> Window | None:
        """Confirm a cluster's window with the system itself; None if there is none, or an earlier one is known."""
        inside = self.growing_motion(candidate, there)
        if inside is None or (first is not None and self.opens_later(inside, first)):
            return None
        above = follow_to(inside, there, self.limits)
        end = None if above.grows else edge_from_inside(self.at, above, inside, self.limits)
        return self.follow_back(inside, self.passed, end)

    def follow_back(self, inside: Space, passed: Sequence[System], end: Edge | None = None) -> Window:
        """The window of a motion that grows, followed back along the loads that were passed."""
        for place in reversed(passed):
            below = follow_to(inside, place, self.limits)
            if not below.grows:
                return Window(edge_from_inside(self.at, below, inside, self.limits), end)
            inside = below
        return Window(Edge.start(inside), end)

    def opens_later(self, inside: Space, first: Window) -> bool:
        """Whether a motion does not grow yet where the first window so far opens."""
        if inside.fx <= first.fx_onset:
            return False
        below = follow_to(inside, self.at(first.fx_onset), self.limits)
        return not below.grows and leads_back(below, inside, self.limits)
