"""Contacts as LAMMPS hands them out, by the laws that they have: their geometry and their forces."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...analysis.arrays import Floats, Indices
from ...analysis.contacts import WALL
from .contact_law_measurement import State
from .granular_commands import NotTakenError
from .lammps_arrays import Arrays


class OneLaw(NamedTuple):
    """Contacts that have one law, as LAMMPS says them: between particles of two types, or with one wall.

    `geometry` has the fields of LinearisedContacts that no law enters. `forces` has f_n and the vector f_t of LAMMPS's
    own styles, shape (C, 4), or f_n and the slip of ours, shape (C, 2).
    """

    who: str
    geometry: dict[str, Any]
    forces: Floats

    def chosen(self, which: NDArray[np.bool_]) -> "OneLaw":
        """Some of the contacts."""
        return OneLaw(self.who, {name: values[which] for name, values in self.geometry.items()}, self.forces[which])


def _geometry(
    found: Arrays, i: Indices, j: Indices, normal: Floats, distance: Floats, overlap: Floats
) -> dict[str, Any]:
    arms = np.column_stack([found["radius"][i], np.where(j == WALL, 0.0, found["radius"][j])])
    return {"i": i, "j": j, "normal": normal, "distance": distance, "overlap": overlap, "slip_arm": arms}


def contacts_of_pairs(found: Arrays, box: Floats) -> OneLaw:
    """All contacts between particles, of whatever types."""
    rows, partners = found["contacts"], found["partners"]
    if not len(rows):
        rows, partners = np.zeros((0, 7)), np.zeros((0, 2))
    i, j = np.searchsorted(found["id"], partners).T
    if np.any(i == j):
        raise NotTakenError(
            f"Particle {int(partners[i == j][0, 0])} touches its own periodic image: take a box that is wider."
        )
    branch = _towards_first(rows[:, :3], found["x"][i] - found["x"][j], box)
    distance = np.linalg.norm(branch, axis=1)
    overlap = found["radius"][i] + found["radius"][j] - distance
    geometry = _geometry(found, i, j, branch / distance[:, None], distance, overlap)
    return OneLaw("contacts of mindlin/smooth", geometry, rows[:, 3:])


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


def contacts_of_wall(found: Arrays, name: str) -> OneLaw:
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
