r"""K and C of a live LAMMPS by differences of its own forces, whatever exerts them.

With q the coordinates of :mod:`~faultgouge.analysis.configuration` and F the forces,

.. math::

    K e_k = -\frac{F(h e_k) - F(-h e_k)}{2h} + O(h^2), \qquad C e_k = -\frac{F(v e_k) - F(-v e_k)}{2v} .

All of it happens in a copy of the process. A displacement is one step of LAMMPS, so slow that dashpots exert nothing:
histories of contacts follow as in any step. A velocity is a run of zero steps, in which histories do not change. Before
each, positions and, by fix keep/histories of the plugin, histories are put back to the bit. Particles without a common
neighbour are displaced together (colours), as a particle feels only those that it touches: the number of displacements
depends on the number of neighbours, not of particles (Curtis, Powell and Reid, J. Inst. Math. Appl. 13, 117, 1974).

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
from itertools import combinations
from itertools import count as count_from
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array

from ...analysis import Configuration, LinearisedContacts
from ...analysis.arrays import Floats, Indices, derive_frozen
from ..lammps.instance import load_plugin
from .balance import TWICE, force_scale, touch_twice
from .configuration_by_laws import OneLaw, contacts_of_pairs
from .granular_commands import BODIES, HOLDS, MOVES, OWN, Commands, NotTakenError, without_suffix
from .lammps_arrays import Arrays, on_coordinates, owned_array, rows_of, set_velocity
from .look_in_a_copy import in_a_copy, open_files, quieten, styles_of
from .looks import box_of, look, members_of, particles_of
from .mobility import HELD, mobility, translating_bodies

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


GAP_OF_NEIGHBOURS = 1e-3
"""Gap between particles, as a share of the largest diameter, up to which they are looked for: far beyond all
displacements."""


class Pairs(NamedTuple):
    """Pairs of particles that may feel each other: their indices, and the gap between their surfaces, negative where
    they overlap and minus infinity where something else may act between them; shape (P,) each."""

    i: Indices
    j: Indices
    gap: Floats


def neighbouring_pairs(lmp: Any, c: Configuration) -> Pairs:
    """Pairs that touch or nearly touch, others of LAMMPS's neighbours between which a force acts, and pairs of bonds
    and angles. The instance is a copy, which has been set up."""
    from scipy.spatial import cKDTree  # which takes as long to import as all of `scipy.sparse`

    # LAMMPS has ghosts of particles across a periodic boundary
    every = [np.array(lmp.numpy.extract_atom(name)) for name in ("id", "x", "radius")]
    ids, x, radius = (each[: lmp.extract_setting("nlocal") + lmp.extract_setting("nghost")] for each in every)
    reach = 2 * float(radius.max()) * (1 + GAP_OF_NEIGHBOURS)
    i, j = cKDTree(x).query_pairs(reach, output_type="ndarray").T
    gap = np.linalg.norm(x[i] - x[j], axis=1) - radius[i] - radius[j]
    others = _acting(lmp)
    if lmp.extract_setting("molecule_flag"):
        for each in filter(len, (lmp.numpy.gather_bonds(), lmp.numpy.gather_angles())):
            members = np.asarray(each).reshape(len(each), -1)[:, 1:]
            others += [members[:, pair] for pair in combinations(range(members.shape[1]), 2)]
    bonded = np.concatenate(others)
    pairs = np.searchsorted(c.ids, np.concatenate([ids[np.column_stack([i, j])], bonded]))
    return Pairs(pairs[:, 0], pairs[:, 1], np.concatenate([gap, np.full(len(bonded), -np.inf)]))


def _acting(lmp: Any) -> list[Indices]:
    """IDs of the neighbours between which a force acts, or of all where a pair style hands out no forces of pairs."""
    lmp.command("compute faultgouge_i all property/local patom1 patom2")
    try:
        lmp.command("compute faultgouge_c all pair/local force")
        lmp.command("run 0 post no")
        acts = np.array(lmp.numpy.extract_compute("faultgouge_c", 2, 1)).ravel() != 0
    except Exception:
        lmp.command("uncompute faultgouge_c")
        lmp.command("run 0 post no")
        acts = None
    rows = lmp.numpy.extract_compute("faultgouge_i", 2, 2)
    pairs = np.zeros((0, 2), int) if rows is None else np.array(rows).reshape(-1, 2).astype(np.int64)
    return [pairs if acts is None else pairs[acts[: len(pairs)]]]


def _owners(c: Configuration, constraint: csr_array, pairs: Pairs, near: float, reach: int = 1) -> list[Indices]:
    """Which bodies are displaced together, a colour each: the body that each particle feels, by the particle that leads
    it, -1 if it feels none; shape (N,). No particle feels two bodies of a colour.

    A particle feels its neighbours; with a `reach` of 2, their neighbours, too.
    """
    count, moved, touch = len(c), constraint.tocoo(), pairs.gap < near
    particle, leader, shape = moved.row % count, moved.col % count, (count, count)
    i, j = pairs.i[touch], pairs.j[touch]
    ends = np.concatenate([i, j]), np.concatenate([j, i])
    neighbours = csr_array((np.ones(len(ends[0])), ends), shape=shape) + eye_array(count, format="csr")
    feels = csr_array((np.ones(len(leader)), (leader, particle)), shape=shape)
    for _ in range(reach):
        feels = feels @ neighbours
    free = np.bincount(particle, minlength=count) > 0
    rows = [row[free[row]] for row in np.split(feels.indices, feels.indptr[1:-1])]
    taken: list[set[int]] = [set() for _ in range(count)]
    owners: list[Indices] = []
    for body in np.flatnonzero([len(row) for row in rows]):
        used = set().union(*(taken[each] for each in rows[body]))
        colour = next(k for k in count_from(0) if k not in used)
        if colour == len(owners):
            owners.append(np.full(count, -1))
        owners[colour][rows[body]] = body
        for each in rows[body]:
            taken[each].add(colour)
    return owners


def _measure(
    lmp: Any, c: Configuration, constraint: csr_array, bodies: tuple[str, ...], force: float | None
) -> dict[str, Any]:
    """Fields of the configuration that concern K and C at rest, in a copy that may change.

    `constraint` is P of q = P Q, `bodies` are the commands of fix rigid, and `force` is the mean contact force, by
    which velocities are chosen; by default by the forces of the displacements. A NotTakenError if LAMMPS's forces are
    not functions of displacements and velocities of neighbours.
    """
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
    owners = _owners(c, constraint, pairs, 4 * step)
    stiffness = _derivative(by_place, owners, lengths)
    if stiffness.unexplained > LEAST_JUMP:
        farther = _owners(c, constraint, pairs, 4 * step, reach=2)
        other = _derivative(replace(by_place, settles=True), farther, lengths)
        if other.unexplained < 0.5 * stiffness.unexplained:
            owners, stiffness = farther, other
    if force is None:
        force = step * float(np.abs(stiffness.matrix.data).max(initial=0.0)) / SHARE_OF_OVERLAP
    by_velocity = replace(by_place, duration=None, sizes=(1.0,))
    speed = _speed(by_velocity, step / timestep, DASHPOT_FORCE * force)
    if speed == 0.0:
        damping = stiffness._replace(matrix=csr_array(stiffness.matrix.shape))
    else:
        damping = _derivative(by_velocity, owners, _sizes(speed, SHORTEST_VELOCITY * speed))
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
    return {
        "stiffness": stiffness.matrix, "damping": damping.matrix, "operator_error": float(error.max()), "jump": jump,
    }  # fmt: skip


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


def _derivative(probe: Probe, of_colours: list[Indices], sizes: list[float]) -> _Derivative:
    """-dF/dQ by steps of the first size, and by shorter ones where the forces of the first are not linear."""
    c, count = probe.configuration, len(probe.configuration)
    owners = [owner for owner in of_colours for _ in range(c.axes)]
    directions = np.zeros((len(owners), c.axes * count))
    for k, owner in enumerate(owners):
        directions[k, k % c.axes * count + np.unique(owner[owner >= 0])] = 1.0
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


NORMAL_PART = 1e-6
"""Part of a tangential force along the normal, as a share of all that is handed out: rounding leaves 1e-10 or less."""


class Still(NamedTuple):
    """Particles as they stand, without K and C: both are empty.

    `constraint` is P of q = P Q, which the configuration has only where P says more than which particles are free.
    `commands` and `fixes` are those of the instance, and so are `velocity` and `rotation`, shape (N, 3).
    """

    configuration: Configuration
    constraint: csr_array
    commands: Commands
    fixes: dict[str, str]
    velocity: Floats
    rotation: Floats


def configuration_by_differences(lmp: Any, still: Still) -> Configuration:
    """The configuration with K and C, of an instance on one rank.

    Its contacts are those of pairs that touch, with their forces as far as LAMMPS hands them out.
    """
    made, lines = still.configuration, still.commands.fixes
    bodies = tuple(lines[name] for name, style in still.fixes.items() if without_suffix(style) in BODIES)
    work = partial(_measure, lmp, made, still.constraint, bodies, force_scale(made) or None)
    return derive_frozen(made, **in_a_copy(work))


def still_particles(lmp: Any, given: Commands | None) -> Still:
    """The particles of an instance, and what moves or holds them."""
    files = open_files()
    columns = ["dx dy dz force p1 p2 p3", "dx dy dz force", "dx dy dz"]
    while True:  # not every pair style hands all of these out
        try:
            commands, fixes, found = in_a_copy(partial(look, lmp, given, files, columns[0]))
            break
        except NotTakenError:
            columns.pop(0)
            if not columns:
                raise
    count, dimension = len(found["id"]), lmp.extract_setting("dimension")
    if count == 0:
        raise NotTakenError("This LAMMPS has no particles.")
    members = members_of(found)
    lines = {name: line for name, line in commands.fixes.items() if name in members}
    moved = mobility(lines, members, found["rmass"], dimension)
    empty = csr_array(moved.constraint.shape)
    made = Configuration(
        **particles_of(lmp, found, moved.free, moved.factor),
        contacts=_forces_of_pairs(found, box_of(lmp)[0], commands.style), stiffness=empty, damping=empty,
        wall_force=found["at walls"], constraint=moved.needed,
    )  # fmt: skip
    total = np.stack([found["f"], found["torque"]], axis=1)
    load = np.where(made.free[:, None, None], total, 0.0) - made.contact_force
    return Still(derive_frozen(made, load=load), moved.constraint, commands, fixes, found["v"], found["omega"])


def _forces_of_pairs(found: Arrays, box: Floats, style: str) -> LinearisedContacts:
    """Pairs that touch, with their forces alone: derivatives are zero, and no bound is known."""
    pairs = contacts_of_pairs(found, box)
    count, columns = pairs.forces.shape
    if columns == 0:
        pairs = OneLaw(pairs.who, {name: values[:0] for name, values in pairs.geometry.items()}, np.zeros((0, 4)))
        count = 0
    none, still = np.zeros(count), np.zeros((count, 3))
    tangential = pairs.forces[:, 1:4] if columns >= 4 else still
    along = np.abs(np.einsum("ca,ca->c", tangential, pairs.geometry["normal"]))
    if np.any(along > NORMAL_PART * np.abs(pairs.forces).sum(axis=1)):
        if touch_twice(pairs.geometry["i"], pairs.geometry["j"]):
            raise NotTakenError(f"The packing cannot rest: {TWICE}.")
        tangential = still  # this pair style hands out something else
    made = LinearisedContacts(
        **pairs.geometry, lever_arm=pairs.geometry["slip_arm"], lever_slope=none, normal_force=pairs.forces[:, 0],
        tangential_force=tangential, normal_stiffness=none, tangential_stiffness=none, closing=still, parting=still,
        friction=np.full(count, np.inf), sliding=np.zeros(count, bool), normal_dashpot=none, tangential_dashpot=none,
        viscous_slider=np.full(count, style != OWN),
    )  # fmt: skip
    return made.chosen(made.normal_force != 0)
