"""The search for all windows of a small packing: the oracle that has all modes of a load if it needs them.

**Few pairs.** On most increments nothing happens, and to know that takes no decomposition. The pairs that
perturbation theory names (:mod:`~faultgouge.analysis.onset.screening`) are followed one by one. Where at most one of
them changes, and D and its slopes at both ends tell that nothing hides, the increment is done.

**All modes.** Everywhere else the modes of both ends are assigned to each other, so that they keep their names
(:func:`~faultgouge.analysis.onset.modes.assign`). A pair that is complex at one end and real at the other has an edge
in between, which is solved for. The increment is divided next to the first edge, where something could hide, and
half-way where a complex pair at one end is not recognised at the other; until nothing wider than `Family.narrowest` is
left to doubt.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from ..errors import FaultgougeError, NoEquilibriumError
from ..packing.packing import Floats, Indices
from ..spectrum.spectrum import Complexes
from .edge import Edge, Family, LostPairError, Window, locate
from .modes import Members, Modes, Place, assign
from .pair import Pair, continued, deepest_dip, dip_between
from .screening import Screen, Screening
from .walk import between, walk

Ends = tuple[Pair, Pair]
"""A pair at both ends of an increment."""

Course = tuple[Pair | None, Pair | None, Edge | None]
"""A pair over an increment: at the lower and at the upper load where it is complex there, and the edge in between if it
is complex at one of them alone."""


class LostTrackError(FaultgougeError):
    """The complex pairs of one increment are not those of the increment before."""


class Dense:
    """The oracle; what it is sure of are the courses of all pairs that are complex at either end of an increment."""

    finished = False

    def __init__(self, family: Family, screening: Screening) -> None:
        self.family, self.screening = family, screening
        self._open: dict[Pair, Edge] | None = None  # the onsets of the windows that are open at the load reached so far
        self._closed: list[Window] = []
        self._known: list[Pair] = []  # the few pairs at the load reached so far
        self._solved: dict[tuple[float, float], Edge] = {}

    def candidates(self, places: Sequence[Place], depth: int) -> Iterator[list[Ends] | None]:
        """The pairs that may meet; None where these are not few, or the increment has been divided."""
        for here, there in pairwise(places):
            planes = self.screening(here.matrix, there.matrix) if depth == 0 else None
            pairs = None if planes is None else self._followed(planes, here, there)
            if depth == 0:
                self._known = [after for _, after in pairs or []]
            yield pairs

    def confirm(
        self, candidates: list[Ends] | None, here: Place, there: Place, depth: int
    ) -> tuple[list[Course] | None, list[Place]]:
        """The courses of the few pairs if these are plain, else those of all, once nothing can hide any more."""
        courses = None if candidates is None else self._plain(candidates)
        if courses is not None:
            return courses, []
        step = Step(here.modes, there.modes)
        divide = self._between(step)
        return (None if divide else [self._course(step, *fate) for fate in step.fates]), divide

    def record(self, sure: list[Course]) -> None:
        """Carry the open windows over an increment.

        Raises
        ------
        LostTrackError
            If the pairs that are complex at its beginning are not those of the open windows.
        """
        if self._open is None:
            self._open = {before: Edge.start(before) for before, _, _ in sure if before}
        now: dict[Pair, Edge] = {}
        for before, after, edge in sure:
            onset = edge
            if before is not None:
                known = before.closest(self._open)
                if known is None:
                    raise LostTrackError
                onset = self._open.pop(known)
            assert onset is not None
            if after is None:
                self._closed.append(Window.between(onset, edge))
            else:
                now[after] = onset
        if self._open:
            raise LostTrackError
        self._open = now

    def windows(self) -> tuple[Window, ...]:
        """All windows by increasing onset."""
        still = [Window.between(onset, None) for onset in (self._open or {}).values()]
        return tuple(sorted(self._closed + still, key=lambda window: window.fx_onset))

    # A few pairs

    def _followed(self, planes: list[Floats], here: Place, there: Place) -> list[Ends] | None:
        """The pairs of these planes at both loads; None if one of them cannot be followed, or is within rounding."""
        pairs: list[Ends] = []
        for plane in planes:
            guess = Pair(here.fx, here.matrix, plane, plane)
            a = guess.closest(self._known) or continued(guess, here.fx, here.matrix, self.family.limits)
            b = None if a is None else continued(a, there.fx, there.matrix, self.family.limits)
            if a is None or b is None or any(before.same_planes(a) for before, _ in pairs):
                return None
            if not a.definite or not b.definite:
                return None
            pairs.append((a, b))
        return pairs

    def _plain(self, pairs: list[Ends]) -> list[Course] | None:
        """The courses of those that are complex at an end; None if more than one changes, or one not plainly."""
        changing = [pair for pair in pairs if not self._keeps_sign(*pair)]
        edge = self._plain_edge(*changing[0]) if len(changing) == 1 else None
        if changing and edge is None:
            return None
        ends = [[pair if pair.discriminant < 0 else None for pair in each] for each in pairs]
        return [(before, after, edge) for before, after in ends if before or after]

    def _plain_edge(self, here: Pair, there: Pair) -> Edge | None:
        """The edge of a pair if it has one and no more between two loads, as far as its D tells."""
        solution = self._solution(here, there) if here.discriminant * there.discriminant <= 0 else None
        if solution is None:
            return None
        edge, below, above = solution
        plain = here.fx < below.fx < above.fx < there.fx
        return edge if plain and self._keeps_sign(here, below) and self._keeps_sign(above, there) else None

    def _keeps_sign(self, here: Pair, there: Pair) -> bool:
        """Whether the discriminant of a pair surely has one sign between two loads."""
        if here.discriminant * there.discriminant <= 0:
            return False
        return dip_between(here, there, self.family.limits)[0] <= self.family.narrowest

    # All modes

    def _between(self, step: "Step") -> list[Place]:
        """Where a step is to be divided; nowhere if all is known of it."""
        here, there = step.here, step.there
        if (here.fx, there.fx) in self._solved or there.fx - here.fx <= self.family.narrowest:
            return []
        halfway = 0.5 * (here.fx + there.fx)
        middle = halfway if any(ends is None for *_, ends in step.fates) else step.hidden_window(self.family)
        changing = [ends for before, after, ends in step.fates if ends and not (before and after)]
        if middle is None and changing:
            solution = self._solution(*changing[0])
            if solution is None:
                middle = halfway
            elif here.fx < solution[1].fx < solution[2].fx < there.fx:
                # What lies on either side of this edge has yet to be looked at.
                edge, below, above = solution
                self._solved[below.fx, above.fx] = edge
                return [Place(side.fx, side.matrix) for side in (below, above)]
        if middle is None:
            return []
        return between(self.family.at, here.fx, middle, there.fx)

    def _course(self, step: "Step", before: Pair | None, after: Pair | None, ends: Ends | None) -> Course:
        """The course of a pair: its edge is half the step wide if it cannot be solved for."""
        if before and after:
            return before, after, None
        edge = self._solved.get((step.here.fx, step.there.fx)) if ends else None
        if ends and edge is None and (solution := self._solution(*ends)):
            edge = solution[0]
        last = ends[1] if ends else before or after
        assert last is not None
        return before, after, edge or Edge.between(step.here.fx, step.there.fx, last)

    def _solution(self, here: Pair, there: Pair) -> tuple[Edge, Pair, Pair] | None:
        """The edge of a pair between two loads, and the pair close by on either side; None if it is not found."""
        try:
            return locate(self.family, here, there)
        except (NoEquilibriumError, LostPairError):
            return None


class Step:
    """Two neighbouring loads, which mode of one is which of the other, and what becomes of the complex pairs.

    Attributes
    ----------
    forward : ndarray of int, shape (E,)
        The mode there of each mode here, -1 where there is none.
    fates : list of (Pair or None, Pair or None, (Pair, Pair) or None)
        The pairs that are complex at one end at least: at the lower and at the upper load if complex there, and at both
        loads if recognised at both.
    """

    def __init__(self, here: Modes, there: Modes) -> None:
        self.here, self.there = here, there
        self.forward = assign(here, there)
        backward = {int(image): k for k, image in enumerate(self.forward)}
        self.fates: list[tuple[Pair | None, Pair | None, Ends | None]] = []
        arrived = set()
        for members in here.complex_pairs:
            image = int(self.forward[members[0]]), int(self.forward[members[1]])
            ends = self._recognised(members, image)
            if ends and there.conjugate(image):
                arrived.add(image)
            self.fates.append((here.pair(members), there.pair(image) if image in arrived else None, ends))
        for image in there.complex_pairs:
            if image not in arrived:
                members = backward.get(image[0], -1), backward.get(image[1], -1)
                self.fates.append((None, there.pair(image), self._recognised(members, image)))

    def _recognised(self, members: Members, image: Members) -> Ends | None:
        """Two modes at both loads, conjugates or both real, if they are the same pair."""
        if min(*members, *image) < 0 or not (self.here.together(members) and self.there.together(image)):
            return None
        before, after = self.here.pair(members), self.there.pair(image)
        return (before, after) if before.same_planes(after) else None

    def hidden_window(self, family: Family) -> float | None:
        """Place where a window wider than the narrowest, or a gap in one, most likely hides; None if nowhere."""
        here, there = self.here, self.there
        known = np.flatnonzero(self.forward >= 0)
        image = self.forward[known]
        p, q = self._neighbours(known, image)
        if len(p) == 0:
            return None
        change = there.matrix - here.matrix
        # In a window that stays open a gap may hide: turn D over.
        sign = np.where(here.partner[known[p]] < 0, 1.0, -1.0)

        def end(modes: Modes, names: Indices) -> tuple[Floats, Floats]:
            values, drift = modes.values[names], _sensitivity(modes, change)[names]
            gap = values[p] - values[q]
            return sign * (gap**2).real, sign * (2 * gap * (drift[p] - drift[q])).real

        width, at = deepest_dip(*end(here, known), *end(there, image), family.limits.bend)
        span = there.fx - here.fx
        worst = int(np.argmax(width))
        if width[worst] * span <= family.narrowest:
            return None
        margin = 0.25 * family.narrowest / span  # never return an end
        return here.fx + span * float(np.clip(at[worst], margin, 1 - margin))

    def _neighbours(self, known: Indices, image: Indices) -> tuple[Indices, Indices]:
        """Two modes each that can meet: neighbours at one end, those that change order, and pairs that stay complex."""
        here, there = self.here, self.there
        p, q = np.triu_indices(len(known), 1)
        rank = np.empty(len(known), int)
        rank[np.argsort(there.values[image].real)] = np.arange(len(known))
        near = (q - p == 1) | (np.abs(rank[q] - rank[p]) == 1) | (rank[q] < rank[p])
        alone = (here.partner[known] < 0) & (there.partner[image] < 0)
        staying = (here.partner[known[p]] == known[q]) & (there.partner[image[p]] == image[q])
        kept = (near & alone[p] & alone[q]) | staying
        return p[kept], q[kept]


def _sensitivity(modes: Modes, change: csr_array) -> Complexes:
    """First-order change of each eigenvalue, y^H dA x / y^H x."""
    y = modes.left.conj()
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sum(y * (change @ modes.right), axis=0) / np.sum(y * modes.right, axis=0)


def all_windows(family: Family, loads: Floats, screening: Screening | None = None) -> tuple[Window, ...]:
    """All windows of a family of matrices between the first and the last of increasing loads.

    `screening` names the pairs that may meet, a `Screen` by default. It is of finite order: should all modes contradict
    it, the ramp is walked again without it.
    """
    try:
        return _walked(Dense(family, screening or Screen(family.limits)), loads)
    except LostTrackError:
        return _walked(Dense(family, lambda here, there: None), loads)


def _walked(oracle: Dense, loads: Floats) -> tuple[Window, ...]:
    """The windows that an oracle finds along a ramp."""
    here = oracle.family.at(loads[0])
    for load in loads[1:]:
        there = oracle.family.at(load)
        walk(oracle, [here, there])
        here = there
    return oracle.windows()
