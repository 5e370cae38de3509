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

From one equilibrium to another q is nearly proportional to the increment: where a third one is known, the iteration
starts from the displacement of that one, in proportion. The ramp of an onset takes the equilibrium before the last,
which saves one of four evaluations; a ramp that is stored does not, so that it goes on to the bit where it was cut off.

Where Newton fails the increment is halved, since the path matters: friction remembers.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from ..analysis import Packing, nearest_image, stiffness_matrix
from .elimination import elimination_order
from .engine import Engine

Floats = NDArray[np.float64]

ITERATIONS = 40
"""Newton iterations before an increment is halved. Four or five do, but where a rattler in a narrow cage has been hit:
its contact opens as delta^(3/2) -> 0, on which Newton's method gains a factor of 3 an iteration, and 20 reach the
floor."""

FRUITLESS = 8
"""Iterations that gain nothing before an increment is halved."""

FREEING = 3
"""Iterations in which a rattler that was hit gets one and a half times Newton's step: its force goes as delta^(3/2), a
root of that order, and the factor makes the convergence quadratic again. Later ones take Newton's own step, since a
rattler in a narrow cage would be thrown to and fro."""

IDLE = 1e-7
"""Share of the largest contact force up to which a contact carries nothing that matters."""

CREEP = 0.1
"""Share of its largest stiffness that is added to a disk with none but such contacts, in all directions. One that is
leant upon by a breath has next to no stiffness along the contact, and none across where that slides: it would be thrown
through its cage. As it is, its force falls tenfold in an iteration, from a value that is small already."""

SPARING = 300
"""Disks beyond which factors of K are used again: a factorisation costs ten force evaluations and more."""

KEPT = 0.1
"""Factor of the residual in one iteration up to which the factors of K are good for another one."""

GAIN = 1e-2
"""Factor by which the first iteration reduces the residual, where nothing is known yet: 1e-2 is that of an increment of
1e-3 from no displacement, and smaller ones have smaller factors."""

DENSE = 400
"""Coordinates up to which a dense solve is the faster one: 1 ms against 3 ms at 285."""

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


def rounding_floor(packing: Packing, displaced: float = 0.0) -> float:
    """Residual that one unit in the last place of each coordinate leaves, force.

    The forces of a disk's contacts are summed as independent errors, and the largest over disks is taken.

    Parameters
    ----------
    packing : Packing
        The configuration.
    displaced : float
        Length of the displacement that led to it, a double, whose last place counts as well.
    """
    contacts, geometry = packing.contacts, packing.geometry
    if len(contacts) == 0:
        return 0.0
    unit = packing.coordinate_rounding + np.finfo(float).eps * displaced
    error = (packing.law.normal_stiffness(geometry.overlap) * unit) ** 2
    per_disk = np.bincount(contacts.i, error, len(packing))
    pair = ~contacts.floor
    per_disk += np.bincount(contacts.j[pair], error[pair], len(packing))
    return float(np.sqrt(per_disk.max()))


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
    guess = None if beside is None else _displacement(last, beside) * ((fx - last.fx) / (beside.fx - last.fx))
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


def _displacement(start: Equilibrium, end: Equilibrium) -> Floats:
    """From one equilibrium to another, (dx.., dy.., R dtheta..)."""
    a, b = start.packing, end.packing
    moved = nearest_image(b.position - a.position, a.box_length)
    return np.concatenate([moved[:, 0], moved[:, 1], b.scaled_angle - a.scaled_angle])


def _newton(
    engine: Engine, base: Packing, force_tolerance: float | None, guess: Floats | None = None
) -> tuple[Equilibrium | None, int]:
    """Newton's method from one base at the engine's fx; None where it does not converge."""
    displacement = np.zeros(3 * len(base)) if guess is None else guess
    best: Equilibrium | None = None
    solve = None
    worse = 0  # iterations that gained nothing; changes of contacts cost some
    earlier = last = np.inf  # residuals of the two iterations before
    for evaluation in range(1, ITERATIONS + 1):
        trial = engine.displace(base, displacement)
        force = engine.net_force
        residual = _largest(force, trial)
        floor = rounding_floor(trial)
        if best is not None and residual > 0.5 * best.residual:
            if best.residual < 10 * floor:
                return best, evaluation
            worse += 1
            if worse > FRUITLESS:
                return None, evaluation
        # What a guess lacks lies in soft directions, where a small force is a large displacement: it has to be solved.
        if (guess is None or evaluation > 1) and (best is None or residual < best.residual):
            best = Equilibrium(trial, residual, floor, evaluation)
        if best is not None and residual <= (force_tolerance if force_tolerance is not None else 0.1 * floor):
            return best, evaluation
        # What is not rounding falls by no less than it did the time before: it may be far below the floor now.
        factor = last / earlier if np.isfinite(earlier) else GAIN
        if best is not None and residual < floor and factor * last < 0.1 * floor:
            return best, evaluation
        if solve is None or len(base) <= SPARING or residual > KEPT * last:
            solve = _factored(trial)
        earlier, last = last, residual
        step = None if solve is None else solve(force)
        if step is None or np.abs(step).max() > 0.1 * base.radius.min():
            return None, evaluation  # a floating part: the linear response is no small displacement
        if evaluation <= FREEING:
            step.reshape(3, -1)[:, _hit(trial)] *= 1.5
        if base.compensated and residual < 10 * rounding_floor(trial, np.abs(displacement).max()):
            base, displacement = trial, np.zeros_like(displacement)
        displacement = displacement + step
    return None, ITERATIONS


def _hit(packing: Packing) -> NDArray[np.bool_]:
    """Disks with one contact that carries something: rattlers that a neighbour ran into, shape (N,)."""
    contacts = packing.loaded(rounding_floor(packing)).contacts
    count = np.bincount(contacts.i, minlength=len(packing))
    count += np.bincount(contacts.j[~contacts.floor], minlength=len(packing))
    return (count == 1) & ~packing.top


def _idle(packing: Packing) -> NDArray[np.bool_]:
    """Disks of which no contact carries more than `IDLE`, shape (N,)."""
    contacts, carried = packing.contacts, packing.normal_force
    most = np.zeros(len(packing))
    np.maximum.at(most, contacts.i, carried)
    pair = ~contacts.floor
    np.maximum.at(most, contacts.j[pair], carried[pair])
    return most <= IDLE * carried.max(initial=0.0)


def _largest(force: Floats, packing: Packing) -> float:
    per_disk = np.linalg.norm(force.reshape(3, -1), axis=0)
    return float(np.delete(per_disk, packing.rattlers).max(initial=0.0))


def newton_step(packing: Packing, force: Floats) -> Floats | None:
    """K^-1 F on the coordinates that K knows, contacts below the floor left out; None if K is singular.

    Parameters
    ----------
    packing : Packing
        Where K is taken.
    force : ndarray, shape (3N,)
        F, force.

    Returns
    -------
    ndarray, shape (3N,), or None
        The displacement, length.
    """
    solve = _factored(packing)
    return None if solve is None else solve(force)


def _factored(packing: Packing) -> Callable[[Floats], Floats | None] | None:
    """The solution of K dq = F as a function of F, on the coordinates that K knows; None if K is singular."""
    packing = packing.loaded(rounding_floor(packing))
    matrix = stiffness_matrix(packing)
    # A share of the diagonal of the size of its rounding keeps the solve finite where something floats, such
    # as the whole packing along a floor without friction; on stiff directions it changes nothing.
    diagonal = matrix.diagonal()
    active = np.flatnonzero(diagonal)
    stiffest = np.tile(diagonal.reshape(3, -1).max(axis=0), 3)
    diagonal = np.where(np.tile(_idle(packing), 3), diagonal + CREEP * stiffest, (1 + 1e-13) * diagonal)
    if len(active) > DENSE:
        active = active[elimination_order(packing, active)]
    block = matrix[active][:, active]
    block.setdiag(diagonal[active])
    if len(active) <= DENSE:
        inverse = partial(np.linalg.solve, block.toarray())
    else:
        try:
            # nearly symmetric: pivots on the diagonal where good
            inverse = splu(
                csc_array(block), permc_spec="NATURAL", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
            ).solve
        except RuntimeError:
            return None

    def solve(force: Floats) -> Floats | None:
        try:
            step = inverse(force[active])
        except np.linalg.LinAlgError:
            return None
        full = np.zeros_like(force)
        full[active] = step
        return full if np.all(np.isfinite(step)) else None

    return solve
