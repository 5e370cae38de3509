"""Disks from a file of another code, and the packing of these disks under a law and a load.

Readers find columns; `of_columns` interprets the columns, whatever their names in the format. If a file lacks masses,
angles, slips or the period, the mass is 1, angles and slips are 0, and the sides are open. Impossible numbers are
refused here, once for all formats: disks out of the plane, below the floor, or with a centre inside another disk.
`upper_layer` selects the layer by a number of disks, a type, IDs, a group, or a region, in one line of text.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Indices
from ...errors import BadInputError, PackingFileError
from ...packing.contacts import FLOOR, Contacts
from ...packing.geometry import nearest_image, neighbour_tree, touching
from ...packing.law import MindlinLaw
from ...packing.packing import Packing
from ..plain_file import read_plain_text

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
REGION = re.compile(r"\s*(x|y|radius)\s*(<=|>=|<|>)\s*([-+.\deE]+)\s*")


NAMES = {
    "x": ("x", "xu", "pos_x"),
    "y": ("y", "yu", "pos_y"),
    "radius": ("radius", "r", "rad"),
    "mass": ("mass", "m"),
    "angle": ("angle", "theta", "d_theta"),
    "type": ("type",),
    "id": ("id",),
    "top": ("top",),
}
"""Names of columns; further columns (diameter, density, x_low, y_low) have one name each."""


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
class Disks:
    """Disks from a file, or from a loose random packing, sorted by ID.

    Attributes
    ----------
    source : str
        The file and the place in it, or another origin of the disks.
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
    slips : Slips or None
        None if the file has none.
    given : mapping
        Law, load and inertia, as far as the file gives them: kn, kt, mu, exponent, rescaled, coulomb, cn, ct, tau,
        fx, fy, inertia_factor; and slips_known, 0 where the file says that the slips are not known.
    groups : mapping
        Groups of disks by name, as booleans.
    remark : str
        Information that the format has lost, or units that it has; empty for none.
    length_unit : str
        Unit of the lengths, as the file has it; empty if it names none.
    types : mapping
        Disks of each type by its name, as booleans, where types have names.
    """

    source: str
    position: Floats
    radius: Floats
    id: Indices
    mass: Floats | None = None
    angle: Floats | None = None
    kind: Indices | None = None
    top: NDArray[np.bool_] | None = None
    position_low: Floats | None = None
    box_length: float | None = None
    slips: Slips | None = None
    given: Mapping[str, float] = field(default_factory=dict)
    groups: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    remark: str = ""
    length_unit: str = ""
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


def of_columns(source: str, columns: Mapping[str, Floats], type_names: Sequence[str] = (), **more: Any) -> Disks:
    """Disks from columns of numbers.

    Parameters
    ----------
    source : str
        The file, and where in it, for messages.
    columns : mapping of ndarray, each of shape (N,)
        By the names of `NAMES`; diameter stands for radius, and density is that of a sphere, as in LAMMPS.
    type_names : sequence of str
        Names of the types of the disks, in the order of the columns; empty for types without names.
    **more
        Further fields of :class:`Disks`.

    Raises
    ------
    PackingFileError
        If a column is missing, or holds what it cannot hold.
    """
    found = {name: columns[each] for name, names in NAMES.items() for each in reversed(names) if each in columns}
    if "diameter" in columns:
        found.setdefault("radius", 0.5 * columns["diameter"])
    for name in ("x", "y", "radius"):
        if name not in found:
            has = ", ".join(columns) or "none"
            also = " or diameter" if name == "radius" else ""
            raise PackingFileError(f"{source} has no column {name}{also} (its columns: {has}): write it with one.")
    ids = _whole(source, "id", found["id"]) if "id" in found else np.arange(1, len(found["x"]) + 1)
    _check_numbers(source, columns, ids)
    _check_plane(source, columns, found["radius"])
    if "density" in columns:
        found.setdefault("mass", mass_of_density(columns["density"], found["radius"]))
    order = np.argsort(ids, kind="stable")
    ids = ids[order]
    twice = ids[1:][ids[1:] == ids[:-1]]
    if len(twice):
        raise PackingFileError(f"{source} has disk {twice[0]} twice: give each disk an ID of its own.")
    found = {name: column[order] for name, column in found.items()}
    names = np.array(type_names)[order] if len(type_names) else np.array([])
    low = None
    if "x_low" in columns and "y_low" in columns:
        low = np.column_stack([columns["x_low"], columns["y_low"]])[order]
    return Disks(
        source,
        np.column_stack([found["x"], found["y"]]),
        found["radius"],
        ids,
        found.get("mass"),
        found.get("angle"),
        _whole(source, "type", found["type"]) if "type" in found else None,
        found["top"] != 0 if "top" in found else None,
        low,
        types={str(name): names == name for name in dict.fromkeys(names.tolist())},
        **more,
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


def packing_of(
    disks: Disks,
    law: MindlinLaw,
    top: NDArray[np.bool_],
    *,
    fx: float = 0.0,
    fy: float = 0.0,
    inertia_factor: float = 1.0,
    drag_time: float | None = None,
) -> Packing:
    """Make a packing of disks under a law and a load.

    Parameters
    ----------
    disks : Disks
        From a reader.
    law : MindlinLaw
        Of all contacts.
    top : ndarray of bool, shape (N,)
        The upper layer.
    fx, fy, inertia_factor, drag_time : float
        As for :class:`~faultgouge.analysis.Packing`.

    Returns
    -------
    Packing
        With slips that are not known, if there are contacts with friction, and the file does not give their slips.

    Raises
    ------
    PackingFileError
        If disks lie below the floor or inside one another, or form no packing.
    """
    try:
        _check_places(disks)
        contacts = _contacts(disks, law)
        return Packing(
            position=disks.position,
            radius=disks.radius,
            contacts=contacts,
            law=law,
            angle=disks.angle,
            mass=disks.mass,
            inertia_factor=inertia_factor,
            box_length=disks.box_length,
            top=top,
            fx=fx,
            fy=fy,
            position_low=disks.position_low,
            drag_time=drag_time,
            slips_known=disks.slips_known or not law.frictional or len(contacts) == 0,
        )
    except PackingFileError:
        raise
    except ValueError as error:
        raise PackingFileError(f"{disks.source} describes no possible packing: {error}") from error


def _contacts(disks: Disks, law: MindlinLaw) -> Contacts:
    near = touching(disks.position, disks.radius, disks.box_length)
    slips = disks.slips
    if slips is None or not law.frictional:
        return near
    i, j = (_index(disks, each) for each in (slips.first, slips.second))
    i, j = np.where(i == FLOOR, j, i), np.where(i == FLOOR, i, j)
    listed = Contacts(i, j, slips.slip, slips.low)
    if slips.complete:
        return listed
    known = {pair: k for k, pair in enumerate(zip(listed.i.tolist(), listed.j.tolist(), strict=True))}
    pairs = list(zip(near.i.tolist(), near.j.tolist(), strict=True))
    _refuse_apart(disks, {pair for pair, k in known.items() if listed.slip[k] != 0} - set(pairs))
    where = [known.get(pair, -1) for pair in pairs]
    return near.slipped(np.where(np.array(where) >= 0, np.append(listed.slip, 0.0)[where], 0.0))


def _refuse_apart(disks: Disks, apart: set[tuple[int, int]]) -> None:
    """Refuse slips of disks that do not touch: no contact could have them."""
    if not apart:
        return
    i, j = min(apart)
    if j == FLOOR:
        gap, other = disks.position[i, 1] - disks.radius[i], "the floor"
    else:
        branch = nearest_image(disks.position[i] - disks.position[j], disks.box_length)
        gap, other = np.hypot(*branch) - disks.radius[i] - disks.radius[j], str(disks.id[j])
    many = "1 slip is" if len(apart) == 1 else f"{len(apart)} slips are"
    raise PackingFileError(
        f"{disks.source}: {many} of disks that do not touch: {disks.id[i]} and {other} are {gap:.3g} apart: leave such "
        "rows out, or give positions and radii with which these disks touch."
    )


def _index(disks: Disks, ids: Indices) -> Indices:
    """Indices of IDs; 0 is the floor."""
    where = np.minimum(np.searchsorted(disks.id, ids), len(disks) - 1)
    strange = (disks.id[where] != ids) & (ids != 0)
    if strange.any():
        raise PackingFileError(f"{disks.source}: a contact names disk {ids[strange][0]}, which is not there.")
    return np.where(ids == 0, FLOOR, where)


def _check_numbers(source: str, columns: Mapping[str, Floats], ids: Indices) -> None:
    for name, column in columns.items():
        odd = ~np.isfinite(column)
        if odd.any():
            raise PackingFileError(f"{source}: {name} of disk {ids[odd][0]} is {column[odd][0]:g}, which is no number.")
    for name in (*NAMES["radius"], "diameter", "mass", "density"):
        odd = columns.get(name, np.ones(1)) <= 0
        if odd.any():
            value = f"{columns[name][odd][0]:g}"
            raise PackingFileError(f"{source}: {name} of disk {ids[odd][0]} is {value}: it must be above 0.")


def _check_plane(source: str, columns: Mapping[str, Floats], radius: Floats) -> None:
    z = columns.get("z", columns.get("zu"))
    if z is not None and len(z) and np.ptp(z) > FLATNESS * radius.min():
        raise PackingFileError(
            f"{source} is of three dimensions (z goes from {z.min():g} to {z.max():g}), and what such a file has is "
            "read as disks in a plane: give a run of dimension 2, or, for spheres, a LAMMPS deck with their contact "
            "law, `faultgouge import DECK.in`."
        )


def _check_places(disks: Disks) -> None:
    below = disks.position[:, 1] <= 0
    if below.any():
        raise PackingFileError(
            f"{disks.source}: the centre of disk {disks.id[below][0]} is at y = {disks.position[below][0, 1]:g}, and "
            "the floor is y = 0: say with --floor at which y it is."
        )
    tree = neighbour_tree(disks.position, disks.box_length)
    pairs = tree.query_pairs(float(disks.radius.max()), output_type="ndarray")
    apart = nearest_image(disks.position[pairs[:, 0]] - disks.position[pairs[:, 1]], disks.box_length)
    distance = np.hypot(*apart.T)
    inside = distance < np.maximum(*disks.radius[pairs].T)
    if inside.any():
        a, b = disks.id[pairs[inside][0]]
        raise PackingFileError(
            f"{disks.source}: disks {a} and {b} are {distance[inside][0]:g} apart, so that the centre of one lies in "
            "the other: the law is that of small overlaps; separate them."
        )


def _whole(source: str, name: str, column: Floats) -> Indices:
    if not np.array_equal(column, np.rint(column)) or (name == "id" and np.any(column < 1)):
        raise PackingFileError(f"{source}: the column {name} must hold whole numbers{' from 1' * (name == 'id')}.")
    return column.astype(np.int64)


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
    source, text = disks.source, "" if says is None else str(says).strip()
    kind, _, value = text.partition(":")

    def refusal(reason: str) -> UpperLayerError:
        return UpperLayerError(f"{key}{text}: {reason}.")

    if says is None:
        if disks.top is None:
            says = f"{source} does not say which disks are the upper layer"
            raise UpperLayerError(f"{says}: add {key.rstrip(' =')}, {LAYER_WAYS}.")
        if not disks.top.any():
            raise UpperLayerError(f"{source}: its own column top holds no disk: {_extent(disks)}.")
        return disks.top
    if text.isdecimal():
        if int(text) > len(disks):
            raise refusal(f"{source} has {len(disks)} disks alone")
        order = np.argsort(-disks.position[:, 1], kind="stable")
        held = ~touching_nothing(disks)[order]
        if held.sum() >= max(int(text), LEAST_TOUCHING_SHARE * len(disks)):
            order = order[held]
        chosen = np.isin(np.arange(len(disks)), order[: int(text)])
    elif kind == "type" and value in disks.types:
        chosen = disks.types[value]
    elif kind == "type" and value.isdecimal() and disks.kind is not None:
        chosen = disks.kind == int(value)
    elif kind == "type" and value:
        if disks.types:
            raise refusal(f"{source} has no type {value} (its types: {', '.join(disks.types)})")
        if disks.kind is None:
            raise refusal(f"{source} has no types; take another of {LAYER_WAYS}")
        raise refusal(f"the types of {source} have no names: give a number, as in type:2")
    elif kind == "group" and value:
        if value not in disks.groups:
            has = ", ".join(disks.groups) or "none; restarts alone have groups"
            raise refusal(f"{source} has no group {value} (its groups: {has})")
        chosen = disks.groups[value]
    elif kind == "ids" and value:
        try:
            listed = read_plain_text(value[1:]) if value.startswith("@") else value
        except (OSError, UnicodeDecodeError) as error:
            raise refusal(f"the file cannot be read ({error})") from None
        wanted: set[int] = set()
        for part in re.split(r"[\s,]+", listed.strip()):
            match = re.fullmatch(r"(\d+)(?:-(\d+))?", part)
            if not match:
                raise refusal(f"{part} is no ID and no range of IDs, as in ids:1,4,7-9")
            wanted.update(range(int(match[1]), int(match[2] or match[1]) + 1))
        if missing := wanted - set(disks.id.tolist()):
            raise refusal(f"{source} has no disk {min(missing)}")
        chosen = np.isin(disks.id, list(wanted))
    else:
        values = {"x": disks.position[:, 0], "y": disks.position[:, 1], "radius": disks.radius}
        chosen = np.ones(len(disks), dtype=np.bool_)
        for part in text.split(" and "):
            match = REGION.fullmatch(part)
            try:
                chosen = chosen & OPERATORS[match[2]](values[match[1]], float(match[3])) if match else chosen & False
            except ValueError:
                match = None
            if match is None:
                raise refusal(f"it is none of {LAYER_WAYS}")
    if not chosen.any():
        raise refusal(f"this layer of {source} holds no disk: {_extent(disks)}")
    return chosen


def touching_nothing(disks: Disks) -> NDArray[np.bool_]:
    """Disks that touch neither another disk nor the floor, shape (N,)."""
    try:
        contacts = touching(disks.position, disks.radius, disks.box_length)
    except ValueError as error:
        raise PackingFileError(f"{disks.source} describes no possible packing: {error}") from error
    alone = np.ones(len(disks), dtype=np.bool_)
    alone[contacts.i] = alone[contacts.j[~contacts.floor]] = False
    return alone


def layer_remark(disks: Disks, says: str | None, layer: NDArray[np.bool_]) -> str:
    """A remark on disks that touch nothing, in the layer or above it; empty for none, or too many."""
    alone = touching_nothing(disks)
    if alone.mean() > 1 - LEAST_TOUCHING_SHARE:
        return ""
    loose = disks.id[layer & alone].tolist()
    if loose:
        return f"{len(loose)} of the {layer.sum()} disks of the upper layer touch nothing: {_list_ids(loose)}"
    if says is None or not says.strip().isdecimal():
        return ""
    above = disks.id[alone & (disks.position[:, 1] > disks.position[layer, 1].min())].tolist()
    return (
        f"--top {says} leaves out {len(above)} of the highest disks, which touch nothing: {_list_ids(above)}"
        if above
        else ""
    )


def _list_ids(ids: list[int]) -> str:
    return ", ".join(map(str, ids[:MOST_NAMES])) + (", ..." if len(ids) > MOST_NAMES else "")


def _extent(disks: Disks) -> str:
    y = disks.position[:, 1]
    types = list(disks.types) or ([] if disks.kind is None else np.unique(disks.kind).tolist())
    kinds = f", and their types are {', '.join(map(str, types))}" if types else ""
    return f"its disks go from y = {y.min():g} to {y.max():g}{kinds}"
