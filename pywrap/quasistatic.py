r"""From equilibrium to equilibrium by Newton's method.

The unknown is the displacement q from the last equilibrium, :math:`q = (\Delta x.., \Delta y.., R \Delta\theta..)`.
LAMMPS moves the disks by q along a straight path, advances the slips from their values at that equilibrium
(never from an iterate), clamps them, and gives the forces F(q). With the consistent stiffness matrix K of
the trial configuration,

.. math:: K\, \Delta q = F(q), \qquad q \leftarrow q + \Delta q.

K is the Jacobian of F up to the finite length of the path, a relative error of order :math:`|q|`, so the
convergence is quadratic until it is linear with a factor of about 1e-4 or less. A contact that opens, closes,
sticks or slides on the way changes K, and the iteration goes on with the new contacts.

Doubles bound what can be reached: a coordinate x is known to :math:`\epsilon |x|`, which changes the force of a
contact of stiffness k by :math:`k \epsilon |x|`. `rounding_floor` sums this over the contacts of each disk. An
equilibrium whose residual no longer falls and is of this order is at the floor, and is reported as such. Where the last
two residuals show that another iteration would gain nothing, it is not made. In compensated arithmetic a coordinate is
known to 1e-23, and the next bound is the displacement itself, a double: :math:`k \epsilon |q|`. From there on
displacements count from the iterate. What is left, :math:`q'`, is of order :math:`\epsilon |q|`, and that its slips
start at an iterate changes them by :math:`|q| |q'|`, which is less than they can resolve.

The first step needs no forces: at an equilibrium they are those of the increment on the upper layer, and the iteration
starts from the linear response to these. Its factors of K serve the next iterations, too, as long as these converge
fast: a small increment takes no others. Between equilibria q is nearly proportional to the increment: where a third one
is known, its displacement in proportion is a better start. The ramp of an onset takes the equilibrium before the last;
a ramp that is stored does not, so that it goes on to the bit where it was cut off.

A rattler that a neighbour runs into on the way is moved to the middle of its cage: it carries nothing, and where it
lies is no matter (:mod:`~faultgouge.pywrap.rattlers`).

Where Newton fails the increment is halved, since the path matters: friction remembers.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..analysis import Packing, nearest_image
from .contact_graph import ContactGraph
from .engine import Engine
from .newton_matrix import Factors, factored
from .rattlers import middle_of_cage
from .trial import EPSILON, Trial, rounding

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

ITERATIONS = 40
"""Newton iterations before an increment is halved. Three or four do, but where a disk is pushed out between two others:
their contacts open as delta^(3/2) -> 0, on which Newton's method gains a factor of 5 an iteration, and 12 reach the
floor."""

FRUITLESS = 8
"""Iterations that gain nothing before an increment is halved."""

FREEING = 3
"""Iterations in which a disk that is pushed out, and yet was not moved out of the way, gets one and a half times
Newton's step: its force goes as delta^(3/2), a root of that order, and the factor makes the convergence quadratic
again. Later ones take Newton's own step, since a rattler in a narrow cage would be thrown to and fro."""

MOVES = 3
"""Times that a rattler is moved in an increment: what it lies against may be another one that is moved later."""

NOISE = 10
"""Rounding floors up to which a residual that no longer falls is one."""

SPARED = 3
"""Iterations that are made with the factors of K at hand if these suffice to reach the floor. New ones cost as much as
two iterations at 100 disks, and one or two more follow."""

SPARING = 300
"""Disks beyond which factors of K are used on whatever is left to go: new ones cost ten force evaluations and more."""

KEPT = 0.1
"""Factor of the residual in one iteration up to which the factors of K are good for another one."""

GAIN = 1e-2
"""Factor by which the first iteration reduces the residual, where nothing is known yet: 1e-2 is that of an increment of
1e-3 from no displacement, and smaller ones have smaller factors."""

SMALLEST_SHARE = 2.0**-10
"""The share of an increment below which halving ends and the packing is said to flow."""


class NoEquilibriumError(RuntimeError):
    """The packing has no equilibrium at this force, or none that can be found: one sentence."""


@dataclass(frozen=True)
class Equilibrium:
    """An equilibrium and how well it is balanced.

    Attributes
    ----------
    packing : Packing
        The configuration.
    residual : float
        Largest force, with torque over radius, on a disk that has a contact; of the forces in LAMMPS.
    floor : float
        Estimate of the residual that the rounding of coordinates leaves.
    evaluations : int
        Force evaluations that it took from the equilibrium before.
    """

    packing: Packing
    residual: float
    floor: float
    evaluations: int

    @property
    def fx(self) -> float:
        """F_x on each disk of the upper layer."""
        return self.packing.fx


class Guess(NamedTuple):
    """Where an iteration starts.

    Attributes
    ----------
    displacement : ndarray, shape (3N,)
        (dx.., dy.., R dtheta..), length.
    factors : Factors, optional
        Those of K that it was found with.
    answers : float
        The largest force that it answers.
    """

    displacement: Floats
    factors: Factors | None = None
    answers: float = np.inf


def rounding_floor(packing: Packing) -> float:
    """Residual that one unit in the last place of each coordinate leaves, force.

    The forces of a disk's contacts are summed as independent errors, and the largest over disks is taken.
    """
    graph = ContactGraph(packing.contacts, packing.radius)
    return rounding(packing.law, graph, packing.geometry.overlap, packing.coordinate_rounding)


def equilibrate(
    engine: Engine,
    last: Equilibrium,
    fx: float,
    force_tolerance: float | None = None,
    beside: Equilibrium | None = None,
) -> Equilibrium:
    """The equilibrium at fx that follows from the last one.

    Parameters
    ----------
    engine : Engine
        LAMMPS with this packing.
    last : Equilibrium
        Where to start; its fx may be lower or higher.
    fx : float
        Force along x on each disk of the upper layer.
    force_tolerance : float, optional
        Residual to stop at. By default the iteration ends at the floor.
    beside : Equilibrium, optional
        Another one near the last, at another fx: its displacement is a better guess than none. It does not change what
        is found, except for the rounding.

    Returns
    -------
    Equilibrium

    Raises
    ------
    NoEquilibriumError
        If halving the increment leads nowhere.
    """
    here, target, evaluations = last, fx, 0
    guess = _response(engine, last, fx) if beside is None else _in_proportion(last, beside, fx)
    while True:
        engine.set_fx(target)
        found, spent = _newton(engine, here.packing, force_tolerance, guess)
        evaluations += spent
        if found is None and guess is not None:
            guess = None
        elif found is None:
            if fx == here.fx or abs(target - here.fx) < SMALLEST_SHARE * abs(fx - last.fx):
                raise NoEquilibriumError(
                    f"no equilibrium was found beyond F_x = {here.fx:.10g}: the packing flows or slides freely there"
                )
            target = 0.5 * (here.fx + target)
        elif target == fx:
            return replace(found, evaluations=evaluations)
        else:
            here, target = found, fx


def _response(engine: Engine, last: Equilibrium, fx: float) -> Guess | None:
    """The linear response to the increment, which is Newton's first step; None where there is none."""
    packing = last.packing
    if fx == packing.fx:
        return None
    push = np.zeros(3 * len(packing))
    push[: len(packing)][packing.top] = fx - packing.fx
    trial = engine.kept(packing)
    factors = factored(trial, trial.floor)
    step = None if factors is None else factors.solve(push)
    return None if step is None or _too_long(step, packing) else Guess(step, factors, abs(fx - packing.fx))


def _in_proportion(last: Equilibrium, beside: Equilibrium, fx: float) -> Guess:
    """The displacement from one equilibrium to another, (dx.., dy.., R dtheta..), in proportion to the increment."""
    a, b = last.packing, beside.packing
    moved = nearest_image(b.position - a.position, a.box_length)
    displacement = np.concatenate([moved[:, 0], moved[:, 1], b.scaled_angle - a.scaled_angle])
    return Guess(displacement * ((fx - last.fx) / (beside.fx - last.fx)))


def _too_long(step: Floats, packing: Packing) -> bool:
    """Whether the linear response is no small displacement: a part floats."""
    return bool(np.abs(step).max() > 0.1 * packing.radius.min())


def _newton(
    engine: Engine, base: Packing, force_tolerance: float | None, guess: Guess | None
) -> tuple[Equilibrium | None, int]:
    """Newton's method from one base at the engine's fx; None where it does not converge."""
    with engine.displacing() as displaced:
        best, evaluations = _iterated(displaced, engine.kept(base), force_tolerance, guess)
    if best is None:
        return None, evaluations
    return Equilibrium(engine.keep(best), best.residual, best.floor, evaluations), evaluations


def _iterated(
    displaced: Callable[[Packing, Floats], Trial],
    start: Trial,
    force_tolerance: float | None,
    guess: Guess | None,
) -> tuple[Trial | None, int]:
    base, since, loose = start.packing, start.graph, _loose(start)
    displacement, factors, last = guess or Guess(np.zeros(3 * len(base)))
    best: Trial | None = None
    floor = start.floor
    worse = 0  # iterations that gained nothing; changes of contacts cost some
    moved, moves = np.zeros(len(base), dtype=np.int64), 0  # how often rattlers were moved out of the way
    earlier = np.inf  # residual of the iteration before the last
    for evaluation in range(1, ITERATIONS + 1):
        trial = displaced(base, displacement)
        residual = trial.residual
        if best is not None and residual > 0.5 * best.residual:
            if best.residual < NOISE * floor:  # below the floor the one that moved less is as good
                return (trial if residual < best.residual and floor < best.residual else best), evaluation + moves
            worse += 1
            if worse > FRUITLESS:
                return None, evaluation + moves
        # What a guess lacks lies in soft directions, where a small force is a large displacement: it has to be solved.
        if (guess is None or evaluation > 1) and (best is None or residual < best.residual):
            best = trial
        if best is not None and residual <= (force_tolerance if force_tolerance is not None else 0.1 * floor):
            return best, evaluation + moves
        # What is not rounding falls by no less than it did the time before: it may be far below the floor now.
        factor = last / earlier if earlier < np.inf else GAIN
        if best is not None and residual < floor and factor * last < 0.1 * floor:
            return best, evaluation + moves
        # the same factors would lead to the floor soon
        sufficient = residual * (residual / last) ** SPARED < 0.1 * floor
        if factors is None or not (sufficient or (len(base) > SPARING and residual <= KEPT * last)):
            floor = trial.floor
            hit = _hit(trial, loose) & (moved < MOVES)
            if hit.any():
                displacement = _out_of_the_way(trial.packing, np.flatnonzero(hit), displacement)
                trial = displaced(base, displacement)
                residual = trial.residual
                moved, moves = moved + hit, moves + 1
            factors = factored(trial, floor, since, factors)
        earlier, last = last, residual
        step = None if factors is None else factors.solve(trial.force)
        if factors is None or step is None or _too_long(step, base):
            return None, evaluation + moves
        if evaluation <= FREEING and factors.expelled.any():
            step.reshape(3, -1)[:, factors.expelled] *= 1.5
        if base.compensated and residual < 10 * trial.rounded(
            trial.coordinate_rounding + EPSILON * np.abs(displacement).max()
        ):
            base, since, displacement = trial.packing, trial.graph, np.zeros_like(displacement)
        displacement = displacement + step
    return None, ITERATIONS + moves


def _carrying(trial: Trial, least: float) -> Floats:
    """Number of contacts of each disk that carry more than a given force, shape (N,)."""
    return trial.graph.count(trial.derivatives.normal_force > least)


def _loose(trial: Trial) -> Booleans:
    """Rattlers, shape (N,): disks whose contacts carry no more than an equilibrium may leave."""
    return (_carrying(trial, NOISE * trial.floor) == 0) & ~trial.still.top


def _hit(trial: Trial, loose: Booleans) -> Booleans:
    """Rattlers that a neighbour ran into, and disks with one contact left, which become rattlers, shape (N,)."""
    count = _carrying(trial, trial.floor)
    return ((count == 1) & ~trial.still.top) | (loose & (count > 0))


def _out_of_the_way(trial: Packing, disks: NDArray[np.int64], displacement: Floats) -> Floats:
    """The displacement with which these disks end up in the middle of their cages."""
    changed = displacement.copy()
    changed.reshape(3, -1)[:2, disks] += (middle_of_cage(trial, disks) - trial.position[disks]).T
    return changed
