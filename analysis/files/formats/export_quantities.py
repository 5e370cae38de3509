"""Quantities of a packing in files: law and load by name, contacts as rows; and further quantities in exports.

Law, load and inertia are names with numbers. Contacts are rows (first ID, second ID, slip); a second ID of 0 is the
floor. Low parts of compensated packings are an additional column. `float.__repr__` is the shortest text that gives the
same double when it is read. Exports also show forces, mobilised friction and modes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...contacts import LinearisedContacts
from ...packing.contacts import Contacts
from ...packing.packing import Packing
from ..runfile_header import law_parameters
from .disks import Slips

PARAMETER_NAMES = (
    "kn", "kt", "mu", "exponent", "rescaled", "coulomb", "cn", "ct", "tau", "fx", "fy", "inertia_factor",
    "slips_known",
)  # fmt: skip
"""Names of law, load and inertia in files; and slips_known, 0 where the slips are not known."""


@dataclass(frozen=True, eq=False)
class ModeVectors:
    """A mode of a packing for an export.

    Attributes
    ----------
    name : str
        Name of its fields.
    eigenvalue : complex
        lambda, 1 / time^2.
    displacement : ndarray of complex, shape (3, N)
        x, y and R theta; of a Configuration all its coordinates, shape (axes, N).
    """

    name: str
    eigenvalue: complex
    displacement: NDArray[np.complex128]

    @property
    def numbers(self) -> dict[str, float]:
        """Real and imaginary part of the eigenvalue by their names in a file."""
        return {f"{self.name}_eigenvalue": self.eigenvalue.real, f"{self.name}_eigenvalue_imag": self.eigenvalue.imag}

    def fields(self, vectors: Callable[[Floats], tuple[Floats, Floats]] | None = None) -> dict[str, Floats]:
        """Translations, shape (N, 3), and rotations by their names in a file; `vectors` is a method of Configuration.

        Without `vectors` the rotations are those of disks, shape (N,).
        """
        found: dict[str, Floats] = {}
        for part, moved in (("", self.displacement.real), ("_imag", self.displacement.imag)):
            if not part or np.any(moved):
                translation, rotation = vectors(moved) if vectors else (in_space(moved[:2].T), moved[2])
                found |= {f"{self.name}{part}": translation, f"{self.name}{part}_rotation": rotation}
        return found


@dataclass(frozen=True, eq=False)
class Frame:
    """A packing for an export, alone or as a frame of a film.

    Attributes
    ----------
    packing : Packing
        The packing. If it is not `whole`, its contacts are all disks that touch, without slips.
    time : float
        F_x of an equilibrium, or the total path of F_x on a ramp with turning points; or the time of an undamped run.
    displacement : ndarray, shape (N, 2), or None
        Displacement from the first frame of a film, length.
    whole : bool
        Whether angles and slips, and so the forces, are known: an undamped run stores only positions.
    """

    packing: Packing
    time: float = 0.0
    displacement: Floats | None = None
    whole: bool = True

    @property
    def number(self) -> dict[str, float]:
        """The time with its name; a ramp has no time besides fx."""
        return {} if self.whole else {"time": self.time}


def scalars(packing: Packing) -> dict[str, float]:
    """Law, load and inertia by name, without absent values and defaults."""
    values = law_parameters(packing.law)
    if packing.drag_time is not None:
        values["tau"] = packing.drag_time
    if not packing.slips_known:
        values["slips_known"] = 0.0
    return {**values, "fx": packing.fx, "fy": packing.fy, "inertia_factor": packing.inertia_factor}


def pick_numbers(values: Mapping[str, Any]) -> dict[str, float]:
    """The values of `PARAMETER_NAMES` in a mapping, as far as these are numbers."""
    found = {}
    for key in PARAMETER_NAMES:
        try:
            found[key] = float(values[key])
        except (KeyError, TypeError, ValueError):
            continue
    return found


def contact_rows(packing: Packing) -> Floats:
    """Rows (first ID, second ID, slip[, low part]), shape (C, 3 or 4); IDs from 1, 0 is the floor."""
    contacts = packing.contacts
    columns = [contacts.i + 1, contacts.j + 1, contacts.slip]
    if contacts.slip_low is not None:
        columns.append(contacts.slip_low)
    return np.column_stack(columns).astype(np.float64)


def slips_of(numbers: Sequence[float] | Floats, compensated: bool) -> Slips:
    """The reverse of `contact_rows`, of its numbers in a row."""
    rows = np.reshape(np.asarray(numbers, dtype=np.float64), (-1, 4 if compensated else 3))
    low = rows[:, 3] if compensated else None
    return Slips(rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64), rows[:, 2], low, complete=True)


def in_space(vectors: Floats) -> Floats:
    """Vectors in the plane with z = 0, shape (n, 3)."""
    return np.ascontiguousarray(np.column_stack([vectors, np.zeros(len(vectors))]))


def contact_force(packing: Packing) -> Floats:
    """f_n n + f_t tau, the force on the first partner of each contact, shape (C, 2)."""
    g = packing.geometry
    return packing.normal_force[:, None] * g.normal + packing.tangential_force[:, None] * g.tangent


def disk_force(packing: Packing) -> Floats:
    """Net force on each disk, load included, and torque over radius, shape (N, 3)."""
    return packing.net_force.reshape(3, -1).T


def disk_pressure(packing: Packing) -> Floats:
    """Sum of the normal forces on each disk, shape (N,)."""
    return sum_at_particles(np.add, len(packing), packing.contacts, packing.normal_force)


def disk_mobilised(packing: Packing) -> Floats:
    """The largest |f_t|/(mu f_n) of the contacts of each disk, shape (N,)."""
    return sum_at_particles(np.maximum, len(packing), packing.contacts, packing.mobilised)


def sum_at_particles(
    operation: np.ufunc, count: int, contacts: Contacts | LinearisedContacts, values: Floats
) -> Floats:
    """Numbers of contacts put together at their particles, shape (N,)."""
    found, pair = np.zeros(count), contacts.j >= 0
    operation.at(found, contacts.i, values)
    operation.at(found, contacts.j[pair], values[pair])
    return found
