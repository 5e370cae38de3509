"""The oracle that has all modes at both loads of an increment.

Modes keep their names from load to load (:func:`~faultgouge.analysis.onset.modes.assign`). A pair that is complex at
one end of the increment and real at the other has an edge in between, which is solved for. Two neighbouring real modes,
or a complex pair, may have left the real axis or come back to it, and be again what they were: their discriminant and
its slopes at both ends tell where a window, or a gap in one, could hide (:mod:`~faultgouge.analysis.onset.dip`).

The increment is divided where something could hide, next to the first edge that is solved for, and half-way where a
complex pair at one end is not recognised at the other; until nothing wider than `Family.narrowest` is left to doubt.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from ..errors import NoEquilibriumError
from ..spectrum import Complexes
from .dip import deepest_dip
from .edge import Edge, Family, LostPairError, locate
from .modes import Members, Modes, Operator, assign
from .pair import Pair
from .walk import between
from .windows import Course, Ledger

Decompose = Callable[[float, Operator], Modes]


class Step:
    """Two neighbouring loads, the assignment of their modes, and what the complex pairs of one are at the other."""

    def __init__(self, here: Modes, there: Modes) -> None:
        self.here, self.there = here, there
        self.forward = assign(here, there)
        self.backward = np.full(len(there.values), -1)
        known = self.forward >= 0
        self.backward[self.forward[known]] = np.flatnonzero(known)
        self.staying: list[tuple[Members, Members]] = []
        self.opening: list[tuple[Members, Members]] = []
        self.closing: list[tuple[Members, Members]] = []
        self.lost: list[Members] = []
        self.found: list[Members] = []
        for members in here.complex_pairs:
            self._from_here(members)
        for image in there.complex_pairs:
            self._from_there(image)

    def _from_here(self, members: Members) -> None:
        """Sort a pair that is complex at the lower load."""
        here, there = self.here, self.there
        image = (int(self.forward[members[0]]), int(self.forward[members[1]]))
        if min(image) < 0 or not here.pair(members).same_planes(there.pair(image)):
            self.lost.append(members)
        elif there.partner[image[0]] == image[1]:
            self.staying.append((members, image))
        elif there.partner[image[0]] == there.partner[image[1]] == -1:
            self.closing.append((members, image))
        else:
            self.lost.append(members)

    def _from_there(self, image: Members) -> None:
        """Sort a pair that is complex at the upper load, unless it stays so."""
        here, there = self.here, self.there
        if any(image == arrived for _, arrived in self.staying):
            return
        members = (int(self.backward[image[0]]), int(self.backward[image[1]]))
        real = min(members) >= 0 and here.partner[members[0]] == here.partner[members[1]] == -1
        if real and here.pair(members).same_planes(there.pair(image)):
            self.opening.append((members, image))
        else:
            self.found.append(image)

    @property
    def consistent(self) -> bool:
        """Whether every complex pair at one end is recognised at the other."""
        return not self.lost and not self.found

    def courses(self, edge: Callable[["Step", Members, Members], Edge]) -> Iterator[Course]:
        """The courses of all complex pairs: edges by a function, and half-way for pairs that are not recognised."""
        here, there = self.here, self.there
        for members, image in self.staying:
            yield (here.pair(members), there.pair(image), None)
        for members, image in self.closing:
            yield (here.pair(members), None, edge(self, members, image))
        for members, image in self.opening:
            yield (None, there.pair(image), edge(self, members, image))
        for members in self.lost:
            pair = here.pair(members)
            yield (pair, None, self.halfway(pair))
        for image in self.found:
            pair = there.pair(image)
            yield (None, pair, self.halfway(pair))

    def halfway(self, pair: Pair) -> Edge:
        """An edge somewhere in this step."""
        return Edge.somewhere(self.here.fx, self.there.fx, pair)

    def hidden_window(self, family: Family) -> float | None:
        """Load where a window wider than the narrowest, or a gap in one, most likely hides; None if nowhere."""
        here, there = self.here, self.there
        known = np.flatnonzero(self.forward >= 0)
        image = self.forward[known]
        p, q = self._neighbours(known)
        if len(p) == 0:
            return None
        a, b = here.values[known], there.values[image]
        change = there.matrix - here.matrix
        drift_a, drift_b = _sensitivity(here, change)[known], _sensitivity(there, change)[image]
        gap_a, gap_b = a[p] - a[q], b[p] - b[q]
        # In a window that stays open a gap may hide: turn D over.
        sign = np.where(here.partner[known[p]] < 0, 1.0, -1.0)
        width, at = deepest_dip(
            sign * (gap_a**2).real,
            sign * (2 * gap_a * (drift_a[p] - drift_a[q])).real,
            sign * (gap_b**2).real,
            sign * (2 * gap_b * (drift_b[p] - drift_b[q])).real,
            family.limits.bend,
        )
        span = there.fx - here.fx
        worst = int(np.argmax(width))
        if width[worst] * span <= family.narrowest:
            return None
        margin = 0.25 * family.narrowest / span  # never return an end
        return here.fx + span * float(np.clip(at[worst], margin, 1 - margin))

    def _neighbours(self, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Two modes each that can meet: neighbours at one end, those that change order, and pairs that stay complex."""
        here, there, image = self.here, self.there, self.forward[known]
        p, q = np.triu_indices(len(known), 1)
        rank = np.empty(len(known), int)
        rank[np.argsort(there.values[image].real)] = np.arange(len(known))
        near = (q - p == 1) | (np.abs(rank[q] - rank[p]) == 1) | (rank[q] < rank[p])
        real_a, real_b = here.partner[known] < 0, there.partner[image] < 0
        alone = real_a[p] & real_a[q] & real_b[p] & real_b[q]
        staying = (here.partner[known[p]] == known[q]) & (there.partner[image[p]] == image[q])
        kept = (near & alone) | staying
        return p[kept], q[kept]


def _sensitivity(modes: Modes, change: csr_array) -> Complexes:
    """First-order change of each eigenvalue, y^H dA x / y^H x."""
    y = modes.left.conj()
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sum(y * (change @ modes.right), axis=0) / np.sum(y * modes.right, axis=0)


class AllModes:
    """The oracle; its places are `Modes`, and what it is sure of are courses of pairs for the ledger."""

    finished = False

    def __init__(self, family: Family, ledger: Ledger, decompose: Decompose = Modes.of) -> None:
        self.family, self.ledger, self.decompose = family, ledger, decompose
        self._solved: dict[tuple[float, float], Edge] = {}

    def candidates(self, places: Sequence[Modes]) -> Iterator[Step]:
        """The assignment of the modes over each increment."""
        return (Step(here, there) for here, there in pairwise(places))

    def confirm(self, step: Step, here: Modes, there: Modes, depth: int) -> tuple[list[Course] | None, list[Modes]]:
        """The courses of all complex pairs, once nothing can hide any more."""
        edge = self._solved.get((here.fx, there.fx))
        if edge is not None:
            return list(step.courses(lambda *_: edge)), []
        divide = self._between(step) if there.fx - here.fx > self.family.narrowest else []
        return (None if divide else list(step.courses(self._edge))), divide

    def record(self, sure: list[Course]) -> None:
        """Carry the open windows over an increment."""
        self.ledger.carry(sure)

    def _between(self, step: Step) -> list[Modes]:
        """Where a step is to be divided."""
        here, there = step.here, step.there
        halfway = 0.5 * (here.fx + there.fx)
        middle = step.hidden_window(self.family) if step.consistent else halfway
        edges = step.closing + step.opening
        if middle is None and edges:
            solution = self._solution(step, *edges[0])
            if solution is None:
                middle = halfway
            elif here.fx < solution[1].fx < solution[2].fx < there.fx:
                # What lies on either side of this edge has yet to be looked at.
                edge, below, above = solution
                self._solved[below.fx, above.fx] = edge
                return [self.decompose(side.fx, side.matrix) for side in (below, above)]
        if middle is None:
            return []
        return between(lambda fx: self.decompose(*self.family.at(fx)), here.fx, middle, there.fx)

    def _edge(self, step: Step, members: Members, image: Members) -> Edge:
        """The edge of a pair, half the step wide if it cannot be solved for."""
        solution = self._solution(step, members, image)
        return step.halfway(step.there.pair(image)) if solution is None else solution[0]

    def _solution(self, step: Step, members: Members, image: Members) -> tuple[Edge, Pair, Pair] | None:
        """The edge of a pair that is complex at one end, and the pair close by on either side; None if it is not
        found."""
        try:
            return locate(self.family, step.here.pair(members), step.there.pair(image))
        except (NoEquilibriumError, LostPairError):
            return None
