"""One motion between two loads, followed by its eigenvalues alone: each is the one next to where it should be."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError

from ..arrays import Complexes
from ..errors import NoEquilibriumError
from .edges import Edge, Kind, SignChange
from .states import Motions, eigenvalues_near, overlap_near
from .system import System


class DoubtError(Exception):
    """The search cannot decide what happens on an increment; `fx` is a load inside at which to look, or None."""

    def __init__(self, fx: float | None = None) -> None:
        super().__init__("an increment is in doubt")
        self.fx = fx


@dataclass(frozen=True, eq=False)
class TrackPoint:
    """A motion at one load: the mean and D of two eigenvalues without dissipation, or s; and their slopes."""

    fx: float
    numbers: Complexes
    slopes: Complexes

    @classmethod
    def pair(cls, state: Motions, drift: Complexes, *members: int) -> "TrackPoint":
        """Two real eigenvalues of a state, or one of a complex pair."""
        values, slopes = state.values[list(members)], drift[list(members)]
        if len(members) == 1:
            values, slopes = (np.array([each[0], each[0].conj()]) for each in (values, slopes))
        gap = values[0] - values[1]
        numbers = values.mean(), gap**2
        return cls(state.fx, np.array(numbers), np.array([slopes.mean(), 2 * gap * (slopes[0] - slopes[1])]))

    @classmethod
    def motion(cls, state: Motions, drift: Complexes, member: int) -> "TrackPoint":
        """One motion with dissipation."""
        return cls(state.fx, state.values[[member]], drift[[member]])


class Track:
    """A motion between two loads at which it is known.

    Parameters
    ----------
    at : callable
        Load -> System.
    below, above : TrackPoint
        The motion at the ends.
    """

    def __init__(self, at: Callable[[float], System], below: TrackPoint, above: TrackPoint) -> None:
        self.at, self.points = at, (below, above)
        self.ends = below.fx, above.fx
        self.known = {each.fx: each.numbers for each in self.points}
        # slopes are values close by
        step = 1e-4 * (above.fx - below.fx)
        self._beside = {
            each.fx + side * step: each.numbers + side * step * each.slopes
            for each, side in zip(self.points, (1, -1), strict=True)
        }
        self.pairs = len(below.numbers) == 2

    @property
    def loads(self) -> list[float]:
        """Loads at which it is known, and two beside the ends."""
        return sorted({**self.known, **self._beside})

    def expected(self, fx: float) -> Complexes:
        """Its numbers by the polynomial through the nearest four loads."""
        known = {**self.known, **self._beside}
        near: list[float] = []
        for load in sorted(known, key=lambda load: abs(load - fx)):
            if all(abs(load - other) > 0.3 * abs(load - fx) for other in near):  # close ones tell noise
                near.append(load)
        near = near[:4]
        weights = [np.prod([(fx - m) / (n - m) for m in near if m != n]) for n in near]
        return sum(weight * known[load] for weight, load in zip(weights, near, strict=True))

    def numbers(self, fx: float) -> Complexes:
        """Its numbers at a load; a DoubtError if there is no equilibrium, or if the motion is not recognised."""
        if fx in self.known:
            return self.known[fx]
        if fx in self._beside:
            return self._beside[fx]
        expected = self.expected(fx)
        try:
            point = expected[0].real if self.pairs else expected[0]
            values = eigenvalues_near(self.at(fx), point)
        except (NoEquilibriumError, LinAlgError):
            raise DoubtError from None
        self.known[fx] = _pair_of(values, expected) if self.pairs else _motion_of(values, expected)
        return self.known[fx]

    def growth(self, fx: float) -> float:
        """Positive where the motion grows: -D, or Re s."""
        numbers = self.numbers(fx)
        return float(-numbers[1].real if self.pairs else numbers[0].real)

    def growth_slope(self, end: TrackPoint) -> float:
        """The slope of the growth at an end."""
        return float(-end.slopes[1].real if self.pairs else end.slopes[0].real)

    def edge(self, change: SignChange) -> Edge:
        """The edge where the growth changes its sign."""
        middle = self.at(change.loads[len(change.loads) // 2])
        mean = np.mean([self.numbers(fx)[0] for fx in change.loads])
        value = float(mean.real) if self.pairs else complex(mean)
        kind: Kind = "contact change"
        if change.smooth:
            steady = 1e-9 * middle.frequency  # |Im s| that counts as zero
            kind = "coalescence" if self.pairs else "steady" if mean.imag <= steady else "hopf"
        return Edge(change.fx, change.error + middle.balance, value, overlap_near(middle, value), kind)


def nearest_pair(values: Complexes, expected: Complexes) -> tuple[int, int]:
    """The two of some real levels whose mean and distance are as expected; a DoubtError if two others are nearly so."""
    i, j = np.triu_indices(len(values), 1)
    if not len(i):
        raise DoubtError
    k = _nearest(0.5 * (values[i] + values[j]), (values[i] - values[j]) ** 2, expected)
    return int(i[k]), int(j[k])


def _nearest(means: Complexes, gaps: Complexes, expected: Complexes) -> int:
    """The number of the pair with the mean and D that were expected."""
    cost = np.abs(means.real - expected[0].real) + 0.5 * np.abs(
        np.sqrt(np.abs(gaps.real)) - np.sqrt(np.abs(expected[1].real))
    )
    first, second = np.argsort(cost)[:2] if len(cost) > 1 else (0, None)
    if second is not None and cost[first] > 0.5 * cost[second]:
        raise DoubtError
    return int(first)


def _pair_of(values: Complexes, expected: Complexes) -> Complexes:
    """Mean and D of the pair of eigenvalues that were expected."""
    complex_, real = values[values.imag > 0], np.sort(values[values.imag == 0].real)
    i, j = np.triu_indices(len(real), 1)
    means = np.concatenate([complex_.real, 0.5 * (real[i] + real[j])])
    gaps = np.concatenate([-4 * complex_.imag**2, (real[i] - real[j]) ** 2])
    if not len(means):
        raise DoubtError
    k = _nearest(means, gaps, expected)
    return np.array([means[k], gaps[k]], complex)


def _motion_of(values: Complexes, expected: Complexes) -> Complexes:
    """The motion that was expected."""
    near = np.argsort(np.abs(values - expected[0]))
    return values[near[:1]]
