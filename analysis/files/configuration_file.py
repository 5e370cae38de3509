"""A run.h5 that contains a Configuration, bitwise, in two or three dimensions.

The file is sealed like every run.h5 (:mod:`.atomic_write`), and is H5MD 1.1::

    /h5md                             version, author, creator
    /particles/particles/position     (1, N, 3)  centres; z = 0 of disks
    /particles/particles/box          dimension 3; lengths of the edges, and which are periodic
    /snapshot/<name>                  fields of :class:`~faultgouge.analysis.Configuration`
    /snapshot/contacts/<name>         fields of :class:`~faultgouge.analysis.LinearisedContacts`
    /snapshot/<matrix>/<part>         stiffness, damping and constraint, where these are given: data, indices, indptr
"""

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from ..configuration import Configuration
from ..contacts import PER_CONTACT, LinearisedContacts
from .atomic_write import SEAL, begins_with, new_sealed, open_sealed, telling, write_sealed

if TYPE_CHECKING:
    import h5py

CREATOR = "faultgouge"

CHECKSUM: dict[str, Any] = {"fletcher32": True}
"""A checksum for every chunk, for readers other than this one."""

SCALARS = ("dimension", "fx", "load_error", "drag_rate", "spring", "operator_error", "slips_known")
ARRAYS = (
    "position", "radius", "mass", "inertia", "box", "origin", "periodic", "load", "free", "ids", "kind", "top", "jump",
    "wall_force",
)  # fmt: skip
MATRICES = ("stiffness", "damping", "constraint")
MATRIX_PARTS = ("data", "indices", "indptr")


def write_configuration(
    path: Path, configuration: Configuration, attributes: Mapping[str, str | int | float] | None = None
) -> None:
    """Write a configuration; an existing file is replaced.

    Parameters
    ----------
    attributes : mapping, optional
        Attributes of the root, such as the deck.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    c = configuration
    with new_sealed() as file:
        write_h5md(file)
        particles, group = file.create_group("particles/particles"), file.create_group("snapshot")
        position = np.pad(c.position, ((0, 0), (0, 3 - c.dimension)))
        for name, value in (("value", position[None]), ("step", np.zeros(1, int)), ("time", np.zeros(1))):
            particles[f"position/{name}"] = value
        particles["box/edges"] = np.linalg.norm(c.box, axis=1)
        sides = ["periodic" if each else "none" for each in c.periodic]
        particles["box"].attrs.update({"dimension": 3, "boundary": sides})
        more = {"proof": c.proof, "remarks": list(c.remarks) or None}
        numbers = {name: getattr(c, name) for name in SCALARS} | more
        group.attrs.update({name: value for name, value in numbers.items() if value is not None})
        for name in ARRAYS:
            group[name] = getattr(c, name)
        given = {name: matrix for name in MATRICES if (matrix := getattr(c, name)) is not None}
        parts = {f"{name}/{each}": getattr(matrix, each) for name, matrix in given.items() for each in MATRIX_PARTS}
        parts |= {f"contacts/{name}": getattr(c.contacts, name) for name in PER_CONTACT}
        for name, values in parts.items():
            group.create_dataset(name, data=values, **(CHECKSUM if len(values) else {}), chunks=len(values) > 0 or None)
        file.attrs.update(attributes or {})
        write_sealed(path, file)


def holds_configuration(path: Path) -> bool:
    """Whether a file is an HDF5 file with a configuration; False for any other kind of file.

    Raises PackingFileError if the file has changed since it was sealed.
    """
    if not path.is_file() or not begins_with(path, SEAL):
        return False
    with open_sealed(path) as file:
        return "snapshot" in file


def read_configuration(path: Path) -> Configuration:
    """The configuration of a file. Raises PackingFileError if the file is missing, damaged, or holds none."""
    with open_sealed(path) as file, telling(path, "holds no configuration that can be read"):
        group = file["snapshot"]
        # what version 1 did not store has a default
        contacts = {name: group[f"contacts/{name}"][()] for name in PER_CONTACT if f"contacts/{name}" in group}
        given = {name: group[name][()] for name in ARRAYS if name in group}
        given |= {name: group.attrs[name].item() for name in (*SCALARS, "proof") if name in group.attrs}
        for name in (each for each in MATRICES if each in group):
            parts = tuple(group[f"{name}/{each}"][()] for each in MATRIX_PARTS)
            given[name] = csr_array(parts, shape=(len(parts[2]) - 1,) * 2)
            given[name].check_format()
        given["remarks"] = [str(each) for each in group.attrs.get("remarks", ())]
        return Configuration(contacts=LinearisedContacts(**contacts), **given)


def write_h5md(file: "h5py.File") -> None:
    """The version of H5MD, and what has written the file; no version where it is not installed."""
    try:
        program = version(CREATOR)
    except PackageNotFoundError:
        program = ""
    file.create_group("h5md").attrs["version"] = np.array([1, 1])
    file.create_group("h5md/author").attrs["name"] = CREATOR
    file.create_group("h5md/creator").attrs.update({"name": CREATOR, "version": program})
