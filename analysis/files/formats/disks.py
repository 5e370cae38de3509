"""What a file of another code holds: particles in columns, disks in a plane, and the packing of these under a law.

A reader returns columns, a `ParticleTable`, whatever their names are in the format. `sorted_columns` interprets them
once for all formats, and refuses impossible numbers. `disks_of` makes disks: if a file lacks masses, angles, slips or
the period, the mass is 1, angles and slips are 0, and the sides are open. `packing_of` refuses disks below the floor,
or with a centre inside another disk. `upper_layer` selects the layer by a number of disks, a type, IDs, a group, or a
region, in one line of text.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Indices
from ...errors import BadInputError, PackingFileError
from ...packing.contacts import FLOOR, Contacts
from ...packing.geometry import nearest_image, neighbour_tree, touching
from ...packing.law import MindlinLaw
from ...packing.packing import Packing
from ..atomic_write import read_plain_text, telling

FLATNESS = 1e-6
"""Spread of z up to which disks lie in a plane, in smallest radii: text with seven digits, or float32, leaves less."""

LAYER_WAYS = (
    "12 (the highest that touch something), type:2, type:NAME, ids:1,4,7-9, ids:@FILE, group:NAME (of a restart), or a "
    'region such as "y>10"'
)

LEAST_TOUCHING_SHARE = 0.5
"""Share of disks that touch something below which a packing is not at rest yet, and contacts tell nothing."""

MOST_NAMES = 10
"""Disks that are named; more are counted."""

OPERATORS = {"<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge}
REGION = re.compile(r"\s*(x|y|radius)\s*(<=|>=|<|>)\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*")

ALIASES = {
    "xu": "x", "yu": "y", "zu": "z", "pos_x": "x", "pos_y": "y", "r": "radius", "rad": "radius", "c_radius": "radius",
    "m": "mass", "theta": "angle", "d_theta": "angle", "matid": "type",
    "i": "id1", "j": "id2", "first": "id1", "second": "id2", "patom1": "id1", "patom2": "id2", "f_n": "fn",
    "force": "fn", "p1": "ftx", "p2": "fty", "p3": "ftz", "f_t_x": "ftx", "f_t_y": "fty", "f_t_z": "ftz",
    "f_low[1]": "x_low", "f_low[2]": "y_low", "f_floor[3]": "floor_slip", "f_floor[8]": "floor_slip_low",
    "c_ids[1]": "id1", "c_ids[2]": "id2", "c_contact[3]": "slip", "c_contact[4]": "slip_low",
}  # fmt: skip
"""Other names of columns, of particles and of contacts: those of LAMMPS, of our decks' dumps, of YADE."""


def standard_names(columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """The columns by their standard names; of two with the same meaning the one that has the standard name itself."""
    lower = {name.lower(): column for name, column in columns.items()}
    named = {ALIASES[name]: column for name, column in reversed(lower.items()) if name in ALIASES}
    return named | {name: column for name, column in lower.items() if name not in ALIASES}


@dataclass(frozen=True, eq=False)
class Slips:
    """Slips of contacts, by the IDs of their disks.

    Attributes
    ----------
    first, second : ndarray of int, shape (C,)
        IDs; a second ID of 0 is the floor.
    slip : ndarray, shape (C,)
        Along tau, length.
    low : ndarray, shape (C,), or None
        Their low parts.
    complete : bool
        Whether these are all contacts. Otherwise all touching disks are in contact; contacts not listed have no slip.
    """

    first: Indices
    second: Indices
    slip: Floats
    low: Floats | None = None
    complete: bool = False


@dataclass(frozen=True, eq=False)
class FileContents:
    """What a file of another code says, besides its particles.

    Attributes
    ----------
    source : str
        The file and the place in it, or another origin of the particles.
    slips : Slips or None
        None if the file has none.
    given : mapping
        Law, load and inertia, as far as the file gives them: kn, kt, mu, exponent, rescaled, coulomb, cn, ct, tau,
        fx, fy, inertia_factor; and slips_known, 0 where the file says that the slips are not known.
    groups : mapping
        Groups of particles by name, as booleans, sorted by ID.
    remark : str
        Information that the format has lost, or units that it has; empty for none.
    length_unit : str
        Unit of the lengths, as the file has it; empty if it names none.
    """

    source: str
    slips: Slips | None = field(default=None, kw_only=True)
    given: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    groups: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict, kw_only=True)
    remark: str = field(default="", kw_only=True)
    length_unit: str = field(default="", kw_only=True)


@dataclass(frozen=True, eq=False)
class ParticleTable(FileContents):
    """What a reader finds in a file.

    Attributes
    ----------
    columns : mapping of ndarray, each of shape (N,)
        Numbers by name.
    box : ndarray, shape (3, 3), or None
        Its edges in rows, length; None where the file has none.
    origin : ndarray, shape (3,), or None
        Its lower corner; zero by default.
    periodic : sequence of bool, or None
        Along each edge; None where the file does not say, and disks are taken as periodic along x.
    type_names : sequence of str
        Of each particle, where types have names.
    first_id : int
        Number of the first particle, in a code that counts from 0.
    """

    columns: Mapping[str, Floats]
    box: Floats | None = None
    origin: Floats | None = None
    periodic: Sequence[bool] | None = None
    type_names: Sequence[str] = ()
    first_id: int = 1


@dataclass(frozen=True, eq=False)
class Disks(FileContents):
    """Disks from a file, or from a loose random packing, sorted by ID.

    Attributes
    ----------
    position : ndarray, shape (N, 2)
        Centres, length.
    radius : ndarray, shape (N,)
        Radii, length.
    id : ndarray of int, shape (N,)
        IDs of the file, or from 1.
    mass, angle, kind, top, position_low : ndarray or None
        Mass, orientation, type, whether a disk belongs to the upper layer, low parts of the centres; None if absent.
    box_length : float or None
        Period along x; None if the sides are open.
    types : mapping
        Disks of each type by its name, as booleans, where types have names.
    """

    position: Floats
    radius: Floats
    id: Indices
    mass: Floats | None = None
    angle: Floats | None = None
    kind: Indices | None = None
    top: NDArray[np.bool_] | None = None
    position_low: Floats | None = None
    box_length: float | None = None
    types: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.radius)

    def above(self, floor: float) -> Disks:
        """The disks, shifted so that a floor at another height is at y = 0."""
        return self if floor == 0 else replace(self, position=self.position - (0.0, floor))

    @property
    def slips_known(self) -> bool:
        """Whether the file gives slips that are known."""
        return self.slips is not None and bool(self.given.get("slips_known", True))


def choose_frame(path: Path, counts: Sequence[int], frame: int | None) -> int:
    """The number of the chosen frame, from 0; by default the last frame, if all frames have as many particles."""
    wanted, (low, high) = -1 if frame is None else frame, (min(counts, default=0), max(counts, default=0))
    if frame is None and low != high:
        raise PackingFileError(f"{path} has frames with {low} and {high} particles: choose one with --frame.")
    if not -len(counts) <= wanted < len(counts):
        raise PackingFileError(f"{path} has {len(counts)} frames; there is no --frame {wanted}.")
    return wanted % len(counts)


def sorted_columns(found: ParticleTable) -> tuple[dict[str, Floats], Indices]:
    """The columns by standard names, sorted by ID, with radius, id and, of a density, mass; and their order.

    Raises PackingFileError if a column is missing, or holds what it cannot hold.
    """
    source, columns = found.source, standard_names(found.columns)
    if "diameter" in columns:
        columns.setdefault("radius", 0.5 * columns["diameter"])
    for name in ("x", "y", "radius"):
        if name not in columns:
            has = ", ".join(found.columns) or "none"
            also = " or diameter" if name == "radius" else ""
            raise PackingFileError(f"{source} has no column {name}{also} (its columns: {has}): write it with one.")
    if not len(columns["x"]):
        raise PackingFileError(f"{source} has no particles.")
    ids = columns.setdefault("id", np.arange(len(columns["x"]), dtype=np.float64) + np.float64(found.first_id))
    for name, column in columns.items():
        odd, says = ~np.isfinite(column), "which is no number"
        if name in ("radius", "mass", "density"):
            odd, says = odd | (column <= 0), "and must be above 0"
        elif name in ("id", "type"):
            odd, says = odd | (column != np.rint(column)), "and must be a whole number"
        if odd.any():
            raise PackingFileError(f"{source}: {name} of particle {ids[odd][0]:g} is {column[odd][0]:g}, {says}.")
    order = np.argsort(ids, kind="stable")
    for twice in ids[order][1:][np.diff(ids[order]) == 0]:
        raise PackingFileError(f"{source} has particle {twice:g} twice: give each an ID of its own.")
    if ids[order][0] < found.first_id:
        raise PackingFileError(f"{source}: IDs must be {found.first_id} or more, and one is {ids[order][0]:g}.")
    if "density" in columns:
        columns.setdefault("mass", mass_of_density(columns["density"], columns["radius"]))
    return {name: column[order] for name, column in columns.items()}, order


def disks_of(found: ParticleTable) -> Disks:
    """The disks that a reader has found; a PackingFileError if they do not lie in a plane, or as `sorted_columns`."""
    source, (c, order) = found.source, sorted_columns(found)
    z = c.get("z", np.zeros(1))
    if np.ptp(z) > FLATNESS * c["radius"].min():
        says = f"it is of three dimensions (z goes from {z.min():g} to {z.max():g}), and is read as disks in a plane"
        raise PackingFileError(f"{source}: {says}; for spheres give --material, or `faultgouge import DECK.in`.")
    period = None
    if found.box is not None:
        if np.count_nonzero(found.box - np.diag(np.diag(found.box))):
            raise PackingFileError(f"{source} has a tilted box: give one with right angles.")
        if found.box[0, 0] > 0 and (found.periodic is None or found.periodic[0]):
            period = float(found.box[0, 0])
    names = np.array(found.type_names)[order] if len(found.type_names) else np.array([])
    return Disks(
        source,
        np.column_stack([c["x"], c["y"]]),
        c["radius"],
        c["id"].astype(np.int64) + (1 - found.first_id),  # 0 is the floor
        c.get("mass"),
        c.get("angle"),
        c["type"].astype(np.int64) if "type" in c else None,
        c["top"] != 0 if "top" in c else None,
        np.column_stack([c["x_low"], c["y_low"]]) if {"x_low", "y_low"} <= c.keys() else None,
        period,
        types={str(name): names == name for name in dict.fromkeys(names.tolist())},
        **{each.name: getattr(found, each.name) for each in fields(FileContents) if each.name != "source"},
    )


def sphere_volume(radius: Floats) -> Floats:
    """Volume of a sphere in the very order of LAMMPS's operations, so that masses are those of LAMMPS to the bit."""
    return 4.0 * np.pi / 3.0 * radius * radius * radius


def mass_of_density(density: Floats, radius: Floats) -> Floats:
    """Masses of spheres, as they were before LAMMPS wrote their densities with 16 digits.

    A mass of one may come back as 0.9999999999999999. A mass is therefore the number of twelve digits, if there is one
    within the rounding of its density; else it is that which LAMMPS reads, to the bit.
    """
    volume = sphere_volume(radius)
    mass = density * volume
    short = np.array([float(f"{each:.12g}") for each in mass.tolist()])
    half = 0.5 * 10.0 ** (np.floor(np.log10(density)) - 15)
    return np.where(np.abs(short - mass) <= half * volume + 2 * np.spacing(mass), short, mass)


def packing_of(disks: Disks, law: MindlinLaw, top: NDArray[np.bool_], **load: float | None) -> Packing:
    """Make a packing of disks under a law and a load.

    Parameters
    ----------
    disks : Disks
        From a reader.
    law : MindlinLaw
        Of all contacts.
    top : ndarray of bool, shape (N,)
        The upper layer.
    **load : float
        fx, fy, inertia_factor, drag_time as for :class:`~faultgouge.analysis.Packing`.

    Returns
    -------
    Packing
        With slips that are not known, if there are contacts with friction, and the file does not give their slips.

    Raises
    ------
    PackingFileError
        If disks lie below the floor or inside one another, or form no packing.
    """
    with telling(disks.source, "describes no possible packing", (ValueError,)):
        _check_places(disks)
        contacts = _contacts(disks, law)
        names = ("position", "radius", "angle", "mass", "box_length", "position_low")
        fields = load | {name: getattr(disks, name) for name in names}
        known = disks.slips_known or not law.frictional or len(contacts) == 0
        return Packing(contacts=contacts, law=law, top=top, slips_known=known, **fields)


def _check_places(disks: Disks) -> None:
    below = disks.position[:, 1] <= 0
    if below.any():
        says = (
            f"the centre of disk {disks.id[below][0]} is at y = {disks.position[below][0, 1]:g}, and the floor is y = 0"
        )
        raise PackingFileError(f"{disks.source}: {says}: say with --floor at which y it is.")
    tree = neighbour_tree(disks.position, disks.box_length)
    pairs = tree.query_pairs(float(disks.radius.max()), output_type="ndarray")
    apart = nearest_image(disks.position[pairs[:, 0]] - disks.position[pairs[:, 1]], disks.box_length)
    distance = np.hypot(*apart.T)
    for k in np.flatnonzero(distance < np.maximum(*disks.radius[pairs].T)):
        a, b = disks.id[pairs[k]]
        says = f"disks {a} and {b} are {distance[k]:g} apart, the centre of one in the other: separate them"
        raise PackingFileError(f"{disks.source}: {says}.")


def _contacts(disks: Disks, law: MindlinLaw) -> Contacts:
    """All contacts, with the slips of the file, of which disks that do not touch may have none."""
    near, slips = touching(disks.position, disks.radius, disks.box_length), disks.slips
    if slips is None or not law.frictional:
        return near
    ids = np.array([slips.first, slips.second])
    ends = np.minimum(np.searchsorted(disks.id, ids), len(disks) - 1)
    for strange in ids[(disks.id[ends] != ids) & (ids != 0)]:
        raise PackingFileError(f"{disks.source}: a contact names disk {strange}, which is not there.")
    ends[ids == 0] = FLOOR
    i, j = np.where(ends[0] == FLOOR, ends[::-1], ends)
    listed = Contacts(i, j, slips.slip, slips.low)
    if slips.complete:
        return listed
    known = {pair: k for k, pair in enumerate(zip(near.i.tolist(), near.j.tolist(), strict=True))}
    pairs = zip(listed.i.tolist(), listed.j.tolist(), strict=True)
    where = np.array([known.get(pair, -1) for pair in pairs], dtype=np.int64)
    lost = np.flatnonzero((where < 0) & (listed.slip != 0))
    if len(lost):
        a, b = int(listed.i[lost[0]]), int(listed.j[lost[0]])
        second, reach = (disks.position[b], disks.radius[b]) if b >= 0 else (disks.position[a] * (1, 0), 0.0)
        gap = np.hypot(*nearest_image(disks.position[a] - second, disks.box_length)) - disks.radius[a] - reach
        other, many = disks.id[b] if b >= 0 else "the floor", "slip is" if len(lost) == 1 else "slips are"
        says = f"{len(lost)} {many} of disks that do not touch: {disks.id[a]} and {other} are {gap:.3g} apart"
        raise PackingFileError(f"{disks.source}: {says}: leave such rows out, or give places and radii that touch.")
    slip = np.zeros(len(near))
    slip[where[where >= 0]] = listed.slip[where >= 0]
    return near.slipped(slip)


class UpperLayerError(BadInputError):
    """The upper layer is not given, or its text is not understood, or names what a file does not have."""


def upper_layer(disks: Disks, says: str | int | None, key: str = "--top ") -> NDArray[np.bool_]:
    """Select the disks of the upper layer.

    Parameters
    ----------
    disks : Disks
        From a reader.
    says : str or int, optional
        A number of highest disks that touch something, ``type:K`` or ``type:NAME``, ``ids:1,4,7-9``, ``ids:@FILE``
        (numbers in a file), ``group:NAME``, or conditions on x, y and radius joined by "and". By default the upper
        layer of the file. Of a packing of which less than half touches something, which is not at rest yet, a number
        is one of the highest of all disks.
    key : str
        What stands before the text where the user gives it, for messages.

    Returns
    -------
    ndarray of bool, shape (N,)

    Raises
    ------
    UpperLayerError
        If no upper layer is given, the text is not understood, or it selects no disk.
    """
    text = "" if says is None else str(says).strip()
    if says is None and disks.top is None:
        unsaid = f"{disks.source} does not say which disks are the upper layer"
        raise UpperLayerError(f"{unsaid}: add {key.rstrip(' =')}, {LAYER_WAYS}.")
    try:
        chosen = disks.top if says is None else _layer_of(disks, text)
    except (OSError, ValueError) as error:
        raise UpperLayerError(f"{key}{text}: {error}.") from None
    if chosen is None or not chosen.any():
        y = disks.position[:, 1]
        types = list(disks.types) or ([] if disks.kind is None else np.unique(disks.kind).tolist())
        kinds = f", and their types are {', '.join(map(str, types))}" if types else ""
        source = disks.source
        layer = f"{source}: its own column top" if says is None else f"{key}{text}: this layer of {source}"
        raise UpperLayerError(f"{layer} holds no disk: its disks go from y = {y.min():g} to {y.max():g}{kinds}.")
    return chosen


def _layer_of(disks: Disks, text: str) -> NDArray[np.bool_]:
    """The layer that a text names; a ValueError or an OSError says why it is none."""
    kind, _, value = text.partition(":")
    if text.isdecimal():
        if int(text) > len(disks):
            raise ValueError(f"{disks.source} has {len(disks)} disks alone")
        order = np.argsort(-disks.position[:, 1], kind="stable")
        held = ~touching_nothing(disks)[order]
        if held.sum() >= max(int(text), LEAST_TOUCHING_SHARE * len(disks)):
            order = order[held]
        return np.isin(np.arange(len(disks)), order[: int(text)])
    if kind in ("type", "group") and value:
        by_name = disks.types if kind == "type" else disks.groups
        if value in by_name:
            return by_name[value]
        if kind == "type" and value.isdecimal() and disks.kind is not None:
            return np.asarray(disks.kind == int(value))
        numbers = "numbers, as in type:2" if kind == "type" and disks.kind is not None else "none"
        raise ValueError(f"{disks.source} has no {kind} {value} (its {kind}s: {', '.join(by_name) or numbers})")
    if kind == "ids" and value:
        wanted = set[int]()
        for part in re.split(r"[\s,]+", (read_plain_text(value[1:]) if value.startswith("@") else value).strip()):
            match = re.fullmatch(r"(\d+)(?:-(\d+))?", part)
            if not match:
                raise ValueError(f"{part} is no ID and no range of IDs, as in ids:1,4,7-9")
            wanted.update(range(int(match[1]), int(match[2] or match[1]) + 1))
        for missing in sorted(wanted - set(disks.id.tolist())):
            raise ValueError(f"{disks.source} has no disk {missing}")
        return np.isin(disks.id, list(wanted))
    values = {"x": disks.position[:, 0], "y": disks.position[:, 1], "radius": disks.radius}
    parts = [REGION.fullmatch(part) for part in text.split(" and ")]
    if None in parts:
        raise ValueError(f"it is none of {LAYER_WAYS}")
    return np.all([OPERATORS[each[2]](values[each[1]], float(each[3])) for each in parts if each], axis=0)


def touching_nothing(disks: Disks) -> NDArray[np.bool_]:
    """Disks that touch neither another disk nor the floor, shape (N,)."""
    with telling(disks.source, "describes no possible packing", (ValueError,)):
        contacts = touching(disks.position, disks.radius, disks.box_length)
    return ~np.isin(np.arange(len(disks)), [contacts.i, contacts.j])


def layer_remark(disks: Disks, says: str | None, layer: NDArray[np.bool_]) -> str:
    """A remark on disks that touch nothing, in the layer or above it; empty for none, or too many."""

    def listed(which: NDArray[np.bool_]) -> str:
        ids = disks.id[which].tolist()
        return ", ".join(map(str, ids[:MOST_NAMES])) + (", ..." if len(ids) > MOST_NAMES else "")

    alone = touching_nothing(disks)
    above = alone & (disks.position[:, 1] > disks.position[layer, 1].min())
    if alone.mean() > 1 - LEAST_TOUCHING_SHARE:
        return ""
    if (loose := layer & alone).any():
        return f"{loose.sum()} of the {layer.sum()} disks of the upper layer touch nothing: {listed(loose)}"
    if says is not None and says.strip().isdecimal() and above.any():
        return f"--top {says} leaves out {above.sum()} of the highest disks, which touch nothing: {listed(above)}"
    return ""
