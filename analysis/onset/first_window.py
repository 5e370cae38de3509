"""The search for the first window of a large packing: the oracles that look at slices of the spectrum.

Modes mix with their neighbours in the spectrum only. In the eigenbasis of one load, slice by slice
(:mod:`~faultgouge.analysis.onset.eigenbasis`), perturbation theory names the pairs that may meet, few of thousands. The
*cluster* of neighbouring modes about each of these, interpolated between two loads, is searched for all of its windows
as a small packing is. What clusters announce is confirmed with the operator itself; so an edge has the same digits as
in the search among all modes.

**Where the clusters are wrong.** Between two loads the projected operator is taken to be a straight line, which it is
not where contacts open, close or slide. What the operator has instead shows it: the announced pair is not there, cannot
be followed, or turns complex elsewhere. The walker then divides the increment. What is in doubt even in the finest
parts is handed out with the result. Elsewhere the onsets of clusters were within a tenth of an increment of the
confirmed ones (packings of 1,000 disks, increments of 1e-3).

**Edges.** A real pair may exchange partners with a third mode within an increment. A complex pair is the only one of
its kind, so a pair is followed from inside of its window to the edge.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain, pairwise
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from ..errors import FaultgougeError, NoEquilibriumError
from ..packing.packing import Floats
from ..progress import report_progress
from .all_windows import all_windows
from .eigenbasis import Bases, Basis, Levels, ModeCluster, width_and_mixing
from .eigenvalue_pair import Pair, continue_pair
from .limits import LIMITS, Limits
from .march import march
from .modes import LoadPoint
from .perturbation_screening import may_meet
from .ranks import ALONE, Ranks
from .slice_store import NEW_PASS, Candidate, OperatorAtLoad, SlicePass, SliceResult, pass_folder
from .window_edges import (
    DoubtError,
    Edge,
    Family,
    GrowthWindow,
    LostPairError,
    Window,
    edge_from_inside,
    other_sign,
    returns_to_start,
)

At = tuple[float, Levels]
"""A load and the operator there in a basis."""

Increments = tuple[tuple[float, float], ...]
"""From load to load."""


P = TypeVar("P", bound=OperatorAtLoad)
W = TypeVar("W", bound=GrowthWindow)


class SliceSearch(ABC, Generic[P, W]):
    """An oracle; its places are operators, and what it is sure of is a window.

    Parameters
    ----------
    at : callable
        Load -> the operator there.
    modes, ranks, folder, limits
        As of :func:`~faultgouge.analysis.find_onset`.
    """

    locates = True
    """Whether clusters tell where a window begins, and not only that one does."""

    def __init__(
        self,
        at: Callable[[float], P],
        modes: tuple[int, int] | None = None,
        ranks: Ranks = ALONE,
        folder: Path | None = None,
        limits: Limits = LIMITS,
    ) -> None:
        self.at, self.limits, self.ranks = at, limits, ranks
        self.folder = folder
        self.bases = Bases(modes, ranks, limits)
        self.first: W | None = None
        self.doubtful: list[tuple[float, float]] = []
        self._passed: list[P] = []

    @abstractmethod
    def _look_at_basis(self, basis: Basis, levels: Levels, places: Sequence[P]) -> SliceResult:
        """What a basis announces between some places; the operator at the first of them is given in the basis."""

    @abstractmethod
    def _confirm_window(self, candidate: Candidate, there: P, first: W | None) -> W | None:
        """The window of the operator itself in place of that of a cluster; None if it is none, or not the first.

        `there` is the end of the increment. A DoubtError, a LostPairError or a NoEquilibriumError says that one cannot
        tell.
        """

    @property
    def finished(self) -> bool:
        """Whether the first window has been found."""
        return self.first is not None

    def ahead(self, done: int) -> int:
        """Increments that are looked at while bases that are not kept pass by, after so many others."""
        return self.limits.ahead

    def record(self, sure: W) -> None:
        """Take down a window; the one with the smaller onset is the first."""
        if self.first is None or sure.fx_onset < self.first.fx_onset:
            self.first = sure

    # What clusters announce

    def candidates(self, places: Sequence[P], depth: int) -> list[list[Candidate]]:
        """What the clusters of all ranks announce on each increment, by increasing onset."""
        increments = zip(*(each.candidates for each in self._found_by_all(places)), strict=True)
        return [sorted(chain(*each), key=lambda candidate: candidate.onset) for each in increments]

    def _found_by_all(self, places: Sequence[P]) -> list[SliceResult]:
        """What the slices of all ranks have, by the order of the spectrum; those of other searches are waited for."""
        first, stop = self.bases.range(places[0].matrices[0])
        while True:
            known = self._stored_slices(places)
            fresh = self.ranks.together(partial(self._search_slices, places, known))
            found = sorted(chain(known.found, *fresh), key=lambda each: each.border.modes)
            if known.folder is None or sum(each.border.size for each in found) == stop - first:
                return found
            if not any(fresh):
                time.sleep(self.limits.wait)

    def _stored_slices(self, places: Sequence[P]) -> SlicePass:
        """What other searches have left; nothing if bases are kept, as the increments beyond need these."""
        matrix = places[0].matrices[0]
        if self.folder is None or self.bases.keeps(matrix):
            return NEW_PASS
        folder = pass_folder(self.folder, places, self.bases.range(matrix), self.limits)
        return self.ranks.together(lambda: SlicePass.read(folder) if self.ranks.rank == 0 else NEW_PASS)[0]

    def _search_slices(self, places: Sequence[P], known: SlicePass) -> list[SliceResult]:
        """What this rank's slices have, without those that are known."""
        found: list[SliceResult] = []
        first, stop = self.bases.range(places[0].matrices[0])
        before = sum(each.size for each in known.borders)
        done, wanted = (-(-modes // self.ranks.size) for modes in (before, stop - first))
        failure: FaultgougeError | None = None
        where = f"F_x from {places[0].fx:.6g} to {places[-1].fx:.6g}"
        report_progress(
            f"{where}: {f'{before} of {stop - first} modes are known' if known.shifts else 'modes are counted'}"
        )
        for basis, levels in self.bases.at(places[0].matrices[0], known):
            done += basis.own.stop - basis.own.start
            report_progress(f"{where}: {min(done, wanted)} of {wanted} modes")
            try:
                found.append(self._look_at_basis(basis, levels, places))
            except FaultgougeError as error:
                failure = failure or error  # it waits: the ranks meet at the end of their bases
                continue
            known.keep(found[-1])
        if failure is not None:
            raise failure
        return found

    # What the operator has

    def confirm(self, candidates: list[Candidate], here: P, there: P, depth: int) -> tuple[W | None, list[P]]:
        """The first window that one of the candidates has become; parts of the increment where that is in doubt."""
        if not self._passed or self._passed[-1].fx != here.fx:
            self._passed.append(here)
        finest = depth == self.limits.depth
        window, doubt = self._earliest(candidates, there, finest)
        between = self._parts(here, there) if doubt and not finest else []
        if doubt and not between:
            self.doubtful.append((here.fx, there.fx))
        return window, between

    def _parts(self, here: P, there: P) -> list[P]:
        """Where an increment is divided; nowhere if one of the parts has no equilibrium at its end."""
        loads = here.fx + (there.fx - here.fx) * np.arange(1, self.limits.parts) / self.limits.parts
        try:
            return [self.at(load) for load in loads]
        except NoEquilibriumError:
            return []

    def _earliest(self, candidates: list[Candidate], there: P, finest: bool) -> tuple[W | None, bool]:
        """The first window of the operator itself, and whether that is in doubt, at which the search ends.

        On the finest increments it goes on, and an error is raised if no window has been found beside it.
        """
        here = self._passed[-1]
        off = 2 * self.limits.reach  # of what clusters locate, in shares of the way or of the increment
        first: W | None = None
        lost: Exception | None = None
        doubt = False
        for candidate in candidates:
            beyond = first is not None and candidate.onset - here.fx > (1 + off) * (first.fx_onset - here.fx)
            if self.locates and beyond:
                break
            try:
                window = self._confirm_window(candidate, there, first)
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


class SlicedPairs(SliceSearch[LoadPoint, Window]):
    """The oracle of complex pairs of a family of matrices."""

    def __init__(self, family: Family, modes: tuple[int, int] | None, ranks: Ranks, folder: Path | None) -> None:
        super().__init__(family.at, modes, ranks, folder, family.limits)
        self.family = family

    def _look_at_basis(self, basis: Basis, levels: Levels, places: Sequence[LoadPoint]) -> SliceResult:
        """The pairs of a basis that turn complex in their clusters."""
        found = []
        for here, there in pairwise(places):
            before, levels = levels, basis.change(levels, there.matrix - here.matrix)
            found.append(list(self._announce_pairs(basis, (here.fx, before), (there.fx, levels))))
        return SliceResult(basis.border, found)

    def _announce_pairs(self, basis: Basis, here: At, there: At) -> Iterator[Candidate]:
        """The pairs of a basis that turn complex in their clusters."""
        named = may_meet(here[1], here[1].beyond(there[1], 1 + self.limits.reach), self.limits.slack)
        for cluster in basis.clusters:
            first, last = (cluster.modes.start + end for end in cluster.core)
            if np.any((named >= first) & (named <= last)):
                yield from self._search_cluster(basis, cluster, here, there)

    def _search_cluster(self, basis: Basis, cluster: ModeCluster, here: At, there: At) -> Iterator[Candidate]:
        """The windows of one cluster, with its blocks interpolated between two loads."""
        increment = there[0] - here[0]
        before, after = (levels.block(cluster) for _, levels in (here, there))
        if len(before) < len(basis.active):
            before, after = (_memory_exceeded(block, self.limits.excess) for block in (before, after))

        def block(fx: float) -> Floats:
            share = (fx - here[0]) / increment
            return (1 - share) * before + share * after

        last = there[0] + self.limits.reach * increment
        family = Family(block, self._narrowest(increment), self.limits)
        for window in all_windows(family, np.array([here[0], last])):
            end = last if window.fx_end is None else window.fx_end
            inside = there[0] if window.fx_onset < there[0] <= end else 0.5 * (window.fx_onset + end)
            modes = family.at(inside).modes
            pair = modes.pair(modes.about(window.eigenvalue, modes.complex_pairs))
            if cluster.owns(pair.right):
                right, left = (basis.lift(cluster.modes, plane) for plane in (pair.right, pair.left))
                yield Candidate(window.fx_onset, min(inside, there[0]), right, left)

    def _narrowest(self, increment: float) -> float:
        """The narrowest windows that are looked for on an increment, force."""
        return max(self.family.narrowest, self.limits.finest * increment)

    def _confirm_window(self, candidate: Candidate, there: LoadPoint, first: Window | None) -> Window | None:
        """The window of the operator itself in place of that of a cluster; None if it is none, or not the first."""
        report_progress(f"a pair that turns complex about F_x = {candidate.onset:.6g}: its onset")
        inside = self._complex_pair(candidate, there)
        if inside is None or (first is not None and self._opens_later(inside, first)):
            return None
        above = self._follow(inside, there)
        end = edge_from_inside(self.family, above, inside) if above.discriminant > 0 else None
        for place in reversed(self._passed):
            below = self._follow(inside, place)
            if below.discriminant > 0:
                return Window.between(edge_from_inside(self.family, below, inside), end)
            inside = below
        return Window.between(Edge.start(inside), end)

    def _follow(self, pair: Pair, place: LoadPoint) -> Pair:
        """A pair at the same load, or another one."""
        return pair if pair.fx == place.fx else self.family.follow_pair(pair, place)

    def _opens_later(self, inside: Pair, first: Window) -> bool:
        """Whether a pair is still real where the first window so far opens."""
        if inside.fx <= first.fx_onset:
            return False
        below = self.family.follow_pair(inside, self.family.at(first.fx_onset))
        return below.discriminant > 0 and returns_to_start(self.family, below, inside)

    def _complex_pair(self, candidate: Candidate, there: LoadPoint) -> Pair | None:
        """The pair at a load where it is complex; None if it is surely real, or not before these loads are passed."""
        place = there if candidate.inside == there.fx else self.family.at(candidate.inside)
        guess = Pair(place.fx, place.matrix, candidate.right, candidate.left)
        pair = continue_pair(guess, place.fx, place.matrix, self.limits)
        if pair is not None and pair.discriminant < 0:
            return pair
        if candidate.onset > there.fx:
            return None  # it is looked for on the next increment
        if pair is None:
            raise DoubtError
        here = self._passed[-1]
        try:
            known = [pair, self._follow(pair, here), self._follow(pair, there)]
            return other_sign(self.family, known, self._narrowest(there.fx - here.fx))
        except LostPairError as error:
            raise DoubtError from error


def first_window(
    family: Family,
    loads: Floats,
    modes: tuple[int, int] | None = None,
    ranks: Ranks = ALONE,
    folder: Path | None = None,
) -> tuple[Window | None, Increments]:
    """The first window of a family of large matrices, if there is one, and the increments before it that are in doubt.

    Its end is None where the pair is complex at the next load. On increments in doubt clusters announce a pair that the
    operator was not seen to have. Arguments and errors are those of `find_onset`; of loads those of `search_along`.
    """
    return search_along(SlicedPairs(family, modes, ranks, folder), loads)


def search_along(oracle: SliceSearch[P, W], loads: Floats) -> tuple[W | None, Increments]:
    """The first window that an oracle finds along a ramp, and the increments before it that are in doubt.

    Loads beyond the one above the onset are not asked for, except those of `Limits.ahead` increments; a
    NoEquilibriumError of the operator at one of them is raised if no window has been found before.
    """
    here = oracle.at(float(loads[0]))
    done = 1
    while done < len(loads) and not oracle.finished:
        ahead = 1 if oracle.bases.keeps(here.matrices[0]) else oracle.ahead(done)
        places = [here, *_reach_loads(oracle.at, loads[done : done + ahead])]
        march(oracle, places)
        here = places[-1]
        done += len(places) - 1
    first = oracle.first
    doubtful = (each for each in oracle.doubtful if first is None or each[0] < first.fx_onset)
    return first, tuple(doubtful)


def _reach_loads(at: Callable[[float], P], loads: Floats) -> list[P]:
    """The operator at loads as far as there are equilibria; the error if there is none at the first."""
    places: list[P] = []
    for load in loads:
        try:
            places.append(at(float(load)))
        except NoEquilibriumError:
            if not places:
                raise
            break
    return places


def _memory_exceeded(block: Floats, excess: float) -> Floats:
    """The operator in a cluster with its antisymmetric couplings enlarged by what they may be in error."""
    width, mixing = width_and_mixing(block, np.diag(block))
    return block + excess * mixing**2 * width / len(block) * np.sign(block - block.T)
