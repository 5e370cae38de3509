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
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from ..configuration import Configuration
from ..contacts import PER_CONTACT, LinearisedContacts
from .atomic_write import SEAL, begins_with, new_sealed, open_sealed, telling, write_sealed

if TYPE_CHECKING:
    import h5py

SPARSE = "data", "indices", "indptr"
PARTS = {"contacts": tuple(PER_CONTACT), "stiffness": SPARSE, "damping": SPARSE, "constraint": SPARSE}
"""Fields of a Configuration that are groups, and the arrays in each."""


def write_configuration(
    path: Path, configuration: Configuration, attributes: Mapping[str, str | int | float] | None = None
) -> None:
    """Write a configuration, with attributes of the root, such as the deck; an existing file is replaced.

    Raises OutputError if the file cannot be written.
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
        for name in c.__dataclass_fields__:
            value = getattr(c, name)
            if isinstance(value, np.ndarray):
                group[name] = value
            elif value is not None and name in PARTS:
                group.update({f"{name}/{part}": getattr(value, part) for part in PARTS[name]})
            elif value is not None and value != ():
                group.attrs[name] = value
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
        group, known = file["snapshot"], Configuration.__dataclass_fields__.keys()
        # what version 1 did not store has a default
        given = {name: group.attrs[name].tolist() for name in known & group.attrs.keys()}
        for name in known & group.keys():
            if name not in PARTS:
                given[name] = group[name][()]
                continue
            parts = {part: group[name][part][()] for part in PARTS[name] if part in group[name]}
            sparse = name != "contacts"
            rows = len(parts["indptr"]) - 1 if sparse else 0
            given[name] = csr_array((*parts.values(),), (rows, rows)) if sparse else LinearisedContacts(**parts)
        return Configuration(**given)


def write_h5md(file: "h5py.File") -> None:
    """The version of H5MD, and what has written the file."""
    file.create_group("h5md").attrs["version"] = np.array([1, 1])
    file.create_group("h5md/author").attrs["name"] = "faultgouge"
    file.create_group("h5md/creator").attrs.update({"name": "faultgouge", "version": version("faultgouge")})
