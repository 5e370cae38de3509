r"""Windows of loads on which a motion grows, and their edges: where the growth goes through zero, or jumps.

At an edge the growth of a motion (:mod:`~faultgouge.analysis.windows.search`) changes its sign. The growth goes through
zero along a straight line, at distances far below the increment, at

- a *coalescence*: without dissipation, where the discriminant D of two modes changes its sign and
  :math:`|y^H x| \to 0`;
- a *Hopf* point: with dissipation, where Re s of one mode changes its sign; a *steady* point if s itself is zero.

A few secant steps bracket the root; five points close to the root then give its last digits, and their number. The
growth jumps at a *contact change*, where the equilibrium itself jumps: a contact opened, closed or slid. Bisection
locates the jump. A mere crossing of two levels touches D = 0 without a change of sign.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from ..arrays import Floats
from ..errors import FaultgougeError
from .states import Motions
from .system import System

Kind = Literal["coalescence", "hopf", "steady", "contact change", "start"]


class LostPairError(FaultgougeError):
    """A motion cannot be followed to another load; the text is one sentence."""


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
    def start(cls, state: Motions, k: int) -> "Edge":
        """The edge of a motion that grows at the smallest load."""
        return cls(state.fx, 0.0, _value(state.system, state.values[k]), float(state.overlap[k]), "start")

    @classmethod
    def between(cls, loads: tuple[float, float], system: System, value: complex, overlap: float) -> "Edge":
        """The edge half way between two loads, where the equilibrium jumps or a motion is not recognised."""
        below, above = loads
        error = 0.5 * (above - below) + system.balance
        return cls(0.5 * (below + above), error, _value(system, value), float(overlap), "contact change")


def _value(system: System, value: complex) -> float | complex:
    return complex(value) if system.dissipative else float(value.real)


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


def sign_change(value: Callable[[float], float], below: float, above: float) -> SignChange:
    """Where a function of the load goes through zero, or jumps, between two loads at which it has opposite signs.

    A few steps bracket the root. Five points close to it then give its last digits, and their number: they are as
    close as the noise allows, since the function should be straight and yet stand out of its scatter. Where it does not
    cross zero along a smooth line at any distance, bisection locates the jump. If rounding makes the signs at both
    loads equal, the function is zero within rounding at one of these. That load is the root, uncertain by the function
    over its slope.
    """
    ends = value(below), value(above)
    span = above - below
    if ends[0] * ends[1] >= 0:
        fx = below if abs(ends[0]) <= abs(ends[1]) else above
        return SignChange(fx, min(map(abs, ends)) / (abs(ends[1] - ends[0]) / span), [fx], smooth=True)
    values = {below: ends[0], above: ends[1]}

    def look_at(fx: float) -> float:
        if fx not in values:
            values[fx] = value(fx)
        return values[fx]

    root = _bracketed(look_at, below, above, 1e-8 * span)
    room = min(root - below, above - root)
    distance = min(1e-3 * room, 1e-6 * span)
    while 0 < distance < 0.1 * room:
        loads = [float(fx) for fx in root + distance * np.arange(-2.0, 3.0)]
        found = _root_of_five(loads, np.array([look_at(fx) for fx in loads]))
        if found is not None and abs(found[0] - root) <= distance:
            return SignChange(*found, loads, smooth=True)
        if found is not None and abs(found[0] - root) < 0.5 * room:
            root = found[0]  # the bracket was wider than the points
        else:
            distance *= 30.0
    width = max(1e-9 * span, 4 * float(np.spacing(max(abs(below), abs(above)))))  # paths differ by far more at a jump
    left, right = next((a, b) for a, b in pairwise(sorted(values)) if values[a] * values[b] <= 0)
    while right - left > width:
        middle = 0.5 * (left + right)
        left, right = (middle, right) if look_at(middle) * values[left] > 0 else (left, middle)
    return SignChange(0.5 * (left + right), 0.5 * (right - left), [left, right], smooth=False)


def _bracketed(value: Callable[[float], float], a: float, b: float, tolerance: float) -> float:
    """The root between a and b to a tolerance, by Ridders's method (IEEE Trans. Circuits Syst. 26, 979 (1979))."""
    last = np.inf
    while abs(b - a) > tolerance:
        middle = 0.5 * (a + b)
        low, half, high = value(a), value(middle), value(b)
        if half == 0:
            return middle
        fx = middle + (middle - a) * float(np.sign(low - high) * half / np.sqrt(half**2 - low * high))
        steady, last = abs(fx - last) <= tolerance, fx
        if value(fx) == 0 or (steady and min(abs(fx - a), abs(b - fx)) > 0.01 * abs(b - a)):
            return float(fx)
        places = sorted([a, b, middle, float(fx)])
        a, b = next((p, q) for p, q in pairwise(places) if value(p) * value(q) <= 0)
    return 0.5 * (a + b)


def _root_of_five(loads: list[float], values: Floats) -> tuple[float, float] | None:
    """Root and error of a parabola through five equidistant points: two degrees of freedom tell the scatter."""
    middle, distance = loads[2], loads[3] - loads[2]
    curve, residuals, *_ = np.polynomial.polynomial.polyfit(np.arange(-2, 3), values, 2, full=True)
    scatter = float(np.sqrt(residuals[0].sum() / 2)) if residuals[0].size else 0.0
    value, slope = float(curve[0]), float(curve[1])
    # a step of height 1 has slope 0.3 and scatter 0.3
    if scatter > 0.1 * abs(slope):
        return None
    shift = -value / slope  # and the parabola's root, to second order
    shift *= 1 - float(curve[2]) * shift / slope if abs(shift) <= 2 else 1
    return middle + shift * distance, 2 * scatter / abs(slope) * distance + float(np.spacing(abs(middle)))


Increments = tuple[tuple[float, float], ...]
"""From load to load."""
