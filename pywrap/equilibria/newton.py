r"""Newton's method from one equilibrium, at one load.

The unknown is the displacement q from the last equilibrium, :math:`q = (\Delta x.., \Delta y.., R \Delta\theta..)`.
LAMMPS moves the disks by q along a straight path, advances the slips from their values at that equilibrium (never from
an iterate), clamps them, and returns the forces F(q). With the consistent stiffness matrix K of the trial
configuration,

.. math:: K\, \Delta q = F(q), \qquad q \leftarrow q + \Delta q.

K is the Jacobian of F up to the finite length of the path, a relative error of order :math:`|q|`, so the convergence is
quadratic until it is linear with a factor of about 1e-4 or less. A contact that opens, closes, sticks or slides changes
K, and the iteration continues with the new contacts.

Doubles limit the residual: a coordinate x is accurate to :math:`\epsilon |x|`, which changes the force of a contact of
stiffness k by :math:`k \epsilon |x|`. The rounding floor is the sum of these errors over the contacts of each disk. An
equilibrium whose residual no longer falls and is of this order is at the floor. The iteration ends when the last two
residuals show that another step would gain nothing. In compensated arithmetic a coordinate is accurate to 1e-23, and
the next limit is the displacement itself, a double: :math:`k \epsilon |q|`. From there on displacements are measured
from the iterate. The remaining displacement :math:`q'` is of order :math:`\epsilon |q|`. Its slips start at an iterate,
which changes them by :math:`|q| |q'|`, less than they can resolve.

If a neighbour hits a rattler, the rattler is moved to the middle of its cage: it carries no force, and its position
does not matter (:mod:`~faultgouge.pywrap.equilibria.rattlers`).
"""

from typing import NamedTuple

import numpy as np

from ...analysis import Packing, nearest_image, touching
from ...analysis.arrays import Floats, Indices
from ..lammps.engine import Engine
from ..lammps.trial_state import EPSILON, Trial
from .newton_matrix import IDLE_FORCE_SHARE, StiffnessFactors, factor_stiffness
from .rattlers import middle_of_cage

NEWTON_ITERATIONS = 40
"""Newton iterations before an increment is halved. Three or four do, but where a disk is pushed out between two others:
their contacts open as delta^p -> 0, on which Newton's method gains a factor of 5 an iteration for p = 3/2, and 12 reach
the floor."""

ITERATIONS_WITHOUT_GAIN, LEAST_GAIN = 8, 0.5
"""Iterations that gain nothing before an increment is halved, and the factor of the residual that counts as a gain."""

PATIENCE = 200, 0.95
"""Iterations, and the factor of the residual that counts as a gain, where halving leads nowhere. Beside a contact that
carries next to nothing, or slides nearly, the residual may fall by no more than 0.7 an iteration."""

FREEING_ITERATIONS = 3
"""Iterations in which a disk that is pushed out, and yet was not moved out of the way, takes p times Newton's step. Its
force goes as delta^p, a root of the order p, and the factor p makes the convergence quadratic again. Later iterations
take Newton's own step, since a rattler in a narrow cage would be thrown to and fro."""

RATTLER_MOVES = 3
"""Times that a rattler is moved in an increment: what it lies against may be another one that is moved later."""

FLOORS_OF_ROUNDING = 10
"""Rounding floors up to which a residual that no longer falls is one."""

REUSE_ITERATIONS = 3
"""Iterations that are made with the factors of K at hand if these suffice to reach the floor. New ones cost as much as
two iterations at 100 disks, and one or two more follow."""

REUSE_SIZE = 300
"""Disks beyond which factors of K are used on whatever is left to go: new ones cost ten force evaluations and more."""

REUSE_LIMIT = 0.1
"""Factor of the residual in one iteration up to which the factors of K are good for another one."""

FIRST_GAIN = 1e-2
"""Factor by which the first iteration reduces the residual, where nothing is known yet: 1e-2 is that of an increment of
1e-3 from no displacement, and smaller ones have smaller factors."""


FARTHEST_MOVE = 0.25
"""Displacement, in units of the smallest radius, up to which no centre of a disk comes to lie in another disk."""

FARTHEST_TRIAL = 0.99
"""Displacement of a disk from an equilibrium, in units of its radius, up to which a trial is made."""


class Guess(NamedTuple):
    """Where an iteration starts: (dx.., dy.., R dtheta..), length, shape (3N,); the factors of K with which this was
    found, and the largest force to which it is the response."""

    displacement: Floats
    factors: StiffnessFactors | None = None
    answers: float = np.inf


def iterate_newton(
    engine: Engine,
    base: Packing,
    fx: float,
    force_tolerance: float | None = None,
    guess: Guess | None = None,
    patient: bool = False,
) -> Trial | None:
    """Newton's method from one equilibrium, at any load, to the load fx; None where the iteration does not converge.

    It begins at the `guess`, by default without a displacement, and stops at the residual `force_tolerance`, by default
    at the floor of rounding. A `patient` iteration goes on while its residual falls slowly, see `PATIENCE`.
    """

    def bearing(trial: Trial, least: float) -> Floats:
        """Contacts of each disk that carry more than a force, shape (N,)."""
        return trial.graph.per_disk(trial.derivatives.normal_force > least)

    engine.set_fx(fx)
    start = engine.trial_of(base)
    since, top = start.graph, base.top
    displacement, factors, last = guess or Guess(np.zeros(3 * len(base)))
    iterations, gain = PATIENCE if patient else (NEWTON_ITERATIONS, LEAST_GAIN)
    # rattlers carry no more than an equilibrium may leave
    idle = IDLE_FORCE_SHARE * float(start.derivatives.normal_force.max(initial=0.0)) if patient else 0.0
    loose = (bearing(start, max(FLOORS_OF_ROUNDING * start.floor, idle)) == 0) & ~top
    times_moved = np.zeros(len(base), dtype=np.int64)
    best: Trial | None = None
    # `last` and `earlier` are the residuals of the two iterations before, and the factors of K are of an earlier trial
    floor, earlier, worse = start.floor, np.inf, 0
    for iteration in range(iterations):
        if _lammps_refuses(displacement, base):
            return None
        trial = engine.try_displacement(base, displacement)
        residual = trial.residual
        if best is not None and residual > gain * best.residual:  # a change of contacts may cost some iterations
            if best.residual < FLOORS_OF_ROUNDING * floor:
                # below the floor the trial that moved less is as good
                return trial if residual < best.residual and floor < best.residual else best
            worse += 1
            if worse > ITERATIONS_WITHOUT_GAIN:
                return None
        # what a guess lacks lies in soft directions, where a small force is a large displacement: it has to be solved
        if (guess is None or iteration > 0) and (best is None or residual < best.residual):
            best = trial
        if best is not None:
            if residual <= (0.1 * floor if force_tolerance is None else force_tolerance):
                return best
            # the next residual falls by at least the factor of this one, rounding apart: it may be far below the floor
            factor = last / earlier if earlier < np.inf else FIRST_GAIN
            if residual < floor and factor * last < 0.1 * floor:
                return best
        suffice = residual * (residual / last) ** REUSE_ITERATIONS < 0.1 * floor
        if factors is None or not (suffice or (len(base) > REUSE_SIZE and residual <= REUSE_LIMIT * last)):
            floor, count = trial.floor, bearing(trial, trial.floor)
            # rattlers that a neighbour ran into, and disks with one contact left, new rattlers
            hit = ((count == 1) & ~top) | (loose & (count > 0))
            disks = np.flatnonzero(hit & (times_moved < RATTLER_MOVES))
            times_moved[disks] += 1
            if len(disks):
                displacement = _out_of_the_way(trial.packing, disks, displacement)
                trial = engine.try_displacement(base, displacement)
            factors = factor_stiffness(trial, floor, since)
        earlier, last = last, trial.residual
        step = None if factors is None else factors.solver.solve(trial.force)
        if factors is None or step is None or too_long(step, base):
            return None
        if iteration < FREEING_ITERATIONS and factors.expelled.any():
            step.reshape(3, -1)[:, factors.expelled] *= base.law.exponent
        if base.compensated:
            # the displacement is a double: from its rounding on it is measured from the iterate
            rounding = trial.packing.coordinate_rounding + EPSILON * float(np.abs(displacement).max())
            if trial.residual < FLOORS_OF_ROUNDING * trial.graph.rounding(trial.derivatives.normal_stiffness, rounding):
                base, since, displacement = trial.packing, trial.graph, np.zeros_like(displacement)
        displacement = displacement + step
    return None


def too_long(step: Floats, packing: Packing) -> bool:
    """Whether a step of Newton's method is too long for a small displacement, as where a part floats."""
    return bool(np.abs(step).max() > 0.1 * packing.radius.min())


def _out_of_the_way(trial: Packing, disks: Indices, displacement: Floats) -> Floats:
    """The displacement with which these disks end up in the middle of their cages."""
    changed = displacement.copy()
    changed.reshape(3, -1)[:2, disks] += (middle_of_cage(trial, disks) - trial.position[disks]).T
    moved = np.hypot(*changed.reshape(3, -1)[:2])
    far = disks[moved[disks] > FARTHEST_TRIAL * trial.radius[disks]]
    changed.reshape(3, -1)[:2, far] *= FARTHEST_TRIAL * trial.radius[far] / moved[far]  # a part of the way
    return changed


def _lammps_refuses(displacement: Floats, packing: Packing) -> bool:
    """Whether LAMMPS would refuse a displacement: a disk moves by its radius, or gets the centre of another inside.

    No iteration that converges has such a displacement.
    """
    moved = displacement.reshape(3, -1)[:2]
    far = np.hypot(*moved)
    if far.max(initial=0.0) <= FARTHEST_MOVE * packing.radius.min():
        return False
    if np.any(far > FARTHEST_TRIAL * packing.radius):
        return True
    there = packing.position + moved.T
    contacts = touching(there, packing.radius, packing.box_length)
    pairs = ~contacts.floor
    i, j = contacts.i[pairs], contacts.j[pairs]
    apart = np.linalg.norm(nearest_image(there[i] - there[j], packing.box_length), axis=1)
    return bool(np.any(apart <= np.maximum(packing.radius[i], packing.radius[j])))
