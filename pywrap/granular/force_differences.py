r"""K and C of a live LAMMPS by differences of its own forces, whatever exerts them.

With q the coordinates of :mod:`~faultgouge.analysis.configuration` and F the forces,

.. math::

    K e_k = -\frac{F(h e_k) - F(-h e_k)}{2h} + O(h^2), \qquad C e_k = -\frac{F(v e_k) - F(-v e_k)}{2v} .

All of it happens in copies of the process (:mod:`~faultgouge.pywrap.granular.force_probe`): the instance itself stays
as it is. Particles without a common neighbour are displaced together (:mod:`~faultgouge.pywrap.granular.colours`).

**Error.** Slopes of both sides are extrapolated from the steps h/2 and h. A displacement and a velocity of all
particles at once in random directions are then compared with K q and C v, and the difference is the error. Some models
(mdr) make forces depend on all contacts of a particle, so that a particle feels the neighbours of its neighbours. Where
the error shows such forces, particles are displaced together only if they are farther apart.

**One-sided derivatives.** A contact at Coulomb's bound, a contact that is about to open or close, and a law with two
derivatives have another derivative forwards than backwards. K is the mean of both, and `jump` their difference. The
forces of two displacements do not add up there, so that an error there is no reason to refuse K.

**Weak contacts.** The random direction is taken at the shortest displacement, too. Where the forces then differ from
K q, or are not linear, shorter displacements are tried (:mod:`~faultgouge.pywrap.granular.force_slopes`).

**Bodies.** q = P Q, where several coordinates move as one. Column k of K belongs to a displacement of Q_k, and its rows
are sums of the forces on the coordinates that each Q moves.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from ...analysis.arrays import Floats, Indices
from .colours import Colours, Pairs, neighbouring_pairs
from .force_probe import Probe, ProbedParticles, hold_still, set_coordinate_velocity
from .force_slopes import Slope, slopes_along, slopes_by_shorter_steps
from .granular_commands import NotTakenError
from .look_in_a_copy import in_a_copy

LENGTH_OF_STEP = 1e12
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

DASHPOT_FORCE = 1e-4
"""Force of dashpots as a share of the mean contact force: contacts below Coulomb's bound do not reach the bound, and
the rounding of forces is 1e-7 of this force or less."""

LEAST_JUMP = 1e-3
"""Jump of a derivative, as a share of the largest entry, from which on two sides are said to differ; the extrapolation
leaves 1e-5 of one."""

NEXT_SIZE = 0.03
"""Size of the next shorter displacement, as a share of the one before: contacts of cohesive particles, which pull about
as much as they push, may bear a force 1e-5 of the mean one, and slide within 1e-7 of an overlap."""

SHORTEST_OF_COORDINATE, SHORTEST_OF_OVERLAP = 1e-11, 1e-6
"""Shortest displacement: as a share of the largest coordinate, whose rounding is 1e-5 of the displacement, and of the
median overlap, where the history that `granular` does not turn is 6e-4 of mu of the difference."""

SHORTEST_ERROR = 1e-2
"""Error of the shortest displacement, as a share of the largest force, from which on shorter ones are tried."""

SHORTEST_VELOCITY = 1e-6
"""Lowest velocity as a share of the first one: the rounding of forces is 1e-6 of their differences."""

LARGEST_OPERATOR_ERROR = 0.1
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
        entry; zero below LEAST_JUMP.
    """

    stiffness: csr_array
    damping: csr_array
    error: float
    jump: Floats


def measure_operators(lmp: Any, particles: ProbedParticles, force: float | None) -> ForceDifferences:
    """K and C at rest; the process must be one that can be copied, and nothing of the instance changes.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance, on one rank.
    particles : ProbedParticles
        Its particles.
    force : float, optional
        The mean contact force, by which velocities are chosen; by default by the forces of the displacements.

    Raises
    ------
    NotTakenError
        If LAMMPS's forces are not functions of displacements and velocities of neighbours.
    """
    return in_a_copy(partial(_measure, lmp, particles, force))


def _measure(lmp: Any, particles: ProbedParticles, force: float | None) -> ForceDifferences:
    """K and C, in a copy that may change."""
    lmp.command("log none")
    hold_still(lmp, particles.bodies)
    set_coordinate_velocity(lmp, particles, np.zeros(particles.constraint.shape[0]))
    pairs = neighbouring_pairs(lmp, particles)
    step = probe_displacement(particles, pairs)
    colours = Colours(particles, pairs, 4 * step)
    timestep = float(lmp.extract_global("dt"))
    lmp.command(f"timestep {LENGTH_OF_STEP * timestep:.17g}")
    lmp.command("thermo_style custom step")
    by_place = Probe(lmp, particles, LENGTH_OF_STEP * timestep, (0.5, 1.0))
    lengths = _sizes(step, _shortest(particles, pairs))
    stiffness = _derivative(by_place, colours, lengths)
    if stiffness.unexplained > LEAST_JUMP:
        farther = Colours(particles, pairs, 4 * step, reach=2)
        other = _derivative(replace(by_place, settles=True), farther, lengths)
        if other.unexplained < 0.5 * stiffness.unexplained:
            colours, stiffness = farther, other
    if force is None:
        force = step * float(np.abs(stiffness.matrix.data).max(initial=0.0)) / SHARE_OF_OVERLAP
    by_velocity = Probe(lmp, particles, None, (1.0,))
    speed = _speed(by_velocity, step / timestep, DASHPOT_FORCE * force)
    if speed == 0.0:
        damping = stiffness._replace(matrix=csr_array(stiffness.matrix.shape))
    else:
        damping = _derivative(by_velocity, colours, _sizes(speed, SHORTEST_VELOCITY * speed))
    jump, error = np.maximum(stiffness.jump, damping.jump), np.maximum(stiffness.error, damping.error)
    _refuse_errors(particles, jump, error)
    return ForceDifferences(stiffness.matrix, damping.matrix, float(error.max()), jump)


def _sizes(first: float, last: float) -> list[float]:
    """Ever shorter displacements, or lower velocities, from the first to the last one."""
    count = max(0, int(np.ceil(np.log(last / first) / np.log(NEXT_SIZE))))
    return [float(each) for each in np.geomspace(first, last, count + 1)] if count else [first]


def _shortest(particles: ProbedParticles, pairs: Pairs) -> float:
    """The shortest displacement with which forces are not rounded."""
    overlaps = -pairs.gap[pairs.gap < 0]
    usual = float(np.median(overlaps)) if len(overlaps) else 0.0
    return max(SHORTEST_OF_COORDINATE * float(np.abs(particles.position).max()), SHORTEST_OF_OVERLAP * usual)


class _Derivative(NamedTuple):
    """-dF/dQ; jump and error are shares of its largest entry, by particle, shape (N,)."""

    matrix: csr_array
    jump: Floats
    error: Floats

    @property
    def unexplained(self) -> float:
        """Largest error where no force is one-sided."""
        return float(np.where(self.jump > 0, 0.0, self.error).max())


def _refuse_errors(particles: ProbedParticles, jump: Floats, error: Floats) -> None:
    """Refuse operators that describe nothing, with the particle where the error is largest; shape (N,) both."""
    error = np.where(jump > 0, 0.0, error)
    worst = int(np.argmax(error))
    if error[worst] <= LARGEST_OPERATOR_ERROR:
        return
    place = ", ".join(f"{x:.6g}" for x in particles.position[worst, : particles.dimension])
    others = int(np.sum(error > LARGEST_OPERATOR_ERROR)) - 1
    raise NotTakenError(
        f"K and C by differences of forces are {error[worst]:.2g} of their largest entry from the forces of a "
        f"displacement of all particles at particle {particles.ids[worst]} at ({place})"
        f"{f', and at {others} more' if others else ''}: contacts there are about to open, to close or to slide, or "
        "lie between both planes of one fix wall/gran, of which LAMMPS has the nearer act alone (write a fix for each "
        "plane), or something couples particles that are no neighbours; run on with drag under a load that presses "
        "them together."
    )


def probe_displacement(particles: ProbedParticles, pairs: Pairs) -> float:
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


def _derivative(probe: Probe, colours: Colours, sizes: list[float]) -> _Derivative:
    """-dF/dQ by steps of the first size, and by shorter ones where the forces of the first are not linear."""
    particles = probe.particles
    count, size = len(particles.ids), particles.constraint.shape[0]
    directions, owners = _directions(colours, count, size // count)
    random = np.random.Generator(np.random.PCG64(0)).uniform(-1, 1, size)
    *found, first = slopes_along(probe, [*directions, random], sizes[0])
    last = slopes_along(probe, [random], sizes[-1])[0]
    matrix, jump = _assemble(particles, found, owners)
    differs = _error(particles, matrix, random, last) > SHORTEST_ERROR
    largest = max(np.abs(each.mean).max() for each in (*found, first))
    rough = [
        k for k, each in enumerate(found) if each.uneven.max() > LEAST_JUMP * largest or np.any(owners[k][differs] >= 0)
    ]
    if rough:
        shorter = slopes_by_shorter_steps(
            probe, {k: directions[k] for k in rough}, owners, sizes, differs, LEAST_JUMP * largest
        )
        found = [shorter.get(k, each) for k, each in enumerate(found)]
        matrix, jump = _assemble(particles, found, owners)
    errors = [_error(particles, matrix, random, slope) for slope in (first, last)]
    return _Derivative(matrix, jump, np.minimum(*errors))


def _directions(colours: Colours, count: int, axes: int) -> tuple[list[Floats], list[Indices]]:
    """A unit displacement of each colour along each axis, shape (axes N,), and the body that each particle feels in it,
    shape (N,), -1 for none."""
    directions = []
    for members in colours.members:
        for axis in range(axes):
            directions.append(np.zeros(axes * count))
            directions[-1][axis * count + np.array(members)] = 1.0
    return directions, [owner for owner in colours.owner for _ in range(axes)]


def _assemble(particles: ProbedParticles, found: list[Slope], owners: list[Indices]) -> tuple[csr_array, Floats]:
    """-dF/dQ of the slopes along all directions, and its jumps."""
    size, count = particles.constraint.shape[0], len(particles.ids)
    axis = count * np.arange(size // count)
    rows, columns, values, jump = [], [], [], np.zeros(count)
    for k, (slope, owner) in enumerate(zip(found, owners, strict=True)):
        felt = np.flatnonzero(owner >= 0)
        where = axis[:, None] + felt
        rows.append(where.ravel())
        columns.append(np.broadcast_to(axis[k % len(axis)] + owner[felt], where.shape).ravel())
        values.append(-slope.mean[where].ravel())
        jump[felt] = np.maximum(jump[felt], np.abs(slope.jump[where]).max(axis=0))
    raw = coo_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size))
    matrix = csr_array(_sums(particles) @ raw.tocsr())
    matrix.eliminate_zeros()
    matrix.sort_indices()
    largest = np.abs(matrix.data).max(initial=0.0)
    return matrix, np.where(jump > LEAST_JUMP * largest, jump, 0.0) / (largest or 1.0)


def _sums(particles: ProbedParticles) -> csr_array:
    """P_1^T, which sums the forces on coordinates that move as one."""
    return csr_array(csr_array(particles.constraint != 0).astype(np.float64).T)


def _error(particles: ProbedParticles, matrix: csr_array, direction: Floats, slope: Slope) -> Floats:
    """Difference of the forces along a direction from those of the matrix, as a share of the largest; shape (N,)."""
    forces = _sums(particles) @ slope.mean
    felt = float(np.abs(forces).max(initial=0.0))
    return np.asarray(np.abs(forces + matrix @ direction).reshape(-1, len(particles.ids)).max(axis=0) / (felt or 1.0))
