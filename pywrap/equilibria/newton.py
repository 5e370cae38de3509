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

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...analysis import Packing, nearest_image, touching
from ...analysis.arrays import Floats, Indices
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
    """Where an iteration starts.

    Attributes
    ----------
    displacement : ndarray, shape (3N,)
        (dx.., dy.., R dtheta..), length.
    factors : StiffnessFactors, optional
        The factors of K with which the displacement was found.
    answers : float
        Largest force to which the displacement is the response.
    """

    displacement: Floats
    factors: StiffnessFactors | None = None
    answers: float = np.inf


def iterate_newton(
    displaced: Callable[[Packing, Floats], Trial],
    start: Trial,
    force_tolerance: float | None = None,
    guess: Guess | None = None,
    patient: bool = False,
) -> tuple[Trial | None, int]:
    """Newton's method from one equilibrium.

    Parameters
    ----------
    displaced : callable
        The trial at the end of a displacement from a packing, under the load that is wanted.
    start : Trial
        The equilibrium.
    force_tolerance : float, optional
        Residual to stop at. By default the iteration ends at the floor.
    guess : Guess, optional
        By default it starts without a displacement.
    patient : bool
        Whether a residual that falls slowly is good enough to go on, see `PATIENCE`.

    Returns
    -------
    Trial, or None
        In balance; None where the iteration does not converge.
    int
        Force evaluations.
    """
    base, since, rattlers = start.packing, start.graph, _Rattlers(start, IDLE_FORCE_SHARE if patient else 0.0)
    displacement, factors, answers = guess or Guess(np.zeros(3 * len(base)))
    iterations, gain = PATIENCE if patient else (NEWTON_ITERATIONS, LEAST_GAIN)
    course = _Course(start.floor, answers, force_tolerance, gain)
    evaluations = 0
    for iteration in range(iterations):
        if _lammps_refuses(displacement, base):
            return None, evaluations
        trial, evaluations = displaced(base, displacement), evaluations + 1
        # What a guess lacks lies in soft directions, where a small force is a large displacement: it has to be solved.
        if course.is_finished(trial, result=guess is None or iteration > 0):
            return course.best, evaluations
        if factors is None or not course.may_reuse_factors(trial.residual, len(base)):
            course.floor = trial.floor
            hit = rattlers.find_hit(trial)
            if len(hit):
                displacement = _out_of_the_way(trial.packing, hit, displacement)
                trial, evaluations = displaced(base, displacement), evaluations + 1
            factors = factor_stiffness(trial, course.floor, since, factors)
        course.go_on(trial.residual)
        step = None if factors is None else factors.solve(trial.force)
        if factors is None or step is None or too_long(step, base):
            return None, evaluations
        if iteration < FREEING_ITERATIONS and factors.expelled.any():
            step.reshape(3, -1)[:, factors.expelled] *= base.law.exponent
        if base.compensated and trial.residual < FLOORS_OF_ROUNDING * _floor_of(displacement, trial):
            base, since, displacement = trial.packing, trial.graph, np.zeros_like(displacement)
        displacement = displacement + step
    return None, evaluations


class _Course:
    """How the residual falls from iteration to iteration, and when it falls no more.

    Parameters
    ----------
    floor : float
        Residual that rounding leaves.
    answers : float
        Largest force to which the first displacement is the response.
    force_tolerance : float or None
        Residual to stop at.
    gain : float
        Factor of the residual that counts as a gain.
    """

    def __init__(self, floor: float, answers: float, force_tolerance: float | None, gain: float) -> None:
        self.floor, self._tolerance, self._gain = floor, force_tolerance, gain
        self.best: Trial | None = None
        self._worse = 0  # iterations that gained nothing; changes of contacts cost some
        self._earlier, self._last = np.inf, answers  # residuals of the two iterations before

    def is_finished(self, trial: Trial, result: bool) -> bool:
        """Whether the iteration ends: `best` is then the result, or None if the iteration has failed."""
        residual = trial.residual
        if self.best is not None and residual > self._gain * self.best.residual:
            if self.best.residual < FLOORS_OF_ROUNDING * self.floor:
                if residual < self.best.residual and self.floor < self.best.residual:
                    self.best = trial  # below the floor the trial that moved less is as good
                return True
            self._worse += 1
            if self._worse > ITERATIONS_WITHOUT_GAIN:
                self.best = None
                return True
        if result and (self.best is None or residual < self.best.residual):
            self.best = trial
        if self.best is None:
            return False
        if residual <= (0.1 * self.floor if self._tolerance is None else self._tolerance):
            return True
        # The next residual falls by at least the factor of this one, rounding apart: it may be far below the floor.
        factor = self._last / self._earlier if self._earlier < np.inf else FIRST_GAIN
        return residual < self.floor and factor * self._last < 0.1 * self.floor

    def may_reuse_factors(self, residual: float, disks: int) -> bool:
        """Whether the factors of an earlier K serve for the next iteration."""
        if residual * (residual / self._last) ** REUSE_ITERATIONS < 0.1 * self.floor:
            return True
        return disks > REUSE_SIZE and residual <= REUSE_LIMIT * self._last

    def go_on(self, residual: float) -> None:
        """Another iteration is made from here."""
        self._earlier, self._last = self._last, residual


class _Rattlers:
    """Which disks carry nothing, or no more than a share of the largest force; how often each has been moved."""

    def __init__(self, start: Trial, share: float) -> None:
        # no more than an equilibrium may leave
        nothing = max(FLOORS_OF_ROUNDING * start.floor, share * float(start.derivatives.normal_force.max(initial=0.0)))
        self._loose = (_count_bearing_contacts(start, nothing) == 0) & ~start.still.top
        self._moved = np.zeros(len(self._loose), dtype=np.int64)

    def find_hit(self, trial: Trial) -> Indices:
        """Disks to be moved: rattlers that a neighbour ran into, and disks with one contact left, new rattlers."""
        count = _count_bearing_contacts(trial, trial.floor)
        hit = ((count == 1) & ~trial.still.top) | (self._loose & (count > 0))
        disks = np.flatnonzero(hit & (self._moved < RATTLER_MOVES))
        self._moved[disks] += 1
        return disks


def _count_bearing_contacts(trial: Trial, least: float) -> Floats:
    """Number of contacts of each disk that carry more than a given force, shape (N,)."""
    return trial.graph.count(trial.derivatives.normal_force > least)


def _floor_of(displacement: Floats, trial: Trial) -> float:
    """The rounding floor with the rounding of the displacement, which is a double."""
    return trial.force_rounding(trial.coordinate_rounding + EPSILON * float(np.abs(displacement).max()))


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
