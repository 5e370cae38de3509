r"""A Configuration whose contacts have the laws that LAMMPS shows.

LAMMPS tells the normal, the overlap and both forces of each contact (compute pair/local, fix wall/gran ... contacts),
without dashpots, since the look is taken at rest (:mod:`~faultgouge.pywrap.granular.lammps_arrays`). With the measured
laws (:mod:`~faultgouge.pywrap.granular.contact_law_measurement`)

.. math::

    f_n' = p\, f_n/\delta, \qquad k_t' = k_t (R\delta)^q, \qquad \mathbf b = \beta\, \mathbf f_t/\delta,

so that the slip itself is not needed. Measurements gave

=====================================  =====  =====  =============  =============
style                                  p      q      beta, closing  beta, parting
=====================================  =====  =====  =============  =============
gran/hooke/history; linear_history     1      0      0              0
gran/hertz/history; mindlin            3/2    1/2    1/2            1/2
linear_history_classic                 1      1/2    1/2            1/2
mindlin/force                          3/2    1/2    0              0
mindlin_rescale                        3/2    1/2    1/2            1
mindlin_rescale/force                  3/2    1/2    0              1/2
=====================================  =====  =====  =============  =============

Hooke with a mindlin model, or hertz with linear_history, is as its parts. The wall of fix wall/gran hooke/history is as
linear_history_classic in the release of 22 Jul 2025. A contact at Coulomb's bound sticks in K by default: what it does
is for :mod:`~faultgouge.analysis.motion.one_sided`.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...analysis import Configuration, LinearisedContacts, MindlinLaw
from ...analysis.arrays import Floats, Indices, derive_frozen
from ...analysis.contacts import BOOLEAN, PER_CONTACT, WALL
from ...analysis.packing.linearise import linearise_contacts
from .balance import known_cause
from .contact_law_measurement import MeasuredLaw, State, measure_law, remark_on
from .granular_commands import GIVE_LINES, OWN, PLANES, Commands, NotLinearisedError, NotTakenError, without_suffix
from .lammps_arrays import Arrays
from .looks import box_of, members_of, particles_of
from .mobility import mobility

FORCE_AGREEMENT = 1e-6
"""Relative difference of the normal forces of LAMMPS from those of its commands, besides that of roundings."""

OVERLAP_ROUNDING = 1e-14
"""Rounding of an overlap, as a share of the distance of two centres: some units in the last place of coordinates that
may be ten times as large."""


class OneLaw(NamedTuple):
    """Contacts that have one law, as LAMMPS says them: between particles of two types, or with one wall.

    `geometry` has the fields of LinearisedContacts that no law enters. `forces` has f_n and the vector f_t of LAMMPS's
    own styles, shape (C, 4), or f_n and the slip of ours, shape (C, 2). `rolling` has what LAMMPS says of rolling
    friction, shape (C, 3): the force at the arm R of contacts between particles, and the whole torque of a wall.
    """

    who: str
    geometry: dict[str, Any]
    forces: Floats
    rolling: Floats | None = None

    def chosen(self, which: NDArray[np.bool_]) -> "OneLaw":
        """Some of the contacts."""
        geometry = {name: values[which] for name, values in self.geometry.items()}
        rolling = None if self.rolling is None else self.rolling[which]
        return OneLaw(self.who, geometry, self.forces[which], rolling)


KnownLaws = dict[tuple[Any, ...], MeasuredLaw]
"""By their commands, and the two types or the ID of a wall's fix."""


def configuration_by_laws(lmp: Any, commands: Commands, found: Arrays, laws: KnownLaws) -> Configuration:
    """The configuration of the arrays of a look; laws that are known are not measured, and new ones are added."""
    if not len(found["id"]):
        raise NotTakenError("This LAMMPS has no particles.")
    members = members_of(found)
    lines = {name: line for name, line in commands.fixes.items() if name in members}
    moved = mobility(lines, members, found["rmass"], lmp.extract_setting("dimension"))
    free, frozen = moved.free, np.zeros(len(found["id"]), bool)
    for name, line in lines.items():
        frozen |= members[name] & (without_suffix(line.split()[3]) == "freeze")
    felt = np.where(frozen, np.inf, moved.felt_mass)
    contacts, remarks = _linearised_contacts(lmp, commands, found, felt, laws, box_of(lmp)[0])
    made = Configuration(
        **particles_of(lmp, found, free, moved.factor), contacts=contacts, constraint=moved.needed, remarks=remarks
    )
    total = np.stack([found["f"], found["torque"]], axis=1)
    load = np.where(free[:, None, None], total - made.contact_force, -made.contact_force)
    _check_torques(load[free, 1] / made.radius[free, None], commands, made.contacts)
    return derive_frozen(made, load=load)


def check_friction(contacts: LinearisedContacts, *, rests: bool) -> None:
    """Refuse tangential forces beyond Coulomb's bound of the commands."""
    size = np.linalg.norm(contacts.tangential_force, axis=1)
    beyond = size > contacts.friction + FORCE_AGREEMENT * (contacts.friction + contacts.normal_force)
    if np.any(beyond):
        most = np.max(size[beyond] / contacts.normal_force[beyond])
        mu = np.min(contacts.friction[beyond] / contacts.normal_force[beyond])
        moves = "" if rests else "the packing moves: bring it to rest by faultgouge.relax(lmp); or "
        raise NotTakenError(
            f"{np.count_nonzero(beyond)} contacts carry more than Coulomb's bound of the commands, up to |f_t| = "
            f"{most:.3g} f_n with mu = {mu:.3g}: {moves}the commands are not those of the instance; {GIVE_LINES}, as "
            "they hold now."
        )


def _check_torques(others: Floats, commands: Commands, contacts: LinearisedContacts) -> None:
    """Refuse torques besides those of the contacts: only contacts may turn particles here."""
    allowed = FORCE_AGREEMENT * np.abs(contacts.tangential_force).max(initial=0.0)
    if np.abs(others).max() > allowed + OVERLAP_ROUNDING * contacts.normal_force.max(initial=0.0):
        says = "The torques on particles are not those of their contacts"
        if known := known_cause(commands, contacts):
            raise NotTakenError(f"{says}: {known}.")
        raise NotLinearisedError(
            f"{says}: something else turns them, or this release of LAMMPS hands out contacts in another way than "
            "those of 29 Aug 2024 to 22 Jul 2025."
        )


def _linearised_contacts(
    lmp: Any, commands: Commands, found: Arrays, mass: Floats, laws: KnownLaws, box: Floats
) -> tuple[LinearisedContacts, tuple[str, ...]]:
    """Contacts between particles, then those with each wall; and remarks on their laws. `mass` is what dashpots feel,
    infinite where frozen."""
    pairs, walls = (
        contacts_of_pairs(found, box),
        [name.removeprefix("wall ") for name in found if name.startswith("wall ")],
    )
    parts, couples, remarks = [], [], []
    if commands.style == OWN:
        parts.append(_linearise_smooth(_smooth_law(commands.pair[0].split()[2:]), pairs))
        for name in walls:
            words = commands.fixes[name].split()
            law = _smooth_law(words[4:7] + words[9:])
            parts.append(_linearise_smooth(law, contacts_of_floor(found, name, float(words[8]))))
    else:
        groups: dict[Any, OneLaw] = by_types(pairs, found["type"]) | {
            name: contacts_of_wall(found, name, commands.fixes[name]) for name in walls
        }
        for name, every in groups.items():
            # what overlaps by rounding alone, as in a lattice whose spheres just touch, is no contact
            group = every.chosen(every.geometry["overlap"] > OVERLAP_ROUNDING * every.geometry["slip_arm"].sum(axis=1))
            if len(group.forces) == 0:
                continue
            # laws belong to commands, which a user may change
            key = (*commands.pair, commands.fixes.get(name), name)
            state = median_state(group, found)
            if key not in laws:
                laws[key] = measure_law(lmp, commands, name, state, group.who)
            remarks.append(remark_on(laws[key], commands, name, state))
            parts.append(_linearise_measured(laws[key], group, found, mass))
            if laws[key].mu_rolling:
                couples.append(_linearise_rolling(laws[key], group, parts[-1], found, mass))
    parts += couples
    values = {name: [getattr(each, name) for each in parts] for name in PER_CONTACT}
    if not parts:
        values = {
            name: [np.zeros((0, *shape), bool if name in BOOLEAN else float)] for name, shape in PER_CONTACT.items()
        }
    contacts = LinearisedContacts(**{name: np.concatenate(each) for name, each in values.items()})
    return contacts, tuple(remark for remark in remarks if remark)


def _smooth_law(words: list[str]) -> MindlinLaw:
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


def _linearise_smooth(law: MindlinLaw, contacts: OneLaw) -> LinearisedContacts:
    """Contacts of mindlin/smooth, along z x n."""
    normal, arms = contacts.geometry["normal"], contacts.geometry["slip_arm"]
    tangent = np.column_stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))])
    slip = contacts.forces[:, -1]
    made = linearise_contacts(law, slip=slip, tangent=tangent, lever_arm=arms, **contacts.geometry)
    _agree(made.normal_force, made.normal_stiffness, contacts)
    return made


def _linearise_measured(law: MeasuredLaw, contacts: OneLaw, found: Arrays, mass: Floats) -> LinearisedContacts:
    """Contacts of a law that has been measured; `mass` as above."""
    i, overlap, arms = (contacts.geometry[name] for name in ("i", "overlap", "slip_arm"))
    normal_force, tangential_force = contacts.forces[:, 0], contacts.forces[:, 1:]
    stiffness = (1 + law.stiffness.overlap) * normal_force / overlap
    reduced_radius, reduced_mass = _reduced(contacts, found, mass)
    _agree(law.stiffness.at(reduced_radius, overlap) * overlap, stiffness, contacts)
    per_overlap = tangential_force / overlap[:, None]
    return LinearisedContacts(
        **contacts.geometry,
        lever_arm=np.where(arms > 0, arms - law.lever * overlap[:, None], 0.0),
        lever_slope=np.full(len(i), law.lever),
        normal_force=normal_force,
        tangential_force=tangential_force,
        normal_stiffness=stiffness,
        tangential_stiffness=law.tangential.at(reduced_radius, overlap),
        closing=law.closing * per_overlap,
        parting=law.parting * per_overlap,
        friction=law.mu * normal_force,
        sliding=np.zeros(len(i), dtype=bool),
        normal_dashpot=law.normal_dashpot.at(reduced_radius, overlap, reduced_mass),
        tangential_dashpot=law.tangential_dashpot.at(reduced_radius, overlap, reduced_mass),
    )


def _reduced(contacts: OneLaw, found: Arrays, mass: Floats) -> tuple[Floats, Floats]:
    """Effective radii and masses of contacts."""
    i, j, radius = contacts.geometry["i"], contacts.geometry["j"], found["radius"]
    wall = j == WALL
    reduced_radius = np.where(wall, radius[i], radius[i] * radius[j] / (radius[i] + radius[j]))
    # frozen particles weigh infinitely much in LAMMPS's dashpots, but not at walls; two frozen ones matter to nobody
    inverse = 1 / mass[i] + 1 / mass[j]
    reduced_mass = np.divide(1.0, inverse, out=np.zeros(len(i)), where=inverse > 0)
    return reduced_radius, np.where(wall, np.where(np.isinf(mass), found["rmass"], mass)[i], reduced_mass)


def _linearise_rolling(
    law: MeasuredLaw, contacts: OneLaw, sticks: LinearisedContacts, found: Arrays, mass: Floats
) -> LinearisedContacts:
    """The rolling friction of contacts, whose torque on the first partner is R n x f of LAMMPS's rolling force f."""
    assert contacts.rolling is not None
    normal, overlap, wall = (contacts.geometry[name] for name in ("normal", "overlap", "j"))
    radius, reduced_mass = _reduced(contacts, found, mass)
    none, across = np.zeros((len(radius), 3)), np.cross(normal, sticks.tangential_force)
    # of a wall the whole torque is known; a frozen particle has none
    by_wall = np.cross(normal, contacts.rolling + sticks.lever_arm[:, :1] * across) / radius[:, None]
    by_wall[~np.any(contacts.rolling, axis=1)] = 0.0
    force = np.where((wall == WALL)[:, None], by_wall, -contacts.rolling)
    arm = np.column_stack([radius, np.where(wall == WALL, 0.0, -radius)])
    return derive_frozen(
        sticks, couple=np.ones(len(radius), bool), tangential_force=force, slip_arm=arm, lever_arm=arm,
        lever_slope=np.zeros(len(radius)), closing=none, parting=none, friction=law.mu_rolling * sticks.normal_force,
        tangential_stiffness=law.rolling.at(radius, overlap),
        tangential_dashpot=law.rolling_dashpot.at(radius, overlap, reduced_mass),
    )  # fmt: skip


def _agree(computed: Floats, stiffness: Floats, contacts: OneLaw) -> None:
    """Refuse normal forces that are not those of the commands."""
    said, rounding = contacts.forces[:, 0], OVERLAP_ROUNDING * stiffness * contacts.geometry["slip_arm"].sum(axis=1)
    if len(said) and np.any(np.abs(computed - said) > FORCE_AGREEMENT * np.max(np.abs(said)) + rounding):
        raise NotTakenError(
            f"The normal forces of the {contacts.who} are not those of the commands: {GIVE_LINES}, as they hold now."
        )


def _geometry(
    found: Arrays, i: Indices, j: Indices, normal: Floats, distance: Floats, overlap: Floats
) -> dict[str, Any]:
    arms = np.column_stack([found["radius"][i], np.where(j == WALL, 0.0, found["radius"][j])])
    return {"i": i, "j": j, "normal": normal, "distance": distance, "overlap": overlap, "slip_arm": arms}


def contacts_of_pairs(found: Arrays, box: Floats) -> OneLaw:
    """All contacts between particles, of whatever types."""
    rows, partners = found["contacts"], found["partners"]
    if not len(rows):
        rows, partners = np.zeros((0, 10)), np.zeros((0, 2))
    i, j = np.searchsorted(found["id"], partners).T
    if np.any(i == j):
        raise NotTakenError(
            f"Particle {int(partners[i == j][0, 0])} touches its own periodic image: take a box that is wider."
        )
    branch = _towards_first(rows[:, :3], found["x"][i] - found["x"][j], box)
    distance = np.linalg.norm(branch, axis=1)
    overlap = found["radius"][i] + found["radius"][j] - distance
    geometry = _geometry(found, i, j, branch / distance[:, None], distance, overlap)
    rolling = rows[:, 7:10] if rows.shape[1] > 7 else None
    return OneLaw("contacts of mindlin/smooth", geometry, rows[:, 3:7], rolling)


def _towards_first(branch: Floats, between: Floats, box: Floats) -> Floats:
    """Branch vectors with the sign of another vector but for periods of the box: in LAMMPS of 2024 dx, dy and dz may
    point to the second of the partners."""
    beside = [(between - sign * branch) @ np.linalg.inv(box) for sign in (1, -1)]
    right, wrong = (np.abs(each - np.round(each)).max(axis=1) for each in beside)
    return np.where((right <= wrong)[:, None], branch, -branch)


def by_types(pairs: OneLaw, kind: Indices) -> dict[Any, OneLaw]:
    """Contacts between particles by their two types, the smaller first."""
    low, high = np.sort([kind[pairs.geometry["i"]], kind[pairs.geometry["j"]]], axis=0)
    count = 1 + int(kind.max(initial=0))
    codes, found = low * count + high, {}
    for code in np.unique(codes).tolist():
        (first, second), which = divmod(code, count), codes == code
        found[first, second] = pairs.chosen(which)._replace(who=f"contacts of types {first} and {second}")
    return found


def _at_wall(found: Arrays, name: str, i: Indices, normal: Floats, overlap: Floats, forces: Floats) -> OneLaw:
    geometry = _geometry(found, i, np.full(len(i), WALL), normal, np.full(len(i), np.inf), overlap)
    return OneLaw(f"contacts of fix {name}", geometry, forces)


def contacts_of_wall(found: Arrays, name: str, line: str) -> OneLaw:
    """Contacts with the planes of fix wall/gran, of which LAMMPS has the nearer act."""
    words = line.split()
    at = next(k for k, word in enumerate(words) if word in PLANES)
    axis, force = PLANES.index(words[at]), found[f"wall {name}"]
    lower, upper = (np.nan if word == "NULL" else float(word) for word in words[at + 1 : at + 3])
    low, high = (np.nan_to_num(each, nan=np.inf) for each in (found["x"][:, axis] - lower, upper - found["x"][:, axis]))
    overlap = found["radius"] - np.minimum(low, high)
    i = np.flatnonzero((overlap > 0) & force.any(axis=1))
    normal = np.zeros((len(i), 3))
    normal[:, axis] = np.where(low < high, 1.0, -1.0)[i]
    along = np.einsum("ca,ca->c", force[i], normal)[:, None]
    made = _at_wall(found, name, i, normal, overlap[i], np.hstack([along, force[i] - along * normal]))
    return made._replace(rolling=found[f"torque {name}"][i] if f"torque {name}" in found else None)


def contacts_of_floor(found: Arrays, name: str, height: float) -> OneLaw:
    """Contacts with a floor of mindlin/smooth."""
    overlap = found["radius"] - (found["x"][:, 1] - height)
    i = np.flatnonzero(overlap > 0)
    normal, forces = np.tile([0.0, 1.0, 0.0], (len(i), 1)), found[f"wall {name}"][i][:, [0, 2]]
    return _at_wall(found, name, i, normal, overlap[i], forces)


def median_state(contacts: OneLaw, found: Arrays) -> State:
    """The contact of the median overlap, its partner of the smaller type first."""
    i, j, overlap = (contacts.geometry[name] for name in ("i", "j", "overlap"))
    k = np.argsort(overlap)[len(overlap) // 2]
    radius, mass = found["radius"], found["rmass"]
    if j[k] == WALL:
        return State((radius[i[k]], 0.0), (mass[i[k]], np.inf), overlap[k])
    first, second = sorted((i[k], j[k]), key=lambda each: found["type"][each])
    return State((radius[first], radius[second]), (mass[first], mass[second]), overlap[k])
