"""The oracle of growing motion, for the walk along a ramp: what a few modes do, or all of them.

**A few modes.** On most increments nothing happens, or one mode crosses the axis. The clusters that perturbation theory
names (:mod:`~faultgouge.analysis.damped_onset.perturbation_screening`) tell which modes grow, or nearly do, at the
upper load. These are found again with the operator, one by one. Those that grow are followed: from the lower load to
the upper one if they grew already, else back to where they did not. An increment in which a cluster has a window of its
own, or a mode is not recognised, is divided, up to `DEPTH` times.

**All modes.** What is still in doubt is told by all modes of both loads
(:mod:`~faultgouge.analysis.damped_onset.load_step`).
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from ..errors import NoEquilibriumError
from ..onset.march import look_between, march
from ..onset.modes import assign_columns
from ..onset.window_edges import LostPairError, LostTrackError, track_pair
from .load_step import GrowthStep, excursion
from .modes import DampedMode, DampedModes, Pencil
from .perturbation_screening import Cluster, GrowthScreen
from .window_edges import Crossing, DampedWindow, solve_edge, window_of

DEPTH = 4
"""How often an increment is divided before all modes are asked: they take as long as ten looks at a few."""

MOST = 5e-5
"""Clusters of an increment, for each coordinate squared, beyond which all modes take less time: four of 100 disks. Half
as many in a half, so that dividing costs no more than that at any depth."""

CLUSTER = 1e-4
"""Narrowest windows that are looked for in clusters, in increments: where they begin is known to 1e-2 or so."""

NEARLY = 0.3
"""A mode of a cluster whose damping is below this share of the median is looked at with the operator, which decides."""

BEYOND = 0.05
"""Share of an increment by which a cluster is followed beyond the upper load: a cluster knows to 1e-2 or so of an
increment where modes begin to grow. What grows there is looked at with the operator, too."""


Open = list[tuple[DampedMode, Crossing]]
"""Modes that grow at a load, and where each has begun to."""


Course = tuple[Open, list[DampedWindow]]
"""An increment: the modes that grow at its end, and the windows that end on it."""

Announcement = Course | float | None
"""What the few modes do, or a load at which more is to be seen of them, or neither."""


class AllGrowth:
    """The oracle of growing motion; it is sure of the course of an increment."""

    finished = False

    def __init__(self, pencil: Callable[[float], Pencil], narrowest: float, screen: GrowthScreen | None) -> None:
        self.at, self.narrowest, self.screen = pencil, narrowest, screen
        self.open: Open | None = None  # at the load reached so far
        self.closed: list[DampedWindow] = []

    def windows(self) -> tuple[DampedWindow, ...]:
        """All windows by increasing onset."""
        still = [window_of(onset, None) for _, onset in self.open or []]
        return tuple(sorted(self.closed + still, key=lambda window: window.fx_onset))

    # A few modes

    def candidates(self, places: Sequence[Pencil], depth: int) -> Iterator[Announcement]:
        """What the few modes do that may grow, or where to look for that; None where all modes have to tell."""
        for here, there in pairwise(places):
            clusters = self.screen(here, there) if self.screen and depth <= DEPTH else None
            if self.open is None:  # where no mode is a suspect, none grows
                self.open = [] if clusters == [] else self.find_growing_at_start(here)
            most = max(1, MOST * here.stiffness.shape[0] ** 2) / 2**depth
            if clusters is not None and len(clusters) > most:
                clusters = None
            course = None if clusters is None else self.follow_growing(clusters, here, there)
            yield None if depth == DEPTH and isinstance(course, float) else course

    def find_growing_at_start(self, here: Pencil) -> Open:
        """The modes that grow at the smallest load."""
        growing = [here.modes.mode(k) for k in here.modes.grows]
        return [(mode, Crossing(here.fx, 0.0, mode.rate.imag, "start")) for mode in growing]

    def follow_growing(self, clusters: list[Cluster], here: Pencil, there: Pencil) -> Course | float:
        """The modes that grow at either load, solved for; else a load in between, at which more is to be seen."""
        before, middle = self.open or [], 0.5 * (here.fx + there.fx)
        announced = [describe_search(cluster) for cluster in clusters]
        hidden = next((modes for modes in announced if isinstance(modes, float)), None)
        if hidden is not None:
            return hidden
        after = [each.at(there, each.rate) for modes in announced if isinstance(modes, list) for each in modes]
        if any(mode is None for mode in after):
            return middle
        growing = drop_duplicates([mode for mode in after if mode is not None and mode.grows])
        now: Open = []
        closed: list[DampedWindow] = []
        for mode, onset in before:
            image = mode.at(there)
            if image is None:
                return middle
            known = next((k for k, each in enumerate(growing) if each.same(image)), None)
            if known is not None:
                now.append((growing.pop(known), onset))
                continue
            end = None if image.grows else self.find_crossing(mode, image)
            if end is None:
                return middle
            closed.append(window_of(onset, end))
        for mode in growing:
            origin = mode.at(here)
            if origin is None or origin.grows or any(origin.same(each) for each, _ in before):
                return middle
            begin = self.find_crossing(origin, mode)
            if begin is None:
                return middle
            now.append((mode, begin))
        return now, closed

    # All modes

    def confirm(
        self, candidates: Announcement, here: Pencil, there: Pencil, depth: int
    ) -> tuple[Course | None, list[Pencil]]:
        """What the few modes do, else the crossings of all, once nothing can hide in the increment any more."""
        if isinstance(candidates, tuple):
            return candidates, []
        if candidates is not None:
            divide = look_between(self.at, here.fx, candidates, there.fx)
            if divide:
                return None, divide
        step = GrowthStep.of(here.modes, there.modes)
        middle = 0.5 * (here.fx + there.fx)
        divisible = there.fx - here.fx > self.narrowest
        look = None if not divisible else middle if step.loses_growing_mode else self.unclear(step)
        crossings: dict[tuple[int, int], Crossing] = {}
        for pair in [] if look is not None else step.edges:
            crossing = self.find_crossing(here.modes.mode(pair[0]), there.modes.mode(pair[1]))
            if crossing is not None:
                crossings[pair] = crossing
            elif divisible:
                look = middle
                break
        divide = [] if look is None else look_between(self.at, here.fx, look, there.fx)
        return (None if divide else self.carry_windows(step, crossings)), divide

    def unclear(self, step: GrowthStep) -> float | None:
        """A load at which all modes have to be looked at, as a pair grows there or cannot be followed; else None."""
        for pair in step.suspects(self.narrowest):
            here = [step.here.mode(k) for k in pair]
            there = [step.there.mode(int(step.forward[k])) for k in pair]
            fx = self.inspect_pair(here, there)
            if fx is not None:
                return fx
        return None

    def inspect_pair(self, here: list[DampedMode], there: list[DampedMode]) -> float | None:
        """The same for one pair: it is followed to where the cubics see it grow, and from there to either side."""
        span = there[0].fx - here[0].fx
        slopes = [mode.change(there[0].pencil) for mode in here], [-mode.change(here[0].pencil) for mode in there]
        width, at = excursion([mode.rate for mode in here], slopes[0], [mode.rate for mode in there], slopes[1])
        if width * span <= self.narrowest:
            return None
        fx = here[0].fx + float(at) * span
        try:
            pencil = self.at(fx)
        except NoEquilibriumError:
            return fx
        found = [mode.at(pencil) for mode in (here if at < 0.5 else there)]
        modes = [mode for mode in found if mode is not None]
        if len(modes) < 2 or modes[0].same(modes[1]):
            return fx
        ends = [sorted(mode.grows for mode in each) for each in (here, there)]
        if sorted(mode.grows for mode in modes) not in ends:
            return fx
        return self.inspect_pair(here, modes) or self.inspect_pair(modes, there)

    def find_crossing(self, here: DampedMode, there: DampedMode) -> Crossing | None:
        """Where a mode crosses the axis between two loads; None if it cannot be followed or jumps."""

        def follow(nearest: list[DampedMode], fx: float) -> DampedMode:
            pencil = self.at(fx)
            for mode in nearest:
                found = mode.at(pencil)
                if found is not None:
                    return found
            raise LostPairError

        try:
            return solve_edge(track_pair({here.fx: here, there.fx: there}, follow), here.fx, there.fx)
        except (LostPairError, NoEquilibriumError):
            return None

    def carry_windows(self, step: GrowthStep, crossings: dict[tuple[int, int], Crossing]) -> Course:
        """The open windows over an increment, by where modes, by their numbers at both ends, cross the axis.

        Raises
        ------
        LostTrackError
            If the modes that grow at its beginning are not those of the open windows.
        """
        growing = set(step.there.grows.tolist())
        now: dict[int, Crossing] = {}
        closed: list[DampedWindow] = []
        for k, onset in self._number_windows(step.here).items():
            image = int(step.forward[k])
            if image in growing:
                now[image] = onset
            else:
                closed.append(window_of(onset, crossings.get((k, image)) or _split_halfway(step, step.here, k)))
        for image in growing - set(now):
            before = np.flatnonzero(step.forward == image)
            known = crossings.get((int(before[0]), image)) if len(before) else None
            now[image] = known or _split_halfway(step, step.there, image)
        return [(step.there.mode(k), onset) for k, onset in now.items()], closed

    def _number_windows(self, here: DampedModes) -> dict[int, Crossing]:
        """The onsets of the open windows by the numbers of their modes."""
        known = self.open or []
        if len(known) != len(here.grows):
            raise LostTrackError
        distances = np.abs(
            np.subtract.outer(np.array([mode.rate for mode, _ in known], complex), here.rates[here.grows])
        )
        places = assign_columns(1 / (distances + np.finfo(float).tiny))
        return {int(here.grows[place]): onset for place, (_, onset) in zip(places, known, strict=True)}

    def record(self, sure: Course) -> None:
        """Take down the course of an increment."""
        self.open, closed = sure
        self.closed += closed


def describe_search(cluster: Cluster) -> list[DampedMode] | float:
    """Modes that grow in a cluster at the upper load, or nearly do so; a load in between, if others grow there.

    The modes are on all coordinates. Their pencil is the cluster's: they are where to begin with the operator.
    """
    oracle, there = search_cluster(cluster)
    for each in oracle.closed:
        if each.kind != "start" and each.fx_end is not None and cluster.owns(each.frequency):
            return 0.5 * (each.fx_onset + each.fx_end)
    return [cluster.lift(mode) for mode in nearly_growing(cluster, there.modes)]


def search_cluster(cluster: Cluster) -> tuple[AllGrowth, Pencil]:
    """The oracle of a cluster after its walk from its lower load to its upper one, and the pencil there."""
    below, above = cluster.loads
    oracle = AllGrowth(cluster.pencil, CLUSTER * (above - below), None)
    here, there = oracle.at(below), oracle.at(above)
    march(oracle, [here, there])
    return oracle, there


def nearly_growing(cluster: Cluster, modes: DampedModes) -> list[DampedMode]:
    """Those modes of a cluster that grow at its upper load, nearly do so, or grow a little beyond."""
    near = np.flatnonzero(modes.rates.real > NEARLY * np.median(modes.rates.real))
    found = [modes.mode(int(k)) for k in near if cluster.owns(modes.rates[k].imag)]
    below, above = cluster.loads
    pencil = cluster.pencil(above + BEYOND * (above - below))
    if np.count_nonzero(np.linalg.eigvals(pencil.system.matrix).real > 0) <= 2 * len(modes.grows):
        return found
    further = DampedModes.of(pencil)
    return found + [further.mode(int(k)) for k in further.grows if cluster.owns(further.rates[k].imag)]


def drop_duplicates(modes: Sequence[DampedMode]) -> list[DampedMode]:
    """Modes of one pencil, each of them once."""
    found: list[DampedMode] = []
    for mode in modes:
        if not any(mode.same(each) for each in found):
            found.append(mode)
    return found


def _split_halfway(step: GrowthStep, modes: DampedModes, number: int) -> Crossing:
    """An edge that could not be solved for."""
    half = 0.5 * (step.there.fx - step.here.fx)
    return Crossing(step.here.fx + half, half, float(modes.rates[number].imag), "contact change")
