r"""Where a pair of eigenvalues enters or leaves the real axis: the root of its discriminant.

The discriminant :math:`D(F) = (\lambda_1 - \lambda_2)^2` goes through zero linearly and is smooth on both sides
(:mod:`~faultgouge.analysis.onset.pair`). A few secant steps bracket its root. Five points close to the root then give
the last digits, and say how many there are. `smooth_root` does so for any function of the load.

**Coalescence or not.** An edge is a coalescence if D passes through zero along a straight line at distances far below
the increment; there :math:`|y^H x| \to 0`. A mere crossing touches D = 0 without a change of sign. If D jumps, the
equilibrium itself does: a contact opened, closed or slid. Bisection then locates the jump, and the edge is a "contact
change".
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from ..errors import FaultgougeError
from ..packing import Floats
from .limits import LIMITS, Limits
from .modes import Modes, Operator
from .pair import Pair, Place, continued

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
        """Of a pair that is complex at the smallest load."""
        return cls(pair.fx, 0.0, pair.mean, pair.overlap, "start")

    @classmethod
    def between(cls, one: float, other: float, *pairs: Pair) -> "Edge":
        """Of a pair where the equilibrium jumps, or that is not recognised, between two loads: uncertain by half."""
        half, overlap = 0.5 * abs(other - one), min(pair.overlap for pair in pairs)
        return cls(0.5 * (one + other), half, pairs[-1].mean, overlap, "contact change")


@dataclass(frozen=True)
class Family:
    """The operator as a function of the load, and how closely the search looks at it.

    Attributes
    ----------
    operator : callable
        fx -> the matrix A, ndarray or sparse, shape (n, n).
    narrowest : float
        Windows narrower than this are not looked for, force.
    limits : Limits
        All other bounds of the search.
    """

    operator: Callable[[float], Operator]
    narrowest: float
    limits: Limits = LIMITS

    def at(self, fx: float) -> Place:
        """The operator at a load."""
        return Place(float(fx), csr_array(self.operator(float(fx))))

    def followed(self, pair: Pair, place: Place) -> Pair:
        """A pair at another load: continued, found among all modes, or followed in small steps.

        Raises
        ------
        LostPairError
            If it can be followed in none of these ways.
        """
        image = continued(pair, *place, self.limits)
        if image is None and place.matrix.shape[0] <= self.limits.all_modes:
            modes = Modes.of(*place)
            image = modes.pair(modes.nearest(pair))
        return image or self._in_steps(pair, place)

    def _in_steps(self, pair: Pair, place: Place) -> Pair:
        """The pair at the end of a straight line of operators."""
        moving, done, step = pair, 0.0, 0.5
        while done < 1:
            share = min(1.0, done + step)
            matrix = csr_array((1 - share) * pair.matrix + share * place.matrix) if share < 1 else place.matrix
            image = continued(moving, place.fx, matrix, self.limits)
            if image is not None:
                moving, done = image, share
            elif step > self.limits.shortest:
                step *= 0.5
            else:
                raise LostPairError.of(pair, f"between F_x = {pair.fx:.10g} and {place.fx:.10g}")
        return moving


class Root(NamedTuple):
    """The root of a smooth function of the load, its error, and the loads about it that were looked at."""

    fx: float
    error: float
    loads: Floats


def smooth_root(value: Callable[[float], float], below: float, above: float, limits: Limits = LIMITS) -> Root | None:
    """Where a function of the load that has opposite signs at two loads goes through zero.

    Returns
    -------
    Root or None
        None if the function does not cross zero along a smooth line at any distance: it jumps.
    """
    from scipy.optimize import brentq

    span = above - below
    root = float(brentq(value, below, above, xtol=limits.root * span))
    room = min(root - below, above - root)
    # As near as the noise allows: the function should be straight, and yet stand out of the scatter.
    distance = 1e-3 * min(room, 1e-3 * span)
    while 0 < distance < 0.1 * room:
        loads: Floats = root + distance * np.arange(-2.0, 3.0)
        found = _root_of_five(loads, np.array([value(float(fx)) for fx in loads]))
        if found is not None:
            return Root(*found, loads)
        distance *= 30
    return None


def jump_width(here: float, there: float, limits: Limits = LIMITS) -> float:
    """Width to which a jump between two loads is bracketed, force."""
    rounding = float(np.spacing(max(abs(here), abs(there))))
    return max(limits.jump * abs(there - here), 4 * rounding)


def bracketed_jump(value: Callable[[float], float], below: float, above: float, width: float) -> tuple[float, float]:
    """The loads on either side of a jump of a function from one sign to the other, by bisection."""
    while above - below > width:
        middle = 0.5 * (below + above)
        below, above = (middle, above) if value(middle) * value(below) > 0 else (below, middle)
    return below, above


def _root_of_five(loads: Floats, values: Floats) -> tuple[float, float] | None:
    """Root and error of a parabola through five equidistant points, two degrees of freedom being left for the
    scatter."""
    middle, distance = float(loads[2]), float(loads[3] - loads[2])
    curve, residuals, *_ = np.polynomial.polynomial.polyfit(np.arange(-2, 3), values, 2, full=True)
    scatter = float(np.sqrt(residuals[0].sum() / 2)) if residuals[0].size else 0.0
    value, slope = float(curve[0]), float(curve[1])
    # A step of height 1 has slope 0.3 and scatter 0.3 here.
    if scatter > 0.1 * abs(slope) or abs(value) > abs(slope) or values[0] * values[-1] >= 0:
        return None
    shift = -value / slope * (1 + float(curve[2]) * value / slope**2)  # the parabola's root, to second order
    return middle + shift * distance, 2 * scatter / abs(slope) * distance + float(np.spacing(abs(middle)))


def locate(family: Family, here: Pair, there: Pair) -> tuple[Edge, Pair, Pair]:
    """The root of D of a pair between two loads, and the pair close by on either side."""
    if here.discriminant * there.discriminant >= 0:
        # One end is within rounding of the coalescence: the edge is there, to within D over its slope.
        end = min(here, there, key=lambda pair: abs(pair.discriminant))
        slope = abs(there.discriminant - here.discriminant) / (there.fx - here.fx)
        return Edge(end.fx, abs(end.discriminant) / slope, end.mean, end.overlap, "coalescence"), here, there
    known = {here.fx: here, there.fx: there}

    def pair(fx: float) -> Pair:
        if fx not in known:
            known[fx] = family.followed(known[min(known, key=lambda each: abs(each - fx))], family.at(fx))
        return known[fx]

    root = smooth_root(lambda fx: pair(fx).discriminant, here.fx, there.fx, family.limits)
    if root is None:
        return _located_jump(family, pair, known)
    points = [pair(float(fx)) for fx in root.loads]
    mean, overlap = float(np.mean([point.mean for point in points])), min(point.overlap for point in points)
    return Edge(root.fx, root.error, mean, overlap, "coalescence"), points[0], points[-1]


def _located_jump(family: Family, pair: Callable[[float], Pair], known: dict[float, Pair]) -> tuple[Edge, Pair, Pair]:
    """The edge of a pair whose discriminant jumps between loads that are known, by bisection."""
    order = sorted(known)
    width = jump_width(order[0], order[-1], family.limits)
    below, above = next((a, b) for a, b in pairwise(order) if known[a].discriminant * known[b].discriminant <= 0)
    below, above = bracketed_jump(lambda fx: pair(fx).discriminant, below, above, width)
    # Where the equilibrium does not jump, it is the pair that has become another one on the way.
    across = family.followed(known[below], Place(above, known[above].matrix))
    if across.discriminant * known[above].discriminant < 0 or not across.same_planes(known[above]):
        raise LostPairError.of(known[above], f"at F_x = {above:.10g}")
    return Edge.between(below, above, known[below], known[above]), known[below], known[above]


def edge_from_inside(family: Family, outside: Pair, inside: Pair) -> Edge:
    """Where a pair turns complex between a load where it is real and one where it is complex.

    The pair is followed from inside, with the increment halved until the pair outside leads back to the one inside.
    Then the root of D lies in between. If no half is short enough, the equilibrium jumps.
    """
    width = jump_width(outside.fx, inside.fx, family.limits)
    while abs(inside.fx - outside.fx) > width:
        if leads_back(family, outside, inside):
            try:
                return locate(family, *sorted((outside, inside), key=lambda pair: pair.fx))[0]
            except LostPairError:
                pass
        middle = family.followed(inside, family.at(0.5 * (outside.fx + inside.fx)))
        outside, inside = (middle, inside) if middle.discriminant > 0 else (outside, middle)
    return Edge.between(outside.fx, inside.fx, outside, inside)


def leads_back(family: Family, outside: Pair, inside: Pair) -> bool:
    """Whether a real pair becomes the complex one from which it was followed."""
    returned = continued(outside, inside.fx, inside.matrix, family.limits)
    return returned is not None and returned.discriminant < 0 and returned.same_planes(inside)
