r"""The first window of complex eigenvalues of a large packing, without a dense decomposition.

A dense decomposition takes a second at 300 disks and grows with the cube. But modes mix with their neighbours only. In
a fixed basis, the eigenvectors of the symmetric part at one load, the operator is nearly diagonal. This basis is found
slice by slice of the spectrum (:mod:`~faultgouge.analysis.slices`), each as a projection of its own
(:mod:`~faultgouge.analysis.projection`). In each,

1. a test names the pairs of modes that may meet (:mod:`~faultgouge.analysis.meetings`), few of thousands;
2. the cluster of neighbouring modes about each of these has its eigenvalues up to the third order of the coupling, and
   its windows of complex eigenvalues say where to look;
3. what appears there is confirmed with the operator itself, whose pair is continued to the edges by inverse iteration
   (:mod:`~faultgouge.analysis.tracking`).
"""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigs, splu

from .edges import Edge, State, locate
from .meetings import meetings
from .modes import Modes, Operator, Pair, span
from .packing import Floats
from .projection import MIXING, Cluster, Levels, Projection
from .tracking import Block, continued
from .windows import Place, Window, complex_windows, increasing, window_between

REACH = 0.1
"""Share of an increment by which the clusters are extrapolated: a pair that they have turn complex a little late is
found in time."""

FINEST = 1e-3
"""Narrowest windows of clusters that are looked for, in increments: their own error is larger."""


NEAR = 12
"""Modes among which a pair is looked for that the clusters announce where the operator has another one."""

KEPT = 9000
"""Coordinates up to which the basis is kept from increment to increment, which takes a gigabyte there; of a larger
operator it never exists as a whole."""

AHEAD = 2
"""Increments that are looked at while the basis of a larger operator passes by: each costs a twentieth of it."""


def first_window(
    operator: Callable[[float], Operator], forces: ArrayLike, *, narrowest: float | None = None
) -> Window | None:
    """The first window of complex eigenvalues of a family of large matrices, without all their eigenvalues.

    Clusters of modes are searched as `complex_windows` does, with the projected operators interpolated linearly between
    two loads; what appears there is confirmed with the operator itself, whose pair is continued to the edges. So the
    window that is returned is as certain, and its edges have the same digits, as those of `complex_windows`. That it is
    the first rests on two things. No mode is missing, which the inertia tells. And the clusters are right: their onsets
    were within a tenth of an increment of the confirmed ones (packings of 1,000 disks, increments of 1e-3). A pair that
    is complex by less than their error, or for less than `FINEST` of an increment, may be missed before it.

    Parameters
    ----------
    operator, forces
        As in :func:`~faultgouge.analysis.complex_windows`. Loads beyond the one above the onset are not asked for, but
        for those of `AHEAD` increments.
    narrowest
        As in :func:`~faultgouge.analysis.find_onset`; no less than a thousandth of an increment.

    Returns
    -------
    Window or None
        None if all eigenvalues are real. fx_end is None if the pair is complex at the load above the onset.
    """
    loads = increasing(forces)
    here = Place(float(loads[0]), csr_array(operator(float(loads[0]))))
    search = _Search(operator, narrowest or 0.0)
    ahead = 1 if here.matrix.shape[0] <= KEPT else AHEAD
    for start in range(1, len(loads), ahead):
        places = [here, *_reached(operator, loads[start : start + ahead])]
        window = search.walk(places)
        if window is not None:
            return window
        here = places[-1]
    return None


def _reached(operator: Callable[[float], Operator], loads: Floats) -> list[Place]:
    """The operator at loads as far as there are equilibria; at the first at any rate."""
    places: list[Place] = []
    for load in loads:
        try:
            places.append(Place(float(load), csr_array(operator(float(load)))))
        except RuntimeError:
            if not places:
                raise
            break
    return places


@dataclass(frozen=True, eq=False)
class _Candidate:
    """The planes of a pair that turns complex in its cluster: from where on, and a load at which it still is."""

    onset: float
    inside: float
    right: Floats
    left: Floats


def _nearest_pair(modes: Modes, eigenvalue: float) -> Pair:
    """The complex pair, or failing that the two modes, closest to a real eigenvalue."""
    first, second = np.argsort(np.abs(modes.values.real - eigenvalue))[:2]
    pairs = modes.complex_pairs or [(int(first), int(second))]
    return min(pairs, key=lambda pair: abs(modes.values[pair[0]].real - eigenvalue))


def _complex_pair_near(matrix: csr_array, guess: Block) -> Block | None:
    """A complex pair among the modes about a guess that is no good, as where a contact opened; None if all are real.

    By ARPACK with shift and inversion.
    """
    shift = guess.mean + 0.1 * guess.spread
    factors = splu(csc_array(matrix - shift * eye_array(matrix.shape[0])))
    found = []
    for trans, operator in (("N", matrix), ("T", matrix.T)):
        inverse = LinearOperator(matrix.shape, matvec=partial(factors.solve, trans=trans), dtype=np.float64)
        start = np.random.default_rng(0).standard_normal(matrix.shape[0])
        found.append(eigs(operator, NEAR, sigma=shift, OPinv=inverse, v0=start))
    (values, right), (others, left) = found
    for k in np.argsort(np.abs(values - guess.mean)):
        if values[k].imag > 0:
            same = int(np.argmin(np.abs(others - values[k])))
            return continued(matrix, Block.of(matrix, span(right[:, [k]]), span(left[:, [same]])))
    return None


class _Search:
    """The first window of large operators, from load to load."""

    def __init__(self, operator: Callable[[float], Operator], narrowest: float) -> None:
        self.operator, self.narrowest = operator, narrowest
        self.passed: list[Place] = []
        self.kept: list[Projection] = []

    def walk(self, places: list[Place]) -> Window | None:
        """The first window that begins between the first and the last of several loads."""
        found: list[list[_Candidate]] = [[] for _ in places[1:]]
        for part in self.parts(places[0].matrix):
            before = part.levels(places[0].matrix)
            for candidates, (here, there) in zip(found, pairwise(places), strict=True):
                after = part.change(before, there.matrix - here.matrix)
                candidates.extend(self.candidates(part, (here.fx, before), (there.fx, after)))
                before = after
        for candidates, (here, there) in zip(found, pairwise(places), strict=True):
            self.passed.append(here)
            window = self.earliest(candidates, there)
            if window is not None:
                return window
        return None

    def earliest(self, candidates: list[_Candidate], there: Place) -> Window | None:
        """The first window of the operator itself that one of the candidates has become."""
        here = self.passed[-1]
        first: Window | None = None
        for candidate in sorted(candidates, key=lambda candidate: candidate.onset):
            # Clusters are off by a share of the way from here: one that is far beyond cannot be first.
            if first is not None and candidate.onset - here.fx > (1 + 2 * REACH) * (first.fx_onset - here.fx):
                break
            window = self.confirmed(candidate, there, first)
            if window is not None and (first is None or window.fx_onset < first.fx_onset):
                first = window
        return first

    def parts(self, matrix: csr_array) -> Iterable[Projection]:
        """Projections of all modes, those of an earlier load as long as they serve."""
        if self.kept and all(part.covers(matrix) for part in self.kept):
            mixing = [each for part in self.kept for each in part.mixing(part.onto(matrix))]
            if np.median(mixing) < MIXING:
                return self.kept
        parts = Projection.parts(matrix, workers=len(os.sched_getaffinity(0)))
        if matrix.shape[0] > KEPT:
            return parts
        self.kept = list(parts)
        return self.kept

    def candidates(
        self, part: Projection, here: tuple[float, Levels], there: tuple[float, Levels]
    ) -> Iterator[_Candidate]:
        """The pairs of a projection that turn complex in their clusters."""
        named = meetings(here[1], here[1].beyond(there[1], 1 + REACH))
        for cluster in part.clusters:
            first, last = (cluster.modes.start + end for end in cluster.core)
            if np.any((named >= first) & (named <= last)):
                yield from self.searched(part, cluster, here, there)

    def searched(
        self, part: Projection, cluster: Cluster, here: tuple[float, Levels], there: tuple[float, Levels]
    ) -> Iterator[_Candidate]:
        """The windows of one cluster, with its blocks interpolated between two loads."""
        span = there[0] - here[0]
        before, after = here[1].block(cluster), there[1].block(cluster)

        def block(fx: float) -> Floats:
            share = (fx - here[0]) / span
            return (1 - share) * before + share * after

        reach = there[0] + REACH * span
        for window in complex_windows(block, [here[0], reach], narrowest=max(self.narrowest, FINEST * span)):
            end = reach if window.fx_end is None else window.fx_end
            inside = there[0] if window.fx_onset < there[0] <= end else 0.5 * (window.fx_onset + end)
            modes = Modes.of(inside, block(inside))
            plane = modes.block(_nearest_pair(modes, window.eigenvalue))
            if cluster.owns(plane.right):
                right, left = part.lifted(cluster, plane.right), part.lifted(cluster, plane.left)
                yield _Candidate(window.fx_onset, min(inside, there[0]), right, left)

    def confirmed(self, candidate: _Candidate, there: Place, first: Window | None) -> Window | None:
        """The window of the operator itself in place of that of a cluster; None if it is none, or not the first."""
        inside = self.complex_state(candidate, there)
        if inside is None or (first is not None and self.later(inside, first)):
            return None
        above = inside if inside.fx == there[0] else inside.at(*there)
        end = locate(self.operator, inside, above)[0] if above.discriminant > 0 else None
        for place in reversed(self.passed):
            below = inside if inside.fx == place[0] else inside.at(*place)
            if below.discriminant > 0:
                return window_between(locate(self.operator, below, inside)[0], end)
            inside = below
        return window_between(Edge(inside.fx, 0.0, inside.block.mean, inside.block.overlap, "start"), end)

    def later(self, inside: State, first: Window) -> bool:
        """Whether a pair is still real where the first one so far turns complex."""
        onset = first.fx_onset
        return inside.fx > onset and inside.at(onset, self.operator(onset)).discriminant > 0

    def complex_state(self, candidate: _Candidate, there: Place) -> State | None:
        """The pair at a load where it is complex, if there is one near the candidate's window."""
        fx = candidate.inside
        matrix = there[1] if fx == there[0] else csr_array(self.operator(fx))
        guess = Block.of(matrix, candidate.right, candidate.left)
        block = continued(matrix, guess) or _complex_pair_near(matrix, guess)
        if block is None:
            return None
        start = State(fx, matrix, block)
        if start.discriminant < 0:
            return start
        # A parabola through D at the ends of the increment and here has its minimum where D is least.
        places = [self.passed[-1], there] if fx < there[0] else [self.passed[-1]]
        others = [start.at(*place) for place in places]
        for other in others:
            if other.discriminant < 0:
                return other
        if len(others) < 2:
            return None
        states = sorted([start, *others], key=lambda state: state.fx)
        curve = np.polyfit([state.fx for state in states], [state.discriminant for state in states], 2)
        lowest = float(-0.5 * curve[1] / curve[0])
        if curve[0] <= 0 or not states[0].fx < lowest < states[-1].fx:
            return None
        state = start.at(lowest, self.operator(lowest))
        return state if state.discriminant < 0 else None
