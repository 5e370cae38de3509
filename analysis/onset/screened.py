"""The search for all windows of a small packing: the oracle that follows the few pairs that may meet.

On most increments nothing happens, and to know that takes no decomposition. Perturbation theory, in a basis that serves
many increments, names the pairs that may meet (:mod:`~faultgouge.analysis.onset.screening`). Each of these is followed
by itself (:mod:`~faultgouge.analysis.onset.pair`). Its D, known to all digits at both loads with its slopes, tells
whether it keeps its sign. If all do, the windows that are open go on. If one does not, its edge is solved for, and D
tells of either side. Where more than one may change, or a pair cannot be followed, all modes of both loads are computed
(:mod:`~faultgouge.analysis.onset.all_modes`).
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from scipy.sparse import csr_array

from ..errors import NoEquilibriumError
from ..packing import Floats
from .all_modes import AllModes, Decompose
from .basis import Basis
from .dip import dip_between
from .edge import Edge, Family, LostPairError, locate
from .limits import LIMITS, Limits
from .modes import Modes
from .pair import Pair, Place, continued
from .screening import Levels, may_meet
from .walk import walk
from .windows import Course, Ledger, LostTrackError, Window

Planes = list[Floats]
"""Orthonormal bases, shape (n, 2), of the pairs that may meet."""


Screening = Callable[[csr_array, csr_array], Planes | None]
"""Who names the pairs that may meet between two operators; None if they are more than a few, or not known."""

Followed = tuple[Pair, Pair, bool]
"""A pair at both ends of an increment, and whether it surely stays real, or complex, all through."""


class Screen:
    """Pairs that may meet along a ramp, from one basis for as many increments as it serves."""

    def __init__(self, limits: Limits = LIMITS) -> None:
        self.limits = limits
        self._base: csr_array | None = None
        self._basis: Basis | None = None
        self._seen: tuple[csr_array, Levels] | None = None

    def __call__(self, here: csr_array, there: csr_array) -> Planes | None:
        """The planes of the pairs; None if they are more than `Limits.few`, or if the coordinates change."""
        found = None if self._basis is None else self._look(self._basis, here, there)
        if (found is None or len(found) > 0) and self._base is not here:
            self._base, self._basis, self._seen = here, Basis.of(here, self.limits), None
            found = self._look(self._basis, here, there)
        return found

    def _look(self, basis: Basis, here: csr_array, there: csr_array) -> Planes | None:
        if not (basis.covers(here) and basis.covers(there)):
            return None
        if self._seen is None:
            self._seen = here, basis.levels(here)
        elif self._seen[0] is not here:
            self._seen = here, basis.change(self._seen[1], here - self._seen[0])
        before = self._seen[1]
        after = basis.change(before, there - here)
        self._seen = there, after
        pairs = may_meet(before, after, self.limits.slack)
        return [basis.lifted(pair) for pair in pairs] if len(pairs) <= self.limits.few else None


class Screened:
    """The oracle; its places are operators. What it is not sure of the walker takes through all modes."""

    finished = False

    def __init__(self, family: Family, screening: Screening, fallback: AllModes) -> None:
        self.family, self.screening, self.fallback, self.ledger = family, screening, fallback, fallback.ledger
        self._modes: Modes | None = None  # the last that were computed
        self._known: list[Pair] = []  # pairs at the load reached so far

    def candidates(self, places: Sequence[Place]) -> Iterator[Planes | None]:
        """The planes of the pairs that may meet on each increment; None where they cannot be told."""
        return (self.screening(here.matrix, there.matrix) for here, there in pairwise(places))

    def confirm(
        self, planes: Planes | None, here: Place, there: Place, depth: int
    ) -> tuple[list[Course] | None, list[Place]]:
        """The courses of these pairs if they are plain; else all modes tell."""
        pairs = None if planes is None else self._followed(planes, here, there)
        self._known = [after for _, after, _ in pairs or []]
        courses = None if pairs is None else self._courses(pairs)
        if pairs is not None and courses is not None:
            self.ledger.begin(before for before, _, _ in pairs if before.discriminant < 0)
            return courses, []
        decompose = self.fallback.decompose
        before = self._modes if self._modes is not None and self._modes.fx == here.fx else decompose(*here)
        self.ledger.begin(before.pair(members) for members in before.complex_pairs)
        self._modes = decompose(*there)
        walk(self.fallback, [before, self._modes])
        return None, []

    def record(self, sure: list[Course]) -> None:
        """Carry the open windows over an increment."""
        self.ledger.carry(sure)

    def _followed(self, planes: Planes, here: Place, there: Place) -> list[Followed] | None:
        """The pairs of these planes at both loads; None if one of them cannot be followed, or is within rounding."""
        pairs: list[Followed] = []
        for plane in planes:
            guess = Pair(*here, plane, plane)
            a = guess.closest(self._known) or continued(guess, *here, self.family.limits)
            b = None if a is None else continued(a, *there, self.family.limits)
            if a is None or b is None or any(before.same_planes(a) for before, _, _ in pairs):
                return None
            if not a.definite or not b.definite:
                return None
            pairs.append((a, b, self._keeps_sign(a, b)))
        return pairs

    def _courses(self, pairs: list[Followed]) -> list[Course] | None:
        """The courses of those that are complex at an end; None if more than one changes, or one not plainly."""
        changing = [(here, there) for here, there, steady in pairs if not steady]
        edge = self._plain_edge(*changing[0]) if len(changing) == 1 else None
        if changing and edge is None:
            return None
        return [
            (here if here.discriminant < 0 else None, there if there.discriminant < 0 else None, edge)
            for here, there, steady in pairs
            if not (steady and here.discriminant > 0)
        ]

    def _plain_edge(self, here: Pair, there: Pair) -> Edge | None:
        """The edge of a pair if it has one and no more between two loads, as far as its D tells."""
        if here.discriminant * there.discriminant > 0:
            return None
        try:
            edge, below, above = locate(self.family, here, there)
        except (NoEquilibriumError, LostPairError):
            return None
        plain = here.fx < below.fx < above.fx < there.fx
        return edge if plain and self._keeps_sign(here, below) and self._keeps_sign(above, there) else None

    def _keeps_sign(self, here: Pair, there: Pair) -> bool:
        """Whether the discriminant of a pair surely has one sign between two loads."""
        if here.discriminant * there.discriminant <= 0:
            return False
        return dip_between(here, there, self.family.limits)[0] <= self.family.narrowest


def all_windows(
    family: Family,
    loads: Floats,
    screening: Callable[[], Screening] | None = None,
    decompose: Decompose = Modes.of,
) -> tuple[Window, ...]:
    """All windows of a family of matrices between the first and the last of increasing loads.

    Screening is of finite order. Should all modes contradict it, the ramp is walked again with all modes throughout.

    Parameters
    ----------
    family : Family
    loads : ndarray, shape (S,)
    screening : callable, optional
        Makes a `Screening`; `Screen` by default.
    decompose : callable
        (fx, matrix) -> Modes.
    """
    screens = (Screen(family.limits) if screening is None else screening(), lambda here, there: None)
    for screen in screens:
        ledger = Ledger()
        oracle = Screened(family, screen, AllModes(family, ledger, decompose))
        try:
            here = family.at(loads[0])
            for load in loads[1:]:
                there = family.at(load)
                walk(oracle, [here, there])
                here = there
        except LostTrackError:
            if screen is screens[-1]:
                raise
            continue
        break
    return ledger.all()
