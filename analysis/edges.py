r"""Where a pair of eigenvalues enters or leaves the real axis: the root of its discriminant.

Along a ramp of the load F the discriminant :math:`D(F) = (\lambda_1 - \lambda_2)^2` of a pair (see
:mod:`~faultgouge.analysis.tracking`) goes through zero linearly where the two coalesce, and stays smooth and real on
both sides. A few secant steps bracket the root; five points close to it then give the last digits, and say how many
there are.

**Coalescence or not.** An edge is a coalescence if D passes through zero along a straight line at distances
far below the increment, and there :math:`|y^H x| \to 0`; a mere crossing touches D = 0 without a change of
sign. If D jumps, the equilibrium itself does: a contact opened, closed or slid. The edge is then located by
bisection, and says so.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import csr_array

from .modes import Modes, Operator
from .spectrum import believable, unit_rounding
from .tracking import Block, continued

ROOT = 1e-7
"""Width to which the root of D is bracketed, in increments: a tenth of the distance at which the five points lie
through which the parabola goes that gives the last digits."""

JUMP = 1e-9
"""Width to which a jump of the equilibrium is bracketed, in increments: the place depends on the path, and with it on
the increment, by far more."""

ALL_MODES = 900
"""Coordinates up to which a pair that cannot be continued is looked for among all modes, which takes a second there."""

SHORTEST = 2.0**-6
"""Shortest steps, in shares of the way from one operator to the other, in which a pair of a larger one is followed."""

Kind = Literal["coalescence", "contact change", "start", "scan"]


class LostPairError(RuntimeError):
    """A pair that can be followed no further: one sentence."""


@dataclass(frozen=True)
class Edge:
    """Where a pair enters or leaves the real axis."""

    fx: float
    error: float
    eigenvalue: float
    overlap: float
    kind: Kind


@dataclass(frozen=True, eq=False)
class State:
    """The operator at one load and the block of a pair in it."""

    fx: float
    matrix: csr_array
    block: Block

    @property
    def discriminant(self) -> float:
        return self.block.discriminant

    @property
    def definite(self) -> bool:
        """Whether the pair is real, or complex, by more than rounding."""
        split = complex(self.block.mean, 0.5 * np.sqrt(abs(self.discriminant)))
        return believable(split, self.block.overlap, unit_rounding(self.matrix.data))

    def at(self, fx: float, operator: Operator) -> "State":
        """The same pair at another load: continued, or found among all modes if need be.

        Raises
        ------
        LostPairError
            If it cannot be continued, and there are more modes than `ALL_MODES`.
        """
        matrix = csr_array(operator)
        block = continued(matrix, self.block)
        if block is None and matrix.shape[0] <= ALL_MODES:
            modes = Modes.of(fx, matrix)
            block = modes.block(modes.nearest(self.block))
        return State(fx, matrix, block or self._in_steps(fx, matrix))

    def _in_steps(self, fx: float, matrix: csr_array) -> Block:
        """The pair at the end of a straight line of operators."""
        block, done, step = self.block, 0.0, 0.5
        while done < 1:
            share = min(1.0, done + step)
            found = continued(csr_array((1 - share) * self.matrix + share * matrix), block)
            if found is not None:
                block, done = found, share
            elif step > SHORTEST:
                step *= 0.5
            else:
                raise LostPairError(
                    f"the pair of eigenvalues about {self.block.mean:.6g} cannot be told from its neighbours between "
                    f"F_x = {self.fx:.10g} and {fx:.10g}: take smaller increments"
                )
        return block


def locate(operator: Callable[[float], Operator], here: State, there: State) -> tuple[Edge, State, State]:
    """The root of D of a pair between two loads, and its states close by on either side."""
    span = there.fx - here.fx
    if here.discriminant * there.discriminant >= 0:
        # One end is within rounding of the coalescence: the edge is there, to within D over its slope.
        end = min(here, there, key=lambda state: abs(state.discriminant))
        slope = abs(there.discriminant - here.discriminant) / span
        error = abs(end.discriminant) / slope
        return Edge(end.fx, error, end.block.mean, end.block.overlap, "coalescence"), here, there
    known = {here.fx: here, there.fx: there}

    def state(fx: float) -> State:
        if fx not in known:
            known[fx] = known[min(known, key=lambda each: abs(each - fx))].at(fx, operator(fx))
        return known[fx]

    root = float(brentq(lambda fx: state(fx).discriminant, here.fx, there.fx, xtol=ROOT * span))
    room = min(root - here.fx, there.fx - root)
    # As near as the noise allows: D should be straight, and yet stand out of the scatter.
    distance = 1e-3 * min(room, 1e-3 * span)
    while 0 < distance < 0.1 * room:
        points = [state(root + offset * distance) for offset in (-2, -1, 0, 1, 2)]
        edge = _coalescence(points)
        if edge is not None:
            return edge, points[0], points[-1]
        distance *= 30
    # D jumps: nothing but bisection will do.
    order = sorted(known)
    below, above = next((a, b) for a, b in pairwise(order) if known[a].discriminant * known[b].discriminant <= 0)
    while above - below > jump_width(here, there):
        middle = 0.5 * (below + above)
        if state(middle).discriminant * known[below].discriminant > 0:
            below = middle
        else:
            above = middle
    # Where the equilibrium does not jump, it is the pair that has become another one on the way.
    across = known[below].at(above, known[above].matrix)
    if across.discriminant * known[above].discriminant < 0 or not across.block.same_plane(known[above].block):
        raise LostPairError(
            f"the pair of eigenvalues about {known[above].block.mean:.6g} cannot be told from its neighbours at "
            f"F_x = {above:.10g}: take smaller increments"
        )
    return jump_between(known[below], known[above]), known[below], known[above]


def jump_width(here: State, there: State) -> float:
    """Width to which a jump between two loads is bracketed, force."""
    return max(JUMP * abs(there.fx - here.fx), 4 * float(np.spacing(max(abs(here.fx), abs(there.fx)))))


def jump_between(here: State, there: State) -> Edge:
    """The edge of a pair where the equilibrium jumps, somewhere between two loads."""
    return Edge(
        fx=0.5 * (here.fx + there.fx),
        error=0.5 * abs(there.fx - here.fx),
        eigenvalue=there.block.mean,
        overlap=min(here.block.overlap, there.block.overlap),
        kind="contact change",
    )


def _coalescence(points: Sequence[State]) -> Edge | None:
    """Root and error of D from five equidistant points about it; None if D does not cross zero smoothly.

    A parabola takes care of what curvature there is; two degrees of freedom are left for the scatter.
    """
    middle, distance = points[2].fx, points[3].fx - points[2].fx
    d = np.array([point.discriminant for point in points])
    curve, residuals, *_ = np.polynomial.polynomial.polyfit(np.arange(-2, 3), d, 2, full=True)
    scatter = float(np.sqrt(residuals[0].sum() / 2)) if residuals[0].size else 0.0
    value, slope = float(curve[0]), float(curve[1])
    # A step of height 1 has slope 0.3 and scatter 0.3 here.
    if scatter > 0.1 * abs(slope) or abs(value) > abs(slope) or d[0] * d[-1] >= 0:
        return None
    shift = -value / slope * (1 + float(curve[2]) * value / slope**2)  # the parabola's root, to second order
    return Edge(
        fx=middle + shift * distance,
        error=2 * scatter / abs(slope) * distance + float(np.spacing(abs(middle))),
        eigenvalue=float(np.mean([point.block.mean for point in points])),
        overlap=min(point.block.overlap for point in points),
        kind="coalescence",
    )
