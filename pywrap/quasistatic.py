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
equilibrium whose residual no longer falls and is of this order is at the floor, and is reported as such. In
compensated arithmetic a coordinate is known to 1e-23, and the next bound is the displacement itself, a double:
:math:`k \epsilon |q|`. From there on displacements count from the iterate. What is left, :math:`q'`, is of order
:math:`\epsilon |q|`, and that its slips start at an iterate changes them by :math:`|q| |q'|`, which is less than they
can resolve.

Where Newton fails the increment is halved, since the path matters: friction remembers.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from ..analysis import Packing, stiffness_matrix
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


def equilibrate(engine: Engine, last: Equilibrium, fx: float, force_tolerance: float | None = None) -> Equilibrium:
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

    Returns
    -------
    Equilibrium

    Raises
    ------
    NoEquilibriumError
        If halving the increment leads nowhere.
    """
    here, target, evaluations = last, fx, 0
    while True:
        engine.set_fx(target)
        found, spent = _newton(engine, here.packing, force_tolerance)
        evaluations += spent
        if found is None:
            if fx == here.fx or abs(target - here.fx) < SMALLEST_SHARE * abs(fx - last.fx):
                raise NoEquilibriumError(
                    f"no equilibrium was found beyond F_x = {here.fx:.10g}: the packing flows or slides freely there"
                )
            target = 0.5 * (here.fx + target)
        elif target == fx:
            return replace(found, evaluations=evaluations)
        else:
            here, target = found, fx


def _newton(engine: Engine, base: Packing, force_tolerance: float | None) -> tuple[Equilibrium | None, int]:
    """Newton's method from one base at the engine's fx; None where it does not converge."""
    displacement = np.zeros(3 * len(base))
    best: Equilibrium | None = None
    worse = 0  # iterations that gained nothing; changes of contacts cost some
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
        if best is None or residual < best.residual:
            best = Equilibrium(trial, residual, floor, evaluation)
        if residual <= (force_tolerance if force_tolerance is not None else 0.1 * floor):
            return best, evaluation
        step = _solve(trial, force)
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


def _largest(force: Floats, packing: Packing) -> float:
    per_disk = np.linalg.norm(force.reshape(3, -1), axis=0)
    return float(np.delete(per_disk, packing.rattlers).max(initial=0.0))


def _solve(packing: Packing, force: Floats) -> Floats | None:
    """K^-1 F on the coordinates that K knows, contacts below the floor left out; None if K is singular."""
    packing = packing.loaded(rounding_floor(packing))
    matrix = csc_array(stiffness_matrix(packing))
    active = np.flatnonzero(matrix.diagonal() != 0)
    block = matrix[active][:, active]
    # A share of the diagonal of the size of its rounding keeps the solve finite where something floats, such
    # as the whole packing along a floor without friction; on stiff directions it changes nothing.
    block = block + diags_array(1e-13 * block.diagonal())
    try:
        if len(active) <= DENSE:
            step = np.linalg.solve(block.toarray(), force[active])
        else:
            # nearly symmetric: the fill-reducing order of a symmetric matrix, pivots on the diagonal where good
            factors = splu(
                csc_array(block), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
            )
            step = factors.solve(force[active])
    except (RuntimeError, np.linalg.LinAlgError):
        return None
    full = np.zeros_like(force)
    full[active] = step
    return full if np.all(np.isfinite(step)) else None
