r"""Windows of complex eigenvalues, and their edges: where a pair enters or leaves the real axis.

At an edge the discriminant D(F) of the pair (:mod:`~faultgouge.analysis.onset.eigenvalue_pair`) changes its sign. If it
goes through zero along a straight line at distances far below the increment, the edge is a *coalescence*; there
:math:`|y^H x| \to 0`. A few secant steps bracket the root; five points close to it then give the last digits, and say
how many there are. If D jumps, the equilibrium itself does: a contact opened, closed or slid. Bisection locates the
jump, and the edge is a *contact change*. A mere crossing touches D = 0 without a change of sign.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from scipy.sparse import csr_array

from ..errors import FaultgougeError
from ..packing.packing import Floats
from .eigenvalue_pair import Pair, continue_pair, dip_between
from .limits import LIMITS, Limits
from .march import look_between
from .modes import LoadPoint, Operator

Kind = Literal["coalescence", "contact change", "start"]


class LostPairError(FaultgougeError):
    """A pair that can be followed no further: one sentence."""

    @classmethod
    def of(cls, pair: Pair, where: str) -> "LostPairError":
        """The sentence about a pair and the loads at which it was lost."""
        return cls(
            f"the pair of eigenvalues about {pair.mean:.6g} cannot be told from its neighbours {where}: "
            "take smaller increments"
        )


class LostTrackError(FaultgougeError):
    """The complex pairs, or growing motions, at the begin of an increment are not those at the end of the last one."""


class DoubtError(FaultgougeError):
    """What a pair is expected to do the operator does not surely have."""


@dataclass(frozen=True)
class Edge:
    """Where a pair enters or leaves the real axis; the attributes are those of a window's onset."""

    fx: float
    error: float
    eigenvalue: float
    overlap: float
    kind: Kind

    @classmethod
    def start(cls, pair: Pair) -> "Edge":
        """The edge of a pair that is complex at the smallest load."""
        return cls(pair.fx, 0.0, pair.mean, pair.overlap, "start")

    @classmethod
    def between(cls, one: float, other: float, *pairs: Pair) -> "Edge":
        """The edge between two loads where the equilibrium jumps or a pair is not recognised: uncertain by half."""
        half, overlap = 0.5 * abs(other - one), min(pair.overlap for pair in pairs)
        return cls(0.5 * (one + other), half, pairs[-1].mean, overlap, "contact change")


@dataclass(frozen=True, kw_only=True)
class GrowthWindow:
    """An interval of loads on which one motion grows.

    Attributes
    ----------
    fx_onset : float
        Load at which the motion begins to grow, force per top disk.
    fx_end : float or None
        Load at which it ends to; None if it grows at the largest load that was looked at.
    error : float
        Uncertainty of fx_onset: that of the root, twice the scatter over the slope, or the bracket of a jump; and the
        `load_error` of the equilibria; and `path_error`, if that is known. 0 at a "start".
    kind : str
        What begins the window.
    path_error : float or None
        What of the error comes from the increments in which the path of equilibria was taken, force. One path cannot
        tell: None of a search, a number where another path was taken as well.
    """

    fx_onset: float
    fx_end: float | None
    error: float
    kind: str
    path_error: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """The keys of the JSON contract that all windows have: fx_onset, fx_end, error, error_of_path, kind."""
        names = ("fx_onset", "fx_end", "error", "kind")
        return {name: getattr(self, name) for name in names} | {"error_of_path": self.path_error}


@dataclass(frozen=True, kw_only=True)
class Window(GrowthWindow):
    """An interval of loads on which one pair of eigenvalues is complex; further attributes are those of `GrowthWindow`.

    Attributes
    ----------
    eigenvalue : float
        The double eigenvalue at the onset (the real part of the pair if it does not coalesce there), 1 /
        time^2.
    end_error : float or None
        Uncertainty of fx_end.
    overlap : float
        Smallest |y^H x| met at the onset; at an exceptional point it is the root of the rounding error.
    kind : {"coalescence", "contact change", "start"}
        Two real eigenvalues that meet; a jump of the equilibrium; or nothing, as the pair is complex at the smallest
        load.
    """

    eigenvalue: float
    end_error: float | None
    overlap: float
    kind: Kind

    @classmethod
    def between(cls, onset: Edge, end: Edge | None) -> "Window":
        """The window from one edge to another, or to none."""
        return cls(
            fx_onset=onset.fx,
            fx_end=None if end is None else end.fx,
            eigenvalue=onset.eigenvalue,
            error=onset.error,
            end_error=None if end is None else end.error,
            overlap=onset.overlap,
            kind=onset.kind,
        )

    def as_dict(self) -> dict[str, Any]:
        """The keys of the JSON contract: besides those of all windows, lambda."""
        return super().as_dict() | {"lambda": self.eigenvalue}


Followed = TypeVar("Followed")


def track_pair(
    known: dict[float, Followed], follow: Callable[[list[Followed], float], Followed]
) -> Callable[[float], Followed]:
    """A pair, or a mode, at any load: what is `known` by load, or is followed from there, and then known.

    `follow` is given what is known, the nearest load first, and the new load.
    """

    def at(fx: float) -> Followed:
        if fx not in known:
            known[fx] = follow([known[load] for load in sorted(known, key=lambda load: abs(load - fx))], fx)
        return known[fx]

    return at


@dataclass(frozen=True)
class Family:
    """The operator as a function of the load, and how closely the search looks at it.

    `operator` is fx -> the matrix A, ndarray or sparse, shape (n, n); windows narrower than `narrowest`, a force, are
    not looked for. `states` is fx -> what A is smooth with, of loads at which A is known: where it changes, A bends.
    """

    operator: Callable[[float], Operator]
    narrowest: float
    limits: Limits = LIMITS
    states: Callable[[float], bytes] = lambda fx: b""

    def at(self, fx: float) -> LoadPoint:
        """The operator at a load."""
        return LoadPoint(float(fx), csr_array(self.operator(float(fx))))

    def steps(self, here: LoadPoint, load: float) -> list[LoadPoint]:
        """The steps that lead to a load: where the states change on the way, one about each change is a short one."""
        there = self.at(load)
        shortest = self.limits.bending * (load - here.fx)

        def divide_step(below: LoadPoint, above: LoadPoint) -> list[LoadPoint]:
            if above.fx - below.fx <= shortest or self.states(below.fx) == self.states(above.fx):
                return [above]
            middle = look_between(self.at, below.fx, 0.5 * (below.fx + above.fx), above.fx)
            return [*divide_step(below, middle[0]), *divide_step(middle[0], above)] if middle else [above]

        places = [here, *divide_step(here, there)]
        states = [self.states(place.fx) for place in places]
        smooth = [before == now == after for before, now, after in zip(states, states[1:], states[2:], strict=False)]
        return [place for place, inside in zip(places[1:], [*smooth, False], strict=True) if not inside]

    def track(self, known: dict[float, Pair]) -> Callable[[float], Pair]:
        """A pair at any load, followed from the nearest load where it is known."""

        def follow(nearest: list[Pair], fx: float) -> Pair:
            place = self.at(fx)
            guess = nearest[0].extrapolate(nearest[1], fx) if len(nearest) > 1 else None
            image = None if guess is None else continue_pair(guess, fx, place.matrix, self.limits)
            return image if image and image.same_planes(nearest[0]) else self.follow_pair(nearest[0], place)

        return track_pair(known, follow)

    def follow_pair(self, pair: Pair, place: LoadPoint) -> Pair:
        """A pair at another load: continued, found among all modes, or followed in small steps; else LostPairError."""
        image = continue_pair(pair, place.fx, place.matrix, self.limits)
        if image is None and place.matrix.shape[0] <= self.limits.all_modes:
            image = place.modes.pair(place.modes.nearest(pair))
        return image or self._in_steps(pair, place)

    def _in_steps(self, pair: Pair, place: LoadPoint) -> Pair:
        """The pair at the end of a straight line of operators."""
        moving, done, step = pair, 0.0, 0.5
        while done < 1:
            share = min(1.0, done + step)
            matrix = csr_array((1 - share) * pair.matrix + share * place.matrix) if share < 1 else place.matrix
            image = continue_pair(moving, place.fx, matrix, self.limits)
            if image is not None:
                moving, done = image, share
            elif step > self.limits.shortest:
                step *= 0.5
            else:
                raise LostPairError.of(pair, f"between F_x = {pair.fx:.10g} and {place.fx:.10g}")
        return moving


class SignChange(NamedTuple):
    """Where a function of the load changes its sign: a root, or a jump.

    The error is twice the scatter over the slope of a root, and half of the bracket of a jump. Its loads are the five
    that give the root, or the one that is the root to within rounding, or the two on either side of the jump.
    """

    fx: float
    error: float
    loads: list[float]
    smooth: bool


def sign_change(value: Callable[[float], float], below: float, above: float, limits: Limits = LIMITS) -> SignChange:
    """Where a function of the load goes through zero, or jumps, between two loads at which it has opposite signs.

    Where its signs there are the same, it is within rounding of zero at one of them: the root is that load, to within
    the function over its slope.
    """
    ends = value(below), value(above)
    if ends[0] * ends[1] >= 0:
        fx = below if abs(ends[0]) <= abs(ends[1]) else above
        return SignChange(fx, min(map(abs, ends)) / (abs(ends[1] - ends[0]) / (above - below)), [fx], smooth=True)
    known: dict[float, float] = {}

    def look_at(fx: float) -> float:
        known[fx] = value(fx)
        return known[fx]

    root = _smooth_root(look_at, below, above, limits)
    if root is not None:
        return root
    width = _jump_width(below, above, limits)
    left, right = next((a, b) for a, b in pairwise(sorted(known)) if known[a] * known[b] <= 0)
    while right - left > width:
        middle = 0.5 * (left + right)
        left, right = (middle, right) if look_at(middle) * known[left] > 0 else (left, middle)
    return SignChange(0.5 * (left + right), 0.5 * (right - left), [left, right], smooth=False)


def _smooth_root(value: Callable[[float], float], below: float, above: float, limits: Limits) -> SignChange | None:
    """The root; None if the function does not cross zero along a smooth line at any distance."""
    from scipy.optimize import brentq

    span = above - below
    root = float(brentq(value, below, above, xtol=limits.root * span))
    room = min(root - below, above - root)
    # As near as the noise allows: the function should be straight, and yet stand out of the scatter.
    distance = 1e-3 * min(room, 1e-3 * span)
    while 0 < distance < 0.1 * room:
        loads = [float(fx) for fx in root + distance * np.arange(-2.0, 3.0)]
        found = _root_of_five(loads, np.array([value(fx) for fx in loads]))
        if found is not None:
            return SignChange(*found, loads, smooth=True)
        distance *= 30
    return None


def _root_of_five(loads: list[float], values: Floats) -> tuple[float, float] | None:
    """Root and error of a parabola through five equidistant points: two degrees of freedom tell the scatter."""
    middle, distance = loads[2], loads[3] - loads[2]
    curve, residuals, *_ = np.polynomial.polynomial.polyfit(np.arange(-2, 3), values, 2, full=True)
    scatter = float(np.sqrt(residuals[0].sum() / 2)) if residuals[0].size else 0.0
    value, slope = float(curve[0]), float(curve[1])
    # A step of height 1 has slope 0.3 and scatter 0.3 here.
    if scatter > 0.1 * abs(slope) or abs(value) > abs(slope) or values[0] * values[-1] >= 0:
        return None
    shift = -value / slope * (1 + float(curve[2]) * value / slope**2)  # the parabola's root, to second order
    return middle + shift * distance, 2 * scatter / abs(slope) * distance + float(np.spacing(abs(middle)))


def _jump_width(here: float, there: float, limits: Limits) -> float:
    """Width to which a jump between two loads is bracketed, force."""
    rounding = float(np.spacing(max(abs(here), abs(there))))
    return max(limits.jump * abs(there - here), 4 * rounding)


def locate_edge(family: Family, here: Pair, there: Pair) -> tuple[Edge, Pair, Pair]:
    """The edge of a pair that is real at one of two loads and complex at the other, and the pair on either side of it.

    A LostPairError is raised if the ends are not one pair.
    """
    pair = family.track({here.fx: here, there.fx: there})
    change = sign_change(lambda fx: pair(fx).discriminant, here.fx, there.fx, family.limits)
    points = [pair(fx) for fx in change.loads]
    below, above = points[0], points[-1]
    if change.smooth:
        mean, overlap = float(np.mean([point.mean for point in points])), min(point.overlap for point in points)
        return Edge(change.fx, change.error, mean, overlap, "coalescence"), below, above
    # Where the equilibrium does not jump, it is the pair that has become another one on the way.
    across = family.follow_pair(below, LoadPoint(above.fx, above.matrix))
    if across.discriminant * above.discriminant < 0 or not across.same_planes(above):
        raise LostPairError.of(above, f"at F_x = {above.fx:.10g}")
    return Edge.between(below.fx, above.fx, below, above), below, above


def edge_from_inside(family: Family, outside: Pair, inside: Pair) -> Edge:
    """Where a pair turns complex between a load where it is real and one where it is complex.

    The pair is followed from inside, with the increment halved until the pair outside leads back to the one inside.
    Then the root of D lies in between. If no half is short enough, the equilibrium jumps.
    """
    width = _jump_width(outside.fx, inside.fx, family.limits)
    while abs(inside.fx - outside.fx) > width:
        if returns_to_start(family, outside, inside):
            try:
                return locate_edge(family, *sorted((outside, inside), key=lambda pair: pair.fx))[0]
            except LostPairError:
                pass
        middle = family.follow_pair(inside, family.at(0.5 * (outside.fx + inside.fx)))
        outside, inside = (middle, inside) if middle.discriminant > 0 else (outside, middle)
    return Edge.between(outside.fx, inside.fx, outside, inside)


def other_sign(family: Family, known: Sequence[Pair], narrowest: float, *, dipping: bool = False) -> Pair | None:
    """A pair at a load where its discriminant has another sign than at the first of those that are known.

    None if it surely has that sign between all of them, but for stretches narrower than `narrowest`. A DoubtError is
    raised if that is not known after `Limits.dips` looks; and, of a pair that has to be `dipping`, if its discriminant
    does not dip where its slopes say so: these are then of loads too far apart.
    """
    sign, pairs = np.sign(known[0].discriminant), {pair.fx: pair for pair in known}
    pair = family.track(pairs)
    for _ in range(family.limits.dips):
        places = [pairs[fx] for fx in sorted(pairs)]
        other = next((each for each in places if each.discriminant * sign < 0), None)
        if other is not None:
            return other
        dips = ((*dip_between(*ends, family.limits), ends) for ends in pairwise(places))
        width, fx, ends = max(dips, key=lambda dip: dip[0])
        if width <= narrowest:
            return None
        looked = pair(fx)
        if dipping and abs(looked.discriminant) > min(abs(end.discriminant) for end in ends):
            break
    raise DoubtError


def returns_to_start(family: Family, outside: Pair, inside: Pair) -> bool:
    """Whether a real pair becomes the complex one from which it was followed."""
    returned = continue_pair(outside, inside.fx, inside.matrix, family.limits)
    return returned is not None and returned.discriminant < 0 and returned.same_planes(inside)
