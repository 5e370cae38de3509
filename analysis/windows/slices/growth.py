"""The first window of growing motion of a large packing: clusters in slices of the spectrum, and the operator.

Dissipation and the antisymmetric part couple a mode to its neighbours in the spectrum only. So slices are searched as
for complex pairs (:mod:`~faultgouge.analysis.windows.slices.pairs`). In the eigenbasis of a slice the modes that may
grow are named, clusters about these announce an onset, and the system itself confirms the onset
(:mod:`~faultgouge.analysis.windows.screens.growth`).

**Slices that are left out.** In each slice the antisymmetric part may be so many times larger before it can feed any
motion as much as the motion loses (`Reduced.bears`). A slice is looked at again once the antisymmetric part has grown
by `Limits.bearing_share` of this factor.

**Strong dashpots** couple more modes than a cluster can have, so that clusters may miss a motion. From the first load
with such dashpots on, all motions that grow are looked for with the operator itself
(:mod:`~faultgouge.analysis.windows.slices.axis`), at loads whose numbers on the ramp grow by `Limits.stride`. Motions
that grow are followed back to their onsets. All growing motions are then looked for once more, right below the first
onset and at the last load of the ramp before, until none grows there. So no other window is open at the first onset,
unless increments before it are in doubt. A window that opens and ends between two of these loads is not excluded. Of
more than `Limits.axis_coordinates` coordinates clusters alone are searched, and all loads before the window are named
as in doubt.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np
from scipy.sparse.linalg import ArpackError

from ...arrays import Floats
from ...errors import FaultgougeError, NoEquilibriumError
from ...factors.lanczos import Border
from ...motion.eigenvalues import active_coordinates
from ...progress import report_progress
from ..edges import DoubtError, Increments, LostPairError, Window, follow_to, track
from ..limits import LIMITS, Limits
from ..nearby import find_growing_near
from ..screens.growth import Cluster, find_cores, group_clusters, may_grow, reduce_system, shift_load
from ..space import Space
from ..system import System
from ..system_modes import SystemModes
from .axis import growing_modes
from .clusters import SliceSearch
from .eigenbasis import Basis, Levels
from .store import Candidate, SliceResult


class SlicedGrowth(SliceSearch):
    """The search for growing motion with dissipation.

    Small differences of large couplings tell where weak dashpots begin to feed a mode. So clusters know that a mode is
    about to grow, and not where: all that they announce is looked at, and the operator follows it to its onset.
    """

    locates = False
    crowded = False
    """Whether dashpots couple more modes than a cluster can have, so that clusters may miss a motion."""

    _borne: Floats | None = None  # |A - A^T| up to which each mode of the spectrum is left out
    _borders: Sequence[Border] = ()  # of the slices that were searched last
    _lost: float | None = None  # frequency of the motion that is in doubt
    _passing = False  # whether bases are not kept

    @property
    def finished(self) -> bool:
        """Whether the first window has been found, or all motions are to be looked for without clusters."""
        return super().finished or (self.crowded and self._few_enough(self.passed[-1]))

    def _few_enough(self, place: System) -> bool:
        """Whether all motions that grow at a load can be looked for."""
        return place.stiffness.shape[0] <= self.limits.axis_coordinates

    def ahead(self, done: int) -> int:
        """More and more increments, as dissipation may put off the onset by much; each costs a tenth of the bases."""
        return min(done + 1, self.limits.most_increments_ahead)

    def first_window(self, loads: Floats) -> tuple[Window | None, Increments]:
        first, doubtful = super().first_window(loads)
        return self.look_at_all(loads, doubtful) if self.crowded else (first, doubtful)

    # What clusters announce

    def candidates(self, places: Sequence[System], depth: int) -> list[list[Candidate]]:
        """The modes that begin to grow in clusters of the slices that are looked at.

        Of parts of an increment, while bases pass by, these are the slices about the motion that is in doubt.
        """
        if depth and self._lost is not None and self._passing:
            about = [
                each for each in self._borders if not self._lost**2 < each.first and not self._lost**2 > each.beyond
            ]
            if about:
                self.bases.narrow((about[0].modes[0], about[-1].modes[1]))
                return super().candidates(places, depth)
        count = len(active_coordinates(places[0].stiffness))
        if self._borne is None or len(self._borne) != count:
            self._borne = np.zeros(count)
        feed = max(antisymmetric(place) for place in places)
        if np.all(self._borne > feed):
            return [[] for _ in places[1:]]
        first, stop = self.bases.modes or (0, 0)
        if min(self._borne[:first].min(initial=np.inf), self._borne[stop:].min(initial=np.inf)) <= feed:
            feed *= self.limits.bearing_factor
        loud = np.flatnonzero(self._borne <= feed)
        self.bases.narrow((int(loud[0]), int(loud[-1]) + 1))
        self._passing = not self.bases.keeps(places[0].stiffness)
        return super().candidates(places, depth)

    def found_by_all(self, places: Sequence[System]) -> list[SliceResult]:
        found = super().found_by_all(places)
        self._borders = [each.border for each in found]
        self.crowded = self.crowded or any(each.crowded for each in found)
        if self.crowded and self._few_enough(places[0]):
            return [replace(each, candidates=[[] for _ in places[1:]]) for each in found]
        if self._borne is not None:
            for each in found:
                self._borne[slice(*each.border.modes)] = self.limits.bearing_share * each.bears
        return found

    def look_at_basis(self, basis: Basis, levels: Levels, places: Sequence[System]) -> SliceResult:
        here, found, crowded = reduce_system(basis, levels, places[0]), [], False
        for before, after in pairwise(places):
            there = shift_load(basis, before, here, after)
            named = may_grow(here, there)
            cores = find_cores(named[(named >= basis.own.start) & (named < basis.own.stop)])
            loud = [each for each in group_clusters(basis, (before, here), (after, there), cores) if not each.quiet]
            crowded = crowded or any(each.right.shape[1] > self.limits.largest_cluster for each in loud)
            given_up = crowded and self._few_enough(after)
            announced = [] if given_up else [find_growing(each, self.limits) for each in loud]
            found.append(list(chain.from_iterable(announced)))
            here = there
        return SliceResult(basis.border, found, here.bears * antisymmetric(places[-1]), crowded)

    # What the operator has

    def look_at_all(self, loads: Floats, doubtful: Increments) -> tuple[Window | None, Increments]:
        """The first window by all motions that grow at some loads, from the last one on that clusters have passed.

        Arguments beyond the loads of the ramp, and what is returned, are as of `first_window`.

        Raises
        ------
        NoEquilibriumError
            If there is none at a load before one at which a motion grows.
        UncoveredAxisError, LostPairError
            If the motions of a load cannot be told, or none of those that grow can be followed.
        """
        quiet = self.passed[-1].fx
        if not self._few_enough(self.passed[-1]):
            return self.first, (*doubtful, (self.passed[0].fx, quiet))
        while True:
            done = int(np.searchsorted(loads, self.passed[-1].fx, side="right"))
            farther = self.limits.stride * int(np.searchsorted(loads, quiet, side="right"))
            flows = self._pass_loads(loads[done : max(done + 1, farther)])
            growing = self._all_growing(self.passed[-1])
            if growing:
                break
            if flows is not None:
                raise flows
            if self.passed[-1].fx >= loads[-1]:
                return None, doubtful
            quiet = self.passed[-1].fx
        first = self._earliest_of(growing, None, quiet)
        while first is not None:
            earlier = self._earlier_than(first, quiet)
            if earlier is first:  # nothing that grows there was followed back: the increments are named as in doubt
                break
            first = earlier
        return first, (*doubtful, *self.doubtful)

    def _earlier_than(self, first: Window, quiet: float) -> Window:
        """A window that opens before the first one so far, by motions that grow where this one opens; else the same.

        They are looked for right below its onset and, if none is followed back from there, at the last load before.
        """
        below = [each for each in self.passed if quiet < each.fx < first.fx_onset]
        beside = first.fx_onset - max(self.limits.below_onset * (first.fx_onset - quiet), 10 * first.error)
        places = []
        if beside > quiet:
            try:
                places.append(self.at(beside))
            except NoEquilibriumError:  # nobody has looked there
                self.doubtful.append((quiet, first.fx_onset))
        for place in [*places, *below[-1:]]:
            growing = self._all_growing(place)
            earlier = self._earliest_of(growing, first, quiet) if growing else first
            if earlier is not None and earlier is not first:
                return earlier
        return first

    def _pass_loads(self, loads: Floats) -> NoEquilibriumError | None:
        """Take the operators at some loads to those that were passed, up to one without an equilibrium."""
        for load in loads:
            try:
                self.passed.append(self.at(float(load)))
            except NoEquilibriumError as error:
                return error
        return None

    def _all_growing(self, place: System) -> list[Space]:
        """All motions that grow at a load, the fastest first."""
        report_progress(f"all motions that grow at F_x = {place.fx:.6g}, as the dashpots couple many modes")
        return sorted(growing_modes(place), key=lambda mode: -mode.mean.real)

    def _earliest_of(self, growing: list[Space], first: Window | None, quiet: float) -> Window | None:
        """The first window, once all motions that grow at a load are followed back; no motion grows at the load
        `quiet`."""
        below = [each for each in self.passed if each.fx < growing[0].fx]
        lost: FaultgougeError | None = None
        for mode in growing:
            try:
                if first is None or not self.opens_later(mode, first):
                    window = self.follow_back(mode, below, None)
                    first = window if first is None or window.fx_onset < first.fx_onset else first
            except (LostPairError, NoEquilibriumError) as error:
                lost = error
                self.doubtful.append((quiet, mode.fx))
        if first is None and lost is not None:
            raise lost
        return first

    def growing_motion(self, candidate: Candidate, there: System) -> Space | None:
        """The announced motion at a load where it grows, or one about its frequency; None if it grows nowhere."""
        report_progress(f"a motion that grows from about F_x = {candidate.onset:.6g}: its onset")
        place = there if candidate.inside == there.fx else self.at(candidate.inside)
        guess, rate = predict_mode(candidate, place)
        self._lost = rate.imag
        mode = guess.at(place, self.limits, rate)
        announced = candidate.onset < there.fx  # else the mode nearly grows
        if mode is None and announced:
            mode = self._beside(rate, place, there)
        if mode is not None and announced and not mode.grows:
            mode = self._most(mode, there)
        return mode if mode is not None and mode.grows else None

    def _beside(self, rate: complex, *places: System) -> Space | None:
        """A motion that grows at one of some loads, about the announced frequency; None if there is none.

        Where contacts change, a cluster no longer knows the shapes of modes, and may announce a motion that is not
        there.
        """
        try:
            for place in places:
                growing = find_growing_near(
                    place, rate if rate.imag == 0 else 1j * rate.imag, self.limits.nearest_modes
                )
                if growing:
                    return min(growing, key=lambda each: abs(each.mean - rate))
        except ArpackError as error:
            raise DoubtError from error
        return None

    def _most(self, mode: Space, there: System) -> Space | None:
        """The mode at a load of the increment where it grows, by parabolas through Re s; None if it loses energy."""
        here = self.passed[-1]
        try:
            ends = [follow_to(mode, place, self.limits) for place in (here, there)]
            at = track(self.at, {each.fx: each for each in (mode, *ends)}, self.limits)
            modes = {each.fx: each for each in (mode, *ends)}
            if len(modes) < 3:
                middle = 0.5 * (here.fx + there.fx)
                modes[middle] = at(middle)
            for _ in range(self.limits.places):
                best = max(modes.values(), key=lambda each: each.mean.real)
                if best.grows:
                    return best
                fx = parabola_vertex(sorted(modes.values(), key=lambda each: abs(each.fx - best.fx))[:3])
                fx = float(np.clip(fx, here.fx, there.fx))
                if min(abs(fx - load) for load in modes) < self.limits.place_tolerance * (there.fx - here.fx):
                    return None
                modes[fx] = at(fx)
        except LostPairError as error:  # nothing is lost but what a cluster has announced
            raise DoubtError from error
        raise DoubtError


def antisymmetric(place: System) -> float:
    """|A - A^T|, 1 / time^2: the part of A that feeds motion."""
    return float(np.linalg.norm((place.stiffness - place.stiffness.T).data))


def find_growing(cluster: Cluster, limits: Limits = LIMITS) -> Iterator[Candidate]:
    """Modes of a cluster that begin to grow, and modes that nearly grow at its upper load."""
    below, above = cluster.loads
    search = cluster.search(limits)
    for window in search.windows:
        if window.fx_end is not None and cluster.owns(window.frequency):
            inside = 0.5 * (window.fx_onset + window.fx_end)
            growing = SystemModes.of(cluster.system(inside)).growing
            if growing:
                mode = min(growing, key=lambda each: abs(each.mean.imag - window.frequency))
                yield make_candidate(window.fx_onset, cluster, mode)
    begun = {window.frequency: window.fx_onset for window in search.windows if window.fx_end is None}
    for mode in cluster.nearly_growing(search.modes_at(above), limits):
        onset = above
        if mode.grows:
            onset = min(begun.items(), key=lambda each: abs(each[0] - mode.mean.imag))[1] if begun else below
        yield make_candidate(onset, cluster, mode)


def make_candidate(onset: float, cluster: Cluster, mode: Space) -> Candidate:
    """The announced motion of a mode of a cluster, at its load."""
    right, left = (np.column_stack([each.real, each.imag]) for each in cluster.lift(mode))
    return Candidate(onset, mode.fx, right, left)


def predict_mode(candidate: Candidate, system: System) -> tuple[Space, complex]:
    """The mode of a cluster as one of the system: its s is the root of y^H T(s) x above the axis of real s, or
    the upper one of two on the axis."""
    x, y = (np.asarray(each @ np.array([1.0, 1.0j])) for each in (candidate.right, candidate.left))
    products = [complex(np.vdot(y, each)) for each in (x, system.damping @ x, system.stiffness @ x)]
    rate = complex(max(np.roots(products), key=lambda s: (s.imag, s.real)))
    return Space.of(system, x, y, rate), rate


def parabola_vertex(modes: Sequence[Space]) -> float:
    """Load at the top of a parabola through Re s of three modes; load of the first if there is no top."""
    loads, rates = np.array([mode.fx for mode in modes]), np.array([mode.mean.real for mode in modes])
    scale = np.ptp(loads)
    curve, slope, _ = np.polyfit((loads - loads[0]) / scale, rates, 2)
    return float(loads[0] - 0.5 * slope / curve * scale) if curve < 0 else float(loads[0])
