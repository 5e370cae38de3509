r"""Two neighbouring loads with all of their modes: which is which, and where a narrow window may hide in between.

**A function whose values and slopes are known at both ends** has a cubic through both values and slopes, and two
parabolas through both values and one slope. The lowest point of the cubic, less the disagreement of the three curves,
is a lower bound (`deepest_dip`): where the bound is negative the function may be negative.

**Two modes without dissipation** have :math:`D = (\lambda_1 - \lambda_2)^2`, whose slope :math:`D' = 2 (\lambda_1 -
\lambda_2)(\lambda_1' - \lambda_2')` is known at either end. A load at which contacts change bends the levels: a window
may also hide where the levels, continued from the increment before, would allow for one. Whether one of two modes meets
a third shows in the product :math:`(\lambda_1 - \lambda)(\lambda_2 - \lambda) = (\bar\lambda - \lambda)^2 - D / 4`,
which is smooth where the two coalesce.

**Two modes with dissipation** that nearly meet may begin and cease to grow between two loads at which neither grows.
Half the sum m of two eigenvalues and :math:`D = (s_1 - s_2)^2` are smooth even where both coalesce, so that
:math:`m \pm \tfrac12\sqrt D` of the cubics tells what the modes do in between (`excursion`).
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Indices
from .limits import LIMITS, Limits
from .space import Space
from .system import System
from .system_modes import Members, SystemModes, assign_modes

ModesAtEnds = tuple[list[Space], list[Space]]
"""Modes that nearly meet, at the lower and at the upper load: a pair, or two single modes."""

ModeAtEnds = tuple[Space | None, Space | None]
"""A motion at the lower and at the upper load, where it is known."""


ModesOfLoads = tuple[SystemModes, SystemModes]
"""The modes of the lower and of the upper load among which motions may begin or cease to grow."""


class Few(NamedTuple):
    """The few motions that may change on an increment.

    `named` is the number of motions that were looked at; `courses` has those that grow, or nearly grow, at one load.
    """

    courses: Sequence[ModeAtEnds]
    named: int


PLACES = np.linspace(0, 1, 41)[1:-1]
"""Where in an increment the cubics of two modes with dissipation are looked at."""


class LoadStep:
    """Two neighbouring loads, and which mode of one is which of the other.

    Parameters
    ----------
    here, there : SystemModes
        All modes at the lower and at the upper load.
    before : System, optional
        The load before the lower one.

    Attributes
    ----------
    forward : ndarray of int, shape (E,)
        The mode there of each mode here, -1 where there is none.
    """

    def __init__(
        self, here: SystemModes, there: SystemModes, before: System | None = None, limits: Limits = LIMITS
    ) -> None:
        self.here, self.there, self._before, self.limits = here, there, before, limits
        self.span = there.fx - here.fx
        self.forward = assign_modes(here, there)

    @cached_property
    def drifts(self) -> tuple[Any, Any]:
        """First-order change of each eigenvalue over the step, at either end."""
        return self.here.drifts(self.there.system), -self.there.drifts(self.here.system)

    @property
    def bent(self) -> bool:
        """Whether contacts open or close on the step, whose stiffness goes as the root of the overlap."""
        a, b = self.here.system.stiffness, self.there.system.stiffness
        if isinstance(a, np.ndarray):
            return False
        return not (np.array_equal(a.indptr, b.indptr) and np.array_equal(a.indices, b.indices))

    @property
    def courses(self) -> list[ModeAtEnds]:
        """The motions that grow at one end at least; without dissipation at both ends where they are recognised."""
        if self.here.system.dissipative:
            return [(None, above) for above in self.there.growing]
        found: list[ModeAtEnds] = []
        arrived = set()
        backward = {int(image): k for k, image in enumerate(self.forward)}
        for members in self.here.complex_pairs:
            image = int(self.forward[members[0]]), int(self.forward[members[1]])
            ends = self._recognise(members, image)
            found.append(ends or (self.here.space(members), None))
            if ends and self.there.conjugate(image):
                arrived.add(image)
        for image in self.there.complex_pairs:
            if image not in arrived:
                members = backward.get(image[0], -1), backward.get(image[1], -1)
                found.append(self._recognise(members, image) or (None, self.there.space(image)))
        return found

    def _recognise(self, members: Members, image: Members) -> tuple[Space, Space] | None:
        """Two modes at both loads, conjugates or both real, if they are the same pair."""
        here, there = self.here, self.there
        if min(*members, *image) < 0 or not (here.together(members) and there.together(image)):
            return None
        below, above = here.space(members), there.space(image)
        return (below, above) if below.like(above) else None

    def hiding(self, narrowest: float) -> list[ModesAtEnds] | None:
        """Modes that may grow inside on a stretch wider than `narrowest`; None if that cannot be told."""
        return (self._modes_hiding if self.here.system.dissipative else self._pairs_hiding)(narrowest)

    def _modes_hiding(self, narrowest: float) -> list[ModesAtEnds]:
        finite = (self.forward >= 0) & np.isfinite(self.drifts[0])
        finite[finite] &= np.isfinite(self.drifts[1][self.forward[finite]])
        rows = np.flatnonzero(finite)
        image = self.forward[rows]
        a, b, slope_a, slope_b = (
            self.here.values[rows], self.there.values[image], self.drifts[0][rows], self.drifts[1][image]
        )  # fmt: skip
        p, q = neighbours(a.imag, b.imag, 2)
        width, _ = excursion(*((each[p], each[q]) for each in (a, slope_a, b, slope_b)))
        wide = np.flatnonzero(width * self.span > narrowest)
        return [
            (
                [self.here.space((int(rows[j]),)) for j in (p[k], q[k])],
                [self.there.space((int(image[j]),)) for j in (p[k], q[k])],
            )
            for k in wide
        ]

    def _both(self, rows: Indices, image: Indices) -> tuple[tuple[SystemModes, Indices], tuple[SystemModes, Indices]]:
        return (self.here, rows), (self.there, image)

    def _pairs_hiding(self, narrowest: float) -> list[ModesAtEnds] | None:
        """Real neighbours between which a window may hide; None if one is not recognised."""
        here, there = self.here, self.there
        rows = np.flatnonzero(self.forward >= 0)
        image = self.forward[rows]
        p, q = neighbours(here.values[rows].real, there.values[image].real, 1)
        alone = (here.partner[rows] < 0) & (there.partner[image] < 0)
        kept = alone[p] & alone[q]
        p, q = p[kept], q[kept]
        if len(p) == 0:
            return []
        gaps = [modes.values.real[names][p] - modes.values.real[names][q] for modes, names in self._both(rows, image)]

        def wide(*drifts: Any) -> NDArray[np.bool_]:
            rates = [drift[names].real for drift, names in zip(drifts, (rows, image), strict=True)]
            s0, s1 = (2 * gap * (rate[p] - rate[q]) for gap, rate in zip(gaps, rates, strict=True))
            return deepest_dip(gaps[0] ** 2, s0, gaps[1] ** 2, s1, self.limits.bend)[0] * self.span > narrowest

        near = wide(*self.drifts)
        if np.any((gaps[0] * gaps[1] < 0) & ~near):  # they meet, and their slopes do not say so
            return None
        arrival = self._arrival
        if arrival is not None and np.any(wide(arrival, self.drifts[1]) & ~near):
            return None
        found: list[ModesAtEnds] = []
        for k in np.flatnonzero(near):
            ends = self._recognise(*((int(each[p[k]]), int(each[q[k]])) for each in (rows, image)))
            if ends is None:
                return None
            found.append(([ends[0]], [ends[1]]))
        return found

    @property
    def _arrival(self) -> Any:
        """The drifts at the lower load if levels go on as on the way there; None if that is not known."""
        if self._before is None:
            return None
        return -self.span / (self.here.fx - self._before.fx) * self.here.drifts(self._before)

    def apart(self, changing: Sequence[tuple[Space, Space]], narrowest: float) -> bool:
        """Whether pairs that turn complex or real on the step surely meet neither a real mode nor one another."""
        if not changing:
            return True
        here, there = self.here, self.there
        alone = np.flatnonzero((self.forward >= 0) & (here.partner < 0))
        alone = alone[there.partner[self.forward[alone]] < 0]
        motions = []
        for (modes, names), drifts, pairs in zip(
            self._both(alone, self.forward[alone]), self.drifts, zip(*changing, strict=True), strict=True
        ):
            zero = np.zeros(len(names))
            real = np.array([modes.values.real[names], zero, drifts[names].real, zero])
            motions.append(np.column_stack([*(_motion(pair, here.system, there.system) for pair in pairs), real]))
        for k, pair in enumerate(changing):
            below, above = (_resultant(motion[:, k], motion[:, k + 1 :]) for motion in motions)
            if max(end.growth for end in pair) < 0:  # two of the real modes are its own
                others = np.argsort(np.abs(below[0]))[2:]
                below, above = below[:, others], above[:, others]
            width = deepest_dip(below[0], below[1], above[0], above[1], self.limits.bend)[0].max(initial=0.0)
            if min(below[0].min(initial=1.0), above[0].min(initial=1.0)) <= 0 or width * self.span > narrowest:
                return False
        return True


def stretch(below: Sequence[Space], above: Sequence[Space], limits: Limits = LIMITS) -> tuple[float, float]:
    """The widest stretch between two loads on which another number of modes may grow than at both loads.

    Returned are its width, force, zero if there is surely no such stretch, and the load at which it is deepest.
    """
    (here, *_), (there, *_) = below, above
    span = there.fx - here.fx
    if len(below) == 2:
        rates = [np.array([mode.mean for mode in modes]) for modes in (below, above)]
        slopes = (
            np.array([mode.drift(there.system)[0, 0] for mode in below]),
            -np.array([mode.drift(here.system)[0, 0] for mode in above]),
        )
        width, at = excursion(rates[0], slopes[0], rates[1], slopes[1])
        return float(width) * span, here.fx + float(at) * span
    sign = np.sign(here.growth)
    numbers = here.growth, here.slope(there.system), there.growth, -there.slope(here.system)
    d0, s0, d1, s1 = (sign * np.array([number]) for number in numbers)
    widths, places = deepest_dip(d0, s0, d1, s1, limits.bend)
    return float(widths[0]) * span, here.fx + float(places[0]) * span


def deepest_dip(d0: Floats, s0: Floats, d1: Floats, s1: Floats, bend: float) -> tuple[Floats, Floats]:
    """The widest stretch of 0 < t < 1 on which functions known at both ends may be negative.

    d0, s0 and d1, s1, each of shape (P,), are values, positive, and slopes at t = 0 and at t = 1; `bend` is that of
    `Limits`. Returned are the largest possible width in t, zero where a function surely stays positive, and where it is
    deepest.
    """
    # Parabolas d0 + s0 t + f t^2 and d1 - s1 r + g r^2, r = 1 - t; cubic d0 + s0 t + h t^2 + k t^3.
    f, g = d1 - d0 - s0, d0 - d1 + s1
    h, k = 3 * (d1 - d0) - 2 * s0 - s1, 2 * (d0 - d1) + s0 + s1
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(h * h - 3 * k * s0, 0.0))
        t = np.array([-s0 / (2 * f), 1 - s1 / (2 * g), (root - h) / (3 * k)])
        t = np.clip(np.nan_to_num(t, nan=0.5), 0.0, 1.0)
        r = 1 - t
        cubic = d0 + t * (s0 + t * (h + t * k))
        spread = np.maximum(np.abs(d0 + t * (s0 + t * f) - cubic), np.abs(d1 - r * (s1 - r * g) - cubic))
        lowest = cubic - spread - bend * np.minimum(d0, d1) * (4 * t * r)
        deepest = np.argmin(lowest, axis=0), np.arange(len(d0))
        depth = np.maximum(-lowest[deepest], 0.0)
        width = np.where(depth > 0, 2 * np.sqrt(depth / np.maximum(np.abs(f), np.abs(g))), 0.0)
    return np.minimum(width, 1.0), t[deepest]


def excursion(a: Any, slope_a: Any, b: Any, slope_b: Any) -> tuple[Floats, Floats]:
    """Where pairs of modes have another sign of Re s in 0 < t < 1 than at both ends.

    Parameters
    ----------
    a, slope_a, b, slope_b : two ndarrays of complex, shape (P,)
        Eigenvalues of the two modes at t = 0, their slopes, and those at t = 1.

    Returns
    -------
    width : ndarray, shape (P,)
        Share of the increment; zero where there is no such place.
    at : ndarray, shape (P,)
        The place at which Re s is farthest on the other side.
    """
    mean = _cubic(*(0.5 * (each[0] + each[1]) for each in (a, slope_a, b, slope_b)))
    gap_a, gap_b = a[0] - a[1], b[0] - b[1]
    drift_a, drift_b = 2 * gap_a * (slope_a[0] - slope_a[1]), 2 * gap_b * (slope_b[0] - slope_b[1])
    root = 0.5 * np.sqrt(_cubic(gap_a**2, drift_a, gap_b**2, drift_b).astype(complex)).real
    between = np.array([mean.real + root, mean.real - root])
    before, after = (np.sort(np.array(each).real, axis=0)[::-1, ..., None] for each in (a, b))
    other = ((between > 0) != (before > 0)) & ((before > 0) == (after > 0))
    depth = np.where(other, np.abs(between), 0.0).max(axis=0)
    return other.any(axis=0).sum(axis=-1) / (len(PLACES) + 1), PLACES[np.argmax(depth, axis=-1)]


def neighbours(before: Floats, after: Floats, places: int) -> tuple[Indices, Indices]:
    """Pairs of modes at most so many places apart in either order, before or after, or in another order after."""
    p, q = np.triu_indices(len(before), 1)
    ranks = [np.argsort(np.argsort(each, kind="stable")) for each in (before, after)]
    near = [np.abs(rank[p] - rank[q]) <= places for rank in ranks]
    swapped = (ranks[0][p] < ranks[0][q]) != (ranks[1][p] < ranks[1][q])
    kept = near[0] | near[1] | swapped
    return p[kept], q[kept]


def _motion(pair: Space, here: System, there: System) -> Floats:
    """Mean and discriminant of a pair, and the first-order changes of both over a step."""
    sign, other = (1.0, there) if pair.system is here else (-1.0, here)
    drift = 0.5 * float(np.trace(pair.drift(other)))
    return np.array([pair.mean, pair.discriminant, sign * drift, -sign * pair.slope(other)])


def _resultant(pair: Floats, others: Floats) -> Floats:
    """The product of the four differences of the eigenvalues of a pair and of others, and its first-order change.

    All are given by their `_motion`, shapes (4,) and (4, P); a mode alone counts as a double eigenvalue.
    """
    gap, discriminants, drift, slopes = pair[0] - others[0], others[1], pair[2] - others[2], others[3]
    half = gap**2 - 0.25 * (pair[1] + discriminants)
    change = 2 * gap * drift - 0.25 * (pair[3] + slopes)
    product = 0.25 * pair[1] * discriminants
    return np.array([half**2 - product, 2 * half * change - 0.25 * (pair[3] * discriminants + pair[1] * slopes)])


def _cubic(a: Any, slope_a: Any, b: Any, slope_b: Any) -> Any:
    """Cubics through values and slopes at the ends of 0 < t < 1, at `PLACES`; shape (..., P)."""
    t = PLACES
    parts = ((a, (1 + 2 * t) * (1 - t) ** 2), (slope_a, t * (1 - t) ** 2), (b, t**2 * (3 - 2 * t)))
    return sum(np.multiply.outer(each, shape) for each, shape in parts) - np.multiply.outer(slope_b, t**2 * (1 - t))
