r"""K and C of a live LAMMPS by differences of its own forces, whatever exerts them.

With q the coordinates of :mod:`~faultgouge.analysis.configuration` and F the forces,

.. math::

    K e_k = -\frac{F(h e_k) - F(-h e_k)}{2h} + O(h^2), \qquad C e_k = -\frac{F(v e_k) - F(-v e_k)}{2v} .

All of it happens in a copy of the process. A displacement is one step of LAMMPS, so slow that dashpots exert nothing:
histories of contacts follow as in any step. A velocity is a run of zero steps, in which histories do not change. Before
each, positions and, by fix keep/histories of the plugin, histories are put back to the bit. Particles without a common
neighbour are displaced together (colours), so that the number of displacements depends on the number of neighbours, not
of particles (Curtis, Powell and Reid, J. Inst. Math. Appl. 13, 117, 1974).

**Error.** Slopes of both sides are extrapolated from the steps h/2 and h. A displacement and a velocity of all
particles at once in random directions are then compared with K q and C v, and the difference is the error. In some
models (mdr) a particle feels the neighbours of its neighbours: where the error shows such forces, particles are
displaced together only if they are farther apart.

**One-sided derivatives.** A contact at Coulomb's bound, one that is about to open or close, and a law with two
derivatives have another derivative forwards than backwards. K is the mean of both, and `jump` their difference. The
forces of two displacements do not add up there, so that an error there is no reason to refuse K.

**Weak contacts.** Within a displacement that suits the others a contact whose force is far below the mean one may open
or slide. So the random direction is taken at the shortest displacement, too. Where the forces then differ from K q, or
are not linear, shorter displacements are tried.

**Bodies.** q = P Q: column k of K belongs to a displacement of Q_k, and its rows are sums of the forces on the
coordinates that each Q moves.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array, eye_array

from ...analysis import Configuration, LinearisedContacts
from ...analysis.arrays import Floats, Indices, derive_frozen
from ..lammps.instance import load_plugin
from .balance import force_scale
from .configuration_by_laws import contacts_of_pairs
from .granular_commands import BODIES, HOLDS, OWN, Commands, NotTakenError, translating_bodies
from .lammps_arrays import on_coordinates, owned_array, rows_of, set_velocity
from .look_in_a_copy import in_a_copy, open_files, quieten, styles_of
from .looks import Arrays, Looked, hold_still, look, particles_of

LENGTH_OF_STEP = 1e12
"""Length of a step in which particles are displaced, in time steps: dashpots exert nothing, however strong."""

SHARE_OF_OVERLAP, FREE_DISPLACEMENT = 0.003, 1e-7
"""A displacement as a share of the smallest overlap: the third derivative of Hertz's force, which the extrapolation
leaves, is 1e-7 of its first there; and as a share of a radius where no particles overlap."""

LEAST_OF_COORDINATE, LEAST_OF_OVERLAP = 2e-9, 3e-4
"""Smallest displacement: as a share of the largest coordinate, whose rounding leaves 1e-7 of a difference; and of the
median overlap: `granular` does not turn a history that has left its plane by less than 1e-10 of Coulomb's bound."""

NEXT_SIZE, SHORTEST_OF_COORDINATE, SHORTEST_OF_OVERLAP = 0.03, 1e-11, 1e-6
"""The next shorter displacement, where one is needed, as a share of the one before; and the shortest one. A contact of
cohesive particles may bear a force 1e-5 of the mean one, and slide within 1e-7 of an overlap."""

DASHPOT_FORCE, SHORTEST_VELOCITY = 1e-4, 1e-6
"""Force of dashpots as a share of the mean contact force, and the lowest velocity as a share of the first one: contacts
below Coulomb's bound do not reach the bound."""

LEAST_JUMP = 1e-3
"""Jump of a derivative, as a share of the largest entry, from which on two sides are said to differ."""

SHORTEST_ERROR, LARGEST_OPERATOR_ERROR = 1e-2, 0.1
"""Error, as a share of the largest force, of the shortest displacement from which on shorter ones are tried, and beyond
which the differences describe nothing."""

GAP_OF_NEIGHBOURS = 1e-3
"""Gap between particles, as a share of the largest diameter, up to which they are looked for."""


def configuration_by_differences(lmp: Any, still: Configuration, looked: Looked) -> Configuration:
    """The configuration with K and C, of particles as they stand."""
    work = partial(_measure, lmp, still, looked.commands.fixes)
    return derive_frozen(still, **in_a_copy(work))


def still_particles(lmp: Any, given: Commands | None) -> tuple[Configuration, Looked]:
    """The particles of an instance as they stand, with empty K and C, and contacts of pairs that touch, with their
    forces as far as LAMMPS hands them out; and the look at it."""
    looked = in_a_copy(partial(look, lmp, given, open_files(), whole=True))
    found, fields = looked.found, particles_of(lmp, looked.found, looked.moved)
    empty = csr_array(2 * (len(found["id"]) * (6 if fields["dimension"] == 3 else 3),))
    made = Configuration(
        **fields, stiffness=empty, damping=empty, wall_force=found["at walls"],
        contacts=_forces_of_pairs(found, looked.commands.style),
    )  # fmt: skip
    total = np.stack([found["f"], found["torque"]], axis=1)
    return derive_frozen(made, load=np.where(made.free[:, None, None], total, 0.0) - made.contact_force), looked


def _forces_of_pairs(found: Arrays, style: str) -> LinearisedContacts:
    """Pairs that touch, with their forces alone: derivatives are zero, and no bound is known."""
    pairs = contacts_of_pairs(found)
    forces, count = pairs.forces, len(pairs.forces)
    none, still = np.zeros(count), np.zeros((count, 3))
    along = np.abs(np.einsum("ca,ca->c", forces[:, 1:], pairs.geometry["normal"]))
    if np.any(along > 1e-6 * np.abs(forces).sum(axis=1)):  # rounding leaves 1e-10 of a tangential force
        forces[:, 1:] = 0.0  # this pair style hands out something else
    made = LinearisedContacts(
        **pairs.geometry, lever_arm=pairs.geometry["slip_arm"], lever_slope=none, normal_force=forces[:, 0],
        tangential_force=forces[:, 1:], normal_stiffness=none, tangential_stiffness=none, closing=still, parting=still,
        friction=np.full(count, np.inf), sliding=np.zeros(count, bool), normal_dashpot=none, tangential_dashpot=none,
        viscous_slider=np.full(count, style != OWN),
    )  # fmt: skip
    return made.chosen(made.normal_force != 0)


def _measure(lmp: Any, c: Configuration, lines: dict[str, str]) -> dict[str, Any]:
    """Fields of the configuration that concern K and C at rest, in a copy that may change; a NotTakenError if LAMMPS's
    forces are not functions of displacements and velocities of neighbours."""
    lmp.command("log none")
    _hold_still(lmp, lines)
    rows, timestep = rows_of(lmp, c), float(lmp.extract_global("dt"))
    bodies = csr_array(diags_array(1.0 * c.coordinate_free)) if c.constraint is None else c.constraint
    place = {name: np.array(owned_array(lmp, name)[rows]) for name in ("x", "image")}
    by_place = Probe(lmp, c, bodies, place, LENGTH_OF_STEP * timestep, (0.5, 1.0))
    lmp.command(f"timestep {by_place.duration:.17g}")
    lmp.command("thermo_style custom step")
    by_place.forces(np.zeros(c.coordinates))
    i, j, gap = _neighbours(lmp, c)
    # a step far below the smallest overlap and gap, as far as rounding allows
    largest, gaps = float(np.abs(c.position).max()), gap[np.isfinite(gap)]
    usual, least = float(np.median(-gaps[gaps < 0])) if np.any(gaps < 0) else 0.0, LEAST_OF_COORDINATE * largest
    step = max(least, FREE_DISPLACEMENT * float(c.radius.min()))
    if usual:
        step = max(SHARE_OF_OVERLAP * float(np.abs(gaps).min()), least, LEAST_OF_OVERLAP * usual)
        step = min(step, max(SHARE_OF_OVERLAP * usual, least))
    lengths = _sizes(step, max(SHORTEST_OF_COORDINATE * largest, SHORTEST_OF_OVERLAP * usual))
    near = gap < 4 * step
    owners = _owners(c, bodies, i[near], j[near])
    stiffness = _derivative(by_place, owners, lengths)
    if stiffness.unexplained().max() > LEAST_JUMP:
        farther = _owners(c, bodies, i[near], j[near], reach=2)
        other = _derivative(replace(by_place, settles=True), farther, lengths)
        if other.unexplained().max() < 0.5 * stiffness.unexplained().max():
            owners, stiffness = farther, other
    # a velocity at which dashpots exert a small share of the mean force, or of that of an overlap if none is known
    force = force_scale(c) or step * float(np.abs(stiffness.matrix.data).max(initial=0.0)) / SHARE_OF_OVERLAP
    by_velocity, direction, speed = replace(by_place, duration=None, sizes=(1.0,)), _random(c, 1), step / timestep
    for _ in range(3):  # a velocity far too large has contacts slide
        change = float(np.abs(by_velocity.forces(speed * direction) - by_velocity.rest).max())
        if change <= np.finfo(float).eps * np.abs(by_velocity.rest).max():
            damping = stiffness._replace(matrix=csr_array(stiffness.matrix.shape))
            break
        speed *= DASHPOT_FORCE * force / change
    else:
        damping = _derivative(by_velocity, owners, _sizes(speed, SHORTEST_VELOCITY * speed))
    both = _Derivative(stiffness.matrix, *(np.maximum(a, b) for a, b in zip(stiffness[1:], damping[1:], strict=True)))
    unexplained = both.unexplained()
    worst = int(np.argmax(unexplained))
    if unexplained[worst] > LARGEST_OPERATOR_ERROR:
        there = ", ".join(f"{x:.6g}" for x in c.position[worst])
        others = int(np.sum(unexplained > LARGEST_OPERATOR_ERROR)) - 1
        raise NotTakenError(
            f"K and C by differences of forces are {unexplained[worst]:.2g} of their largest entry from the forces of "
            f"a displacement of all particles at particle {c.ids[worst]} at ({there})"
            f"{f', and at {others} more' if others else ''}: contacts there are about to open, to close or to slide, "
            "or something couples particles that are no neighbours; run on with drag under a load that presses them."
        )
    given = {"stiffness": stiffness.matrix, "damping": damping.matrix}
    return given | {"operator_error": float(both.error.max()), "jump": both.jump}


def _hold_still(lmp: Any, lines: dict[str, str]) -> None:
    """Leave what exerts forces in a copy alone: no output, no drag, and nothing that moves or holds particles by
    itself; what has a velocity moves by it. Frozen particles, whose masses dashpots feel, stay. Histories are kept."""
    quieten(lmp, drag=True)
    fixes, dimension = styles_of(lmp).fixes, lmp.extract_setting("dimension")
    hold_still(lmp, fixes, lines)
    groups = set[str]()
    for name, style in fixes.items():
        if style in BODIES:
            groups |= translating_bodies(lines[name], dimension).keys()
        elif style in HOLDS and style != "freeze":
            lmp.command(f"unfix {name}")
    if groups:
        lmp.command(f"group faultgouge_m subtract all {' '.join(sorted(groups))}")
    lmp.command(f"fix faultgouge_moves {'faultgouge_m' if groups else 'all'} nve/noforce")
    load_plugin(lmp)
    lmp.command("fix faultgouge_h all keep/histories")


def _neighbours(lmp: Any, c: Configuration) -> tuple[Indices, Indices, Floats]:
    """Pairs that touch or nearly touch, others between which a force acts, and pairs of bonds: their indices
    and the gap between their surfaces, shape (P,) each, minus infinity where something else than a contact may act."""
    from scipy.spatial import cKDTree  # which takes as long to import as all of `scipy.sparse`

    # LAMMPS has ghosts of particles across a periodic boundary
    every = [np.array(lmp.numpy.extract_atom(name)) for name in ("id", "x", "radius")]
    ids, x, radius = (each[: lmp.extract_setting("nlocal") + lmp.extract_setting("nghost")] for each in every)
    reach = 2 * float(radius.max()) * (1 + GAP_OF_NEIGHBOURS)
    i, j = cKDTree(x).query_pairs(reach, output_type="ndarray").T
    gap = np.linalg.norm(x[i] - x[j], axis=1) - radius[i] - radius[j]
    lmp.command("compute faultgouge_i all property/local patom1 patom2")
    try:
        lmp.command("compute faultgouge_c all pair/local force")
        lmp.command("run 0 post no")
        acts = np.array(lmp.numpy.extract_compute("faultgouge_c", 2, 1)).ravel() != 0
    except Exception:  # a pair style that hands out no forces of pairs
        lmp.command("uncompute faultgouge_c")
        lmp.command("run 0 post no")
        acts = None
    rows = lmp.numpy.extract_compute("faultgouge_i", 2, 2)
    pairs = np.zeros((0, 2), np.int64) if rows is None else np.array(rows).reshape(-1, 2).astype(np.int64)
    others = [pairs if acts is None else pairs[acts[: len(pairs)]]]
    if lmp.extract_setting("molecule_flag") and len(bonds := np.asarray(lmp.numpy.gather_bonds())):
        others.append(bonds.reshape(len(bonds), -1)[:, 1:])
    joined = np.concatenate(others)
    first, second = np.searchsorted(c.ids, np.concatenate([ids[np.column_stack([i, j])], joined])).T
    return first, second, np.concatenate([gap, np.full(len(joined), -np.inf)])


def _owners(c: Configuration, constraint: csr_array, i: Indices, j: Indices, reach: int = 1) -> list[Indices]:
    """Which bodies are displaced together, a colour each: the body that each particle feels, by the particle that leads
    it, -1 if it feels none; shape (N,). No particle feels two bodies of a colour.

    A particle feels its neighbours, the pairs i and j; with a `reach` of 2, their neighbours, too.
    """
    count, moved = len(c), constraint.tocoo()
    particle, leader, shape = moved.row % count, moved.col % count, (count, count)
    ends = np.concatenate([i, j]), np.concatenate([j, i])
    neighbours = csr_array((np.ones(len(ends[0])), ends), shape=shape) + eye_array(count, format="csr")
    feels = csr_array((np.ones(len(leader)), (leader, particle)), shape=shape)
    for _ in range(reach):
        feels = feels @ neighbours
    free = np.bincount(particle, minlength=count) > 0
    owners: list[Indices] = []
    for body, row in enumerate(np.split(feels.indices, feels.indptr[1:-1])):
        felt = row[free[row]]
        if len(felt):
            colour = next((k for k, owner in enumerate(owners) if np.all(owner[felt] < 0)), len(owners))
            if colour == len(owners):
                owners.append(np.full(count, -1))
            owners[colour][felt] = body
    return owners


@dataclass(frozen=True)
class Probe:
    """Forces of a LAMMPS, which is a copy, along displacements in a step of a `duration`, or velocities if it is None.

    `place` has positions and images of the particles at rest, by their IDs; `sizes` are the shares of a displacement at
    which forces are taken. If it `settles`, a step without motion follows each one, for models that act one step late.
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

    def slope(self, q: Floats, size: float) -> Floats:
        """dF along a unit direction over the size of the displacement or velocity, shape (3, axes N): the mean of the
        slopes ahead and behind, extrapolated to a step of zero by Lagrange's polynomial; the jump from one to the
        other; and the difference of the means at the largest and the smallest size."""
        sides, means = np.zeros((2, len(self.rest))), []
        for share in self.sizes:
            step = share * size
            slopes = np.array([self.forces(way * step * q) - self.rest for way in (1, -1)]) / step
            sides += slopes * np.prod([other / (other - share) for other in self.sizes if other != share])
            means.append((slopes[0] - slopes[1]) / 2)
        return np.array([(sides[0] - sides[1]) / 2, sides[0] + sides[1], means[-1] - means[0]])


def _by_shorter_steps(
    probe: Probe, q: Floats, owner: Indices, sizes: list[float], differs: NDArray[np.bool_], same: float
) -> Floats:
    """The slope by ever shorter steps, the longest first.

    A shorter step is taken for all particles that feel a body where it makes the forces far more linear, or where it is
    linear and the shortest steps exert other forces than K says on a particle, which `differs`, shape (N,). A shorter
    step that says the same to `same` ends the search.
    """
    probe = replace(probe, sizes=(0.5, 1.0))  # how far a force is from a linear one
    bodies, seen = np.tile(owner, len(q) // len(owner)), np.zeros(len(owner) + 1, np.bool_)  # the last stands for none
    seen[owner[differs & (owner >= 0)]] = True
    best = last = probe.slope(q, sizes[0])
    for size in sizes[1:]:
        slope = probe.slope(q, size)
        uneven = np.zeros((2, len(owner) + 1))
        for most, each in zip(uneven, (best, slope), strict=True):
            np.maximum.at(most, bodies, np.abs(each[1:]).max(axis=0))
        better = (uneven[1] < 0.5 * uneven[0]) | (seen & (uneven[1] <= same))
        best = np.where(better[bodies], slope, best)
        if not seen.any() and np.abs(slope - last)[:2].sum(axis=0).max() <= same:
            break
        last = slope
    return best


class _Derivative(NamedTuple):
    """-dF/dQ; jump and error are shares of its largest entry, by particle, shape (N,)."""

    matrix: csr_array
    jump: Floats
    error: Floats

    def unexplained(self) -> Floats:
        """Errors where no force is one-sided."""
        return np.where(self.jump > 0, 0.0, self.error)


def _sizes(first: float, last: float) -> list[float]:
    """Ever shorter displacements, or lower velocities, from the first to the last one."""
    count = max(0, int(np.ceil(np.log(last / first) / np.log(NEXT_SIZE))))
    return [float(each) for each in np.geomspace(first, last, count + 1)] if count else [first]


def _random(c: Configuration, seed: int) -> Floats:
    return np.asarray(c.coordinate_free * np.random.Generator(np.random.PCG64(seed)).uniform(-1, 1, c.coordinates))


def _derivative(probe: Probe, of_colours: list[Indices], sizes: list[float]) -> _Derivative:
    """-dF/dQ by steps of the first size, and by shorter ones where the forces of the first are not linear."""
    c, count, on_bodies = probe.configuration, len(probe.configuration), (probe.constraint != 0).T
    owners, axis, random = np.repeat(of_colours, c.axes, axis=0), count * np.arange(c.axes), _random(c, 0)
    directions = np.zeros((len(owners), c.axes * count))
    for k, owner in enumerate(owners):
        directions[k, axis[k % c.axes] + np.unique(owner[owner >= 0])] = 1.0
    which, felt = np.nonzero(owners >= 0)
    rows = axis[:, None] + felt
    columns = np.broadcast_to(axis[which % c.axes] + owners[which, felt], rows.shape)

    def assemble() -> tuple[csr_array, Floats]:
        """The matrix of the slopes along all directions, and its jumps."""
        entries = (-found[which, 0, rows].ravel(), (rows.ravel(), columns.ravel()))
        matrix, jump = csr_array(on_bodies @ coo_array(entries, shape=on_bodies.shape).tocsr()), np.zeros(count)
        matrix.eliminate_zeros()
        matrix.sort_indices()
        np.maximum.at(jump, felt, np.abs(found[which, 1, rows]).max(axis=0))
        largest = np.abs(matrix.data).max(initial=0.0)
        return matrix, np.where(jump > LEAST_JUMP * largest, jump, 0.0) / (largest or 1.0)

    def error(slope: Floats) -> Floats:
        """Difference of the forces along the random direction from those of the matrix, over the largest; (N,)."""
        forces = on_bodies @ slope[0]
        most = float(np.abs(forces).max(initial=0.0)) or 1.0
        return np.asarray(np.abs(forces + matrix @ random).reshape(c.axes, -1).max(axis=0) / most)

    found = np.array([probe.slope(q, sizes[0]) for q in directions])
    checks = [probe.slope(random, size) for size in (sizes[0], sizes[-1])]
    matrix, jump = assemble()
    differs = error(checks[1]) > SHORTEST_ERROR
    same = LEAST_JUMP * max(np.abs(found[:, 0]).max(), np.abs(checks[0][0]).max())
    rough = (np.abs(found[:, 1:]).max(axis=(1, 2)) > same) | np.any((owners >= 0) & differs, axis=1)
    for each in np.flatnonzero(rough):
        found[each] = _by_shorter_steps(probe, directions[each], owners[each], sizes, differs, same)
    matrix, jump = assemble()
    return _Derivative(matrix, jump, np.minimum(*map(error, checks)))
