"""What a packing is beyond places and sizes, for formats that have room for names with numbers.

Law, load and inertia as names with numbers, and contacts as rows (first ID, second ID, slip), where a second ID of 0 is
the floor; low parts of compensated packings are a column more. `float.__repr__` is the shortest text that is the same
double when it is read.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...analysis import Packing
from ...analysis.files.runfile_header import unusual
from .disks import Slips

KEYS = ("kn", "kt", "mu", "exponent", "rescaled", "cn", "ct", "tau", "fx", "fy", "inertia_factor")
"""Names of law, load and inertia in files."""


def scalars(packing: Packing) -> dict[str, float]:
    """Law, load and inertia by name; those that are not there, or as always, are left out."""
    law = packing.law
    values = {"kn": law.kn, "kt": law.kt, "mu": law.mu}
    values |= unusual(law)
    if packing.drag_time is not None:
        values["tau"] = packing.drag_time
    return {**values, "fx": packing.fx, "fy": packing.fy, "inertia_factor": packing.inertia_factor}


def given(values: Mapping[str, Any]) -> dict[str, float]:
    """The names of `KEYS` among others, as numbers; what is no number is left out."""
    found = {}
    for key in KEYS:
        try:
            found[key] = float(values[key])
        except (KeyError, TypeError, ValueError):
            continue
    return found


def contact_rows(packing: Packing) -> NDArray[np.float64]:
    """Rows (first ID, second ID, slip[, low part]), shape (C, 3 or 4); IDs from 1, 0 is the floor."""
    contacts = packing.contacts
    columns = [contacts.i + 1, contacts.j + 1, contacts.slip]
    if contacts.slip_low is not None:
        columns.append(contacts.slip_low)
    return np.column_stack(columns).astype(np.float64)


def slips_of(rows: NDArray[np.float64]) -> Slips:
    """The reverse of `contact_rows`."""
    low = rows[:, 3] if rows.shape[1] > 3 else None
    return Slips(rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64), rows[:, 2], low, complete=True)
