r"""Bring a loose packing of any size to rest under its load, without friction.

Without friction the disks have an energy, that of the contacts and of the load,

.. math:: E(q) = \frac{k_n}{p + 1} \sum_c \delta_c^{p+1} + F_y \sum_{top} y_i, \qquad F = -\partial E/\partial q,

and settling means to find a minimum of this energy. Most of the path consists of rearrangements, in which contacts open
and close one after the other. Damped dynamics handles rearrangements well, at a thousandth of the cost of a linear
solve per step (deck parts gather.in, bed.in, damp.in). The end is slow for dynamics and fast for Newton's method, if
that can deal with floating modes: a packing without friction has modes without stiffness (the whole packing slides
along the floor, a chain is about to buckle, nothing holds a disk), for which K is singular or has a negative
eigenvalue. Therefore the flow :math:`\dot q = F` is integrated with implicit steps of length :math:`1/\sigma`
(pseudo-transient continuation; Kelley and Keyes, SIAM J. Numer. Anal. 35, 508 (1998)),

.. math:: (K + \sigma)\, \Delta q = F(q), \qquad q \leftarrow q + \alpha\, \Delta q .

For stiff modes this is Newton's step, while floating parts creep by :math:`F/\sigma`. :math:`\sigma` is large enough
for K + sigma to be positive definite, as the signs of its pivots show, so that every step reduces the energy and no
saddle attracts. :math:`\sigma` falls when a whole step is good, and the method becomes Newton's method with its
quadratic convergence. :math:`\alpha < 1` if the step meets a new contact: the step is shortened until the slope
:math:`F \cdot \Delta q` along it is no longer uphill. Energies are never compared, because rounding hides their
differences long before those of forces.

All of this is NumPy on the whole packing, the same on every rank. If Newton's method fails in a rearrangement, dynamics
continues from there, down to a tenth of the previous force.
"""

import numpy as np
from scipy.sparse import csc_array, diags_array

from ...analysis import NoEquilibriumError, Packing, stiffness_matrix
from ...analysis.arrays import Floats
from ...analysis.factors.sparse_lu import Factors, SingularMatrixError, symmetric_lu
from ...analysis.progress import report_progress
from ..equilibria.quasistatic import Equilibrium, equilibrate, rounding_floor
from ..equilibria.rattlers import place_disks
from ..lammps.engine import MOST_STEPS_OF_DYNAMICS, Engine

DYNAMICS_DISKS = 300
"""Disks up to which dynamics goes all the way: a second or two."""

TOLERANCES = tuple(10.0**-k for k in range(4, 10))
"""Forces at which dynamics hands over to Newton's method, in units of F_y, one after the other as that fails. At the
first, a packing of 3000 disks needs about 20 iterations; at the last the contacts are what they will be."""

ABOVE_ROUNDING = 20.0
"""Roundings of a contact's force to which dynamics can bring a disk: a disk has up to six contacts, the stiffest of
which carry ten times F_y, and velocity Verlet stirs the last digits at each step."""

STAGE_STEPS = 400_000
"""Time steps of one stage of dynamics, at the most, for more than DYNAMICS_DISKS disks: a layer may sink for ever. With
the upper layer of `loose.layer_size` a stage takes 10,000 to 50,000, whatever the size of the packing."""

MINIMIZER_ITERATIONS = 60
"""Iterations before dynamics takes over again; where no rearrangement is under way, 15 to 40 do."""

FLOATING_STIFFNESS = 1e-8
"""Stiffness, in units of that of a contact that carries F_y, that is added to coordinates without stiffness, which
nothing holds."""

LONGEST_DISPLACEMENT = 0.1
"""Longest displacement in one iteration, in smallest radii: no disk jumps over another."""

UPHILL_SLOPE_SHARE = 0.5
"""A step is shortened if the slope at its end is uphill and steeper than this share of the slope at its begin."""

LIGHT_VISCOSITY = 0.02
"""Viscosity for few disks, in units of what is critical for a contact that carries F_y, of disks of mass one: about
sqrt(F_y) in the paper's units, that of bed.in, and as good in any others."""

DENSITY = 0.8
"""Area fraction to which a high start is gathered: below that of any jammed packing of disks, 0.82 to 0.85."""

SHEAR_SPEED = 0.2
"""Speed of shear waves in a packing without friction, in units of that of a sound wave along a row of contacts: a
packing that has hardly more contacts than it needs resists compression, and shear little. With it the number of steps
is the least, within a factor of two in the damping, for 1000, 3000 and 10,000 disks."""


def settle_loose(engine: Engine, loose: Packing, bed: bool = True) -> Packing:
    """A loose start, without contacts and F_x, at rest on the floor, under the load on its upper layer.

    With `bed` a pull on every disk lays a bed first. Without, the load begins at once: for disks without friction that
    lie on each other already. The packing rests to the rounding floor; where that is not found, to the last of the
    tolerances; or is as it was when the steps ran out.
    """
    start, width, stiffest = None if bed else loose, _width(loose), _stiffest(loose)
    if loose.law.frictional or len(loose) <= DYNAMICS_DISKS:
        viscosity = None if bed else LIGHT_VISCOSITY * float(np.sqrt(stiffest))
        steps = MOST_STEPS_OF_DYNAMICS if bed else STAGE_STEPS
        engine.settle(finest_tolerance(loose), start, viscosity=viscosity, steps=steps)
        packing = engine.packing
        try:
            return equilibrate(engine, Equilibrium.of(packing), 0.0).packing
        except NoEquilibriumError:
            return packing if loose.law.frictional else minimize_energy(packing)[0]
    # damping that is critical for the slowest shear wave across the height, mass / time: 2 m omega. Its omega is
    # pi c / (2 height), with c = SHEAR_SPEED d (k / m)^(1/2) and the stiffness k of a contact under the pressure
    diameter = 2 * float(loose.radius.mean())
    height = float(np.pi * np.sum(loose.radius**2) / (width * DENSITY))
    carried = loose.fy * loose.top.sum() * diameter / width
    stiffness = float(loose.law.normal_stiffness(loose.law.overlap_of_force(carried)))
    viscosity = float(np.pi * SHEAR_SPEED * diameter * np.sqrt(loose.mass.mean() * stiffness) / height)
    gather = height / loose.position[:, 1].max() if bed else 1.0
    for tolerance in TOLERANCES:
        report_progress(f"dynamics down to {tolerance:.0e} F_y on a disk")
        engine.settle(tolerance * loose.fy, start, gather, viscosity, STAGE_STEPS)
        packing = engine.packing
        if largest_force(packing) > (1 + 1e-6) * tolerance * loose.fy and tolerance > TOLERANCES[-1]:
            return packing  # out of steps: the layer sinks; rounding of forces apart
        report_progress("Newton's method")
        packing, found = minimize_energy(packing)
        if found:
            break
        start, gather = packing, 1.0
    return packing


def minimize_energy(packing: Packing, iterations: int = MINIMIZER_ITERATIONS) -> tuple[Packing, bool]:
    """The packing at the minimum of the energy downhill from a packing without friction near it, by Newton's method
    with implicit steps; and whether the force is down at the rounding floor, else the packing is as far as the
    iteration came."""
    here, best, least, stiffest = packing, packing, largest_force(packing), _stiffest(packing)
    sigma = max(stiffest * min(1.0, least / packing.fy) * 1e-2, 1e-12 * stiffest)
    for _ in range(iterations):
        factors = _positive(here, sigma)
        if factors is None:
            sigma *= 10
            continue
        here, share = _downhill(here, factors.solve(here.net_force[: 2 * len(here)]))
        sigma *= 0.2 if share > 0.5 else 4.0 if share < 0.1 else 1.0
        residual = largest_force(here)
        if least < 10 * rounding_floor(best) and residual > 0.5 * least:
            return best, True
        if residual < least:
            best, least = here, residual
    found = least < 10 * rounding_floor(best)
    return best if found else here, found


def is_minimum(packing: Packing) -> bool:
    """Whether an equilibrium without friction is a minimum of the energy, but for parts that float."""
    return _positive(packing, FLOATING_STIFFNESS * _stiffest(packing)) is not None


def _downhill(packing: Packing, step: Floats) -> tuple[Packing, float]:
    """The packing at the end of the downhill part of a step, and the share of this part."""
    move = step.reshape(2, -1).T
    share = min(1.0, LONGEST_DISPLACEMENT * packing.radius.min() / np.hypot(*move.T).max())
    slope = packing.net_force[: len(step)] @ step
    while True:
        there = place_disks(packing, packing.position + share * move)
        after = there.net_force[: len(step)] @ step
        if after >= -UPHILL_SLOPE_SHARE * slope or share < 1e-6:
            return there, share
        # where the slope would vanish if it fell evenly; a contact that closed on the way makes it fall late
        share *= max(0.1, slope / (slope - after))


def _positive(packing: Packing, sigma: float) -> Factors | None:
    """Factors of K + sigma for x and y; None if that is not positive definite."""
    size = 2 * len(packing)
    matrix = csc_array(stiffness_matrix(packing)[:size, :size] + diags_array(np.full(size, sigma)))
    try:
        # symmetric, and without pivoting: the pivots are positive if and only if the matrix is positive definite; by
        # SuperLU, so that a seed gives the same packing whatever is installed
        factors = symmetric_lu(matrix)
    except SingularMatrixError:
        return None
    return None if factors.negative else factors


def largest_force(packing: Packing) -> float:
    """Largest force on a disk, with torque over radius; disks that touch nothing included, which may fall."""
    return float(np.linalg.norm(packing.net_force.reshape(3, -1), axis=0).max())


def _stiffest(packing: Packing) -> float:
    """Stiffness of a contact that carries F_y."""
    return float(packing.law.normal_stiffness(packing.law.overlap_of_force(packing.fy)))


def finest_tolerance(packing: Packing) -> float:
    """Largest force on a disk to which dynamics can bring a packing: the last tolerance, or rounding.

    Rounding is the change of the force of a contact that carries F_y when a coordinate changes by one unit in the last
    place.
    """
    rounding = _stiffest(packing) * float(np.finfo(float).eps * _width(packing))
    return max(TOLERANCES[-1] * packing.fy, ABOVE_ROUNDING * rounding)


def _width(packing: Packing) -> float:
    return float(np.ptp(packing.position[:, 0])) if packing.box_length is None else packing.box_length
