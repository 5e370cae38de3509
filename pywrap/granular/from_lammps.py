r"""A Configuration of a live LAMMPS with its own granular styles, or ours: any packing, as it stands.

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
linear_history_classic                 1      1/2    1/2            1/2
mindlin/force                          3/2    1/2    0              0
mindlin_rescale                        3/2    1/2    1/2            1
mindlin_rescale/force                  3/2    1/2    0              1/2
=====================================  =====  =====  =============  =============

and hooke with a mindlin model, or hertz with linear_history, are as their parts; the wall of fix wall/gran
hooke/history is as linear_history_classic in the release of 22 Jul 2025. A small vibration shakes a contact at
Coulomb's bound down to elastic, so that it sticks by default.

Whatever has none of these laws (cohesion, rolling and twisting friction, regions, bonds, springs, a lid that moves as
one) has K and C by differences of LAMMPS's own forces (:mod:`~faultgouge.pywrap.granular.force_differences`).
"""

from collections.abc import Iterable
from contextlib import nullcontext, suppress
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from ...analysis import BadInputError, Configuration, LinearisedContacts, MindlinLaw
from ...analysis.arrays import Floats, Indices, derive_frozen
from ...analysis.contacts import BOOLEAN, PER_CONTACT, WALL
from ...analysis.packing.linearise import linearise_contacts
from .acting_fixes import check_holding
from .contact_law_measurement import MeasuredLaw, State, measure_law
from .force_differences import HOLDS, MOVES, Particles, measure_operators
from .granular_commands import (
    GIVE_LINES,
    INTEGRATORS,
    OWN,
    WALLS,
    Commands,
    NotLinearisedError,
    SnapshotError,
    check_fixes,
    check_pair,
    check_rest,
    read_commands,
    without_suffix,
)
from .instance_queries import OpenFile, Styles, communicator, log_of, only_log, open_files, styles_of
from .lammps_arrays import Arrays, arrays_at_rest, contacts_of_plane, given_back
from .law_remarks import remark_on
from .look_in_a_copy import can_copy, in_a_copy, quieten
from .mobility import MOBILE, mobility
from .motion_proof import BOUND, GOOD, NotProvedError
from .motion_proof import prove as prove_motion

BALANCE = 1e-4
"""Share of the mean contact force that may be out of balance: then the motion is that of a packing which comes to rest
elsewhere, and K says nothing of it."""

AGREES = 1e-6
"""Relative difference of the normal forces of LAMMPS from those of its commands, besides that of roundings."""

ROUNDING = 1e-14
"""Rounding of an overlap, as a share of the distance of two centres: some units in the last place of coordinates that
may be ten times as large."""

BY_CONTACT = ("contacts", "partners")
"""Arrays with a row for each contact; all others have one for each particle."""

KnownLaws = dict[tuple[Any, ...], MeasuredLaw]
"""By their commands, and the two types or the ID of a wall's fix."""


def from_lammps(
    lmp: Any,
    commands: Iterable[str] | None = None,
    *,
    slides: bool = False,
    balance: float = BALANCE,
    prove: bool = True,
    differences: bool = False,
) -> Configuration:
    """The packing of a LAMMPS instance with its linearised contacts, as it stands.

    The instance does not change: its next run is the same to the bit as without the look, on any number of ranks, and
    with the threads of `package omp`.

    Parameters
    ----------
    lmp : lammps.lammps
        The instance: disks or spheres at rest. Laws are measured with gran/hooke/history, gran/hertz/history, granular
        or mindlin/smooth, between planes of fix wall/gran or in a periodic box. On several ranks all make this call.
    commands : iterable of str, optional
        The lines pair_style, pair_coeff, fix wall/gran and fix nve/sphere of the deck; by default those in the
        instance's log.
    slides : bool
        Whether contacts at Coulomb's bound slide; they stick by default.
    balance : float
        Residual that is allowed, as a share of the mean contact force; not negative.
    prove : bool
        Whether ten steps of LAMMPS in a copy of the process are compared with those of the result, drag left out: its
        `proof` is their relative difference (:mod:`~faultgouge.pywrap.granular.motion_proof`). A packing of more than
        1e-3 is refused, and 1e-5 or less is usual. `proof` is None on several ranks or with threads, where no copy can
        be made, and for a packing whose residual exceeds the default balance.
    differences : bool
        Whether K and C are found by differences of LAMMPS's forces even where all laws of contacts are measured.

    Returns
    -------
    Configuration
        With its contacts' laws, as they are measured; or, where these do not apply (`operators` says which), with K and
        C by differences of forces, on one rank.

    Raises
    ------
    SnapshotError
        If the packing cannot be taken: it moves, or has moving walls or bodies that rotate; or the commands are not
        those of the instance; or LAMMPS's forces do not change as K says.
    """
    return take_snapshot(lmp, commands, {}, slides=slides, balance=balance, prove=prove, differences=differences)


def check_balance(balance: float) -> None:
    """Refuse a residual that is no number from 0 on: every packing would be at rest, or none."""
    if not balance >= 0:
        raise BadInputError(f"balance = {balance:g} is refused: give a share of the mean contact force, from 0 on.")


def take_snapshot(
    lmp: Any,
    commands: Iterable[str] | None,
    laws: KnownLaws,
    *,
    slides: bool,
    balance: float,
    prove: bool,
    differences: bool = False,
) -> Configuration:
    """What :func:`from_lammps` does. Laws that are known are not measured again, and those that are new are added."""
    check_balance(balance)
    given = None if commands is None else read_commands(commands)
    try:
        if differences:
            raise NotLinearisedError("K and C by differences of forces are asked for.")
        return _by_laws(lmp, given, laws, slides=slides, balance=balance, prove=prove)
    except NotLinearisedError as reason:
        if not can_copy(lmp):
            raise
        if slides:
            raise SnapshotError(
                f"{str(reason).rstrip('.')}; so K is found by differences of forces, which have no choice between "
                "sticking and sliding contacts: leave slides out."
            ) from reason
        if not isinstance(reason, NotProvedError):
            return _by_differences(lmp, given, balance=balance, prove=prove)
        # what acts on velocities, or on particles far apart, is not in differences either, and has been named
        with suppress(SnapshotError):
            found = _by_differences(lmp, given, balance=balance, prove=prove)
            if found.proof is not None and max(found.proof / BOUND, found.operator_error / GOOD) <= 1:
                return found
        raise


def _by_laws(
    lmp: Any, given: Commands | None, laws: KnownLaws, *, slides: bool, balance: float, prove: bool
) -> Configuration:
    """A Configuration whose contacts have the laws that LAMMPS shows; a NotLinearisedError if something else acts."""
    look = partial(_look, lmp, given, open_files())
    deck, fixes, found = in_a_copy(look) if can_copy(lmp) else look()
    snapshot = _snapshot(lmp, deck, found, laws)
    contacts = snapshot.contacts
    proves = prove and can_copy(lmp) and _rests(snapshot)
    if not proves:
        check_holding(fixes)
    _check_friction(contacts)
    _check_balance(snapshot, balance, deck)
    if proves:
        snapshot = _proved(lmp, snapshot, deck, fixes)
    if slides:
        return derive_frozen(snapshot, contacts=derive_frozen(contacts, sliding=contacts.at_bound))
    return snapshot


def _rests(snapshot: Configuration) -> bool:
    """Whether a packing is so near to rest that a motion may prove K."""
    return snapshot.residual <= BALANCE * force_scale(snapshot)


def _proved(lmp: Any, snapshot: Configuration, commands: Commands, fixes: dict[str, str]) -> Configuration:
    """A Configuration with its proof."""
    return derive_frozen(snapshot, proof=prove_motion(lmp, snapshot, fixes, extrapolates=commands.style == OWN))


def force_scale(snapshot: Configuration) -> float:
    """The mean normal force of contacts; where no contact is known, that of an overlap of 1e-4 of a radius."""
    if len(snapshot.contacts):
        return float(np.abs(snapshot.contacts.normal_force).mean())
    return (
        0.0
        if snapshot.stiffness is None
        else 1e-4 * float(np.abs(snapshot.stiffness.data).max(initial=0.0) * snapshot.radius.mean())
    )


def _check_balance(snapshot: Configuration, balance: float, commands: Commands) -> None:
    """Refuse a packing that moves, with the particle that is farthest from rest."""
    force = force_scale(snapshot)
    if snapshot.residual <= balance * force:
        return
    size = snapshot.particle_residual
    worst = int(np.argmax(size))
    place = ", ".join(f"{x:.6g}" for x in snapshot.position[worst])
    others = int(np.sum(size > balance * force)) - 1
    also = f", and {others} more {'are' if others > 1 else 'is'} out of balance" if others else ""
    advice = _known_cause(commands, snapshot.contacts) or (
        "bring it to rest by faultgouge.relax(lmp) or a longer run with drag (fix viscous, and fix viscous/sphere for "
        "rotation), or allow more by from_lammps(lmp, balance=...), in a command --balance"
    )
    raise SnapshotError(
        f"The packing moves: the residual of particle {snapshot.ids[worst]} at ({place}) is {size[worst] / force:.3g} "
        f"of the mean contact force, and {balance:g} is allowed{also}; {advice}."
    )


class _Still(NamedTuple):
    """Particles as they stand, without K and C: both are empty.

    `constraint` is P of q = P Q, which the configuration has only where P says more than which particles are free.
    `commands` and `fixes` are those of the instance.
    """

    configuration: Configuration
    constraint: csr_array
    commands: Commands
    fixes: dict[str, str]


def _by_differences(lmp: Any, given: Commands | None, *, balance: float, prove: bool) -> Configuration:
    """A Configuration whose K and C are differences of LAMMPS's forces, on one rank.

    Its contacts are those of pairs that touch, with their forces as far as LAMMPS hands them out.
    """
    still = _still(lmp, given)
    made, scale = still.configuration, force_scale(still.configuration) or None
    place = np.zeros((len(made), 3))
    place[:, : made.dimension] = made.position
    particles = Particles(made.dimension, made.ids, place, made.radius, still.constraint)
    measured = measure_operators(lmp, particles, scale)
    made = derive_frozen(
        made,
        stiffness=measured.stiffness,
        damping=measured.damping,
        operator_error=measured.error,
        jump=measured.jump,
    )
    _check_balance(made, balance, still.commands)
    return _proved(lmp, made, still.commands, still.fixes) if prove and _rests(made) else made


def particles_at_rest(lmp: Any, given: Commands | None) -> Configuration:
    """The particles of an instance as they stand, and the forces of pairs, without K and C: both are empty."""
    return _still(lmp, given).configuration


def _still(lmp: Any, given: Commands | None) -> _Still:
    """The particles of an instance, and what moves or holds them."""
    files = open_files()
    columns = ["dx dy dz force p1 p2 p3", "dx dy dz force", "dx dy dz"]
    while True:  # not every pair style hands all of these out
        try:
            look = partial(_look_at_forces, lmp, given, files, columns[0])
            commands, fixes, found, members = in_a_copy(look)
            break
        except SnapshotError:
            columns.pop(0)
            if not columns:
                raise
    count, dimension = len(found["id"]), lmp.extract_setting("dimension")
    if count == 0:
        raise SnapshotError("This LAMMPS has no particles.")
    lines = {name: line for name, line in commands.fixes.items() if name in members}
    constraint, factor = mobility(lines, members, found["rmass"], dimension)
    axes = 6 if dimension == 3 else 3
    free = np.diff(constraint.indptr).reshape(axes, count).any(axis=0)
    alone = diags_array(np.tile(free, axes).astype(np.float64))
    box, origin, periodic = _box(lmp)
    empty = csr_array(constraint.shape)
    made = Configuration(
        dimension=dimension,
        position=found["x"][:, :dimension],
        radius=found["radius"],
        mass=found["rmass"],
        inertia=factor * found["rmass"] * found["radius"] ** 2,
        contacts=_forces_of_pairs(found, box, commands.style),
        box=box,
        origin=origin,
        periodic=periodic,
        load=np.zeros((count, 2, 3)),
        free=free,
        ids=found["id"].astype(np.int64),
        kind=found["type"].astype(np.int64),
        stiffness=empty,
        damping=empty,
        constraint=constraint if abs(constraint - alone).nnz else None,
    )
    total = np.stack([found["f"], found["torque"]], axis=1)
    load = np.where(free[:, None, None], total, 0.0) - made.contact_force
    return _Still(derive_frozen(made, load=load), constraint, commands, fixes)


def _look_at_forces(
    lmp: Any, given: Commands | None, files: dict[int, OpenFile], columns: str
) -> tuple[Commands, dict[str, str], Arrays, dict[str, NDArray[np.bool_]]]:
    """The commands, the styles of fixes, the particles, and who is in the groups of the fixes that move or hold them;
    in a copy."""
    if given is None:
        lines = log_of(lmp, files)
        if lines is None:
            raise SnapshotError(f"This LAMMPS has no log to read its commands from: {GIVE_LINES}.")
        given = read_commands(lines, log=True)
    lmp.command("log none")
    styles = styles_of(lmp)
    with suppress(NotLinearisedError):
        check_instance(lmp, styles, given)
    moving = {name for name, style in styles.fixes.items() if style.startswith((*MOVES, *HOLDS))}
    for name in moving:
        style = styles.fixes[name]
        if without_suffix(style) not in MOBILE:
            raise SnapshotError(
                f"fix {name} {style} moves or holds particles in a way that is not known here: unfix it."
            )
        if name not in given.fixes or without_suffix(given.fixes[name].split()[3]) != without_suffix(style):
            raise SnapshotError(
                f"The commands have no line of fix {name} {style}: give the line that the deck has among commands."
            )
    groups = {name: line.split()[2] for name, line in given.fixes.items() if name in moving}
    quieten(lmp)
    found = arrays_at_rest(lmp, groups, [], columns)
    order = np.argsort(found["id"], kind="stable")
    members = {name: found.pop(f"group {name}")[order] for name in groups}
    found = {name: rows if name in BY_CONTACT else rows[order] for name, rows in found.items()}
    return given, styles.fixes, found, members


def _forces_of_pairs(found: Arrays, box: Floats, style: str) -> LinearisedContacts:
    """Pairs that touch, with their forces alone: derivatives are zero, and no bound is known."""
    pairs = _pairs(found, box)
    count, columns = pairs.forces.shape
    if columns == 0:
        pairs = _OneLaw(pairs.who, {name: values[:0] for name, values in pairs.geometry.items()}, np.zeros((0, 4)))
        count = 0
    none, still = np.zeros(count), np.zeros((count, 3))
    tangential = pairs.forces[:, 1:4] if columns >= 4 else still
    made = LinearisedContacts(
        **pairs.geometry, lever_arm=pairs.geometry["slip_arm"], lever_slope=none, normal_force=pairs.forces[:, 0],
        tangential_force=tangential, normal_stiffness=none, tangential_stiffness=none, closing=still, parting=still,
        friction=np.full(count, np.inf), sliding=np.zeros(count, bool), normal_dashpot=none, tangential_dashpot=none,
        viscous_slider=np.full(count, style != OWN),
    )  # fmt: skip
    return made.chosen(made.normal_force != 0)


def _look(lmp: Any, given: Commands | None, files: dict[int, OpenFile]) -> tuple[Commands, dict[str, str], Arrays]:
    """The commands, the styles of fixes, and the arrays of all ranks in the order of the particles' IDs; in a copy if
    there can be one."""
    world, copied = communicator(lmp), can_copy(lmp)
    if given is None:
        lines = log_of(lmp, files) if copied else world.bcast(only_log() if world.rank == 0 else None, root=0)
        if lines is None:
            raise SnapshotError(f"This LAMMPS has no log to read its commands from: {GIVE_LINES}.")
        given = read_commands(lines, log=True)
    elif copied:
        lmp.command("log none")
    styles = styles_of(lmp)
    check_instance(lmp, styles, given)
    plain = {name: without_suffix(style) for name, style in styles.fixes.items()}
    groups = {name: given.fixes[name].split()[2] for name in plain if plain[name] in (*INTEGRATORS, "freeze")}
    walls = [name for name in plain if plain[name] in WALLS]
    columns = "dx dy dz force p3" if given.style == OWN else "dx dy dz force p1 p2 p3"
    if copied:
        quieten(lmp)
    silent = _silent_walls(styles, given)
    with nullcontext() if copied else given_back(lmp):
        mine = arrays_at_rest(lmp, groups, [name for name in walls if name not in silent], columns)
    for name in silent:
        mine[f"wall {name}"] = contacts_of_plane(lmp, name, given.fixes[name], mine)
    every = world.allgather(mine)
    found = {name: _join_ranks([each[name] for each in every]) for name in mine}
    order = np.argsort(found["id"], kind="stable")
    return given, styles.fixes, {name: rows if name in BY_CONTACT else rows[order] for name, rows in found.items()}


def _join_ranks(parts: list[Floats]) -> Floats:
    """Rows of all ranks; those of a rank that has none may have another number of columns."""
    return np.concatenate([part for part in parts if len(part)] or parts[:1])


def check_instance(lmp: Any, styles: Styles, commands: Commands) -> None:
    """Refuse what an instance has that is not linearised here, whatever its particles do."""
    if without_suffix(styles.pair) != commands.style:
        raise SnapshotError(
            f"The commands have pair_style {commands.style}, and the instance has {styles.pair}: {GIVE_LINES}."
        )
    if not lmp.extract_setting("radius_flag") or any(word in styles.atom for word in ("body", "ellipsoid", "bpm")):
        raise SnapshotError(f"atom_style {styles.atom} has no disks and spheres alone: use atom_style sphere.")
    if lmp.extract_global("ftm2v") != 1.0:
        units = lmp.extract_global("units")
        raise SnapshotError(f"In units {units} force is not mass times acceleration: use lj, si, cgs, micro or nano.")
    check_rest(styles.fixes, commands)
    if lmp.extract_setting("molecule_flag") and lmp.extract_global("nbonds"):
        raise NotLinearisedError("Bonds hold particles together: take them out.")
    check_pair(commands, lmp.available_styles("pair"))
    check_fixes(styles.fixes, commands)
    silent = _silent_walls(styles, commands)
    if silent and not can_copy(lmp):
        raise SnapshotError(
            f"fix {silent[0]} wall/gran does not hand out its contacts, and on several ranks or with threads they are "
            "not found without it: write contacts at its end."
        )


def _silent_walls(styles: Styles, commands: Commands) -> list[str]:
    """IDs of walls that hand out no contacts."""
    walls = [name for name, style in styles.fixes.items() if without_suffix(style) == "wall/gran"]
    return [name for name in walls if "contacts" not in commands.fixes[name].split()]


def _snapshot(lmp: Any, commands: Commands, found: Arrays, laws: KnownLaws) -> Configuration:
    count, dimension = len(found["id"]), lmp.extract_setting("dimension")
    if count == 0:
        raise SnapshotError("This LAMMPS has no particles.")
    free, frozen, factor = _mobility(commands, found)
    box, origin, periodic = _box(lmp)
    contacts, remarks = _contacts(lmp, commands, found, frozen, laws, box)
    made = Configuration(
        dimension=dimension,
        position=found["x"][:, :dimension],
        radius=found["radius"],
        mass=found["rmass"],
        inertia=factor * found["rmass"] * found["radius"] ** 2,
        contacts=contacts,
        box=box,
        origin=origin,
        periodic=periodic,
        load=np.zeros((count, 2, 3)),
        free=free,
        ids=found["id"].astype(np.int64),
        kind=found["type"].astype(np.int64),
        remarks=remarks,
    )
    total = np.stack([found["f"], found["torque"]], axis=1)
    load = np.where(free[:, None, None], total - made.contact_force, -made.contact_force)
    _check_torques(load[free, 1] / made.radius[free, None], commands, made.contacts)
    return derive_frozen(made, load=load)


def _box(lmp: Any) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Edges of the box in rows, its lower corner, and along which edges it is periodic."""
    low, high, xy, yz, xz, periodic, _ = lmp.extract_box()
    size = np.subtract(high, low)
    edges = np.array([[size[0], 0, 0], [xy, size[1], 0], [xz, yz, size[2]]])
    return edges, np.array(low), np.array(periodic, dtype=np.bool_)


def _check_friction(contacts: LinearisedContacts) -> None:
    """Refuse tangential forces beyond Coulomb's bound, which is that of the commands."""
    size = np.linalg.norm(contacts.tangential_force, axis=1)
    beyond = size > contacts.friction + AGREES * (contacts.friction + contacts.normal_force)
    if np.any(beyond):
        most = np.max(size[beyond] / contacts.normal_force[beyond])
        mu = np.min(contacts.friction[beyond] / contacts.normal_force[beyond])
        raise SnapshotError(
            f"{np.count_nonzero(beyond)} contacts carry more than Coulomb's bound of the commands, up to |f_t| = "
            f"{most:.3g} f_n with mu = {mu:.3g}: the commands are not those of the instance; {GIVE_LINES}, as they "
            "hold now."
        )


LOST = (
    "have no tangential force, as where histories are lost: LAMMPS reads none from a restart file if another instance "
    "of a granular style was there before in the process, and not all across a periodic boundary or with newton off; "
    "read the file in a process of its own, and run on with drag (fix viscous) until the packing rests"
)

TWICE = "particles touch each other twice, of which LAMMPS mixes the histories: take a box that is wider"


def _touch_twice(contacts: LinearisedContacts) -> bool:
    """Whether two particles touch each other through two periodic images."""
    pairs = np.sort(np.column_stack([contacts.i, contacts.j])[~contacts.wall], axis=1)
    return len(np.unique(pairs, axis=0)) < len(pairs)


def _known_cause(commands: Commands, contacts: LinearisedContacts) -> str:
    """Why forces are out of balance though the packing may be at rest; empty if no cause is known."""
    if _touch_twice(contacts):
        return TWICE
    if commands.write_restart and commands.style != OWN:
        return (
            f"{commands.write_restart!r} stands after the last run, where LAMMPS forgets tangential histories if "
            "its lists of neighbours have changed since: have the run itself write the restart, by `restart N FILE` "
            "before it"
        )
    has_friction = (contacts.friction > 0) & np.isfinite(contacts.friction)  # infinite where no law is known
    lost = np.count_nonzero(has_friction & ~contacts.tangential_force.any(axis=1))
    return f"{lost} of {len(contacts)} contacts {LOST}" if lost else ""


def _check_torques(others: Floats, commands: Commands, contacts: LinearisedContacts) -> None:
    """Refuse torques besides those of the contacts: in all that is taken here contacts alone turn particles."""
    forces = (
        AGREES * np.abs(contacts.tangential_force).max(initial=0.0),
        ROUNDING * contacts.normal_force.max(initial=0.0),
    )
    if np.abs(others).max() > sum(forces):
        known = _known_cause(commands, contacts)
        reason = known or (
            "either something else turns them, which is not linearised here, or this release of LAMMPS hands out "
            "contacts in a way that is not known here; releases of 29 Aug 2024 to 22 Jul 2025 are"
        )
        raise (SnapshotError if known else NotLinearisedError)(
            f"The torques on particles are not those of their contacts: {reason}."
        )


def _mobility(commands: Commands, found: Arrays) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Floats]:
    """Which particles are free, which are frozen, and I/(m R^2) of each."""
    count = len(found["id"])
    frozen, free, factor = np.zeros(count, bool), np.zeros(count, bool), np.full(count, 0.4)
    for name, line in commands.fixes.items():
        if f"group {name}" not in found:
            continue
        members, words = found[f"group {name}"], line.split()
        style = without_suffix(words[3])
        if style == "freeze":
            frozen |= members
        elif style == "nve/sphere":
            factor[members] = 0.5 if "disc" in words else 0.4
        else:
            factor[members] = float(words[4 if style == "nve/disc" else 5])
        free |= members
    free &= ~frozen
    if not free.any():
        raise SnapshotError(
            "Nothing moves the particles: give the line of fix nve/sphere, or set it up, so that it is known which of "
            "them are free and what their moments of inertia are."
        )
    return free, frozen, factor


class _OneLaw(NamedTuple):
    """Contacts that have one law, as LAMMPS says them: between particles of two types, or with one wall.

    `geometry` has the fields of LinearisedContacts that no law enters. `forces` has f_n and the vector f_t of LAMMPS's
    own styles, shape (C, 4), or f_n and the slip of ours, shape (C, 2).
    """

    who: str
    geometry: dict[str, Any]
    forces: Floats


def _contacts(
    lmp: Any, commands: Commands, found: Arrays, frozen: NDArray[np.bool_], laws: KnownLaws, box: Floats
) -> tuple[LinearisedContacts, tuple[str, ...]]:
    """Contacts between particles, then those with each wall; and remarks on their laws."""
    pairs, walls = _pairs(found, box), [name.removeprefix("wall ") for name in found if name.startswith("wall ")]
    parts, remarks = [], []
    if commands.style == OWN:
        parts.append(_linearise_smooth(_smooth_law(commands.pair[0].split()[2:]), pairs))
        for name in walls:
            words = commands.fixes[name].split()
            law = _smooth_law(words[4:7] + words[9:])
            parts.append(_linearise_smooth(law, _floor(found, name, float(words[8]))))
    else:
        groups: dict[Any, _OneLaw] = _by_types(pairs, found["type"]) | {name: _wall(found, name) for name in walls}
        for name, group in groups.items():
            if len(group.forces) == 0:
                continue
            # a law is that of its commands, which a user may change
            key = (*commands.pair, commands.fixes.get(name), name)
            state = _median_state(group, found)
            if key not in laws:
                laws[key] = measure_law(lmp, commands, name, state, group.who)
            remarks.append(remark_on(laws[key], commands, name, state))
            parts.append(_linearise_measured(laws[key], group, found, frozen))
    values = {name: [getattr(each, name) for each in parts] for name in PER_CONTACT}
    if not parts:
        values = {
            name: [np.zeros((0, *shape), bool if name in BOOLEAN else float)] for name, shape in PER_CONTACT.items()
        }
    contacts = LinearisedContacts(**{name: np.concatenate(each) for name, each in values.items()})
    return contacts, tuple(remark for remark in remarks if remark)


def _geometry(
    found: Arrays, i: Indices, j: Indices, normal: Floats, distance: Floats, overlap: Floats
) -> dict[str, Any]:
    arms = np.column_stack([found["radius"][i], np.where(j == WALL, 0.0, found["radius"][j])])
    return {"i": i, "j": j, "normal": normal, "distance": distance, "overlap": overlap, "slip_arm": arms}


def _pairs(found: Arrays, box: Floats) -> _OneLaw:
    """All contacts between particles, of whatever types."""
    rows, partners = found["contacts"], found["partners"]
    if not len(rows):
        rows, partners = np.zeros((0, 7)), np.zeros((0, 2))
    i, j = np.searchsorted(found["id"], partners).T
    if np.any(i == j):
        raise SnapshotError(
            f"Particle {int(partners[i == j][0, 0])} touches its own periodic image: take a box that is wider."
        )
    branch = _towards_first(rows[:, :3], found["x"][i] - found["x"][j], box)
    distance = np.linalg.norm(branch, axis=1)
    overlap = found["radius"][i] + found["radius"][j] - distance
    geometry = _geometry(found, i, j, branch / distance[:, None], distance, overlap)
    return _OneLaw("contacts of mindlin/smooth", geometry, rows[:, 3:])


def _towards_first(branch: Floats, between: Floats, box: Floats) -> Floats:
    """Branch vectors with the sign of another vector but for periods of the box: in LAMMPS of 2024 dx, dy and dz may
    point to the second of the partners."""
    beside = [(between - sign * branch) @ np.linalg.inv(box) for sign in (1, -1)]
    right, wrong = (np.abs(each - np.round(each)).max(axis=1) for each in beside)
    return np.where((right <= wrong)[:, None], branch, -branch)


def _by_types(pairs: _OneLaw, kind: Indices) -> dict[Any, _OneLaw]:
    """Contacts between particles by their two types, the smaller first."""
    types = np.sort(np.column_stack([kind[pairs.geometry["i"]], kind[pairs.geometry["j"]]]), axis=1)
    found = {}
    for first, second in np.unique(types, axis=0).tolist():
        which = np.all(types == (first, second), axis=1)
        geometry = {name: values[which] for name, values in pairs.geometry.items()}
        found[first, second] = _OneLaw(f"contacts of types {first} and {second}", geometry, pairs.forces[which])
    return found


def _at_wall(found: Arrays, name: str, i: Indices, normal: Floats, overlap: Floats, forces: Floats) -> _OneLaw:
    geometry = _geometry(found, i, np.full(len(i), WALL), normal, np.full(len(i), np.inf), overlap)
    return _OneLaw(f"contacts of fix {name}", geometry, forces)


def _wall(found: Arrays, name: str) -> _OneLaw:
    """Contacts with a wall of LAMMPS's own."""
    rows = found[f"wall {name}"]
    i = np.flatnonzero(rows[:, 0] > 0)
    branch, force = found["x"][i] - rows[i, 4:7], rows[i, 1:4]
    every, axis = np.arange(len(i)), np.argmax(np.abs(branch), axis=1)
    distance, normal = branch[every, axis], np.zeros_like(branch)
    normal[every, axis] = np.sign(distance)
    along = np.einsum("ca,ca->c", force, normal)[:, None]
    forces = np.hstack([along, force - along * normal])
    return _at_wall(found, name, i, normal, found["radius"][i] - np.abs(distance), forces)


def _floor(found: Arrays, name: str, height: float) -> _OneLaw:
    """Contacts with a floor of mindlin/smooth."""
    overlap = found["radius"] - (found["x"][:, 1] - height)
    i = np.flatnonzero(overlap > 0)
    normal, forces = np.tile([0.0, 1.0, 0.0], (len(i), 1)), found[f"wall {name}"][i][:, [0, 2]]
    return _at_wall(found, name, i, normal, overlap[i], forces)


def _median_state(contacts: _OneLaw, found: Arrays) -> State:
    """The contact of the median overlap, its partner of the smaller type first."""
    i, j, overlap = (contacts.geometry[name] for name in ("i", "j", "overlap"))
    k = np.argsort(overlap)[len(overlap) // 2]
    radius, mass = found["radius"], found["rmass"]
    if j[k] == WALL:
        return State((radius[i[k]], 0.0), (mass[i[k]], np.inf), overlap[k])
    first, second = sorted((i[k], j[k]), key=lambda each: found["type"][each])
    return State((radius[first], radius[second]), (mass[first], mass[second]), overlap[k])


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


def _linearise_smooth(law: MindlinLaw, contacts: _OneLaw) -> LinearisedContacts:
    """Contacts of mindlin/smooth, along z x n."""
    normal, arms = contacts.geometry["normal"], contacts.geometry["slip_arm"]
    tangent = np.column_stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))])
    slip = contacts.forces[:, -1]
    made = linearise_contacts(law, slip=slip, tangent=tangent, lever_arm=arms, **contacts.geometry)
    _agree(made.normal_force, made.normal_stiffness, contacts)
    return made


def _linearise_measured(
    law: MeasuredLaw, contacts: _OneLaw, found: Arrays, frozen: NDArray[np.bool_]
) -> LinearisedContacts:
    """Contacts of a law that has been measured."""
    i, j, overlap, arms = (contacts.geometry[name] for name in ("i", "j", "overlap", "slip_arm"))
    normal_force, tangential_force = contacts.forces[:, 0], contacts.forces[:, 1:]
    wall, radius, mass = j == WALL, found["radius"], found["rmass"]
    stiffness = (1 + law.stiffness.overlap) * normal_force / overlap
    reduced_radius = np.where(wall, radius[i], radius[i] * radius[j] / (radius[i] + radius[j]))
    # frozen particles weigh infinitely much in LAMMPS's dashpots, but not at walls; two frozen ones matter to nobody
    inverse = np.where(frozen, 0.0, 1 / mass)
    inverse_mass = inverse[i] + inverse[j]
    reduced_mass = np.divide(1.0, inverse_mass, out=np.zeros(len(i)), where=inverse_mass > 0)
    reduced_mass = np.where(wall, mass[i], reduced_mass)
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


def _agree(computed: Floats, stiffness: Floats, contacts: _OneLaw) -> None:
    """Refuse normal forces that are not those of the commands."""
    said, rounding = contacts.forces[:, 0], ROUNDING * stiffness * contacts.geometry["slip_arm"].sum(axis=1)
    if len(said) and np.any(np.abs(computed - said) > AGREES * np.max(np.abs(said)) + rounding):
        raise SnapshotError(
            f"The normal forces of the {contacts.who} are not those of the commands: {GIVE_LINES}, as they hold now."
        )
