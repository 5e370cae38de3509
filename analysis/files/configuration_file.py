"""A run.h5 that contains a Configuration, bitwise, in two or three dimensions.

The file is sealed like every run.h5 (:mod:`.checksummed_file`), and is H5MD 1.1::

    /h5md                             version, author, creator
    /particles/particles/position     (1, N, 3)  centres; z = 0 of disks
    /particles/particles/box          dimension 3; lengths of the edges, and which are periodic
    /snapshot/<name>                  fields of :class:`~faultgouge.analysis.Configuration`
    /snapshot/contacts/<name>         fields of :class:`~faultgouge.analysis.LinearisedContacts`
    /snapshot/<matrix>/<part>         stiffness, damping and constraint, where these are given: data, indices, indptr
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from ..configuration import Configuration
from ..contacts import PER_CONTACT, LinearisedContacts
from ..errors import PackingFileError
from .atomic_write import SEAL
from .checksummed_file import new_file, open_sealed, write
from .plain_file import open_plain
from .runfile import CHECKSUM, write_h5md

if TYPE_CHECKING:
    import h5py

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
    with new_file() as file:
        write_h5md(file)
        particles = file.create_group("particles/particles")
        position = np.zeros((1, len(configuration), 3))
        position[0, :, : configuration.dimension] = configuration.position
        for name, value in (("value", position), ("step", np.zeros(1, int)), ("time", np.zeros(1))):
            particles.create_dataset(f"position/{name}", data=value)
        box = particles.create_group("box")
        box.attrs["dimension"] = 3
        box.attrs["boundary"] = ["periodic" if each else "none" for each in configuration.periodic]
        box.create_dataset("edges", data=np.linalg.norm(configuration.box, axis=1))
        group = file.create_group("snapshot")
        for name in SCALARS:
            group.attrs[name] = getattr(configuration, name)
        if configuration.proof is not None:
            group.attrs["proof"] = configuration.proof
        if configuration.remarks:
            group.attrs["remarks"] = list(configuration.remarks)
        for name in ARRAYS:
            group.create_dataset(name, data=getattr(configuration, name))
        contacts = {f"contacts/{name}": getattr(configuration.contacts, name) for name in PER_CONTACT}
        given = {name: matrix for name in MATRICES if (matrix := getattr(configuration, name)) is not None}
        parts = {f"{name}/{each}": getattr(matrix, each) for name, matrix in given.items() for each in MATRIX_PARTS}
        for name, values in (contacts | parts).items():
            group.create_dataset(name, data=values, **(CHECKSUM if len(values) else {}), chunks=len(values) > 0 or None)
        for name, said in (attributes or {}).items():
            file.attrs[name] = said
        write(path, file)


def holds_configuration(path: Path) -> bool:
    """Whether a file is an HDF5 file with a configuration; False for any other kind of file.

    Raises PackingFileError if the file has changed since it was sealed.
    """
    try:
        with open_plain(path) as stream:
            if stream.read(len(SEAL)) != SEAL:
                return False
    except OSError:
        return False
    with open_sealed(path) as file:
        return "snapshot" in file


def read_configuration(path: Path) -> Configuration:
    """The configuration of a file. Raises PackingFileError if the file is missing, damaged, or holds none."""
    with open_sealed(path) as file:
        try:
            group, given = file["snapshot"], file["snapshot/contacts"]
            # what version 1 did not store has a default
            contacts = LinearisedContacts(**{name: given[name][()] for name in PER_CONTACT if name in given})
            arrays = {name: group[name][()] for name in ARRAYS if name in group}
            numbers = {name: group.attrs[name].item() for name in (*SCALARS, "proof") if name in group.attrs}
            matrices = {name: _matrix(group[name]) for name in MATRICES if name in group}
            remarks = [str(each) for each in group.attrs.get("remarks", ())]
            return Configuration(contacts=contacts, **arrays, **numbers, **matrices, remarks=remarks)
        except Exception as error:  # h5py raises nearly every exception there is, depending on what is damaged
            said = (str(error).strip() or type(error).__name__).rstrip(".")
            raise PackingFileError(f"{path} holds no configuration that can be read: {said}.") from error


def _matrix(group: "h5py.Group") -> csr_array:
    """A square sparse matrix; an error if it is none."""
    data, indices, indptr = (group[name][()] for name in MATRIX_PARTS)
    matrix = csr_array((data, indices, indptr), shape=(len(indptr) - 1,) * 2)
    matrix.check_format()
    return matrix
