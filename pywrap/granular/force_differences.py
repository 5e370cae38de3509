r"""K and C of a live LAMMPS by differences of its own forces, whatever exerts them.

With q the coordinates of :mod:`~faultgouge.analysis.configuration` and F the forces,

.. math::

    K e_k = -\frac{F(h e_k) - F(-h e_k)}{2h} + O(h^2), \qquad C e_k = -\frac{F(v e_k) - F(-v e_k)}{2v} .

All of it happens in copies of the process (:mod:`~faultgouge.pywrap.granular.force_probe`): the instance itself stays
as it is. Particles without a common neighbour are displaced together (:mod:`~faultgouge.pywrap.granular.colours`).

**Error.** Slopes of both sides are extrapolated from the steps h/2 and h. A displacement, and a velocity, of all
particles at once in random directions are then compared with K q and C v. The difference is the error; neighbours of
which nothing is known would show in it.

**One-sided derivatives.** A contact at Coulomb's bound, one that is about to open or close, and a law with two
derivatives have another derivative forwards than backwards. K is the mean of both, and the jump between them is said. A
displacement may also be too long for a contact that is far weaker than the others: where a force is not linear a finer
one is tried.

**Bodies.** q = P Q, where several coordinates move as one. The columns of K are displacements of Q, and its rows sums
of forces on the coordinates that Q moves.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from ...analysis.arrays import Floats, Indices
from .colours import Colours, Pairs, neighbouring_pairs
from .force_probe import Particles, Probe, Sides, hold_still, set_coordinate_velocity
from .granular_commands import NotTakenError
from .look_in_a_copy import in_a_copy

SLOW = 1e12
"""Length of a step in which particles are displaced, in time steps: dashpots exert nothing, however strong."""

SHARE_OF_OVERLAP = 0.003
"""A displacement as a share of the smallest overlap: the third derivative of Hertz's force, which the extrapolation
leaves, is 1e-7 of its first there."""

LEAST_OF_COORDINATE = 2e-9
"""Smallest displacement as a share of the largest coordinate: a force has the rounding of a coordinate, 1e-16, so that
its difference has 1e-7."""

LEAST_OF_OVERLAP = 3e-4
"""Smallest displacement as a share of the median overlap: `granular` does not turn a history that has left its plane by
less than 1e-10 of Coulomb's bound, which is 2e-6 of mu of the difference."""

FREE_DISPLACEMENT = 1e-7
"""A displacement as a share of a radius where no particles overlap."""

PUSH = 1e-4
"""Force of dashpots as a share of the mean contact force: contacts do not reach Coulomb's bound by it unless they are
there, and the rounding of forces is 1e-7 of it or less."""

SIDES = 1e-3
"""Jump of a derivative, as a share of the largest entry, from which on two sides are said to differ; the extrapolation
leaves 1e-5 of one."""

SHORTER = 0.03
"""Size of a shorter displacement, as a share of the first one, where a force is not linear: a contact whose force is
far below the mean one slides within the first, as those of cohesive particles do that pull about as much as they
push."""

TOO_LARGE = 0.1
"""Error, relative to the largest entry, beyond which the differences describe nothing."""


@dataclass(frozen=True, eq=False)
class ForceDifferences:
    """Operators of a packing by differences of LAMMPS's forces.

    Attributes
    ----------
    stiffness, damping : scipy.sparse.csr_array, shape (coordinates, coordinates)
        K, force / length, and C, force time / length.
    error : float
        Error of both, as a share of the largest entry.
    jump : ndarray, shape (N,)
        Largest difference of the two one-sided derivatives of the force on each particle, as a share of the largest
        entry; zero below SIDES.
    """

    stiffness: csr_array
    damping: csr_array
    error: float
    jump: Floats


def measure_operators(lmp: Any, particles: Particles, force: float | None) -> ForceDifferences:
    """K and C at rest; the process must be one that can be copied, and nothing of the instance changes.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance, on one rank.
    particles : Particles
        Its particles.
    force : float, optional
        The mean contact force, by which velocities are chosen; by default by the forces of the displacements.

    Raises
    ------
    NotTakenError
        If LAMMPS's forces are not functions of displacements and velocities of neighbours.
    """
    return in_a_copy(partial(_measure, lmp, particles, force))


def _measure(lmp: Any, particles: Particles, force: float | None) -> ForceDifferences:
    """What `measure_operators` does, in a copy that may change."""
    lmp.command("log none")
    hold_still(lmp, particles.bodies)
    set_coordinate_velocity(lmp, particles, np.zeros(particles.constraint.shape[0]))
    pairs = neighbouring_pairs(lmp, particles)
    step = displacement(particles, pairs)
    colours = Colours(particles, pairs, 4 * step)
    timestep = float(lmp.extract_global("dt"))
    lmp.command(f"timestep {SLOW * timestep:.17g}")
    lmp.command("thermo_style custom step")
    by_place = Probe(lmp, particles, SLOW * timestep, (0.5, 1.0))
    stiffness, jump, error = _derivative(by_place, colours, step)
    by_velocity = Probe(lmp, particles, None, (1.0,))
    if force is None:
        force = step * float(np.abs(stiffness.data).max(initial=0.0)) / SHARE_OF_OVERLAP
    speed = _speed(by_velocity, step / timestep, PUSH * force)
    if speed == 0.0:
        _refuse_errors(particles, error)
        return ForceDifferences(stiffness, csr_array(stiffness.shape), float(error.max()), jump)
    damping, jump_of_c, error_of_c = _derivative(by_velocity, colours, speed)
    error = np.maximum(error, error_of_c)
    _refuse_errors(particles, error)
    return ForceDifferences(stiffness, damping, float(error.max()), np.maximum(jump, jump_of_c))


def _refuse_errors(particles: Particles, error: Floats) -> None:
    """Refuse operators that describe nothing, with the particle where the error, shape (N,), is largest."""
    worst = int(np.argmax(error))
    if error[worst] <= TOO_LARGE:
        return
    place = ", ".join(f"{x:.6g}" for x in particles.position[worst, : particles.dimension])
    others = int(np.sum(error > TOO_LARGE)) - 1
    raise NotTakenError(
        f"K and C by differences of forces are {error[worst]:.2g} of their largest entry from the forces of a "
        f"displacement of all particles at particle {particles.ids[worst]} at ({place})"
        f"{f', and at {others} more' if others else ''}: contacts there are about to open, to close or to slide, or "
        "lie between both planes of one fix wall/gran, of which LAMMPS has the nearer act alone (write a fix for each "
        "plane), or something couples particles that are no neighbours; run on with drag under a load that presses "
        "them together."
    )


def displacement(particles: Particles, pairs: Pairs) -> float:
    """A step far below the smallest overlap and gap, as far as rounding allows."""
    gaps = np.abs(pairs.gap[np.isfinite(pairs.gap)])
    overlaps = -pairs.gap[pairs.gap < 0]
    least = LEAST_OF_COORDINATE * float(np.abs(particles.position).max())
    if not len(overlaps):
        return max(least, FREE_DISPLACEMENT * float(particles.radius.min()))
    usual = float(np.median(overlaps))
    return float(
        min(max(SHARE_OF_OVERLAP * gaps.min(), least, LEAST_OF_OVERLAP * usual), max(SHARE_OF_OVERLAP * usual, least))
    )


def _speed(by_velocity: "Probe", speed: float, force: float) -> float:
    """A velocity at which dashpots exert a force; zero if there are none."""
    direction = np.random.Generator(np.random.PCG64(1)).uniform(-1, 1, by_velocity.particles.constraint.shape[0])
    for _ in range(3):  # a velocity far too large has contacts slide
        rest, sides = by_velocity.each([speed * direction])[0]
        change = float(np.abs(sides[0][0] - rest).max())
        if change <= np.finfo(float).eps * np.abs(rest).max():
            return 0.0
        speed *= force / change
    return speed


def _derivative(probe: Probe, colours: Colours, step: float) -> tuple[csr_array, Floats, Floats]:
    """-dF/dQ by steps of this size, and jumps of it and the error by particle, shape (N,)."""
    size, count = probe.particles.constraint.shape[0], len(probe.particles.ids)
    axis = count * np.arange(size // count)
    directions = []
    for members in colours.members:
        for k in axis:
            directions.append(np.zeros(size))
            directions[-1][k + np.array(members)] = step
    random = step * np.random.Generator(np.random.PCG64(0)).uniform(-1, 1, size)
    owners = [owner for owner in colours.owner for _ in axis]
    *found, last = _slopes(probe, [*directions, random], [*owners, np.arange(count)], step)
    rows, columns, values, jump = [], [], [], np.zeros(count)
    for k, (slope, owner) in enumerate(zip(found, owners, strict=True)):
        felt = np.flatnonzero(owner >= 0)
        where = axis[:, None] + felt
        rows.append(where.ravel())
        columns.append(np.broadcast_to(axis[k % len(axis)] + owner[felt], where.shape).ravel())
        values.append(-slope.mean[where].ravel())
        jump[felt] = np.maximum(jump[felt], np.abs(slope.jump[where]).max(axis=0))
    moved = csr_array(probe.particles.constraint != 0).astype(np.float64).T
    raw = coo_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size))
    matrix = csr_array(moved @ raw.tocsr())
    matrix.eliminate_zeros()
    forces = moved @ last.mean
    largest, felt = np.abs(matrix.data).max(initial=0.0), np.abs(forces).max(initial=0.0)
    error = np.abs(forces + matrix @ random / step).reshape(-1, count).max(axis=0) / (felt or 1.0)
    return matrix, np.where(jump > SIDES * largest, jump, 0.0) / (largest or 1.0), error


class _Slope(NamedTuple):
    """dF along a direction over its size, the mean of both sides; by how much the sides differ, and by how much means
    of both sizes of a displacement do; shape (axes N,) each."""

    mean: Floats
    jump: Floats
    bend: Floats

    @property
    def uneven(self) -> Floats:
        """How far the force is from a linear function of the size, shape (axes N,)."""
        return np.maximum(np.abs(self.jump), np.abs(self.bend))


def _slopes(probe: Probe, directions: list[Floats], owners: list[Indices], step: float) -> list[_Slope]:
    """Slopes along directions of this size, or along finer ones where forces are far more linear there.

    `owners` has the body that each particle feels in a direction, shape (N,), -1 for none.
    """
    found = [_slope(each, probe.sizes, step) for each in probe.each(directions)]
    largest = max(np.abs(each.mean).max() for each in found)
    uneven = [k for k, each in enumerate(found) if each.uneven.max() > SIDES * largest]
    if uneven:
        for k, each in zip(uneven, probe.each([SHORTER * directions[k] for k in uneven]), strict=True):
            found[k] = _more_linear(found[k], _slope(each, probe.sizes, SHORTER * step), owners[k])
    return found


def _more_linear(one: _Slope, other: _Slope, owner: Indices) -> _Slope:
    """The other slopes on all that feel a body, where they are far more linear."""
    bodies = np.tile(owner, len(one.mean) // len(owner))
    most = np.zeros((2, len(owner) + 1))  # the last is that of no body
    for uneven, slope in zip(most, (one, other), strict=True):
        np.maximum.at(uneven, bodies, slope.uneven)
    better = (most[1] < 0.5 * most[0])[bodies]
    return _Slope(*(np.where(better, new, old) for old, new in zip(one, other, strict=True)))


def _slope(found: Sides, sizes: tuple[float, ...], step: float) -> _Slope:
    """Slopes of each side, extrapolated to a step of zero by Lagrange's polynomial in the step."""
    rest, both = found
    sides, means = np.zeros((2, len(rest))), []
    for share, forces in zip(sizes, both, strict=True):
        weight = np.prod([other / (other - share) for other in sizes if other != share])
        slopes = (np.array(forces) - rest) / (share * step)
        sides += weight * slopes
        means.append((slopes[0] - slopes[1]) / 2)
    ahead, behind = sides
    return _Slope((ahead - behind) / 2, ahead + behind, means[-1] - means[0])
