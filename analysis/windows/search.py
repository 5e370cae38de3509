r"""Windows of loads on which motion grows: one search, without dissipation and with it, from eigenvalues alone.

Without dissipation two real eigenvalues of A meet, and go on as a complex pair. Their mean and the *discriminant*

.. math:: D = (\lambda_1 - \lambda_2)^2

are smooth functions of the matrix where the two meet (Kato, *Perturbation Theory for Linear Operators*, 1966, II.1),
so that a backward stable solver returns D with an error of rounding times |A|, although each eigenvalue errs by the
root of that. D < 0 is a complex pair. With dissipation :math:`\mathrm{Re}\, s` of one eigenvalue goes through zero. So
a motion *grows* where -D, or Re s, is positive, and a window begins and ends where this number changes its sign.

**Between two loads a and b** all motions are known at both ends, with slopes. The shapes of motions that grow tell
which of these are the same at both ends. If one motion more grows at one end, its edge lies in between, and is solved
for (:mod:`~faultgouge.analysis.windows.edges`). Two or more changes are in doubt. What grows at neither end, or at
both, may do otherwise in between: a function g that is positive at both ends, whose slopes are known, too, has a cubic
through all four numbers. Where the cubic, less `BEND` of the smaller g, is negative, a window may hide (`lowest`).
Without dissipation g is D of neighbouring real levels, and -D of a complex pair. Two levels that pass each other touch
D = 0, and have to be looked at there. With dissipation the cubics of the mean m and of D of two eigenvalues tell the
real parts of :math:`m \pm \tfrac12\sqrt D`, which neither coalescence nor crossing disturbs (`excursion`).

**An increment in doubt is divided** where the doubt is largest, down to increments of `narrowest`. What changes on
these is a jump of the equilibrium. Where contacts change the levels bend, so that the search first takes a short step
about each such change.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import Complexes, Floats, Indices
from ..errors import NoEquilibriumError, TurningPointError
from .edges import DoubtError, Track, growth_of, nearest_pair, sign_change, track_point
from .motions import Motions, System
from .onset import Edge, Window

SystemOfLoad = Callable[[float], System]
"""Load -> the system there."""

Look = Callable[[float, float], Iterable[float]]
"""Two neighbouring loads of a ramp -> further loads between them that are to be looked at."""

Few = Callable[[System, System], tuple[Motions, Motions] | None]
"""The motions that may change between two loads, at both; None if all motions have to be looked at."""

Changes = tuple[list[tuple[int, int]], dict[int, Edge], dict[int, Edge]]
"""What happens between two loads: motions that go on growing, those that begin to grow, and those that cease to, with
the edge. Motions are numbers in the states at the lower and at the upper load."""

BEND = 0.05
"""Curvature that two values and slopes do not show, as a share of the smaller value: more than enough for loads
between which motions are recognised at all."""

ALIKE = 0.2
"""Product of the overlaps of left and of right vectors from which on two motions are the same."""

BEND_LENGTH = 2.0**-4
"""Length in increments of the step about a load at which contacts change, in which a window may still hide."""

LOOKS = 12
"""Looks at a pair before it is in doubt whether it meets in between: levels that pass each other take one or two."""

PLACES = np.linspace(0, 1, 41)[1:-1]
"""Where in an increment the cubics are looked at."""


class Search:
    """The windows of a family of systems, from load to load; narrower ones than `narrowest`, force, are not looked for.

    `few` names the few motions that may change, and `decompose` gives all motions of a system; with `first` the walk
    ends with the first window.
    """

    def __init__(
        self, system: SystemOfLoad, narrowest: float, few: Few | None = None, first: bool = False,
        decompose: Callable[[System], Motions] = Motions.of,
    ) -> None:  # fmt: skip
        self.at, self.narrowest, self.few, self.first = system, narrowest, few, first
        self._decompose = decompose
        self.growing: list[tuple[complex, Edge]] | None = None  # eigenvalues at the load reached so far
        self.closed: list[Window] = []
        self._known: dict[float, Motions] = {}
        self._before: System | None = None

    def along(self, loads: Floats, look: Look = lambda below, above: ()) -> Iterator[tuple[float, tuple[Window, ...]]]:
        """Yield each load but the smallest, with all windows up to this load, by increasing onset.

        If an eigenvalue is negative at a load, the branch of equilibria has ended before this load. The walk then ends
        if there is a window, and otherwise raises the TurningPointError.
        """
        here = self.at(float(loads[0]))
        for below, above in pairwise(map(float, loads)):
            for load in [*sorted(look(below, above)), above]:
                try:
                    there = self.at(load)
                except NoEquilibriumError as error:
                    if isinstance(error, TurningPointError) and (self.growing or self.closed):
                        return
                    if load == above or isinstance(error, TurningPointError):
                        raise
                    continue
                # where contacts change on the way, a short step about each change
                for place in [*self._bends(here, there, BEND_LENGTH * (there.fx - here.fx)), there]:
                    if place.fx > here.fx and not self._finished:
                        self._advance(here, place)
                        here = place
                still = [Window(onset, None) for _, onset in self.growing or []]
                yield here.fx, tuple(sorted(self.closed + still, key=lambda window: window.fx_onset))
                if self._finished:
                    return

    @property
    def _finished(self) -> bool:
        """Whether the first window has been found, and is all that is sought."""
        return self.first and bool(self.growing or self.closed)

    def _bends(self, below: System, above: System, shortest: float) -> list[System]:
        """The ends of short steps in which contacts change."""
        if below.states == above.states:
            return []
        middle = None
        if above.fx - below.fx > shortest:
            middle = self._between(below.fx, 0.5 * (below.fx + above.fx), above.fx)
        if middle is None:
            return [below, above]
        return [*self._bends(below, middle, shortest), *self._bends(middle, above, shortest)]

    def _between(self, below: float, middle: float, above: float) -> System | None:
        """The system at the middle load, or at a load beside it; None if none of these has an equilibrium."""
        for fx in (middle, 0.5 * (below + middle), 0.5 * (middle + above)):
            with suppress(NoEquilibriumError):
                return self.at(fx) if below < fx < above else None
        return None

    def _motions(self, *systems: System) -> list[Motions]:
        """All motions of systems, kept as long as their loads are not passed."""
        for each in systems:
            if each.fx not in self._known:
                self._known[each.fx] = self._decompose(each)
        return [self._known[each.fx] for each in systems]

    def _advance(self, here: System, there: System) -> None:
        """Carry the windows over an increment, divided while it is in doubt."""
        span = there.fx - here.fx
        try:
            few = self.few(here, there) if self.few else None
            below, above = few or self._motions(here, there)
            if self.growing is None:
                begun = np.flatnonzero(below.grows).tolist()
                self.growing = [(below.values[k], _edge_at(below, k, here.fx, 0.0)) for k in begun]
            if few and len(self.growing) != below.grows.sum():
                below, above = self._motions(here, there)
            drifts = below.slopes(there), above.slopes(here)
            changes = self._changes_of_pairs if here.damping is None else self._changes_of_motions
            same, begins, ends = changes((below, above), drifts)
        except DoubtError as doubt:
            if span > self.narrowest:
                fx = doubt.args[0] if doubt.args else here.fx + 0.47 * span
                fx = float(np.clip(fx, here.fx + 0.02 * span, there.fx - 0.02 * span))
                if (inside := self._between(here.fx, fx, there.fx)) is not None:
                    self._advance(here, inside)
                    if not self._finished:
                        self._advance(inside, there)
                    return
            # an increment that is not divided: an unsolved edge is uncertain by half of it
            below, above = self._motions(here, there)
            same, begun, ended = recognised(below, above, -1.0)
            middle, half = 0.5 * (here.fx + there.fx), 0.5 * span
            begins = {k: _edge_at(above, k, middle, half + there.balance) for k in begun}
            ends = {k: _edge_at(below, k, middle, half + here.balance) for k in ended}
        left = list(self.growing or [])

        def onset_of(k: int) -> Edge:
            nearest = min(range(len(left)), key=lambda j: abs(left[j][0] - below.values[k]))
            return left.pop(nearest)[1]

        self.closed += [Window(onset_of(k), edge) for k, edge in ends.items()]
        self.growing = [(above.values[j], onset_of(i)) for i, j in same]
        self.growing += [(above.values[k], edge) for k, edge in begins.items()]
        self._before = here
        self._known = {fx: each for fx, each in self._known.items() if fx >= there.fx}

    def _changes_of_pairs(self, states: tuple[Motions, Motions], drifts: Sequence[Complexes]) -> Changes:
        """What happens between two loads without dissipation; a DoubtError if that is not sure.

        What changes is real at one load and a complex pair at the other.
        """
        (below, above), span = states, states[1].system.fx - states[0].system.fx
        same, begun, ended = recognised(below, above, ALIKE)
        if len(begun) + len(ended) > 1:
            raise DoubtError
        levels = [np.flatnonzero(~each.grows) for each in states]
        edges: list[dict[int, Edge]] = [{}, {}]
        for inside, k in [(1, k) for k in begun] + [(0, k) for k in ended]:
            # the two real levels that are the pair at the other load
            out, (fx, numbers, slopes) = 1 - inside, track_point(states[inside], drifts[inside], k)
            expected = numbers + (states[out].system.fx - fx) * slopes
            _, two = nearest_pair(states[out].values[levels[out]], expected)
            members = [k], [int(level) for level in levels[out][two]]
            edges[inside][k] = self._edge(self._track(states, drifts, *(members[::-1] if inside else members)))
            levels[out] = np.delete(levels[out], two)
        if not (below.whole and above.whole):  # some have no partner, as another one is nearer to the point there
            alike = below.alike(above, *levels)
            pairs = sorted((levels[0][i], levels[1][j]) for i, j in assign(alike) if alike[i, j] > ALIKE)
            levels = [np.array(sorted(pair[end] for pair in pairs), dtype=np.int64) for end in (0, 1)]
        if len(levels[0]) != len(levels[1]):
            raise DoubtError

        # two real levels may meet between two loads at which they are neighbours
        before = self._before
        arrival = drifts[0] if before is None or before.fx >= below.system.fx else below.slopes(before)
        g0, g1 = (np.diff(state.values[own].real) for state, own in zip(states, levels, strict=True))
        ways = zip((*drifts, arrival), (*levels, levels[0]), strict=True)
        v0, v1, v2 = (span * np.diff(drift[own].real) for drift, own in ways)
        width, place = lowest(g0**2, 2 * g0 * v0, g1**2, 2 * g1 * v1)
        near = width * span > self.narrowest
        bent = lowest(g0**2, 2 * g0 * v2, g1**2, 2 * g1 * v1)[0] * span > self.narrowest
        bent |= np.abs(v2 - v0) > g0  # their speed is another one, so that the equilibrium may have jumped
        if np.any(bent & ~near):
            raise DoubtError  # they would meet if they went on as on the way to the lower load
        for k in np.flatnonzero(near).tolist():
            self._look_inside(self._track(states, drifts, levels[0][k : k + 2], levels[1][k : k + 2]), place[k])
        for i, j in same:  # a complex pair may be real in between
            track = self._track(states, drifts, [i], [j])
            wide, at = lowest(*(growth for _, v, s in track.points for growth in (growth_of(v), span * growth_of(s))))
            if wide * span > self.narrowest:
                self._look_inside(track, float(at))
        return same, edges[1], edges[0]

    def _track(self, states: Sequence[Motions], drifts: Sequence[Complexes], *members: Any) -> Track:
        """The motion that has these members at the lower load and those at the upper one."""
        below, above = (track_point(*each[:2], *each[2]) for each in zip(states, drifts, members, strict=True))
        return Track(self.at, (below, above))

    def _look_inside(self, track: Track, place: float) -> None:
        """Look where the growth of a pair may have the other sign than at both ends: a DoubtError if it has.

        Parabolas through the lowest value and its neighbours lead to the place where growth is nearest to a change of
        its sign.
        """
        (below, above), sign = track.ends, np.sign(track.growth(track.ends[0]))
        span, least = above - below, np.inf
        fx = below + float(np.clip(place, 0.01, 0.99)) * span
        for _ in range(LOOKS):
            found, expected = sign * track.growth(fx), least
            loads = sorted(track.known)
            values = [sign * track.growth(load) for load in loads]
            lowest_of = int(np.argmin(values))
            begin = min(max(lowest_of - 1, 0), len(loads) - 3)
            low, three = loads[lowest_of], slice(begin, begin + 3)
            curve, slope, least = np.polyfit((np.array(loads[three]) - low) / span, values[three], 2)
            if values[lowest_of] < 0 and not 2 * np.sqrt(-values[lowest_of] / max(curve, 0.0)) * span < self.narrowest:
                raise DoubtError(low)
            if not curve > 0 or (len(loads) == 3 and found > 0.5 * min(values[0], values[-1])):
                raise DoubtError(fx)  # it does not dip where the slopes say so: the loads are too far apart
            fx, least = low - 0.5 * float(slope / curve) * span, least - 0.25 * slope**2 / curve
            told = least > BEND * max(values[three]) and abs(found - expected) < 0.1 * least  # what was then found
            if told or not below < fx < above or min(abs(fx - load) for load in loads) < 0.5 * self.narrowest:
                return
        raise DoubtError(fx)

    def _edge(self, track: Track) -> Edge:
        """The edge of a motion that grows at one of two loads; in doubt unless its growth begins or ends once."""
        change, (below, above) = sign_change(track.growth, *track.ends), track.ends
        fx, _, loads, smooth = change
        left, right = loads[0], loads[-1]
        if not smooth:
            one, other = track.at(left), track.at(right)
            jump = float(np.abs(one.stiffness - other.stiffness).max())
            largest, usual = (max(abs(track.growth(each)) for each in places) for places in (loads, track.ends))
            wide = not track.pairs and above - below > 100 * self.narrowest  # s is not smooth where two coalesce
            if jump < 1e-7 * one.frequency**2 and (wide or largest > 1e-3 * usual):
                raise DoubtError(fx)  # the equilibrium does not jump: the motion has become another one
        elif track.pairs and below < left < right < above:
            # on either side of the edge the growth may change its sign again
            slope = (track.growth(right) - track.growth(left)) / (right - left)
            for (end, numbers, slopes), near in zip(track.points, (left, right), strict=True):
                step, there = near - end, growth_of(numbers)
                four = there, growth_of(slopes) * step, track.growth(near), slope * step
                if abs(step) * lowest(*np.sign(there) * np.array(four))[0] > self.narrowest:
                    raise DoubtError
        return track.edge(*change)

    def _changes_of_motions(self, states: tuple[Motions, Motions], drifts: Sequence[Complexes]) -> Changes:
        """What happens between two loads with dissipation; a DoubtError if that is not sure."""
        (below, above), span = states, states[1].system.fx - states[0].system.fx
        alike = below.alike(above) * closeness(below.values, span * drifts[0], above.values, span * drifts[1])
        if not (below.whole and above.whole):  # some have no partner, as another one is nearer to the point there
            alike[alike < ALIKE] = 0.0
        image = dict(assign(alike))
        origin = {j: i for i, j in image.items()}
        rows, columns = (np.flatnonzero(each.grows).tolist() for each in states)
        if not (image.keys() >= set(rows) and origin.keys() >= set(columns)):
            raise DoubtError
        for i in {*rows, *(origin[j] for j in columns)}:
            if alike[i, image[i]] < max(ALIKE, 0.8 * alike[i].max(), 0.8 * alike[:, image[i]].max()):
                raise DoubtError
        known = np.array(sorted(image.items()), dtype=int).reshape(-1, 2).T
        ends = [each for k in (0, 1) for each in (states[k].values[known[k]], span * drifts[k][known[k]])]
        p, q = neighbours(*ends)
        width, place = excursion(*((each[p], each[q]) for each in ends))
        if width.max(initial=0.0) * span > self.narrowest:
            raise DoubtError(below.system.fx + float(place[np.argmax(width)]) * span)

        def edge(i: int) -> Edge:
            return self._edge(self._track(states, drifts, [i], [image[i]]))

        same = [(i, image[i]) for i in rows if above.grows[image[i]]]
        begun = {j: edge(origin[j]) for j in columns if not below.grows[origin[j]]}
        return same, begun, {i: edge(i) for i in rows if not above.grows[image[i]]}


def _edge_at(state: Motions, k: int, fx: float, error: float) -> Edge:
    """The edge of a motion that grows from the start, without an error, or that is not solved for."""
    value = complex(state.values[k])
    value = value if state.system.damping is not None else value.real
    return Edge(fx, error, value, "contact change" if error else "start")


def recognised(below: Motions, above: Motions, least: float) -> tuple[list[tuple[int, int]], list[int], list[int]]:
    """The motions that grow at both of two loads, as far as they are alike, those that have begun, and have ended."""
    rows, columns = np.flatnonzero(below.grows), np.flatnonzero(above.grows)
    alike = below.alike(above, rows, columns) + 1e-300
    same = [(int(rows[i]), int(columns[j])) for i, j in assign(alike) if alike[i, j] > least]
    begun = [int(j) for j in columns if j not in {j for _, j in same}]
    return same, begun, [int(i) for i in rows if i not in {i for i, _ in same}]


def closeness(a: Complexes, slope_a: Complexes, b: Complexes, slope_b: Complexes) -> Floats:
    """How near s of two loads are, or are expected to be, from 0 to 1: it tells two overdamped motions of one shape
    apart."""
    ways = (a[:, None] - b, (a + slope_a)[:, None] - b, a[:, None] - (b - slope_b))
    apart = np.minimum.reduce([np.abs(each) for each in ways])
    return np.asarray(np.maximum(1 - apart / (np.abs(a)[:, None] + np.abs(b) + np.finfo(float).tiny), 0.0))


def assign(weight: Floats) -> list[tuple[int, int]]:
    """Rows and columns that are each other's largest weight, in turn among those that are left."""
    weight, found = weight.copy(), []
    while weight.size and weight.max() > 0:
        columns, rows = weight.argmax(axis=1), weight.argmax(axis=0)
        own = [i for i in range(len(weight)) if weight[i, columns[i]] > 0 and rows[columns[i]] == i]
        found += [(i, int(columns[i])) for i in own]
        weight[own], weight[:, columns[own]] = 0.0, 0.0
    return found


def neighbours(a: Complexes, slope_a: Complexes, b: Complexes, slope_b: Complexes) -> tuple[Indices, Indices]:
    """Pairs of motions that may nearly meet, from s and its slopes at both ends.

    They are at most two places apart in the order of Im s, before or after, or in another order after. But where two
    motions coalesce close by, so that each is the other's nearest by far and they part by more than their distance,
    only their own mean and D are smooth: neither is paired with a third.
    """
    p, q = np.triu_indices(len(a), 1)
    ranks = [np.argsort(np.argsort(each.imag, kind="stable")) for each in (a, b)]
    near = [np.abs(rank[p] - rank[q]) <= 2 for rank in ranks]
    kept = near[0] | near[1] | ((ranks[0][p] < ranks[0][q]) != (ranks[1][p] < ranks[1][q]))
    for values, slopes in ((a, slope_a), (b, slope_b)):
        apart = np.abs(values[:, None] - values)
        np.fill_diagonal(apart, np.inf)
        nearest = apart.argmin(axis=1) if len(values) else np.zeros(0, int)
        own = np.arange(len(values))
        close = (nearest[nearest] == own) & (np.abs(slopes - slopes[nearest]) > np.abs(values - values[nearest]))
        for one, other in ((p, q), (q, p)):
            far = np.abs(values[one] - values[other]) > 10 * np.abs(values[one] - values[nearest[one]])
            kept &= ~(close[one] & far)
    return p[kept], q[kept]


def cubic(a: Any, slope_a: Any, b: Any, slope_b: Any) -> Any:
    """Cubics through values and slopes at both ends of 0 < t < 1, at `PLACES`; shape (..., P)."""
    t = PLACES
    parts = ((a, (1 + 2 * t) * (1 - t) ** 2), (slope_a, t * (1 - t) ** 2), (b, t**2 * (3 - 2 * t)))
    return sum(np.multiply.outer(each, shape) for each, shape in parts) - np.multiply.outer(slope_b, t**2 * (1 - t))


def lowest(d0: Any, s0: Any, d1: Any, s1: Any) -> tuple[Any, Any]:
    """The widest stretch of 0 < t < 1 on which functions, positive at both ends, may be negative.

    d0, s0 and d1, s1, numbers or each of shape (P,), are values and slopes at t = 0 and at t = 1. Returned are the
    largest possible width in t, zero where a function surely stays positive, and where it is lowest.

    The lowest point is that of the cubic or of the parabolas through both values and one slope, less the disagreement
    of the three curves and `BEND` of the smaller value.
    """
    # Parabolas d0 + s0 t + f t^2 and d1 - s1 r + g r^2, r = 1 - t; cubic d0 + s0 t + h t^2 + k t^3.
    f, g = d1 - d0 - s0, d0 - d1 + s1
    h, k = 3 * (d1 - d0) - 2 * s0 - s1, 2 * (d0 - d1) + s0 + s1
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(h * h - 3 * k * s0, 0.0))
        t = np.array([np.divide(-s0, 2 * f), 1 - np.divide(s1, 2 * g), np.divide(root - h, 3 * k)])
        t = np.clip(np.nan_to_num(t, nan=0.5), 0.0, 1.0)
        r = 1 - t
        curve = d0 + t * (s0 + t * (h + t * k))
        spread = np.maximum(np.abs(d0 + t * (s0 + t * f) - curve), np.abs(d1 - r * (s1 - r * g) - curve))
        low = curve - spread - BEND * np.minimum(d0, d1) * (4 * t * r)
        deepest, depth = np.argmin(low, axis=0), np.maximum(-low.min(axis=0), 0.0)
        width = np.where(depth > 0, 2 * np.sqrt(depth / np.maximum(np.abs(f), np.abs(g))), 0.0)
    return np.minimum(width, 1.0), np.take_along_axis(t, deepest[None], axis=0)[0]


def excursion(a: Any, slope_a: Any, b: Any, slope_b: Any) -> tuple[Floats, Floats]:
    """Where pairs of motions have another sign of Re s in 0 < t < 1 than at both ends, from two s and two slopes at
    t = 0 and at t = 1, each of shape (P,).

    Returned are the share of the increment, zero where there is no such place, and where Re s is farthest on the other
    side.
    """
    mean = cubic(*(0.5 * (each[0] + each[1]) for each in (a, slope_a, b, slope_b)))
    gap_a, gap_b = a[0] - a[1], b[0] - b[1]
    drift_a, drift_b = 2 * gap_a * (slope_a[0] - slope_a[1]), 2 * gap_b * (slope_b[0] - slope_b[1])
    root = 0.5 * np.sqrt(cubic(gap_a**2, drift_a, gap_b**2, drift_b).astype(complex)).real
    inside = np.array([mean.real + root, mean.real - root])
    before, after = (np.sort(np.array(each).real, axis=0)[::-1, ..., None] for each in (a, b))
    other = ((inside > 0) != (before > 0)) & ((before > 0) == (after > 0))
    depth = np.where(other, np.abs(inside), 0.0).max(axis=0)
    return other.any(axis=0).sum(axis=-1) / (len(PLACES) + 1), PLACES[np.argmax(depth, axis=-1)]
