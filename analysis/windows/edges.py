r"""Windows of loads on which a motion grows, and their edges: where the growth goes through zero, or jumps.

At an edge the growth of a motion (:mod:`~faultgouge.analysis.windows.space`) changes its sign. The growth goes through
zero along a straight line, at distances far below the increment, at

- a *coalescence*: without dissipation, where the discriminant D of two modes changes its sign and
  :math:`|y^H x| \to 0`;
- a *Hopf* point: with dissipation, where Re s of one mode changes its sign; a *steady* point if s itself is zero.

A few secant steps bracket the root; five points close to the root then give its last digits, and their number. The
growth jumps at a *contact change*, where the equilibrium itself jumps: a contact opened, closed or slid. Bisection
locates the jump. A mere crossing of two levels touches D = 0 without a change of sign.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from ..bracketed_root import bracketed_root
from ..errors import FaultgougeError
from ..packing.packing import Floats
from .limits import LIMITS, Limits
from .space import Space
from .system import System, entries

Kind = Literal["coalescence", "hopf", "steady", "contact change", "start"]


class LostPairError(FaultgougeError):
    """A motion cannot be followed to another load; the text is one sentence."""

    @classmethod
    def of(cls, space: Space, where: str) -> "LostPairError":
        """The sentence about a motion and the loads at which it was lost."""
        what = (
            f"a motion of the frequency {space.mean.imag:.6g}"
            if space.system.dissipative
            else f"the pair of eigenvalues about {space.mean:.6g}"
        )
        return cls(f"{what} cannot be told from its neighbours {where}: take smaller increments")


class LostTrackError(FaultgougeError):
    """At the beginning of an increment other motions grow than at the end of the increment before."""


class DoubtError(FaultgougeError):
    """The search cannot decide what happens on an increment; `fx` is a load inside at which to look, or None."""

    def __init__(self, fx: float | None = None) -> None:
        super().__init__("an increment is in doubt")
        self.fx = fx


@dataclass(frozen=True)
class Edge:
    """A load at which a motion begins or ceases to grow.

    Attributes
    ----------
    fx : float
        The load, force per top disk.
    error : float
        Uncertainty of the load: of a root twice the scatter over the slope, of a jump half of its bracket; plus the
        `load_error` of the equilibria. 0 at a "start".
    eigenvalue : float or complex
        Without dissipation the double eigenvalue (the real part of the pair if it does not coalesce there),
        1 / time^2; with it s, complex, 1 / time.
    overlap : float
        Smallest |y^H x| met at the edge; at an exceptional point it is the root of the rounding error.
    kind : {"coalescence", "hopf", "steady", "contact change", "start"}
        Two real eigenvalues that meet; Re s that goes through zero, with Im s or without; a jump of the equilibrium; or
        nothing, as the motion grows at the smallest load.
    """

    fx: float
    error: float
    eigenvalue: float | complex
    overlap: float
    kind: Kind

    @classmethod
    def start(cls, space: Space) -> "Edge":
        """The edge of a motion that grows at the smallest load."""
        return cls(space.fx, 0.0, space.mean, space.overlap, "start")

    @classmethod
    def between(cls, one: float, other: float, *spaces: Space) -> "Edge":
        """The edge half way between two loads, where the equilibrium jumps or a motion is not recognised."""
        last = spaces[-1]
        error, overlap = 0.5 * abs(other - one) + last.system.balance, min(each.overlap for each in spaces)
        return cls(0.5 * (one + other), error, last.mean, overlap, "contact change")

    @classmethod
    def root(cls, fx: float, error: float, spaces: Sequence[Space]) -> "Edge":
        """The edge at a root of the growth, from the motion at loads close to it."""
        middle = spaces[len(spaces) // 2]
        mean = np.mean([each.mean for each in spaces])
        kind: Kind = "coalescence"
        if middle.system.dissipative:
            size = float(np.sqrt(np.abs(entries(middle.system.stiffness)).max()))
            kind = "steady" if middle.mean.imag <= LIMITS.steady_share * size else "hopf"
        overlap = min(each.overlap for each in spaces)
        return cls(fx, error + middle.system.balance, mean.item(), overlap, kind)

    def in_units_of(self, unit: float) -> "Edge":
        """The edge of systems whose A was divided by a unit, 1 / time^2."""
        scale = float(np.sqrt(unit)) if isinstance(self.eigenvalue, complex) else unit
        return replace(self, eigenvalue=scale * self.eigenvalue)


@dataclass(frozen=True)
class Window:
    """An interval of loads on which one motion grows.

    Attributes
    ----------
    onset : Edge
        Where the motion begins to grow.
    end : Edge or None
        Where the motion ceases to grow; None if it grows at the largest load that was looked at.
    path_error : float or None
        Part of the onset's error that comes from the increments of the path of equilibria, force. None until the path
        has been taken once more, with other increments.
    """

    onset: Edge
    end: Edge | None
    path_error: float | None = None

    @property
    def fx_onset(self) -> float:
        """Load at which the motion begins to grow, force per top disk."""
        return self.onset.fx

    @property
    def fx_end(self) -> float | None:
        """Load at which the motion ceases to grow."""
        return None if self.end is None else self.end.fx

    @property
    def rounding_error(self) -> float:
        """Part of the onset's error that comes from rounding and from equilibria out of balance, force."""
        return self.onset.error

    @property
    def error(self) -> float:
        """Uncertainty of fx_onset: from rounding and, where known, from the path."""
        return self.onset.error + (self.path_error or 0.0)

    @property
    def kind(self) -> Kind:
        """Kind of the edge at which the window begins."""
        return self.onset.kind

    @property
    def dissipative(self) -> bool:
        """Whether the motion has dissipation."""
        return isinstance(self.onset.eigenvalue, complex)

    @property
    def eigenvalue(self) -> float:
        """The double eigenvalue at the onset, 1 / time^2; with dissipation Re(-s^2)."""
        value = self.onset.eigenvalue
        return -((value**2).real) if isinstance(value, complex) else value

    @property
    def frequency(self) -> float:
        """Im s at the onset, radian / time; without dissipation the root of the eigenvalue."""
        value = self.onset.eigenvalue
        return value.imag if isinstance(value, complex) else float(np.sqrt(max(0.0, value)))

    @property
    def overlap(self) -> float:
        """Smallest |y^H x| met at the onset."""
        return self.onset.overlap

    def in_units_of(self, unit: float) -> "Window":
        """The window of systems whose A was divided by a unit, 1 / time^2."""
        return replace(
            self, onset=self.onset.in_units_of(unit), end=None if self.end is None else self.end.in_units_of(unit)
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON: fx_onset, fx_end, error, error_of_path, kind, and lambda, or frequency with dissipation."""
        own = {"frequency": self.frequency} if self.dissipative else {"lambda": self.eigenvalue}
        return {
            "fx_onset": self.fx_onset,
            "fx_end": self.fx_end,
            "error": self.error,
            "kind": self.kind,
            "error_of_path": self.path_error,
        } | own


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

    If rounding makes both signs equal, the function is zero within rounding at one of the loads. That load is the root,
    uncertain by the function over its slope.
    """
    ends = value(below), value(above)
    if ends[0] * ends[1] >= 0:
        fx = below if abs(ends[0]) <= abs(ends[1]) else above
        return SignChange(fx, min(map(abs, ends)) / (abs(ends[1] - ends[0]) / (above - below)), [fx], smooth=True)
    values: dict[float, float] = {}

    def look_at(fx: float) -> float:
        values[fx] = value(fx)
        return values[fx]

    root = _smooth_root(look_at, below, above, limits)
    if root is not None:
        return root
    width = _jump_width(below, above, limits)
    left, right = next((a, b) for a, b in pairwise(sorted(values)) if values[a] * values[b] <= 0)
    while right - left > width:
        middle = 0.5 * (left + right)
        left, right = (middle, right) if look_at(middle) * values[left] > 0 else (left, middle)
    return SignChange(0.5 * (left + right), 0.5 * (right - left), [left, right], smooth=False)


def _smooth_root(value: Callable[[float], float], below: float, above: float, limits: Limits) -> SignChange | None:
    """The root; None if the function does not cross zero along a smooth line at any distance."""
    span = above - below
    root = bracketed_root(value, below, above, limits.root_width * span)
    room = min(root - below, above - root)
    # As near as the noise allows: the function should be straight, and yet stand out of the scatter.
    distance = min(limits.point_distance_share * room, limits.point_distance * limits.root_width * span)
    while 0 < distance < limits.largest_point_share * room:
        loads = [float(fx) for fx in root + distance * np.arange(-2.0, 3.0)]
        found = _root_of_five(loads, np.array([value(fx) for fx in loads]), limits)
        if found is not None:
            return SignChange(*found, loads, smooth=True)
        distance *= limits.point_factor
    return None


def _root_of_five(loads: list[float], values: Floats, limits: Limits) -> tuple[float, float] | None:
    """Root and error of a parabola through five equidistant points: two degrees of freedom tell the scatter."""
    middle, distance = loads[2], loads[3] - loads[2]
    curve, residuals, *_ = np.polynomial.polynomial.polyfit(np.arange(-2, 3), values, 2, full=True)
    scatter = float(np.sqrt(residuals[0].sum() / 2)) if residuals[0].size else 0.0
    value, slope = float(curve[0]), float(curve[1])
    # a step of height 1 has slope 0.3 and scatter 0.3
    if scatter > limits.scatter * abs(slope) or abs(value) > abs(slope) or values[0] * values[-1] >= 0:
        return None
    shift = -value / slope * (1 + float(curve[2]) * value / slope**2)  # the parabola's root, to second order
    return middle + shift * distance, 2 * scatter / abs(slope) * distance + float(np.spacing(abs(middle)))


def _jump_width(here: float, there: float, limits: Limits) -> float:
    """Width to which a jump between two loads is bracketed, force."""
    rounding = float(np.spacing(max(abs(here), abs(there))))
    return max(limits.jump_width * abs(there - here), 4 * rounding)


SystemOfLoad = Callable[[float], System]
"""Load -> the system there."""

Increments = tuple[tuple[float, float], ...]
"""From load to load."""


def follow_to(space: Space, system: System, limits: Limits = LIMITS) -> Space:
    """The same motion at another load; LostPairError if it cannot be followed there."""
    found = space.follow(system, limits)
    if found is None:
        raise LostPairError.of(space, f"between F_x = {space.fx:.10g} and {system.fx:.10g}")
    return found


def track(at: SystemOfLoad, spaces: dict[float, Space], limits: Limits = LIMITS) -> Callable[[float], Space]:
    """A function of the load that follows a motion there from the nearest load in `spaces`, and adds it to `spaces`."""

    def look_at(fx: float) -> Space:
        if fx not in spaces:
            near = [spaces[load] for load in sorted(spaces, key=lambda load: abs(load - fx))]
            spaces[fx] = _follow_from(near, at(fx), limits)
        return spaces[fx]

    return look_at


def _follow_from(near: Sequence[Space], system: System, limits: Limits) -> Space:
    """The motion at another load: from a straight line through the two nearest loads, else from the nearest alone."""
    guess = near[0].extrapolate(near[1], system) if len(near) > 1 else None
    image = None if guess is None else guess.at(system, limits)
    return image if image is not None and image.like(near[0]) else follow_to(near[0], system, limits)


def locate_edge(at: SystemOfLoad, below: Space, above: Space, limits: Limits = LIMITS) -> tuple[Edge, Space, Space]:
    """The edge of a motion that grows at one of two loads, and the motion on either side of the edge.

    A LostPairError is raised if the motions at both ends are not the same.
    """
    motion = track(at, {below.fx: below, above.fx: above}, limits)
    change = sign_change(lambda fx: motion(fx).growth, below.fx, above.fx, limits)
    places = [motion(fx) for fx in change.loads]
    left, right = places[0], places[-1]
    if change.smooth:
        return Edge.root(change.fx, change.error, places), left, right
    # Where the equilibrium does not jump, it is the motion that has become another one on the way.
    across = follow_to(left, right.system, limits)
    if across.growth * right.growth < 0 or not across.like(right):
        raise LostPairError.of(right, f"at F_x = {right.fx:.10g}")
    return Edge.between(left.fx, right.fx, left, right), left, right


def edge_from_inside(at: SystemOfLoad, outside: Space, inside: Space, limits: Limits = LIMITS) -> Edge:
    """Where a motion begins or ends to grow between a load where it does not and one where it does.

    The motion is followed from inside, with the increment halved until the motion outside leads back to the one inside.
    Then the root of the growth lies in between. If no half is short enough, the equilibrium jumps.
    """
    width = _jump_width(outside.fx, inside.fx, limits)
    while abs(inside.fx - outside.fx) > width:
        if leads_back(outside, inside, limits):
            try:
                below, above = sorted((outside, inside), key=lambda space: space.fx)
                return locate_edge(at, below, above, limits)[0]
            except LostPairError:
                pass
        middle = follow_to(inside, at(0.5 * (outside.fx + inside.fx)), limits)
        outside, inside = (outside, middle) if middle.growth > 0 else (middle, inside)
    return Edge.between(outside.fx, inside.fx, outside, inside)


def leads_back(outside: Space, inside: Space, limits: Limits = LIMITS) -> bool:
    """Whether a motion that does not grow becomes the growing one from which it was followed."""
    back = outside.at(inside.system, limits)
    return back is not None and back.growth > 0 and back.equals(inside)
