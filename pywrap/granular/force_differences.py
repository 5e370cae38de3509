r"""K and C of a live LAMMPS by differences of its own forces, whatever exerts them.

With q the coordinates of :mod:`~faultgouge.analysis.configuration` and F the forces,

.. math::

    K e_k = -\frac{F(h e_k) - F(-h e_k)}{2h} + O(h^2), \qquad C e_k = -\frac{F(v e_k) - F(-v e_k)}{2v} .

All of it happens in a copy of the process. A displacement is one step of LAMMPS, so slow that dashpots exert nothing:
histories of contacts follow as in any step. A velocity is a run of zero steps, in which histories do not change. Before
each, positions and, by fix keep/histories of the plugin, histories are put back to the bit. Particles without a common
neighbour are displaced together (:mod:`~faultgouge.pywrap.granular.colours`).

**Error.** Slopes of both sides are extrapolated from the steps h/2 and h. A displacement and a velocity of all
particles at once in random directions are then compared with K q and C v, and the difference is the error. Some models
(mdr) make forces depend on all contacts of a particle, so that a particle feels the neighbours of its neighbours. Where
the error shows such forces, particles are displaced together only if they are farther apart.

**One-sided derivatives.** A contact at Coulomb's bound, a contact that is about to open or close, and a law with two
derivatives have another derivative forwards than backwards. K is the mean of both, and `jump` their difference. The
forces of two displacements do not add up there, so that an error there is no reason to refuse K.

**Weak contacts.** A displacement may be too long for a contact whose force is far below the mean one: the contact opens
within it, or slides, and then its stiffness seems to be next to nothing. So the random direction is taken at the
shortest displacement, too. Where the forces then differ from K q, or are not linear, shorter displacements are tried.

**Bodies.** q = P Q, where several coordinates move as one. Column k of K belongs to a displacement of Q_k, and its rows
are sums of the forces on the coordinates that each Q moves. Dashpots feel the masses of the bodies of fix rigid. So
these bodies stay in the copy, and hold the velocities that they take from their particles where a run begins.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from ...analysis import Configuration
from ...analysis.arrays import Floats, Indices
from ..lammps.instance import load_plugin
from .colours import Colours, Pairs, neighbouring_pairs
from .granular_commands import BODIES, NotTakenError, without_suffix
from .instance_queries import styles_of
from .lammps_arrays import on_coordinates, owned_array, rows_of, set_velocity
from .look_in_a_copy import in_a_copy, quieten
from .translating_bodies import HELD, translating_bodies

MOVES = ("nve", "rigid", "move", "overdamped", "nvt", "nph", "npt")
"""Fixes that move particles, by the beginnings of their styles."""

HOLDS = ("freeze", "setforce", "aveforce", "lineforce", "planeforce", "momentum", "recenter", "temp/")
"""Fixes that change forces or velocities of coordinates that are held, or that move as one."""

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


def measure_operators(
    lmp: Any, configuration: Configuration, constraint: csr_array, bodies: tuple[str, ...], force: float | None
) -> ForceDifferences:
    """K and C at rest; the process must be one that can be copied, and nothing of the instance changes.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance, on one rank.
    configuration : Configuration
        Its particles.
    constraint : scipy.sparse.csr_array, shape (coordinates, coordinates)
        P of q = P Q.
    bodies : tuple of str
        The commands of fix rigid.
    force : float, optional
        The mean contact force, by which velocities are chosen; by default by the forces of the displacements.

    Raises
    ------
    NotTakenError
        If LAMMPS's forces are not functions of displacements and velocities of neighbours.
    """
    return in_a_copy(partial(_measure, lmp, configuration, constraint, bodies, force))


def _measure(
    lmp: Any, c: Configuration, constraint: csr_array, bodies: tuple[str, ...], force: float | None
) -> ForceDifferences:
    """K and C, in a copy that may change."""
    lmp.command("log none")
    _hold_still(lmp, bodies)
    rows, timestep = rows_of(lmp, c), float(lmp.extract_global("dt"))
    place = {name: np.array(owned_array(lmp, name)[rows]) for name in ("x", "image")}
    by_place = Probe(lmp, c, constraint, place, LENGTH_OF_STEP * timestep, (0.5, 1.0))
    lmp.command(f"timestep {by_place.duration:.17g}")
    lmp.command("thermo_style custom step")
    by_place.forces(np.zeros(c.coordinates))
    pairs = neighbouring_pairs(lmp, c)
    largest, overlaps = float(np.abs(c.position).max()), -pairs.gap[np.isfinite(pairs.gap) & (pairs.gap < 0)]
    usual = float(np.median(overlaps)) if len(overlaps) else 0.0
    step = _displacement(c, pairs, usual, LEAST_OF_COORDINATE * largest)
    lengths = _sizes(step, max(SHORTEST_OF_COORDINATE * largest, SHORTEST_OF_OVERLAP * usual))
    colours = Colours(c, constraint, pairs, 4 * step)
    stiffness = _derivative(by_place, colours, lengths)
    if stiffness.unexplained > LEAST_JUMP:
        farther = Colours(c, constraint, pairs, 4 * step, reach=2)
        other = _derivative(replace(by_place, settles=True), farther, lengths)
        if other.unexplained < 0.5 * stiffness.unexplained:
            colours, stiffness = farther, other
    if force is None:
        force = step * float(np.abs(stiffness.matrix.data).max(initial=0.0)) / SHARE_OF_OVERLAP
    by_velocity = replace(by_place, duration=None, sizes=(1.0,))
    speed = _speed(by_velocity, step / timestep, DASHPOT_FORCE * force)
    if speed == 0.0:
        damping = stiffness._replace(matrix=csr_array(stiffness.matrix.shape))
    else:
        damping = _derivative(by_velocity, colours, _sizes(speed, SHORTEST_VELOCITY * speed))
    jump, error = np.maximum(stiffness.jump, damping.jump), np.maximum(stiffness.error, damping.error)
    unexplained = np.where(jump > 0, 0.0, error)
    worst = int(np.argmax(unexplained))
    if unexplained[worst] > LARGEST_OPERATOR_ERROR:
        there = ", ".join(f"{x:.6g}" for x in c.position[worst])
        others = int(np.sum(unexplained > LARGEST_OPERATOR_ERROR)) - 1
        raise NotTakenError(
            f"K and C by differences of forces are {unexplained[worst]:.2g} of their largest entry from the forces of "
            f"a displacement of all particles at particle {c.ids[worst]} at ({there})"
            f"{f', and at {others} more' if others else ''}: contacts there are about to open, to close or to slide, "
            "or lie between both planes of one fix wall/gran, of which LAMMPS has the nearer act alone (write a fix "
            "for each plane), or something couples particles that are no neighbours; run on with drag under a load "
            "that presses them together."
        )
    return ForceDifferences(stiffness.matrix, damping.matrix, float(error.max()), jump)


def _hold_still(lmp: Any, bodies: tuple[str, ...]) -> None:
    """Leave what exerts forces in a copy alone: no output, no drag, and nothing that moves or holds particles by
    itself; what has a velocity moves by it. Dashpots feel the masses of bodies, and of frozen particles, which stay.
    Histories are kept."""
    quieten(lmp, drag=True)
    for name, style in styles_of(lmp).fixes.items():
        if style.startswith((*MOVES, *HOLDS)) and without_suffix(style) not in (*BODIES, "freeze"):
            lmp.command(f"unfix {name}")
    for line in bodies:
        lmp.command(f"{line} {HELD}")
    group = "all"
    if bodies:
        group = "faultgouge_m"
        groups = {body.group for line in bodies for body in translating_bodies(line, lmp.extract_setting("dimension"))}
        lmp.command(f"group {group} subtract all {' '.join(sorted(groups))}")
    lmp.command(f"fix faultgouge_moves {group} nve/noforce")
    load_plugin(lmp)
    lmp.command("fix faultgouge_h all keep/histories")


@dataclass(frozen=True)
class Probe:
    """Forces of a LAMMPS, which is a copy, along displacements, or velocities where `duration` is None.

    `place` has positions and images of the particles at rest, by their IDs; `duration` is the length of a step, and
    `sizes` are the shares of a displacement at which forces are taken. If
    `settles`, a step without motion follows each displacement, for models that act one step late.
    """

    lmp: Any
    configuration: Configuration
    constraint: csr_array
    place: dict[str, Floats]
    duration: float | None
    sizes: tuple[float, ...]
    settles: bool = False

    @cached_property
    def rest(self) -> Floats:
        """Forces on the coordinates at rest, shape (axes N,)."""
        return self.forces(np.zeros(self.configuration.coordinates))

    def forces(self, q: Floats) -> Floats:
        """Forces (F, T/R) after a displacement or with a velocity Q, from rest; shape (axes N,)."""
        lmp, c = self.lmp, self.configuration
        rows = rows_of(lmp, c)
        for name, values in self.place.items():
            owned_array(lmp, name)[rows] = values
        lmp.command("fix_modify faultgouge_h restore")
        set_velocity(lmp, c, q / (self.duration or 1.0))
        lmp.command("run 1 post no" if self.duration else "run 0 post no")
        if self.settles:
            set_velocity(lmp, c, 0.0 * q)
            lmp.command("run 1 post no")
        return on_coordinates(lmp, c, "f", "torque")

    def slope(self, q: Floats, size: float) -> "Slope":
        """Slopes of each side along a unit direction, extrapolated to a step of zero by Lagrange's polynomial."""
        sides, means = np.zeros((2, len(self.rest))), []
        for share in self.sizes:
            step = share * size
            slopes = np.array([self.forces(way * step * q) - self.rest for way in (1, -1)]) / step
            sides += slopes * np.prod([other / (other - share) for other in self.sizes if other != share])
            means.append((slopes[0] - slopes[1]) / 2)
        return Slope((sides[0] - sides[1]) / 2, sides[0] + sides[1], means[-1] - means[0])


class Slope(NamedTuple):
    """dF along a direction, over the size of the displacement or velocity; shape (axes N,) each: the mean of the slopes
    ahead and behind, the jump from one to the other, and the difference of the means at the two sizes."""

    mean: Floats
    jump: Floats
    bend: Floats

    @property
    def uneven(self) -> Floats:
        """How far the force is from a linear function of the size, shape (axes N,)."""
        return np.maximum(np.abs(self.jump), np.abs(self.bend))

    def by_shorter_steps(
        self, probe: Probe, q: Floats, owner: Indices, sizes: list[float], differs: NDArray[np.bool_], same: float
    ) -> "Slope":
        """The slope by ever shorter steps, the longest first.

        A shorter step is taken for all particles that feel a body where it makes the forces far more linear, or where
        it is linear and a particle `differs`, shape (N,): on which the shortest steps exert other forces than K says. A
        shorter step that says the same to `same`, as at a contact which slides on one side, ends the search.
        """
        probe = replace(probe, sizes=(0.5, 1.0))  # how far a force is from a linear one
        bodies, seen = np.tile(owner, len(q) // len(owner)), owner[differs & (owner >= 0)]
        best = last = probe.slope(q, sizes[0])
        for size in sizes[1:]:
            slope = probe.slope(q, size)
            most = np.zeros((2, len(owner) + 1))  # the last column stands for no body
            for uneven, each in zip(most, (best, slope), strict=True):
                np.maximum.at(uneven, bodies, each.uneven)
            better = (most[1] < 0.5 * most[0]) | (np.isin(np.arange(len(owner) + 1), seen) & (most[1] <= same))
            best = Slope(*(np.where(better[bodies], new, old) for old, new in zip(best, slope, strict=True)))
            apart = np.abs(slope.mean - last.mean) + np.abs(slope.jump - last.jump)
            if not len(seen) and apart.max() <= same:
                break
            last = slope
        return best


class _Derivative(NamedTuple):
    """-dF/dQ; jump and error are shares of its largest entry, by particle, shape (N,)."""

    matrix: csr_array
    jump: Floats
    error: Floats

    @property
    def unexplained(self) -> float:
        """Largest error where no force is one-sided."""
        return float(np.where(self.jump > 0, 0.0, self.error).max())


def _sizes(first: float, last: float) -> list[float]:
    """Ever shorter displacements, or lower velocities, from the first to the last one."""
    count = max(0, int(np.ceil(np.log(last / first) / np.log(NEXT_SIZE))))
    return [float(each) for each in np.geomspace(first, last, count + 1)] if count else [first]


def _displacement(c: Configuration, pairs: Pairs, usual: float, least: float) -> float:
    """A step far below the smallest overlap and gap, as far as rounding allows; `usual` is the median overlap."""
    gaps = np.abs(pairs.gap[np.isfinite(pairs.gap)])
    if not usual:
        return max(least, FREE_DISPLACEMENT * float(c.radius.min()))
    step = max(SHARE_OF_OVERLAP * float(gaps.min()), least, LEAST_OF_OVERLAP * usual)
    return min(step, max(SHARE_OF_OVERLAP * usual, least))


def _speed(by_velocity: Probe, speed: float, force: float) -> float:
    """A velocity at which dashpots exert a force; zero if there are none."""
    direction = _random(by_velocity.configuration, 1)
    for _ in range(3):  # a velocity far too large has contacts slide
        change = float(np.abs(by_velocity.forces(speed * direction) - by_velocity.rest).max())
        if change <= np.finfo(float).eps * np.abs(by_velocity.rest).max():
            return 0.0
        speed *= force / change
    return speed


def _random(c: Configuration, seed: int) -> Floats:
    return np.asarray(c.coordinate_free * np.random.Generator(np.random.PCG64(seed)).uniform(-1, 1, c.coordinates))


def _derivative(probe: Probe, colours: Colours, sizes: list[float]) -> _Derivative:
    """-dF/dQ by steps of the first size, and by shorter ones where the forces of the first are not linear."""
    c, count = probe.configuration, len(probe.configuration)
    owners = [owner for owner in colours.owner for _ in range(c.axes)]
    directions = np.zeros((len(owners), c.axes * count))
    for k, members in enumerate(colours.members):
        for axis in range(c.axes):
            directions[c.axes * k + axis, axis * count + np.array(members)] = 1.0
    random = _random(c, 0)
    found = [probe.slope(q, sizes[0]) for q in directions]
    checks = [probe.slope(random, size) for size in (sizes[0], sizes[-1])]
    matrix, jump = _assemble(probe, found, owners)
    differs = _error(probe, matrix, random, checks[1]) > SHORTEST_ERROR
    same = LEAST_JUMP * max(np.abs(each.mean).max() for each in (*found, checks[0]))
    rough = [k for k, each in enumerate(found) if each.uneven.max() > same or np.any(owners[k][differs] >= 0)]
    for k in rough:
        found[k] = found[k].by_shorter_steps(probe, directions[k], owners[k], sizes, differs, same)
    if rough:
        matrix, jump = _assemble(probe, found, owners)
    return _Derivative(matrix, jump, np.minimum(*(_error(probe, matrix, random, each) for each in checks)))


def _assemble(probe: Probe, found: list[Slope], owners: list[Indices]) -> tuple[csr_array, Floats]:
    """-dF/dQ of the slopes along all directions, and its jumps."""
    c, count = probe.configuration, len(probe.configuration)
    axis = count * np.arange(c.axes)
    rows, columns, values, jump = [], [], [], np.zeros(count)
    for k, (slope, owner) in enumerate(zip(found, owners, strict=True)):
        felt = np.flatnonzero(owner >= 0)
        where = axis[:, None] + felt
        rows.append(where.ravel())
        columns.append(np.broadcast_to(axis[k % c.axes] + owner[felt], where.shape).ravel())
        values.append(-slope.mean[where].ravel())
        jump[felt] = np.maximum(jump[felt], np.abs(slope.jump[where]).max(axis=0))
    every = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    matrix = csr_array((probe.constraint != 0).T @ coo_array(every, shape=probe.constraint.shape).tocsr())
    matrix.eliminate_zeros()
    matrix.sort_indices()
    largest = np.abs(matrix.data).max(initial=0.0)
    return matrix, np.where(jump > LEAST_JUMP * largest, jump, 0.0) / (largest or 1.0)


def _error(probe: Probe, matrix: csr_array, direction: Floats, slope: Slope) -> Floats:
    """Difference of the forces along a direction from those of the matrix, as a share of the largest; shape (N,)."""
    forces = (probe.constraint != 0).T @ slope.mean
    felt = float(np.abs(forces).max(initial=0.0))
    return np.asarray(
        np.abs(forces + matrix @ direction).reshape(probe.configuration.axes, -1).max(axis=0) / (felt or 1.0)
    )
