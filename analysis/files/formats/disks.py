"""What a file of another code holds: particles by columns, disks in a plane, and the packing of these under a law.

A reader hands its columns, whatever their names are in the format, to `particles_of`, which interprets them once for
all formats, and refuses impossible numbers. `in_plane` takes them as disks: if a file lacks masses, angles, slips or
the period, the mass is 1, angles and slips are 0, and the sides are open. `packing_of` refuses disks below the floor,
or with a centre inside another disk. `upper_layer` selects the layer by a number of disks, a type, IDs, a group, or a
region, in one line of text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Indices
from ...errors import BadInputError, PackingFileError
from ...packing.contacts import FLOOR, Contacts
from ...packing.geometry import nearest_image, touching
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

OPERATORS = {"<": np.less, ">": np.greater, "<=": np.less_equal, ">=": np.greater_equal}
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


def standard_names(source: object, columns: Mapping[str, Floats], *needed: str) -> dict[str, Floats]:
    """The columns by their standard names; of two with the same meaning the one that has the standard name itself.

    Raises PackingFileError if one that is needed is missing.
    """
    lower = {name.lower(): column for name, column in columns.items()}
    named = {ALIASES[name]: column for name, column in reversed(lower.items()) if name in ALIASES}
    named |= {name: column for name, column in lower.items() if name not in ALIASES}
    if "diameter" in named:
        named.setdefault("radius", 0.5 * named["diameter"])
    for name in (each for each in needed if each not in named):
        also, has = " or diameter" if name == "radius" else "", ", ".join(columns) or "none"
        raise PackingFileError(f"{source} has no column {name}{also} (its columns: {has}): write it with one.")
    return named


class Slips(NamedTuple):
    """Slips of contacts, along tau, length, with low parts if there are any, by the IDs of their disks; 0 is the floor.

    If they are not `complete`, all touching disks are in contact, and contacts that are not listed have no slip.
    """

    first: Indices
    second: Indices
    slip: Floats
    low: Floats | None = None
    complete: bool = False


@dataclass(frozen=True, eq=False)
class Disks:
    """Disks from a file, or from a loose random packing, sorted by ID; or spheres from a file.

    Attributes
    ----------
    source : str
        The file and the place in it, or another origin of the particles.
    position, position_low : ndarray, shape (N, 2), of spheres (N, 3)
        Centres, length, and their low parts, if there are any.
    radius, id, mass, angle, top : ndarray, shape (N,)
        Radii, length; IDs of the file, of disks from 1; mass, orientation, whether in the upper layer: None if absent.
    box_length : float or None
        Period along x; None if the sides are open.
    named : mapping of ndarray of bool, each of shape (N,)
        Members of "type:2", "type:Al" or "group:upper".
    box, origin : ndarray, shape (3, 3) or None, and shape (3,)
        Edges of the box in rows, and its lower corner, length; None where the file has none.
    periodic : sequence of bool, or None
        Along each edge; None where the file does not say, and disks are taken as periodic along x.
    slips : Slips or None
        None if the file has none.
    given : mapping
        Law, load and inertia, as far as the file gives them: kn, kt, mu, exponent, rescaled, coulomb, cn, ct, tau,
        fx, fy, inertia_factor; and slips_known, 0 where the file says that the slips are not known.
    """

    source: str
    position: Floats
    radius: Floats
    id: Indices
    mass: Floats | None = None
    angle: Floats | None = None
    top: NDArray[np.bool_] | None = None
    position_low: Floats | None = None
    box_length: float | None = None
    named: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    box: Floats | None = None
    origin: Floats = field(default_factory=lambda: np.zeros(3))
    periodic: Sequence[bool] | None = None
    slips: Slips | None = None
    given: Mapping[str, float] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.radius)

    def above(self, floor: float) -> Disks:
        """The disks, shifted so that a floor at another height is at y = 0."""
        return self if floor == 0 else replace(self, position=self.position - (0.0, floor))


def places_of(ids: NDArray, known: Indices, source: object, elsewhere: NDArray | bool = False) -> Indices:
    """Where IDs are among known ones, which are sorted; a PackingFileError for one that is not there, nor elsewhere."""
    found = np.minimum(np.searchsorted(known, ids), len(known) - 1)
    for strange in ids[(known[found] != ids) & ~np.broadcast_to(elsewhere, ids.shape)]:
        raise PackingFileError(f"{source}: a contact names particle {strange:g}, which is not there.")
    return found


def choose_frame(path: Path, count: int, frame: int) -> int:
    """The number of the chosen one of some frames, from 0; negative numbers count from the end."""
    if not -count <= frame < count:
        raise PackingFileError(f"{path} has {count} frames; there is no --frame {frame}.")
    return frame % count


def particles_of(
    source: object, columns: Mapping[str, Floats], box: Floats | None = None, *, type_names: Sequence[str] = (),
    first_id: int = 1, groups: Mapping[str, NDArray[np.bool_]] | None = None, **more: Any,
) -> Disks:  # fmt: skip
    """Particles of columns, numbers by name, in any order of the particles.

    `source` begins sentences about them; `type_names` has a name for each particle, `groups` has the members sorted by
    ID, and `more` further fields of `Disks`. A PackingFileError if a column is missing, or holds what it cannot hold.
    """
    c = standard_names(source, columns, "x", "y", "radius")
    if not len(c["x"]):
        raise PackingFileError(f"{source} has no particles.")
    ids = c.setdefault("id", np.arange(len(c["x"]), dtype=np.float64) + np.float64(first_id))
    for name, column in c.items():
        positive, whole = name in ("radius", "mass", "density"), name in ("id", "type")
        odd = ~np.isfinite(column) | (positive & (column <= 0)) | (whole & (column != np.rint(column)))
        needs = "a number above 0" if positive else "a whole number" if whole else "a number"
        for k in np.flatnonzero(odd):
            raise PackingFileError(f"{source}: {name} of particle {ids[k]:g} is {column[k]:g}, and must be {needs}.")
    order = np.argsort(ids, kind="stable")
    c = {name: column[order] for name, column in c.items()}
    for twice in c["id"][1:][np.diff(c["id"]) == 0]:
        raise PackingFileError(f"{source} has particle {twice:g} twice: give each an ID of its own.")
    if c["id"][0] < first_id:
        raise PackingFileError(f"{source}: IDs must be {first_id} or more, and one is {c['id'][0]:g}.")
    if "density" in c:
        c.setdefault("mass", mass_of_density(c["density"], c["radius"]))
    named = {f"type:{kind:g}": c["type"] == kind for kind in np.unique(c.get("type", []))}
    names, sides = np.array(type_names, dtype=object)[order[: len(type_names)]], more.get("periodic")
    named |= {f"type:{name}": names == name for name in dict.fromkeys(names.tolist())}
    named |= {f"group:{name}": members for name, members in (groups or {}).items()}
    closes = box is not None and box[0, 0] > 0 and (sides is None or sides[0])
    return Disks(
        str(source), np.column_stack([c[axis] for axis in ("xyz" if "z" in c and np.ptp(c["z"]) else "xy")]),
        c["radius"], c["id"].astype(np.int64), c.get("mass"), c.get("angle"), c["top"] != 0 if "top" in c else None,
        position_low=np.column_stack([c["x_low"], c["y_low"]]) if {"x_low", "y_low"} <= c.keys() else None,
        box_length=float(box[0, 0]) if box is not None and closes else None, named=named, box=box, **more,
    )  # fmt: skip


def in_plane(found: Disks) -> Disks:
    """Particles as disks, with IDs from 1, as 0 is the floor; a PackingFileError if they do not lie in a plane."""
    place, box = found.position, found.box
    if place.shape[1] == 3 and np.ptp(place[:, 2]) > FLATNESS * found.radius.min():
        says = f"it is of three dimensions (z goes from {place[:, 2].min():g} to {place[:, 2].max():g}), and is read as"
        cure = "for spheres give --material, or `faultgouge import DECK.in`"
        raise PackingFileError(f"{found.source}: {says} disks in a plane; {cure}.")
    if box is not None and np.count_nonzero(box - np.diag(np.diag(box))):
        raise PackingFileError(f"{found.source} has a tilted box: give one with right angles.")
    return replace(found, position=place[:, :2].copy(), id=found.id + (found.id[0] == 0))


def sphere_volume(radius: Floats) -> Floats:
    """Volume of a sphere in the very order of LAMMPS's operations, so that masses are those of LAMMPS to the bit."""
    return 4.0 * np.pi / 3.0 * radius * radius * radius


def mass_of_density(density: Floats, radius: Floats) -> Floats:
    """Masses of spheres, as they were before LAMMPS wrote their densities with 16 digits.

    A mass is the number of twelve digits, if there is one within the rounding of its density; else that which LAMMPS
    reads, to the bit: a mass of one may come back as 0.9999999999999999.
    """
    volume = sphere_volume(radius)
    mass = density * volume
    short = np.array([float(f"{each:.12g}") for each in mass.tolist()])
    half = 0.5 * 10.0 ** (np.floor(np.log10(density)) - 15)
    return np.where(np.abs(short - mass) <= half * volume + 2 * np.spacing(mass), short, mass)


def packing_of(disks: Disks, law: MindlinLaw, top: NDArray[np.bool_], **load: float | None) -> Packing:
    """A packing of disks under a law and a load (fx, fy, inertia_factor, drag_time), with an upper layer, shape (N,).

    Its slips are not known if there is friction and the file does not give the slips of the contacts. Raises
    PackingFileError if disks lie below the floor or inside one another, or form no packing.
    """
    place, radius, period, source = disks.position, disks.radius, disks.box_length, disks.source
    with telling(source, "describes no possible packing", ValueError):
        contacts = touching(place, radius, period)
        for k in np.flatnonzero(place[:, 1] <= 0):
            says = f"disk {disks.id[k]} is at y = {place[k, 1]:g}, below the floor at 0"
            raise PackingFileError(f"{source}: {says}: say with --floor at which y it is.")
        i, j = contacts.i[~contacts.floor], contacts.j[~contacts.floor]
        distance = np.hypot(*nearest_image(place[i] - place[j], period).T)
        for k in np.flatnonzero(distance < np.maximum(radius[i], radius[j])):
            says = f"disks {disks.id[i[k]]} and {disks.id[j[k]]} are {distance[k]:g} apart"
            raise PackingFileError(f"{source}: {says}, the centre of one in the other: separate them.")
        if disks.slips is not None and law.frictional:
            contacts = _slipped(contacts, disks, disks.slips)
        known = disks.slips is not None and bool(disks.given.get("slips_known", True))
        given: dict[str, Any] = {name: getattr(disks, name) for name in ("radius", "angle", "mass", "position_low")}
        given |= {"slips_known": known or not law.frictional or len(contacts) == 0, "box_length": period}
        return Packing(position=place, contacts=contacts, law=law, top=top, **(given | load))


def _slipped(near: Contacts, disks: Disks, slips: Slips) -> Contacts:
    """Contacts with the slips of the file, of which disks that do not touch may have none."""
    ids = np.array([slips.first, slips.second])
    ends = np.where(ids == 0, FLOOR, places_of(ids, disks.id, disks.source, ids == 0))
    i, j = np.where(ends[0] == FLOOR, ends[::-1], ends)
    listed = Contacts(i, j, slips.slip, slips.low)
    if slips.complete:
        return listed
    slip = {(i, j): s for i, j, s in zip(*(each.tolist() for each in (listed.i, listed.j, listed.slip)), strict=True)}
    found = near.slipped(np.array([slip.pop(pair, 0.0) for pair in zip(near.i.tolist(), near.j.tolist(), strict=True)]))
    for i, j in (pair for pair, size in slip.items() if size):
        both = f"{disks.id[i]} and {disks.id[j] if j >= 0 else 'the floor'}"
        says = f"{both} have a slip and do not touch: leave such rows out, or give places and radii that touch"
        raise PackingFileError(f"{disks.source}: {says}.")
    return found


def upper_layer(disks: Disks, says: str | int | None, key: str = "--top ") -> NDArray[np.bool_]:
    """The disks of the upper layer, as booleans, shape (N,).

    `says` is a number of highest disks that touch something, ``type:K`` or ``type:NAME``, ``ids:1,4,7-9``,
    ``ids:@FILE`` (numbers in a file), ``group:NAME``, or conditions on x, y and radius joined by "and"; by default the
    upper layer of the file. Of a packing of which less than half touches something, which is not at rest yet, a number
    is one of the highest of all disks. `key` is what stands before the text where the user gives it. Raises
    BadInputError if no upper layer is given, the text is not understood, or it selects no disk.
    """
    y = disks.position[:, 1]
    if says is None and disks.top is None:
        add = f"add {key.rstrip(' =')}, {LAYER_WAYS}"
        raise BadInputError(f"{disks.source} does not say which disks are the upper layer: {add}.")
    layer = "its own column top" if says is None else f"{key}{says}"
    try:
        chosen = _layer_of(disks, str(says).strip()) if says is not None else disks.top
    except (OSError, ValueError) as error:
        raise BadInputError(f"{layer}: {error}.") from None
    if chosen is None or not chosen.any():
        raise BadInputError(f"{disks.source}: {layer} holds no disk; they go from y = {y.min():g} to {y.max():g}.")
    return chosen


def _layer_of(disks: Disks, text: str) -> NDArray[np.bool_]:
    """The layer that a text names; a ValueError or an OSError says why it is none."""
    kind, _, value = text.partition(":")
    values = {"x": disks.position[:, 0], "y": disks.position[:, 1], "radius": disks.radius}
    chosen = np.zeros(len(disks), dtype=np.bool_)
    if text.isdecimal():
        if int(text) > len(disks):
            raise ValueError(f"{disks.source} has {len(disks)} disks alone")
        with telling(disks.source, "describes no possible packing", ValueError):
            contacts = touching(disks.position, disks.radius, disks.box_length)
        order = np.argsort(-values["y"], kind="stable")
        held = order[np.isin(order, [contacts.i, contacts.j])]
        enough = len(held) >= max(int(text), LEAST_TOUCHING_SHARE * len(disks))
        chosen[(held if enough else order)[: int(text)]] = True
    elif kind in ("type", "group") and value:
        if text not in disks.named:
            has = ", ".join(each[len(kind) + 1 :] for each in disks.named if each.startswith(kind)) or "none"
            raise ValueError(f"{disks.source} has no {kind} {value} (its {kind}s: {has})")
        chosen = disks.named[text]
    elif kind == "ids" and value:
        for part in re.split(r"[\s,]+", (read_plain_text(value[1:]) if value.startswith("@") else value).strip()):
            first, _, last = part.partition("-")
            if not re.fullmatch(r"\d+(-\d+)?", part):
                raise ValueError(f"{part} is no ID and no range of IDs, as in ids:1,4,7-9")
            within = (int(first) <= disks.id) & (disks.id <= int(last or first))
            if within.sum() <= int(last or first) - int(first):
                raise ValueError(f"{disks.source} has no disk {part}")
            chosen |= within
    else:
        parts = [REGION.fullmatch(part) for part in text.split(" and ")]
        if None in parts:
            raise ValueError(f"it is none of {LAYER_WAYS}")
        chosen = np.all([OPERATORS[each[2]](values[each[1]], float(each[3])) for each in parts if each], axis=0)
    return chosen
