r"""A Configuration whose contacts have the laws that LAMMPS shows.

LAMMPS tells the normal, the overlap and both forces of each contact (:mod:`~faultgouge.pywrap.granular.looks`), without
dashpots. With the measured laws (:mod:`~faultgouge.pywrap.granular.contact_law_measurement`)

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

The wall of fix wall/gran hooke/history is as linear_history_classic in the release of 22 Jul 2025. A contact at
Coulomb's bound sticks in K: what it does is for :mod:`~faultgouge.analysis.motion.one_sided`.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...analysis import Configuration, LinearisedContacts, MindlinLaw
from ...analysis.arrays import Floats, Indices, derive_frozen
from ...analysis.contacts import BOOLEAN, PER_CONTACT, WALL
from ...analysis.packing.linearise import linearise_contacts
from .balance import known_cause
from .contact_law_measurement import Law, State, measure_law
from .granular_commands import GIVE_LINES, OWN, PLANES, Commands, NotLinearisedError, NotTakenError
from .looks import Arrays, Looked, particles_of

FORCE_AGREEMENT = 1e-6
"""Relative difference of the normal forces of LAMMPS from those of its commands, besides that of roundings."""

OVERLAP_ROUNDING = 1e-14
"""Rounding of an overlap, as a share of the distance of two centres, beside which coordinates may be ten times as
large."""

KnownLaws = dict[tuple[Any, ...], Law]
"""By their commands, and the two types or the ID of a wall's fix."""


class OneLaw(NamedTuple):
    """Contacts that have one law, as LAMMPS says them: between particles of two types, or with one wall.

    `geometry` has the fields of LinearisedContacts that no law enters; `forces` f_n and the vector f_t of LAMMPS's own
    styles, or the slip of ours, shape (C, 4); `rolling` the force of rolling friction at the arm R, or, of a wall, the
    whole torque, shape (C, 3).
    """

    who: str
    geometry: dict[str, Any]
    forces: Floats
    rolling: Floats

    def chosen(self, which: NDArray[np.bool_], who: str) -> "OneLaw":
        """Some of the contacts."""
        geometry = {name: values[which] for name, values in self.geometry.items()}
        return OneLaw(who, geometry, self.forces[which], self.rolling[which])


def configuration_by_laws(lmp: Any, looked: Looked, laws: KnownLaws) -> Configuration:
    """The configuration of a look; laws that are known are not measured, and new ones are added."""
    found, commands = looked.found, looked.commands
    contacts = _linearised_contacts(lmp, commands, found, looked.moved.felt_mass, laws)
    made = Configuration(**particles_of(lmp, found, looked.moved), contacts=contacts)
    total, free = np.stack([found["f"], found["torque"]], axis=1), made.free
    load = np.where(free[:, None, None], total - made.contact_force, -made.contact_force)
    # only contacts may turn particles here
    allowed = FORCE_AGREEMENT * np.abs(contacts.tangential_force).max(initial=0.0)
    allowed += OVERLAP_ROUNDING * contacts.normal_force.max(initial=0.0)
    if np.abs(load[free, 1] / made.radius[free, None]).max() > allowed:
        says = "The torques on particles are not those of their contacts"
        if known := known_cause(commands, contacts):
            raise NotTakenError(f"{says}: {known}.")
        raise NotLinearisedError(f"{says}: something else turns them, or this LAMMPS hands out contacts otherwise.")
    return derive_frozen(made, load=load)


def _linearised_contacts(
    lmp: Any, commands: Commands, found: Arrays, mass: Floats, laws: KnownLaws
) -> LinearisedContacts:
    """Contacts between particles, then those with each wall, then rolling friction. `mass` is what dashpots feel,
    infinite where frozen."""
    pairs, parts, couples = contacts_of_pairs(found), [], []
    types = np.sort([found["type"][pairs.geometry["i"]], found["type"][pairs.geometry["j"]]], axis=0).T
    groups: dict[Any, OneLaw] = {}
    for a, b in np.unique(types, axis=0).tolist():
        groups[a, b] = pairs.chosen(np.all(types == (a, b), axis=1), f"contacts of types {a} and {b}")
    for name in [name.removeprefix("wall ") for name in found if name.startswith("wall ")]:
        groups[name] = _contacts_of_wall(found, name, commands.fixes[name])
    for name, every in groups.items():
        if commands.style == OWN:
            words = commands.fixes[name].split() if name in commands.fixes else commands.pair[0].split()
            parts.append(_linearise_smooth(words[4:7] + words[9:] if name in commands.fixes else words[2:], every))
            continue
        # what overlaps by rounding alone, as in a lattice whose spheres just touch, is no contact
        touches = every.geometry["overlap"] > OVERLAP_ROUNDING * every.geometry["slip_arm"].sum(axis=1)
        if not touches.any():
            continue
        group = every.chosen(touches, every.who)
        # laws belong to commands, which a user may change; one line pair_coeff is one law for all types
        key = (*commands.pair, commands.fixes.get(name), name if len(commands.pair) > 2 else None)
        if key not in laws:
            laws[key] = measure_law(lmp, commands, name, _median_state(group, found), group.who)
        sticks, rolls = _linearise_measured(laws[key], group, found, mass)
        parts.append(sticks)
        couples += [rolls] * (laws[key]["mu_rolling"] > 0)
    values = {}
    for name, shape in PER_CONTACT.items():
        kind = bool if name in BOOLEAN else np.int64 if name in ("i", "j") else np.float64
        values[name] = np.concatenate([np.zeros((0, *shape), kind), *(getattr(each, name) for each in parts + couples)])
    return LinearisedContacts(**values)


def _linearise_smooth(words: list[str], contacts: OneLaw) -> LinearisedContacts:
    """Contacts of mindlin/smooth, along z x n, of a line whose first three words are kn, kt and mu."""
    given = dict(zip(words, [*words[1:], ""], strict=True))
    at = words.index("damping") if "damping" in words else -3
    cn, ct = map(float, words[at + 1 : at + 3]) if "damping" in words else (0.0, 0.0)
    kn, kt, mu, exponent = *map(float, words[:3]), float(given.get("exponent", 1.5))
    history = {each: given.get("history") == each for each in ("rescaled", "coulomb")}
    law = MindlinLaw(kn, kt, mu, exponent=exponent, cn=cn, ct=ct, **history)
    normal, arms = contacts.geometry["normal"], contacts.geometry["slip_arm"]
    tangent = np.column_stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))])
    made = linearise_contacts(law, slip=contacts.forces[:, 1], tangent=tangent, lever_arm=arms, **contacts.geometry)
    _agree(made.normal_force, made.normal_stiffness, contacts)
    return made


def _linearise_measured(
    law: Law, contacts: OneLaw, found: Arrays, mass: Floats
) -> tuple[LinearisedContacts, LinearisedContacts]:
    """Contacts of a law that has been measured, and their rolling friction, whose torque on the first partner is
    R n x f of LAMMPS's rolling force f; `mass` as above."""
    i, j, overlap, arms, normal = (contacts.geometry[name] for name in ("i", "j", "overlap", "slip_arm", "normal"))
    fn, ft = contacts.forces[:, 0], contacts.forces[:, 1:]
    wall, none, zero = j == WALL, np.zeros_like(normal), 0.0 * overlap
    # frozen particles weigh infinitely much in LAMMPS's dashpots, but not at walls; two frozen ones matter to nobody
    inverse = 1 / mass[i] + 1 / mass[j]
    of_pair = np.divide(1.0, inverse, out=0.0 * inverse, where=inverse > 0)
    radius = np.where(wall, arms[:, 0], arms.prod(axis=1) / arms.sum(axis=1))
    of_state = radius, overlap, np.where(wall, np.where(np.isinf(mass), found["rmass"], mass)[i], of_pair)
    stiffness, lever = (1 + law["stiffness"].overlap) * fn / overlap, law["lever"]
    _agree(law["stiffness"].at(*of_state) * overlap, stiffness, contacts)
    sticks = LinearisedContacts(
        **contacts.geometry, lever_arm=np.where(arms > 0, arms - lever * overlap[:, None], 0.0),
        lever_slope=lever + zero, normal_force=fn, tangential_force=ft, normal_stiffness=stiffness,
        friction=law["mu"] * fn, sliding=np.zeros(len(i), dtype=bool), closing=law["closing"] * ft / overlap[:, None],
        parting=law["parting"] * ft / overlap[:, None], tangential_stiffness=law["tangential"].at(*of_state),
        normal_dashpot=law["normal_dashpot"].at(*of_state), tangential_dashpot=law["tangential_dashpot"].at(*of_state),
    )  # fmt: skip
    # of a wall the whole torque is known; a frozen particle has none
    radius = of_state[0][:, None]
    by_wall = np.cross(normal, contacts.rolling + sticks.lever_arm[:, :1] * np.cross(normal, ft)) / radius
    by_wall[~np.any(contacts.rolling, axis=1)] = 0.0
    arm = np.hstack([radius, np.where(wall[:, None], 0.0, -radius)])
    return sticks, derive_frozen(
        sticks, couple=np.ones(len(i), bool), tangential_force=np.where(wall[:, None], by_wall, -contacts.rolling),
        slip_arm=arm, lever_arm=arm, lever_slope=zero, closing=none, parting=none, friction=law["mu_rolling"] * fn,
        tangential_stiffness=law["rolling"].at(*of_state), tangential_dashpot=law["rolling_dashpot"].at(*of_state),
    )  # fmt: skip


def _agree(computed: Floats, stiffness: Floats, contacts: OneLaw) -> None:
    """Refuse normal forces that are not those of the commands."""
    said, rounding = contacts.forces[:, 0], OVERLAP_ROUNDING * stiffness * contacts.geometry["slip_arm"].sum(axis=1)
    if len(said) and np.any(np.abs(computed - said) > FORCE_AGREEMENT * np.max(np.abs(said)) + rounding):
        other = f"The normal forces of the {contacts.who} are not those of the commands"
        raise NotTakenError(f"{other}: {GIVE_LINES}, as they hold now.")


def _geometry(
    found: Arrays, i: Indices, j: Indices, normal: Floats, distance: Floats, overlap: Floats
) -> dict[str, Any]:
    arms = np.column_stack([found["radius"][i], np.where(j == WALL, 0.0, found["radius"][j])])
    return {"i": i, "j": j, "normal": normal, "distance": distance, "overlap": overlap, "slip_arm": arms}


def contacts_of_pairs(found: Arrays) -> OneLaw:
    """All contacts between particles, of whatever types."""
    rows = np.zeros((len(found["contacts"]), 10))
    rows[:, : found["contacts"].shape[1]] = found["contacts"]
    i, j = np.searchsorted(found["id"], found["partners"]).T
    if np.any(i == j):
        particle = int(found["id"][i[i == j][0]])
        raise NotTakenError(f"Particle {particle} touches its own periodic image: take a box that is wider.")
    # in LAMMPS of 2024 dx, dy and dz may point to the second of the partners
    branch, between = rows[:, :3], found["x"][i] - found["x"][j]
    beside = [(between - sign * branch) @ np.linalg.inv(found["box"]) for sign in (1, -1)]
    right, wrong = (np.abs(each - np.round(each)).max(axis=1) for each in beside)
    branch = np.where((right <= wrong)[:, None], branch, -branch)
    distance = np.linalg.norm(branch, axis=1)
    overlap = found["radius"][i] + found["radius"][j] - distance
    geometry = _geometry(found, i, j, branch / distance[:, None], distance, overlap)
    return OneLaw("contacts of pairs", geometry, rows[:, 3:7], rows[:, 7:10])


def _contacts_of_wall(found: Arrays, name: str, line: str) -> OneLaw:
    """Contacts with the planes of fix wall/gran, of which LAMMPS has the nearer act, or with a floor of ours."""
    words, radius = line.split(), found["radius"]
    ours = words[3] == "wall/mindlin/smooth"
    at = 7 if ours else next(k for k, word in enumerate(words) if word in PLANES)
    axis, planes = (1, [words[8], "NULL"]) if ours else (PLANES.index(words[at]), words[at + 1 : at + 3])
    lower, upper = (np.nan if word == "NULL" else float(word) for word in planes)
    x = found["x"][:, axis]
    low, high = (np.nan_to_num(each, nan=np.inf) for each in (x - lower, upper - x))
    overlap = radius - np.minimum(low, high)
    i = np.flatnonzero((overlap > 0) & found[f"group {name}"])
    normal, force = np.zeros((len(i), 3)), found[f"wall {name}"][i]
    normal[:, axis] = np.where(low < high, 1.0, -1.0)[i]
    along = np.einsum("ca,ca->c", force[:, :3], normal)[:, None]
    forces = force[:, [0, 2]] if ours else np.hstack([along, force - along * normal])
    geometry = _geometry(found, i, np.full(len(i), WALL), normal, np.full(len(i), np.inf), overlap[i])
    return OneLaw(f"contacts of fix {name}", geometry, forces, found.get(f"torque {name}", 0.0 * found["f"])[i])


def _median_state(contacts: OneLaw, found: Arrays) -> State:
    """The contact of the median overlap, its partner of the smaller type first."""
    i, j, overlap = (contacts.geometry[name] for name in ("i", "j", "overlap"))
    k = np.argsort(overlap)[len(overlap) // 2]
    pair = [i[k]] if j[k] == WALL else sorted((i[k], j[k]), key=lambda each: found["type"][each])
    radii, masses = (*found["radius"][pair], 0.0), (*found["rmass"][pair], np.inf)
    return State(radii[:2], masses[:2], overlap[k])
