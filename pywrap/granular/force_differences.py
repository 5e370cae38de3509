r"""K and C of a live LAMMPS by differences of its own forces, whatever exerts them.

With q the coordinates of :mod:`~faultgouge.analysis.configuration` and F the forces,

.. math::

    K e_k = -\frac{F(h e_k) - F(-h e_k)}{2h} + O(h^2), \qquad C e_k = -\frac{F(v e_k) - F(-v e_k)}{2v} .

A displacement is one step of LAMMPS, so slow that dashpots exert nothing, in a copy of the process: histories of
contacts follow as in any step, and the instance itself stays as it is. A velocity is a run of zero steps, in which
histories do not change.

**Colours.** A particle feels only the particles that it touches. Particles without a common neighbour are displaced
together (Curtis, Powell and Reid, J. Inst. Math. Appl. 13, 117, 1974), so that the number of displacements depends on
the number of neighbours, not of particles.

**Error.** Slopes of both sides are extrapolated from the steps h/2 and h. A displacement, and a velocity, of all
particles at once in random directions are then compared with K q and C v. The difference is the error; neighbours of
which nothing is known would show in it.

**Copies.** Where a way there and back restores the forces, one copy goes all ways. Where a history is cut at Coulomb's
bound, or scaled, each way has a copy of its own.

**One-sided derivatives.** A contact at Coulomb's bound, one that is about to open or close, and a law with two
derivatives have another derivative forwards than backwards. K is the mean of both, and the jump between them is said.

**Bodies.** q = P Q, where several coordinates move as one. The columns of K are displacements of Q, and its rows sums
of forces on the coordinates that Q moves.
"""

from dataclasses import dataclass
from functools import partial
from itertools import combinations
from itertools import count as count_from
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from ...analysis.arrays import Floats, Indices
from .granular_commands import SnapshotError
from .instance_queries import styles_of
from .lammps_arrays import owned_array
from .look_in_a_copy import in_a_copy, quieten

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

GAP_OF_NEIGHBOURS = 1e-3
"""Gap between particles, as a share of a radius, up to which they are looked for: far beyond all displacements."""

FREE_DISPLACEMENT = 1e-7
"""A displacement as a share of a radius where no particles overlap."""

PUSH = 1e-4
"""Force of dashpots as a share of the mean contact force: contacts do not reach Coulomb's bound by it unless they are
there, and the rounding of forces is 1e-7 of it or less."""

SIDES = 1e-3
"""Jump of a derivative, as a share of the largest entry, from which on two sides are said to differ; the extrapolation
leaves 1e-5 of one."""

RETURNS, RETURNS_IN_ALL, ROUNDS = 1e-5, 1e-3, 1e-13
"""Changes of forces that ways there and back leave: one and all of them as a share of the forces on the way, and that
of rounding as a share of those at rest. What turns a history, and back, leaves a share of step / radius."""

CHANGES = "histories change on a way there and back"
"""What one copy says to another: then each displacement needs a copy of its own."""

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


@dataclass(frozen=True, eq=False)
class Particles:
    """Who is displaced: IDs, places and radii of all particles, shape (N,), (N, 3) and (N,), and q = P Q."""

    dimension: int
    ids: Indices
    position: Floats
    radius: Floats
    constraint: csr_array

    @property
    def axes(self) -> Indices:
        """The components of (translation, rotation) that are coordinates."""
        return np.arange(6) if self.dimension == 3 else np.array([0, 1, 5])


@dataclass(frozen=True)
class Pairs:
    """Pairs of particles that LAMMPS knows as neighbours or as bonded: their indices, the gap between their surfaces,
    negative where they overlap, and whether a force acts; shape (P,) each."""

    i: Indices
    j: Indices
    gap: Floats
    acts: NDArray[np.bool_]


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
    SnapshotError
        If LAMMPS's forces are not functions of displacements and velocities of neighbours.
    """
    return in_a_copy(partial(_measure, lmp, particles, force))


def _measure(lmp: Any, particles: Particles, force: float | None) -> ForceDifferences:
    """What `measure_operators` does, in a copy that may change."""
    lmp.command("log none")
    hold_still(lmp)
    _set_velocity(lmp, particles, np.zeros(particles.constraint.shape[0]))
    pairs = neighbouring_pairs(lmp, particles)
    step = displacement(particles, pairs)
    colours = _Colours(particles, pairs, 4 * step)
    lmp.command("fix faultgouge_moves all nve/noforce")
    timestep = float(lmp.extract_global("dt"))
    lmp.command(f"timestep {SLOW * timestep:.17g}")
    lmp.command("thermo_style custom step")
    by_place = _Probe(lmp, particles, SLOW * timestep, (0.5, 1.0))
    stiffness, jump, error = _derivative(by_place, colours, step)
    by_velocity = _Probe(lmp, particles, None, (1.0,))
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
    raise SnapshotError(
        f"K and C by differences of forces are {error[worst]:.2g} of their largest entry from the forces of a "
        f"displacement of all particles at particle {particles.ids[worst]} at ({place})"
        f"{f', and at {others} more' if others else ''}: contacts there are about to open, to close or to slide, or "
        "something couples particles that are no neighbours; run on with drag under a load that presses them together."
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


def _speed(by_velocity: "_Probe", speed: float, force: float) -> float:
    """A velocity at which dashpots exert a force; zero if there are none."""
    direction = np.random.Generator(np.random.PCG64(1)).uniform(-1, 1, by_velocity.particles.constraint.shape[0])
    for _ in range(3):  # a velocity far too large has contacts slide
        rest, sides = by_velocity.each([speed * direction])[0]
        change = float(np.abs(sides[0][0] - rest).max())
        if change <= np.finfo(float).eps * np.abs(rest).max():
            return 0.0
        speed *= force / change
    return speed


MOVES = ("nve", "rigid", "move", "overdamped", "nvt", "nph", "npt")
"""Fixes that move particles, by the beginnings of their styles."""

HOLDS = ("freeze", "setforce", "aveforce", "lineforce", "planeforce", "momentum", "recenter", "temp/")
"""Fixes that change forces or velocities of coordinates that are held, or that move as one."""


def hold_still(lmp: Any) -> None:
    """Leave what exerts forces in a copy alone: no output, no drag, and nothing that moves or holds particles."""
    quieten(lmp, drag=True)
    for name, style in styles_of(lmp).fixes.items():
        if style.startswith((*MOVES, *HOLDS)):
            lmp.command(f"unfix {name}")


def _rows(lmp: Any, particles: Particles) -> Indices:
    ids = owned_array(lmp, "id")
    rows = np.argsort(ids)
    if not np.array_equal(ids[rows], particles.ids):
        raise SnapshotError("Particles left LAMMPS while they were displaced: let the packing come to rest first.")
    return rows


def _set_velocity(lmp: Any, particles: Particles, velocity: Floats) -> None:
    """Give the particles velocities of their coordinates, shape (axes N,)."""
    values = np.zeros((6, len(particles.ids)))
    values[particles.axes] = velocity.reshape(len(particles.axes), -1)
    rows = _rows(lmp, particles)
    owned_array(lmp, "v")[rows] = values[:3].T
    owned_array(lmp, "omega")[rows] = values[3:].T / particles.radius[:, None]


def _forces(lmp: Any, particles: Particles) -> Floats:
    """Forces on the coordinates, F and T/R, shape (axes N,)."""
    rows = _rows(lmp, particles)
    torque = owned_array(lmp, "torque")[rows] / particles.radius[:, None]
    return np.hstack([owned_array(lmp, "f")[rows], torque]).T[particles.axes].ravel()


def neighbouring_pairs(lmp: Any, particles: Particles) -> Pairs:
    """Pairs that touch or nearly do, and those of bonds and angles; in a copy, where it runs zero steps."""
    lmp.command("compute faultgouge_i all property/local patom1 patom2")
    try:
        lmp.command("compute faultgouge_c all pair/local dist force")
        lmp.command("run 0 post no")
        distance, force = _local(lmp, "c", 2).T
    except Exception:  # a pair style that hands out no forces of pairs: all neighbours may act
        lmp.command("uncompute faultgouge_c")
        lmp.command("run 0 post no")
        distance, force = None, None
    i, j = np.searchsorted(particles.ids, _local(lmp, "i", 2).astype(np.int64)).T
    if distance is None or force is None:
        gap, acts = np.full(len(i), np.inf), np.ones(len(i), np.bool_)
    else:
        gap, acts = distance - particles.radius[i] - particles.radius[j], force != 0
    bonded, near = _bonded(lmp, particles.ids), _nearly_touching(lmp, particles)
    return Pairs(
        np.concatenate([i, bonded[0], near.i]),
        np.concatenate([j, bonded[1], near.j]),
        np.concatenate([gap, np.full(len(bonded[0]), np.inf), near.gap]),
        np.concatenate([acts, np.ones(len(bonded[0]), np.bool_), near.acts]),
    )


def _nearly_touching(lmp: Any, particles: Particles) -> Pairs:
    """Pairs a little apart: compute pair/local hands none of them out. LAMMPS has ghosts of particles across a periodic
    boundary."""
    every = [np.array(lmp.numpy.extract_atom(name)) for name in ("id", "x", "radius")]
    count = lmp.extract_setting("nlocal") + lmp.extract_setting("nghost")
    ids, x, radius = (values[:count] for values in every)
    i, j = cKDTree(x).query_pairs(2 * float(radius.max()) * (1 + GAP_OF_NEIGHBOURS), output_type="ndarray").T
    gap = np.linalg.norm(x[i] - x[j], axis=1) - radius[i] - radius[j]
    near = (gap >= 0) & (gap < GAP_OF_NEIGHBOURS * radius[i])
    i, j = (np.searchsorted(particles.ids, ids[each[near]]) for each in (i, j))
    return Pairs(i, j, gap[near], np.zeros(len(i), np.bool_))


def _local(lmp: Any, name: str, columns: int) -> Floats:
    rows = lmp.numpy.extract_compute(f"faultgouge_{name}", 2, 2)
    return np.zeros((0, columns)) if rows is None else np.array(rows).reshape(-1, columns)


def _bonded(lmp: Any, ids: Indices) -> tuple[Indices, Indices]:
    """Pairs of particles of one bond or angle."""
    found = [np.zeros((0, 2), np.int64)]
    if lmp.extract_setting("molecule_flag"):
        for each in (lmp.numpy.gather_bonds(), lmp.numpy.gather_angles()):
            if not len(each):
                continue
            members = np.asarray(each).reshape(len(each), -1)[:, 1:]
            found += [members[:, pair] for pair in combinations(range(members.shape[1]), 2)]
    i, j = np.searchsorted(ids, np.concatenate(found)).T
    return i, j


class _Colours:
    """Which bodies are displaced together: no particle is a neighbour of two of them.

    Attributes
    ----------
    members : list of ndarray of int
        Bodies of each colour, by the particle that leads each.
    owner : list of ndarray of int, shape (N,)
        The body that each particle feels, -1 if it feels none.
    """

    def __init__(self, particles: Particles, pairs: Pairs, near: float) -> None:
        count = len(particles.ids)
        moved = particles.constraint.tocoo()
        leads: list[set[int]] = [set() for _ in range(count)]
        for particle, leader in zip(moved.row % count, moved.col % count, strict=True):
            leads[leader].add(int(particle))
        free = np.zeros(count, np.bool_)
        free[moved.row % count] = True
        feels = [{k} for k in range(count)]
        touch = (pairs.acts | (pairs.gap < near)) & free[pairs.i] & free[pairs.j]
        for i, j in zip(pairs.i[touch].tolist(), pairs.j[touch].tolist(), strict=True):
            feels[i].add(j)
            feels[j].add(i)
        taken: list[set[int]] = [set() for _ in range(count)]
        self.members: list[list[int]] = []
        self.owner: list[Indices] = []
        for leader in range(count):
            around = sorted(set().union(*(feels[each] for each in leads[leader])))
            if not around:
                continue
            used = set().union(*(taken[each] for each in around))
            colour = next(k for k in count_from(0) if k not in used)
            if colour == len(self.members):
                self.members.append([])
                self.owner.append(np.full(count, -1))
            self.members[colour].append(leader)
            self.owner[colour][around] = leader
            for each in around:
                taken[each].add(colour)


Sides = tuple[Floats, list[tuple[Floats, Floats]]]
"""Forces on the particles at rest, and ahead and behind for each size; shape (axes N,) each."""


@dataclass(frozen=True)
class _Probe:
    """Forces of a LAMMPS, which is a copy, along displacements, or velocities where `duration` is None.

    `duration` is the length of a step, and `sizes` the shares of a displacement at which forces are taken.
    """

    lmp: Any
    particles: Particles
    duration: float | None
    sizes: tuple[float, ...]

    def each(self, directions: list[Floats]) -> list[Sides]:
        """Forces along each direction Q, from the state in which LAMMPS is.

        In one copy if every way back restores the forces, as it does where no history is cut or scaled; otherwise each
        way has a copy of its own.
        """
        try:
            return in_a_copy(partial(self.there_and_back, directions))
        except SnapshotError as error:
            if str(error) != CHANGES:
                raise
        rest = self._alone(0.0 * directions[0])
        return [(rest, [(self._alone(s * q), self._alone(-s * q)) for s in self.sizes]) for q in directions]

    def there_and_back(self, directions: list[Floats]) -> list[Sides]:
        """Forces along each direction; a SnapshotError if a way there and back changes the state."""
        first = rest = self._from_rest(0.0 * directions[0])
        found, place = [], self._positions()
        for q in directions:
            sides = []
            for way in (sign * size for size in self.sizes for sign in (1, -1)):
                there, back = self._go(way * q), self._go(-way * q if self.duration else 0.0 * q)
                left = np.abs(back - [rest, first]).max(axis=1) - ROUNDS * np.abs(first).max()
                if np.any(left > np.array([RETURNS, RETURNS_IN_ALL]) * np.abs(there - rest).max()):
                    raise SnapshotError(CHANGES)
                if self.duration:
                    self._put(place)
                sides.append(there)
                rest = back  # what is left of a way is of second order in the step
            found.append((rest, list(zip(sides[::2], sides[1::2], strict=True))))
        return found

    def _alone(self, q: Floats) -> Floats:
        return in_a_copy(partial(self._from_rest, q))

    def _from_rest(self, q: Floats) -> Floats:
        """Forces along a direction, in a copy of its own; those at rest for none."""
        _set_velocity(self.lmp, self.particles, np.zeros(len(q)))
        self.lmp.command("run 0 post no")
        return self._go(q)

    def _go(self, q: Floats) -> Floats:
        moves = self.particles.constraint @ q
        _set_velocity(self.lmp, self.particles, moves / self.duration if self.duration else moves)
        self.lmp.command("run 1 pre no post no" if self.duration else "run 0 post no")
        return _forces(self.lmp, self.particles)

    def _positions(self) -> Floats:
        return np.array(owned_array(self.lmp, "x")[_rows(self.lmp, self.particles)])

    def _put(self, place: Floats) -> None:
        """Take the rounding of the way back away."""
        owned_array(self.lmp, "x")[_rows(self.lmp, self.particles)] = place


def _derivative(probe: _Probe, colours: _Colours, step: float) -> tuple[csr_array, Floats, Floats]:
    """-dF/dQ by steps of this size, and jumps of it and the error by particle, shape (N,)."""
    size, count = probe.particles.constraint.shape[0], len(probe.particles.ids)
    axis = count * np.arange(size // count)
    directions = []
    for members in colours.members:
        for k in axis:
            directions.append(np.zeros(size))
            directions[-1][k + np.array(members)] = step
    random = step * np.random.Generator(np.random.PCG64(0)).uniform(-1, 1, size)
    *found, last = probe.each([*directions, random])
    rows, columns, values, jump = [], [], [], np.zeros(count)
    for k, each in enumerate(found):
        owner = colours.owner[k // len(axis)]
        felt = np.flatnonzero(owner >= 0)
        slope, sides = _slope_and_jump(each, probe.sizes, step)
        where = axis[:, None] + felt
        rows.append(where.ravel())
        columns.append(np.broadcast_to(axis[k % len(axis)] + owner[felt], where.shape).ravel())
        values.append(-slope[where].ravel())
        jump[felt] = np.maximum(jump[felt], np.abs(sides[where]).max(axis=0))
    moved = csr_array(probe.particles.constraint != 0).astype(np.float64).T
    raw = coo_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size))
    matrix = csr_array(moved @ raw.tocsr())
    matrix.eliminate_zeros()
    forces = moved @ _slope_and_jump(last, probe.sizes, step)[0]
    largest, felt = np.abs(matrix.data).max(initial=0.0), np.abs(forces).max(initial=0.0)
    error = np.abs(forces + matrix @ random / step).reshape(-1, count).max(axis=0) / (felt or 1.0)
    return matrix, np.where(jump > SIDES * largest, jump, 0.0) / (largest or 1.0), error


def _slope_and_jump(found: Sides, sizes: tuple[float, ...], step: float) -> tuple[Floats, Floats]:
    """dF along a direction over its size, the mean of both sides, and by how much they differ.

    Slopes of each side are extrapolated to a step of zero, by Lagrange's polynomial in the step.
    """
    rest, both = found
    sides = np.zeros((2, len(rest)))
    for share, forces in zip(sizes, both, strict=True):
        weight = np.prod([other / (other - share) for other in sizes if other != share])
        sides += weight * (np.array(forces) - rest) / (share * step)
    ahead, behind = sides
    return (ahead - behind) / 2, ahead + behind
