r"""Edges of windows: one motion is followed between two loads, and its growth goes through zero, or jumps.

Each motion is followed by its eigenvalues alone: they are those next to where they should be. At an edge the growth of
a motion (:mod:`~faultgouge.analysis.windows.search`) changes its sign. The growth goes through zero along a straight
line, at distances far below the increment, at

- a *coalescence*: without dissipation, where the discriminant D of two modes changes its sign and
  :math:`|y^H x| \to 0`;
- a *Hopf* point: with dissipation, where Re s of one mode changes its sign; a *steady* point if s itself is zero.

A few secant steps bracket the root; five points close to the root then give its last digits, and their number. The
growth jumps at a *contact change*, where the equilibrium itself jumps: a contact opened, closed or slid. Bisection
locates the jump. A mere crossing of two levels touches D = 0 without a change of sign.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.linalg import LinAlgError

from ..arrays import Complexes
from ..errors import NoEquilibriumError
from .motions import Motions, System, eigenvalues_near
from .onset import Edge, Kind

TrackPoint = tuple[float, Complexes, Complexes]
"""A motion at one load: the load; the mean and D of two eigenvalues without dissipation, or s; and their slopes."""


class DoubtError(Exception):
    """The search cannot decide what happens on an increment; it may name a load inside at which to look."""


def sign_change(value: Callable[[float], float], below: float, above: float) -> tuple[float, float, list[float], bool]:
    """Where a function of the load goes through zero, or jumps, between two loads at which it has opposite signs.

    A few steps bracket the root (Ridders, IEEE Trans. Circuits Syst. 26, 979 (1979)). Five points close to it then give
    its last digits, and their number: they are as close as the noise allows, since the function should be straight and
    yet stand out of its scatter. Where it does not cross zero along a smooth line at any distance, bisection locates
    the jump. The root may be one of the two loads but for rounding, which may make the signs at both equal. The five
    points are then on its one side.

    Returns the root, with twice the scatter over the slope, or the jump, with half of its bracket; the five loads that
    give the root, or the one that is the root, or the two on either side of the jump; and whether it is a root.
    """
    values, span = {below: value(below), above: value(above)}, above - below
    ends, last_place = (values[below], values[above]), float(np.spacing(max(abs(below), abs(above))))

    def look_at(fx: float) -> float:
        if fx not in values:
            values[fx] = value(fx)
        return values[fx]

    crosses = ends[0] * ends[1] < 0
    a, b, last, root = below, above, np.inf, np.nan
    while crosses and np.isnan(root) and abs(b - a) > 1e-8 * span:
        middle = 0.5 * (a + b)
        low, half, high = look_at(a), look_at(middle), look_at(b)
        shift = 0.0 if half == 0 else float(np.sign(low - high) * half / np.sqrt(half**2 - low * high))
        fx = middle + (middle - a) * shift
        steady, last = abs(fx - last) <= 1e-8 * span, fx
        if look_at(fx) == 0 or (steady and min(abs(fx - a), abs(b - fx)) > 0.01 * abs(b - a)):
            root = fx
        else:
            a, b = next((p, q) for p, q in pairwise(sorted([a, b, middle, fx])) if look_at(p) * look_at(q) <= 0)
    root = 0.5 * (a + b) if np.isnan(root) else root

    room, offsets = min(root - below, above - root), np.arange(-2.0, 3.0)
    smaller, larger = sorted(map(abs, ends))
    if not crosses or (room < 1000 * last_place and smaller < 1e-6 * larger):
        lower = abs(ends[0]) <= abs(ends[1])
        root, room, offsets = below if lower else above, span, np.arange(5.0) * (1 if lower else -1)
    distance = max(min(1e-3 * room, 1e-6 * span), 4 * last_place)
    while distance < 0.1 * room:
        loads = [float(fx) for fx in root + distance * offsets]
        try:
            there = [look_at(fx) for fx in loads]
        except DoubtError:
            if crosses:
                raise
            break  # one load alone is known, and is the root
        curve, residuals, *_ = np.polynomial.polynomial.polyfit(offsets, there, 2, full=True)
        # two degrees of freedom beside the parabola tell the scatter; a step of height 1 has slope 0.3 and scatter 0.3
        scatter = float(np.sqrt(residuals[0].sum() / 2)) if residuals[0].size else 0.0
        found, slope, step = root, float(curve[1]), abs(loads[3] - loads[2])
        if scatter <= 0.1 * abs(slope):
            shift = -float(curve[0]) / slope  # and the parabola's root, to second order
            shift *= 1 - float(curve[2]) * shift / slope if abs(shift) <= 2 else 1
            found = root + shift * step
            if abs(found - root) <= distance:
                return found, 2 * scatter / abs(slope) * step + last_place, loads if offsets[0] else [root], True
        if found != root and abs(found - root) < 0.5 * room:
            root = found  # the bracket was wider than the points
        else:
            distance *= 30.0

    if not crosses:
        return root, smaller / ((larger + smaller) / span) + last_place, [root], True
    left, right = next((a, b) for a, b in pairwise(sorted(values)) if values[a] * values[b] <= 0)
    while right - left > max(1e-9 * span, 4 * last_place):  # paths differ by far more at a jump
        middle = 0.5 * (left + right)
        left, right = (middle, right) if look_at(middle) * values[left] > 0 else (left, middle)
    return 0.5 * (left + right), 0.5 * (right - left), [left, right], False


def growth_of(numbers: Complexes) -> float:
    """-D of the mean and D of a pair, or Re s: positive where the motion grows; of slopes its slope."""
    return float(-numbers[1].real if len(numbers) == 2 else numbers[0].real)


def track_point(state: Motions, drift: Complexes, *members: int) -> TrackPoint:
    """One motion with dissipation; without it two real eigenvalues of a state, or one of a complex pair."""
    values, slopes = state.values[list(members)], drift[list(members)]
    if state.system.damping is not None:
        return state.system.fx, values, slopes
    if len(members) == 1:
        values, slopes = (np.array([each[0], each[0].conj()]) for each in (values, slopes))
    gap = values[0] - values[1]
    moves = np.array([slopes.mean(), 2 * gap * (slopes[0] - slopes[1])])
    return state.system.fx, np.array([values.mean(), gap**2]), moves


class Track:
    """A motion between two loads, at which it is known (`points`); `at` gives the system of a load."""

    def __init__(self, at: Callable[[float], System], points: tuple[TrackPoint, TrackPoint]) -> None:
        self.at, self.points, self.ends = at, points, (points[0][0], points[1][0])
        self.known = {fx: numbers for fx, numbers, _ in points}
        step = 1e-4 * (self.ends[1] - self.ends[0])  # slopes are values close by
        moves = zip(points, (step, -step), strict=True)
        self._beside = {fx + move: numbers + move * slopes for (fx, numbers, slopes), move in moves}
        self.pairs = len(points[0][1]) == 2

    def numbers(self, fx: float) -> Complexes:
        """Its numbers at a load; a DoubtError if there is no equilibrium, or if the motion is not recognised."""
        known = {**self.known, **self._beside}
        if fx in known:
            return known[fx]
        near: list[float] = []  # by the polynomial through the nearest four loads; close ones are noise
        for load in sorted(known, key=lambda load: abs(load - fx)):
            if len(near) < 4 and all(abs(load - other) > 0.3 * abs(load - fx) for other in near):
                near.append(load)
        weights = [np.prod([(fx - m) / (n - m) for m in near if m != n]) for n in near]
        expected = sum(weight * known[load] for weight, load in zip(weights, near, strict=True))
        try:
            values = eigenvalues_near(self.at(fx), expected[0].real if self.pairs else expected[0])
        except (NoEquilibriumError, LinAlgError):
            raise DoubtError from None
        found = nearest_pair(values, expected)[0] if self.pairs else values[[np.argmin(np.abs(values - expected[0]))]]
        self.known[fx] = found
        return found

    def growth(self, fx: float) -> float:
        """Positive where the motion grows: -D, or Re s."""
        return growth_of(self.numbers(fx))

    def edge(self, fx: float, error: float, loads: list[float], smooth: bool) -> Edge:
        """The edge where the growth changes its sign."""
        middle = self.at(loads[len(loads) // 2])
        mean = np.mean([self.numbers(load)[0] for load in loads])
        value = float(mean.real) if self.pairs else complex(mean)
        kind: Kind = "contact change"
        if smooth:
            steady = 1e-9 * middle.frequency  # |Im s| that counts as zero
            kind = "coalescence" if self.pairs else "steady" if mean.imag <= steady else "hopf"
        return Edge(fx, error + middle.balance, value, kind)


def nearest_pair(values: Complexes, expected: Complexes) -> tuple[Complexes, list[int]]:
    """Mean and D of the one of some complex pairs and twos of real levels whose numbers are as expected, and its
    members; a DoubtError if there is none, or if another one is nearly so."""
    pairs, real = np.flatnonzero(values.imag > 0), np.flatnonzero(values.imag == 0)
    i, j = (real[each] for each in np.triu_indices(len(real), 1))
    means = np.concatenate([values[pairs].real, 0.5 * (values[i] + values[j]).real])
    gaps = np.concatenate([-4 * values[pairs].imag ** 2, (values[i] - values[j]).real ** 2])
    apart = np.sqrt(np.abs(gaps)) - np.sqrt(np.abs(expected[1].real))
    cost = np.abs(means - expected[0].real) + 0.5 * np.abs(apart)
    order = np.argsort(cost)
    if not len(order) or (len(order) > 1 and cost[order[0]] > 0.5 * cost[order[1]]):
        raise DoubtError
    k = int(order[0])
    members = [int(pairs[k])] if k < len(pairs) else [int(i[k - len(pairs)]), int(j[k - len(pairs)])]
    return np.array([means[k], gaps[k]], complex), members
