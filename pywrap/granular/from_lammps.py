r"""A Snapshot of a live LAMMPS with its own granular styles, or ours: any packing, as it stands.

What LAMMPS says of each contact (compute pair/local, fix wall/gran ... contacts) is its normal, its overlap and both
forces, without dashpots, since the look is taken at rest (:mod:`~faultgouge.pywrap.granular.lammps_arrays`). The laws
are measured (:mod:`~faultgouge.pywrap.granular.contact_law_measurement`), with which

.. math::

    f_n' = p\, f_n/\delta, \qquad k_t' = k_t (R\delta)^q, \qquad \mathbf b = \beta\, \mathbf f_t/\delta,

so that the slip itself is not needed. What the styles have was found to be

=====================================  =====  =====  =============  =============
style                                  p      q      beta, closing  beta, parting
=====================================  =====  =====  =============  =============
gran/hooke/history; linear_history     1      0      0              0
gran/hertz/history; mindlin            3/2    1/2    1/2            1/2
mindlin/force                          3/2    1/2    0              0
mindlin_rescale                        3/2    1/2    1/2            1
mindlin_rescale/force                  3/2    1/2    0              1/2
=====================================  =====  =====  =============  =============

and hooke with a mindlin model, or hertz with linear_history, are as their parts. A contact at Coulomb's bound has two
derivatives, that of slipping on and that of sticking on the way back. A small vibration shakes such a contact down to
elastic, so that it sticks by default.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...analysis import LinearisedContacts, MindlinLaw, Snapshot
from ...analysis.packing.arrays import Floats, Indices
from ...analysis.packing.snapshot import PER_CONTACT, WALL, linearise_contacts
from .contact_law_measurement import MeasuredLaw, State, measure_laws
from .granular_commands import OWN, Commands, SnapshotError, check_fixes, check_pair, read_commands, without_suffix
from .instance_queries import communicator, log_of, only_log, styles_of
from .lammps_arrays import Arrays, arrays_at_rest
from .look_in_a_copy import can_copy, in_a_copy, quieten
from .look_in_place import in_place

BALANCE = 1e-4
"""Share of the mean contact force that may be out of balance: then the motion is that of a packing which comes to rest
elsewhere, and K says nothing of it."""

AGREES = 1e-6
"""Relative difference of the normal forces of LAMMPS from those of its commands, besides that of roundings."""

ROUNDING = 1e-14
"""Rounding of an overlap, as a share of the distance of two centres: some units in the last place of coordinates that
may be ten times as large."""

INTEGRATORS = {"nve/sphere": 0.4, "nve/disc": 1.0, "overdamped/disc": 1.0}
"""Fixes that move particles and turn them, with I/(m R^2)."""


Styles = tuple[str, dict[str, str], str, str]
KnownLaws = dict[tuple[Any, ...], MeasuredLaw]
"""By their commands, and the two types or the ID of a wall's fix."""


def from_lammps(
    lmp: Any, commands: Iterable[str] | None = None, *, slides: bool = False, balance: float = BALANCE
) -> Snapshot:
    """The packing of a LAMMPS instance with its linearised contacts, as it stands.

    The instance does not change: its next run is the same to the bit as without the look, on any number of ranks, and
    with the threads of `package omp`.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance: disks or spheres with gran/hooke/history, gran/hertz/history, granular or mindlin/smooth, between
        planes of fix wall/gran ... contacts or in a periodic box, at rest. On several ranks all of them make this call.
    commands : iterable of str, optional
        The lines pair_style, pair_coeff, fix wall/gran and fix nve/sphere of the deck; by default those in the
        instance's log.
    slides : bool
        Whether contacts at Coulomb's bound slide; they stick by default.
    balance : float
        Residual that is allowed, as a share of the mean contact force.

    Returns
    -------
    Snapshot

    Raises
    ------
    SnapshotError
        If the packing cannot be taken: it moves, or has rolling or twisting friction, cohesion, no history, walls
        without contacts, moving or curved walls, or bodies; or the commands are not those of the instance.
    """
    return take_snapshot(lmp, commands, {}, slides=slides, balance=balance)


def take_snapshot(
    lmp: Any, commands: Iterable[str] | None, laws: KnownLaws, *, slides: bool, balance: float
) -> Snapshot:
    """What :func:`from_lammps` does. Laws that are known are not measured again, and those that are new are added."""
    given = None if commands is None else read_commands(commands)
    if can_copy(lmp):
        styles, read, found = in_a_copy(lambda: _look(lmp, given, copied=True))
    else:
        styles, read, found = _look(lmp, given, copied=False)
    snapshot = _snapshot(lmp, styles, read, found, laws)
    force = snapshot.contacts.normal_force.mean() if len(snapshot.contacts) else 0.0
    if snapshot.residual > balance * force:
        raise SnapshotError(
            f"The packing moves: its residual is {snapshot.residual / force:.3g} of the mean contact force, and "
            f"{balance:g} is allowed; run on with drag (fix viscous) until it rests, or allow more by balance."
        )
    return snapshot.with_sliding() if slides else snapshot


def _look(lmp: Any, given: Commands | None, *, copied: bool) -> tuple[Styles, Commands, Arrays]:
    """Styles, commands, and the arrays of all ranks."""
    world = communicator(lmp)
    if given is None:
        lines = log_of(lmp) if copied else world.bcast(only_log() if world.rank == 0 else None, root=0)
        if lines is None:
            raise SnapshotError(
                "This LAMMPS has no log to read its commands from: give the lines pair_style, pair_coeff, fix "
                "wall/gran and fix nve/sphere of the deck as commands=[...]."
            )
        given = read_commands(lines, log=True)
    elif copied:
        lmp.command("log none")
    styles = styles_of(lmp)
    _check(lmp, styles, given)
    if copied:
        quieten(lmp)
    groups = _groups(styles[1], given)
    walls = tuple(
        name for name, style in styles[1].items() if without_suffix(style) in ("wall/gran", "wall/mindlin/smooth")
    )
    own = given.style == OWN
    columns = "dx dy dz force p1 p2 p3" if not own else "dx dy dz force p1 p3"

    def work() -> Arrays:
        return arrays_at_rest(lmp, groups, walls, columns)

    mine = work() if copied else in_place(lmp, work, groups)
    every = world.allgather(mine)
    return styles, given, {name: _join_ranks([each[name] for each in every]) for name in mine}


def _join_ranks(parts: list[Floats]) -> Floats:
    """Rows of all ranks; those of a rank that has none may have another number of columns."""
    kept = [part for part in parts if len(part)] or parts[:1]
    return np.concatenate(kept)


def _check(lmp: Any, styles: Styles, commands: Commands) -> None:
    pair, fixes, units, atom = styles
    if without_suffix(pair) != commands.style:
        raise SnapshotError(
            f"The commands have pair_style {commands.style}, and the instance has {pair}: give the lines pair_style, "
            "pair_coeff, fix wall/gran and fix nve/sphere of the deck as commands=[...]."
        )
    if not lmp.extract_setting("radius_flag") or "body" in atom or "ellipsoid" in atom or "bpm" in atom:
        raise SnapshotError(f"atom_style {atom} has no disks and spheres alone: use atom_style sphere.")
    if lmp.extract_global("ftm2v") != 1.0:
        raise SnapshotError(f"In units {units} force is not mass times acceleration: use lj, si, cgs, micro or nano.")
    check_pair(commands, lmp.available_styles("pair"))
    check_fixes(fixes, commands)
    for name, style in fixes.items():
        plain = without_suffix(style)
        if plain in INTEGRATORS and name not in commands.fixes:
            raise SnapshotError(f"The commands have no line of fix {name} {style}: give the line that the deck has.")
        if (plain.startswith("nve") or plain.startswith(("nvt", "npt", "nph"))) and plain not in INTEGRATORS:
            raise SnapshotError(f"fix {name} {style} does not turn particles by their contacts: use fix nve/sphere.")


def _groups(fixes: dict[str, str], commands: Commands) -> dict[str, str]:
    """Groups that move, by the numbers of their fixes, and those that are frozen."""
    found = {}
    for number, (name, style) in enumerate(fixes.items()):
        plain = without_suffix(style)
        line = commands.fixes.get(name, "").split()
        if plain in INTEGRATORS:
            found[f"moves{number}"] = line[2]
        elif plain == "freeze":
            if not line:
                raise SnapshotError(f"The commands have no line of fix {name} freeze: give the line that the deck has.")
            found[f"freeze{number}"] = line[2]
    return found


def _snapshot(lmp: Any, styles: Styles, commands: Commands, found: Arrays, laws: KnownLaws) -> Snapshot:
    order = np.argsort(found["id"], kind="stable")
    per_atom = [name for name in found if name not in ("contacts", "partners")]
    found = found | {name: found[name][order] for name in per_atom}
    count, dimension = len(order), lmp.extract_setting("dimension")
    if count == 0:
        raise SnapshotError("This LAMMPS has no particles.")
    free, frozen, factor = _mobility(styles[1], commands, found)
    mass = found["rmass"]
    low, high, xy, yz, xz, periodic, _ = lmp.extract_box()
    size = np.subtract(high, low)
    made = Snapshot(
        dimension=dimension,
        position=found["x"][:, :dimension],
        radius=found["radius"],
        mass=mass,
        inertia=factor * mass * found["radius"] ** 2,
        contacts=_Contacts(found, commands, styles, lmp.extract_setting("ntypes"), frozen, laws).all(),
        box=np.array([[size[0], 0, 0], [xy, size[1], 0], [xz, yz, size[2]]]),
        origin=np.array(low),
        periodic=np.array(periodic, dtype=bool),
        load=np.zeros((count, 2, 3)),
        free=free,
        ids=found["id"].astype(np.int64),
        kind=found["type"].astype(np.int64),
    )
    total = np.stack([found["f"], found["torque"]], axis=1)
    load = np.where(free[:, None, None], total - made.contact_force, -made.contact_force)
    return made.loaded_by(load)


def _mobility(
    fixes: dict[str, str], commands: Commands, found: Arrays
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Floats]:
    """Which particles are free, which are frozen, and I/(m R^2) of each."""
    count = len(found["id"])
    frozen, free, factor = np.zeros(count, bool), np.zeros(count, bool), np.full(count, 0.4)
    for number, (name, style) in enumerate(fixes.items()):
        plain, words = without_suffix(style), commands.fixes.get(name, "").split()
        if f"moves{number}" in found:
            free |= found[f"moves{number}"]
            own = 0.5 if plain == "nve/sphere" and "disc" in words else INTEGRATORS[plain]
            if plain != "nve/sphere":
                own = float(words[4 if plain == "nve/disc" else 5])
            factor[found[f"moves{number}"]] = own
        elif f"freeze{number}" in found:
            frozen |= found[f"freeze{number}"]
    free &= ~frozen
    if not free.any():
        raise SnapshotError(
            "Nothing moves the particles: give the line of fix nve/sphere, or set it up, so that it is known which of "
            "them are free and what their moments of inertia are."
        )
    return free, frozen, factor


class _Contacts:
    """The contacts of a look, with the laws that LAMMPS has for them."""

    def __init__(
        self,
        found: Arrays,
        commands: Commands,
        styles: Styles,
        types: int,
        frozen: NDArray[np.bool_],
        laws: KnownLaws,
    ) -> None:
        self.found, self.commands, self.types, self.units, self.laws = found, commands, types, styles[2], laws
        self.radius, self.mass = found["radius"], np.where(frozen, np.inf, found["rmass"])
        self.kind = found["type"].astype(np.int64)
        self.walls = {name.removeprefix("wall "): rows for name, rows in found.items() if name.startswith("wall ")}

    def all(self) -> LinearisedContacts:
        """Contacts between particles, then those with each wall."""
        if self.commands.style == OWN:
            parts = [self._own_pairs(), *(self._own_floor(name, rows) for name, rows in self.walls.items())]
        else:
            parts = self._linearise_by_measured_laws()
        values = {name: np.concatenate([getattr(part, name) for part in parts]) for name in PER_CONTACT}
        return LinearisedContacts(**values)

    def _pairs(self) -> tuple[Indices, Indices, Floats, Floats, Floats, Floats]:
        """Partners, branch vectors as normal and distance, overlaps, and rows of numbers of all pairs."""
        rows, partners = self.found["contacts"], self.found["partners"]
        if not len(rows) or rows.shape[1] < 6:
            rows, partners = np.zeros((0, 7)), np.zeros((0, 2))
        i, j = np.searchsorted(self.found["id"], partners).T
        if np.any(i == j):
            raise SnapshotError(
                f"Particle {int(partners[i == j][0, 0])} touches its own periodic image: take a box that is wider."
            )
        distance = np.linalg.norm(rows[:, :3], axis=1)
        overlap = self.radius[i] + self.radius[j] - distance
        return i, j, rows[:, :3] / distance[:, None], distance, overlap, rows[:, 3:]

    def _wall(self, rows: Floats) -> tuple[Indices, Floats, Floats, Floats]:
        """Particles that touch a wall, normals, overlaps and forces."""
        i = np.flatnonzero(rows[:, 0] > 0)
        branch = self.found["x"][i] - rows[i, 4:7]
        axis = np.argmax(np.abs(branch), axis=1)
        normal = np.zeros_like(branch)
        distance = branch[np.arange(len(i)), axis]
        normal[np.arange(len(i)), axis] = np.sign(distance)
        return i, normal, self.radius[i] - np.abs(distance), rows[i, 1:4]

    def _linearise_by_measured_laws(self) -> list[LinearisedContacts]:
        pairs, walls = self._pairs_by_types(), self._walls()
        groups: dict[Any, _OneLaw] = {**pairs, **walls}
        # a law is that of its commands, which a user may change
        keys = {name: (*self.commands.pair, self.commands.fixes.get(name), name) for name in groups}
        new = measure_laws(
            self.commands,
            self.units,
            self.types,
            {types: each.median_state() for types, each in pairs.items() if keys[types] not in self.laws},
            [(name, each.median_state()) for name, each in walls.items() if keys[name] not in self.laws],
        )
        self.laws.update({keys[name]: law for name, law in new.items()})
        return [_by_law(self.laws[keys[name]], group) for name, group in groups.items()] or [_none()]

    def _pairs_by_types(self) -> dict[tuple[int, int], "_OneLaw"]:
        """Contacts between particles by their two types, the smaller first."""
        i, j, normal, distance, overlap, rows = self._pairs()
        types = np.sort(np.stack([self.kind[i], self.kind[j]], axis=1), axis=1)
        found = {}
        for first, second in np.unique(types, axis=0).tolist():
            chosen = np.flatnonzero(np.all(types == (first, second), axis=1))
            p, q = i[chosen], j[chosen]
            with np.errstate(divide="ignore"):
                effective = 1 / (1 / self.mass[p] + 1 / self.mass[q])
            found[first, second] = _OneLaw(
                f"contacts of types {first} and {second}",
                i=p,
                j=q,
                normal=normal[chosen],
                distance=distance[chosen],
                overlap=overlap[chosen],
                normal_force=rows[chosen, 0],
                tangential_force=rows[chosen, 1:4],
                radii=np.column_stack([self.radius[p], self.radius[q]]),
                masses=np.column_stack([self.found["rmass"][p], self.found["rmass"][q]]),
                radius=self.radius[p] * self.radius[q] / (self.radius[p] + self.radius[q]),
                # LAMMPS's meff of two frozen particles matters to nobody
                mass=np.where(np.isfinite(effective), effective, 0.0),
                turned=self.kind[p] != first,
            )
        return found

    def _walls(self) -> dict[str, "_OneLaw"]:
        """Contacts with each wall that particles touch."""
        found = {}
        for name, rows in self.walls.items():
            i, normal, depth, force = self._wall(rows)
            if not len(i):
                continue
            along, mass = np.einsum("ca,ca->c", force, normal), self.found["rmass"][i]
            found[name] = _OneLaw(
                f"fix {name}",
                i=i,
                j=np.full(len(i), WALL),
                normal=normal,
                distance=np.full(len(i), np.inf),
                overlap=depth,
                normal_force=along,
                tangential_force=force - along[:, None] * normal,
                radii=np.column_stack([self.radius[i], np.zeros(len(i))]),
                masses=np.column_stack([mass, np.full(len(i), np.inf)]),
                radius=self.radius[i],
                mass=mass,
                turned=np.zeros(len(i), dtype=bool),
            )
        return found

    def _own_law(self, words: list[str]) -> MindlinLaw:
        """The smooth law of a line, whose first three words are kn, kt and mu."""
        kn, kt, mu = map(float, words[:3])
        rest = words[3:]
        at = rest.index("damping") if "damping" in rest else None
        cn, ct = (0.0, 0.0) if at is None else (float(word) for word in rest[at + 1 : at + 3])
        exponent = float(rest[rest.index("exponent") + 1]) if "exponent" in rest else 1.5
        history = rest[rest.index("history") + 1] if "history" in rest else "total"
        return MindlinLaw(
            kn, kt, mu, exponent=exponent, cn=cn, ct=ct, rescaled=history == "rescaled", coulomb=history == "coulomb"
        )

    def _own_pairs(self) -> LinearisedContacts:
        i, j, normal, distance, overlap, rows = self._pairs()
        arms = np.column_stack([self.radius[i], self.radius[j]])
        law = self._own_law(self.commands.pair[0].split()[2:])
        return _smooth(
            law, overlap, rows[:, 2], normal, rows[:, 0], i=i, j=j, distance=distance, slip_arm=arms, lever_arm=arms
        )

    def _own_floor(self, name: str, rows: Floats) -> LinearisedContacts:
        words = self.commands.fixes[name].split()
        law, height = self._own_law(words[4:7] + words[9:]), float(words[8])
        overlap = self.radius - (self.found["x"][:, 1] - height)
        i = np.flatnonzero(overlap > 0)
        normal = np.tile([0.0, 1.0, 0.0], (len(i), 1))
        arms = np.column_stack([self.radius[i], np.zeros(len(i))])
        return _smooth(
            law,
            overlap[i],
            rows[i, 2],
            normal,
            rows[i, 0],
            i=i,
            j=np.full(len(i), WALL),
            distance=np.full(len(i), np.inf),
            slip_arm=arms,
            lever_arm=arms,
        )


def _none() -> LinearisedContacts:
    """No contacts."""
    empty = {name: np.zeros((0, *shape)) for name, shape in PER_CONTACT.items()}
    whole = {"i": np.zeros(0, int), "j": np.zeros(0, int), "sliding": np.zeros(0, bool)}
    return LinearisedContacts(**(empty | whole))


def _smooth(
    law: MindlinLaw, overlap: Floats, slip: Floats, normal: Floats, said: Floats, **where: Any
) -> LinearisedContacts:
    """Contacts of mindlin/smooth, along z x n."""
    tangent = np.column_stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))])
    made = linearise_contacts(law, overlap, slip, tangent, normal=normal, **where)
    rounding = ROUNDING * made.normal_stiffness * made.slip_arm.sum(axis=1)
    _agree(made.normal_force, said, rounding, "contacts of mindlin/smooth")
    return made


def _agree(computed: Floats, said: Floats, rounding: Floats | float, who: str) -> None:
    if len(said) and np.any(np.abs(computed - said) > AGREES * np.max(np.abs(said)) + rounding):
        raise SnapshotError(
            f"The normal forces of the {who} are not those of the commands: give the lines pair_style, pair_coeff, fix "
            "wall/gran and fix nve/sphere that hold now as commands=[...]."
        )


@dataclass(frozen=True)
class _OneLaw:
    """Contacts that have one law, as LAMMPS says them: of two types, or with one wall.

    `radius` and `mass` are the effective ones. `turned` contacts have the particle of the second type first.
    """

    who: str
    i: Indices
    j: Indices
    normal: Floats
    distance: Floats
    overlap: Floats
    normal_force: Floats
    tangential_force: Floats
    radii: Floats
    masses: Floats
    radius: Floats
    mass: Floats
    turned: NDArray[np.bool_]

    def median_state(self) -> State:
        """The contact of the median overlap."""
        k = np.argsort(self.overlap)[len(self.overlap) // 2]
        order = slice(None, None, -1 if self.turned[k] else 1)
        (a, b), (m, n) = self.radii[k][order], self.masses[k][order]
        return State((a, b), (m, n), self.overlap[k])


def _by_law(law: MeasuredLaw, contacts: _OneLaw) -> LinearisedContacts:
    """Contacts of a law that has been measured."""
    overlap, arms = contacts.overlap, contacts.radii
    stiffness = law.exponent * contacts.normal_force / overlap
    computed = law.stiffness.at(contacts.radius, overlap) * overlap
    _agree(computed, contacts.normal_force, ROUNDING * stiffness * arms.sum(axis=1), contacts.who)
    per_overlap = contacts.tangential_force / overlap[:, None]
    return LinearisedContacts(
        i=contacts.i,
        j=contacts.j,
        normal=contacts.normal,
        distance=contacts.distance,
        overlap=overlap,
        slip_arm=arms,
        lever_arm=np.where(arms > 0, arms - law.lever * overlap[:, None], 0.0),
        lever_slope=np.full(len(overlap), law.lever),
        normal_force=contacts.normal_force,
        tangential_force=contacts.tangential_force,
        normal_stiffness=stiffness,
        tangential_stiffness=law.tangential.at(contacts.radius, overlap),
        closing=law.closing * per_overlap,
        parting=law.parting * per_overlap,
        friction=law.mu * contacts.normal_force,
        sliding=np.zeros(len(overlap), dtype=bool),
        normal_dashpot=law.normal_dashpot.at(contacts.radius, overlap, contacts.mass),
        tangential_dashpot=law.tangential_dashpot.at(contacts.radius, overlap, contacts.mass),
    )
