"""Pairs that turn complex in clusters of slices: the search without dissipation, for the first window.

**Edges.** A real pair may exchange partners with a third mode within an increment. A complex pair is the only one of
its kind, so a pair is followed from inside of its window to the edge.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from ...arrays import Floats
from ...progress import report_progress
from ..edges import DoubtError, LostPairError, follow_to
from ..screens.pairs import PairScreen, may_meet
from ..search import other_growth, windows_along
from ..space import Space
from ..system import System
from ..system_modes import SystemModes
from .clusters import SliceSearch
from .eigenbasis import Basis, Levels, ModeCluster, width_and_mixing
from .store import Candidate, SliceResult

Reached = tuple[float, Levels]
"""A load and A there in a basis."""


class SlicedPairs(SliceSearch):
    """The search for complex pairs."""

    def look_at_basis(self, basis: Basis, levels: Levels, places: Sequence[System]) -> SliceResult:
        """The pairs of a basis that turn complex in their clusters."""
        found = []
        for here, there in pairwise(places):
            before, levels = levels, basis.change(levels, there.stiffness - here.stiffness)
            found.append(list(self._announce_pairs(basis, (here.fx, before), (there.fx, levels))))
        return SliceResult(basis.border, found)

    def _announce_pairs(self, basis: Basis, here: Reached, there: Reached) -> Iterator[Candidate]:
        """The pairs of a basis that turn complex in their clusters."""
        named = may_meet(here[1], here[1].beyond(there[1], 1 + self.limits.cluster_reach), self.limits.slack)
        for cluster in basis.clusters:
            first, last = (cluster.modes.start + end for end in cluster.core)
            if np.any((named >= first) & (named <= last)):
                yield from self._search_cluster(basis, cluster, here, there)

    def _search_cluster(self, basis: Basis, cluster: ModeCluster, here: Reached, there: Reached) -> Iterator[Candidate]:
        """The windows of one cluster, with its blocks interpolated between two loads."""
        increment = there[0] - here[0]
        before, after = (levels.block(cluster) for _, levels in (here, there))
        if len(before) < len(basis.active):
            before, after = (_with_larger_feed(block, self.limits.coupling_excess) for block in (before, after))

        def small(fx: float) -> System:
            share = (fx - here[0]) / increment
            return System(fx, csr_array((1 - share) * before + share * after))

        limits = replace(self.limits, root_width=self.limits.increment_window)
        last = there[0] + self.limits.cluster_reach * increment
        narrowest, screen = limits.cluster_window * increment, PairScreen(limits)
        *_, (_, windows) = windows_along(small, np.array([here[0], last]), narrowest, screen, limits=limits)
        for window in windows:
            end = last if window.fx_end is None else window.fx_end
            inside = there[0] if window.fx_onset < there[0] <= end else 0.5 * (window.fx_onset + end)
            modes = SystemModes.of(small(inside))
            pair = modes.space(modes.about(window.eigenvalue, modes.complex_pairs))
            if cluster.owns(pair.right):
                right, left = (basis.lift(cluster.modes, plane) for plane in (pair.right, pair.left))
                yield Candidate(window.fx_onset, min(inside, there[0]), right, left)

    def growing_motion(self, candidate: Candidate, there: System) -> Space | None:
        """The pair at a load where it is complex; None if it is surely real, or not before these loads are passed."""
        report_progress(f"a pair that turns complex about F_x = {candidate.onset:.6g}: its onset")
        place = there if candidate.inside == there.fx else self.at(candidate.inside)
        guess = Space(place, candidate.right, candidate.left)
        pair = guess.at(place, self.limits)
        if pair is not None and pair.grows:
            return pair
        if candidate.onset > there.fx:
            return None  # it is looked for on the next increment
        if pair is None:
            raise DoubtError
        here = self.passed[-1]
        try:
            images = [pair, *(follow_to(pair, each, self.limits) for each in (here, there) if each.fx != pair.fx)]
            inside = next((each for each in images if each.grows), None)
            if inside is not None:
                return inside
            narrowest = self.limits.cluster_window * (there.fx - here.fx)
            found = other_growth(self.at, [[each] for each in images], narrowest, limits=self.limits)
            return None if found is None else found[0]
        except LostPairError as error:
            raise DoubtError from error


def _with_larger_feed(block: Floats, excess: float) -> Floats:
    """The operator in a cluster with its antisymmetric couplings enlarged by their error."""
    width, mixing = width_and_mixing(block, np.diag(block))
    return block + excess * mixing**2 * width / len(block) * np.sign(block - block.T)
