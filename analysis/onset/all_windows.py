r"""The search for all windows of a small packing: the oracle that has all modes of a load if it needs them.

**Few pairs.** On most increments nothing happens, and to know that takes no decomposition. The pairs that
perturbation theory names (:mod:`~faultgouge.analysis.onset.perturbation_screening`) are followed one by one. Where at
most one of them changes, and D and its slopes at both ends tell that nothing hides, the increment is done.

**All modes.** Everywhere else the modes of both ends are assigned to each other, so that they keep their names
(:func:`~faultgouge.analysis.onset.modes.assign_modes`). Each pair that is complex at an end, and each pair of real
neighbours between whose eigenvalues something could hide, is then followed alone: its edges are solved for. The
increment is divided where such a pair is not recognised at both ends, changes more than plainly, or might meet a third
mode on the way; until nothing wider than `Family.narrowest` is left to doubt. Whether one of two modes meets a third
shows in the product :math:`(\lambda_1 - \lambda)(\lambda_2 - \lambda) = (\bar\lambda - \lambda)^2 - D / 4`, which is
smooth where the two coalesce. An increment in which contacts change bends the levels: it is divided, too, if something
may hide as the levels go on from the increment before. So is one on which two modes change order though their slopes at
both ends say that they do not meet.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ..errors import NoEquilibriumError, TurningPointError
from ..motion.eigenvalues import Complexes
from ..packing.packing import Floats, Indices
from .eigenvalue_pair import Pair, continue_pair, deepest_dip, dip_between
from .march import look_between, march
from .modes import LoadPoint, Members, Modes, assign_modes, neighbours
from .perturbation_screening import PairScreen, Screening
from .window_edges import (
    DoubtError,
    Edge,
    Family,
    LostPairError,
    LostTrackError,
    Window,
    locate_edge,
    other_sign,
)

Ends = tuple[Pair, Pair]
"""A pair at both ends of an increment."""

Course = tuple[Pair | None, Pair | None, tuple[Edge, ...]]
"""A pair over an increment: at the lower and at the upper load where it is complex there, and its edges in between."""

Fate = tuple[Pair | None, Pair | None, Ends | None]
"""A pair at the lower and at the upper load where it is complex there, and at both loads if recognised at both."""


class AllPairs:
    """The oracle; what it is sure of are the courses of all pairs that are complex at either end of an increment."""

    def __init__(self, family: Family, screening: Screening, first: bool = False) -> None:
        self.family, self.screening, self._first = family, screening, first
        self._open: dict[Pair, Edge] | None = None  # the onsets of the windows that are open at the load reached so far
        self._closed: list[Window] = []
        self._reached: tuple[LoadPoint, LoadPoint] | None = None  # the last step that was looked at
        self._known: list[Pair] = []  # the few pairs at the load reached so far

    @property
    def finished(self) -> bool:
        """Whether the first window has been found, and is all that is sought."""
        return self._first and bool(self._open or self._closed)

    def candidates(self, places: Sequence[LoadPoint], depth: int) -> Iterator[list[Ends] | None]:
        """The pairs that may meet; None where these are not few, or the increment has been divided."""
        for here, there in pairwise(places):
            planes = self.screening(here.matrix, there.matrix, len(self._open or {})) if depth == 0 else None
            pairs = None if planes is None else self._follow(planes, here, there)
            if depth == 0:
                self._known = [after for _, after in pairs or []]
            yield pairs

    def confirm(
        self, candidates: list[Ends] | None, here: LoadPoint, there: LoadPoint, depth: int
    ) -> tuple[list[Course] | None, list[LoadPoint]]:
        """The courses of the few pairs if these are plain, else those of all, once nothing can hide any more."""
        courses = None if candidates is None else self._few(candidates)
        if courses is not None:
            return courses, []
        step = PairStep(here.modes, there.modes, self._arrival(here, there))
        courses = self._all(step, depth)
        if courses is None and there.fx - here.fx > self.family.narrowest:
            share = self.family.limits.share
            middle = look_between(self.family.at, here.fx, (1 - share) * here.fx + share * there.fx, there.fx)
            if middle:
                return None, middle
        if courses is None:
            courses = [self._blunt(here, there, *fate) for fate in step.fates]
        return courses, []

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
        for before, after, edges in sure:
            onset = None
            if before is not None:
                known = before if before in self._open else before.closest(self._open)
                if known is None:
                    raise LostTrackError
                onset = self._open.pop(known)
            for edge in edges:
                if onset is not None:
                    self._closed.append(Window.between(onset, edge))
                onset = edge if onset is None else None
            if after is not None:
                assert onset is not None
                now[after] = onset
        if self._open:
            raise LostTrackError
        self._open = now

    def windows(self) -> tuple[Window, ...]:
        """All windows by increasing onset."""
        still = [Window.between(onset, None) for onset in (self._open or {}).values()]
        return tuple(sorted(self._closed + still, key=lambda window: window.fx_onset))

    # A few pairs

    def _follow(self, planes: list[Floats], here: LoadPoint, there: LoadPoint) -> list[Ends] | None:
        """The pairs of these planes at both loads; None if one of them cannot be followed, or is within rounding."""
        pairs: list[Ends] = []
        for plane in planes:
            guess = Pair(here.fx, here.matrix, plane, plane)
            a = guess.closest(self._known) or continue_pair(guess, here.fx, here.matrix, self.family.limits)
            b = None if a is None else continue_pair(a, there.fx, there.matrix, self.family.limits)
            if a is None or b is None or any(before.same_planes(a) for before, _ in pairs):
                return None
            if not a.definite or not b.definite:
                return None
            pairs.append((a, b))
        return pairs

    def _few(self, pairs: list[Ends]) -> list[Course] | None:
        """The courses of a few pairs; None if more than one changes, or one not plainly."""
        if sum(not self._keeps_sign(*ends) for ends in pairs) > 1:
            return None
        complex_ends = [[pair if pair.discriminant < 0 else None for pair in ends] for ends in pairs]
        return self._courses([(before, after, ends) for (before, after), ends in zip(complex_ends, pairs, strict=True)])

    # All modes

    def _all(self, step: "PairStep", depth: int) -> list[Course] | None:
        """The courses of all pairs that are complex somewhere on a step; None if that is in doubt."""
        near = step.near(self.family)
        recognised = [(before, after, ends) for before, after, ends in step.fates if ends is not None]
        if near is None or len(recognised) < len(step.fates):
            return None
        changing = [ends for before, after, ends in recognised if (before is None) != (after is None)]
        limits = self.family.limits
        parts = limits.bent if step.bent else limits.changing
        if ((changing or near) and depth < parts) or not step.apart(changing, self.family):
            return None
        hidden = self._courses([(None, None, ends) for ends in near])
        if hidden is None or (hidden and not step.apart([*changing, *near], self.family)):
            return None
        courses = self._courses(recognised)
        return None if courses is None else courses + hidden

    def _arrival(self, here: LoadPoint, there: LoadPoint) -> csr_array | None:
        """The change of the operator over a step if it goes on as on the way to its beginning; None if not known."""
        before, self._reached = self._reached, (here, there)
        if before is None or before[1] is not here:
            return None
        last = before[0]
        return (there.fx - here.fx) / (here.fx - last.fx) * (here.matrix - last.matrix)

    def _courses(self, fates: list[tuple[Pair | None, Pair | None, Ends]]) -> list[Course] | None:
        """The courses of those pairs that are complex somewhere; None if the edges of one are not plain."""
        courses: list[Course] = []
        for before, after, ends in fates:
            edges = self._edges(ends, (before is None) != (after is None))
            if edges is None:
                return None
            if before or after or edges:
                courses.append((before, after, edges))
        return courses

    def _edges(self, ends: Ends, changes: bool) -> tuple[Edge, ...] | None:
        """The edges of a pair that is recognised at both loads; None if they are not plain."""
        pairs: list[Pair] = list(ends)
        if not changes:
            if self._keeps_sign(*ends):
                return ()
            if ends[0].discriminant * ends[1].discriminant <= 0:
                return None
            try:
                inside = other_sign(self.family, pairs, self.family.narrowest, dipping=True)
            except (NoEquilibriumError, LostPairError, DoubtError):
                return None
            if inside is None:
                return ()
            if not inside.definite:
                return None
            pairs.insert(1, inside)
        edges = [self._plain_edge(*both) for both in pairwise(pairs)]
        return None if None in edges else tuple(edge for edge in edges if edge)

    def _plain_edge(self, here: Pair, there: Pair) -> Edge | None:
        """The edge of a pair between two loads, if it has one and no more, as far as its D tells."""
        solution = self._solution(here, there)
        if solution is None:
            return None
        edge, below, above = solution
        inner = here.fx < below.fx < above.fx < there.fx  # else one end is within rounding of the edge
        return edge if not inner or (self._keeps_sign(here, below) and self._keeps_sign(above, there)) else None

    def _keeps_sign(self, here: Pair, there: Pair) -> bool:
        """Whether the discriminant of a pair surely has one sign between two loads."""
        if here.discriminant * there.discriminant <= 0:
            return False
        return dip_between(here, there, self.family.limits)[0] <= self.family.narrowest

    def _blunt(
        self, here: LoadPoint, there: LoadPoint, before: Pair | None, after: Pair | None, ends: Ends | None
    ) -> Course:
        """The course of a pair over a step that is not divided: an edge that is not solved for is half of it wide."""
        if before and after:
            return before, after, ()
        solution = self._solution(*ends) if ends else None
        last = ends[1] if ends else before or after
        assert last is not None
        return before, after, (solution[0] if solution else Edge.between(here.fx, there.fx, last),)

    def _solution(self, here: Pair, there: Pair) -> tuple[Edge, Pair, Pair] | None:
        """The edge of a pair between two loads, and the pair close by on either side; None if it is not found."""
        try:
            return locate_edge(self.family, here, there)
        except (NoEquilibriumError, LostPairError):
            return None


class PairStep:
    """Two neighbouring loads, which mode of one is which of the other, and what becomes of the complex pairs.

    Attributes
    ----------
    forward : ndarray of int, shape (E,)
        The mode there of each mode here, -1 where there is none.
    fates : list of Fate
        The pairs that are complex at one end at least.
    """

    def __init__(self, here: Modes, there: Modes, arrival: csr_array | None) -> None:
        self.ends, self.arrival, self.span = (here, there), arrival, there.fx - here.fx
        self.forward = assign_modes(here, there)
        backward = {int(image): k for k, image in enumerate(self.forward)}
        self.fates: list[Fate] = []
        arrived = set()
        for members in here.complex_pairs:
            image = int(self.forward[members[0]]), int(self.forward[members[1]])
            ends = self._recognise(members, image)
            if ends and there.conjugate(image):
                arrived.add(image)
            self.fates.append((here.pair(members), there.pair(image) if image in arrived else None, ends))
        for image in there.complex_pairs:
            if image not in arrived:
                members = backward.get(image[0], -1), backward.get(image[1], -1)
                self.fates.append((None, there.pair(image), self._recognise(members, image)))

    def _recognise(self, members: Members, image: Members) -> Ends | None:
        """Two modes at both loads, conjugates or both real, if they are the same pair."""
        here, there = self.ends
        if min(*members, *image) < 0 or not (here.together(members) and there.together(image)):
            return None
        before, after = here.pair(members), there.pair(image)
        return (before, after) if before.same_planes(after) else None

    def near(self, family: Family) -> list[Ends] | None:
        """Real neighbours between which a window wider than the narrowest may hide; None if one is not recognised."""
        here = self.ends[0]
        known = np.flatnonzero(self.forward >= 0)
        image = self.forward[known]
        p, q = self._neighbours(known, image)
        if len(p) == 0:
            return []

        gaps = [
            modes.values.real[names][p] - modes.values.real[names][q]
            for modes, names in zip(self.ends, (known, image), strict=True)
        ]

        def wide(*drifts: Floats) -> NDArray[np.bool_]:
            numbers: list[Floats] = []
            for gap, drift, names in zip(gaps, drifts, (known, image), strict=True):
                rates = drift[names]
                numbers += [gap**2, 2 * gap * (rates[p] - rates[q])]
            d0, s0, d1, s1 = numbers
            return deepest_dip(d0, s0, d1, s1, family.limits.bend)[0] * self.span > family.narrowest

        near = wide(*self.drifts)
        if np.any((gaps[0] * gaps[1] < 0) & ~near):  # they meet, and their slopes do not say so
            return None
        if self.arrival is not None and np.any(wide(_sensitivity(here, self.arrival).real, self.drifts[1]) & ~near):
            return None
        found: list[Ends] = []
        for k in np.flatnonzero(near):
            ends = self._recognise((int(known[p[k]]), int(known[q[k]])), (int(image[p[k]]), int(image[q[k]])))
            if ends is None:
                return None
            found.append(ends)
        return found

    def apart(self, changing: list[Ends], family: Family) -> bool:
        """Whether pairs that turn complex or real on the step surely meet neither a real mode nor one another."""
        if not changing:
            return True
        here, there = self.ends
        alone = np.flatnonzero((self.forward >= 0) & (here.partner < 0))
        alone = alone[there.partner[self.forward[alone]] < 0]
        names, motions = (alone, self.forward[alone]), []
        for modes, rates, each, pairs in zip(self.ends, self.drifts, names, zip(*changing, strict=True), strict=True):
            real = np.array([modes.values.real[each], np.zeros(len(each)), rates[each], np.zeros(len(each))])
            motions.append(np.column_stack([*(_motion(pair, self.change) for pair in pairs), real]))
        for k, pair in enumerate(changing):
            below, above = (_resultant(motion[:, k], motion[:, k + 1 :]) for motion in motions)
            if min(end.discriminant for end in pair) > 0:  # two of the real modes are its own
                others = np.argsort(np.abs(below[0]))[2:]
                below, above = below[:, others], above[:, others]
            width = deepest_dip(below[0], below[1], above[0], above[1], family.limits.bend)[0].max(initial=0.0)
            if min(below[0].min(initial=1.0), above[0].min(initial=1.0)) <= 0 or width * self.span > family.narrowest:
                return False
        return True

    @property
    def bent(self) -> bool:
        """Whether contacts open or close on the step, whose stiffness goes as the root of the overlap."""
        here, there = (modes.matrix for modes in self.ends)
        return not (np.array_equal(here.indptr, there.indptr) and np.array_equal(here.indices, there.indices))

    @cached_property
    def change(self) -> csr_array:
        """The difference of the operators."""
        here, there = self.ends
        return there.matrix - here.matrix

    @cached_property
    def drifts(self) -> tuple[Floats, Floats]:
        """First-order change of each real eigenvalue over the step, y^H dA x / y^H x, at either end."""
        here, there = self.ends
        return _sensitivity(here, self.change).real, _sensitivity(there, self.change).real

    def _neighbours(self, known: Indices, image: Indices) -> tuple[Indices, Indices]:
        """Two real modes each that can meet: neighbours at one end, and those that change order."""
        here, there = self.ends
        p, q = neighbours(here.values[known].real, there.values[image].real, 1)
        alone = (here.partner[known] < 0) & (there.partner[image] < 0)
        kept = alone[p] & alone[q]
        return p[kept], q[kept]


def _motion(pair: Pair, change: csr_array) -> Floats:
    """Mean and discriminant of a pair, and the first-order changes of both."""
    return np.array([pair.mean, pair.discriminant, 0.5 * np.trace(pair.block(change)), pair.slope(change)])


def _resultant(pair: Floats, others: Floats) -> Floats:
    """The product of the four differences of the eigenvalues of a pair and of others, and its first-order change.

    All are given by their `_motion`, shapes (4,) and (4, P); a mode alone counts as a double eigenvalue.
    """
    gap, discriminants, drift, slopes = pair[0] - others[0], others[1], pair[2] - others[2], others[3]
    half = gap**2 - 0.25 * (pair[1] + discriminants)
    change = 2 * gap * drift - 0.25 * (pair[3] + slopes)
    product = 0.25 * pair[1] * discriminants
    return np.array([half**2 - product, 2 * half * change - 0.25 * (pair[3] * discriminants + pair[1] * slopes)])


def _sensitivity(modes: Modes, change: csr_array) -> Complexes:
    """First-order change of each eigenvalue, y^H dA x / y^H x."""
    y = modes.left.conj()
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sum(y * (change @ modes.right), axis=0) / np.sum(y * modes.right, axis=0)


def all_windows(
    family: Family, loads: Floats, screening: Screening | None = None, first: bool = False
) -> tuple[Window, ...]:
    """All windows of a family of matrices between the first and the last of increasing loads.

    `screening` names the pairs that may meet, a `PairScreen` by default. It is of finite order: should all modes
    contradict it, the ramp is walked again without it. If the `first` window alone is sought, the walk ends with it,
    and no load beyond the increment in which it begins is asked for; the windows are then those that begin up to there.
    """
    *_, (_, windows) = windows_along(family, loads, screening, first)
    return windows


def windows_along(
    family: Family, loads: Floats, screening: Screening | None = None, first: bool = False
) -> Iterator[tuple[float, tuple[Window, ...]]]:
    """Each load but the smallest as it is reached, and all windows up to there; arguments are those of `all_windows`.

    The walk ends where an eigenvalue is found to be negative: the branch of equilibria has ended before that load.
    """
    reached = float(loads[0])
    ways = screening or PairScreen(family.limits), _without_screening
    for way in ways:
        try:
            for load, windows in _march_along_ramp(AllPairs(family, way, first), loads):
                if load > reached or (first and windows):  # the second walk may find what the first one missed
                    reached = max(reached, load)
                    yield load, windows
            return
        except LostTrackError:
            if way is _without_screening:
                raise


def _without_screening(here: csr_array, there: csr_array, known: int) -> None:
    """No pairs are named: all modes tell."""


def _march_along_ramp(oracle: AllPairs, loads: Floats) -> Iterator[tuple[float, tuple[Window, ...]]]:
    """The loads of a ramp as an oracle reaches them, and the windows up to there."""
    here = oracle.family.at(loads[0])
    for load in loads[1:]:
        try:
            steps = oracle.family.steps(here, load)
        except TurningPointError:
            if not oracle.windows():
                raise
            return
        for there in steps:
            march(oracle, [here, there])
            here = there
            if oracle.finished:
                break
        yield float(load), oracle.windows()
        if oracle.finished:
            return
