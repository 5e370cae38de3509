"""Formats that MDAnalysis reads with radii, such as PQR. Their positions are float32."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from ...errors import BadInputError, PackingFileError
from .disks import Disks, of_columns
from .optional_library import needed_library

MDANALYSIS_PRECISION = (
    "MDAnalysis hands out positions in float32, about 1e-7 of a coordinate: overlaps are lost below that"
)


def has_parser(path: Path) -> bool:
    """Whether MDAnalysis has a parser for files of this name."""
    try:
        library = needed_library("MDAnalysis", path)
    except BadInputError:  # not installed: then the formats that are read are named
        return False
    return path.suffix[1:].upper() in library._PARSERS


def read_universe(path: Path, frame: int | None = None) -> Disks:
    """Disks of a file of MDAnalysis."""
    library = needed_library("MDAnalysis", path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            universe = library.Universe(str(path))
            universe.trajectory[-1 if frame is None else frame]
    except Exception as error:  # its parsers raise nearly every exception there is
        raise PackingFileError(f"{path} is not read by MDAnalysis: {str(error).splitlines()[0]}") from error
    atoms = universe.atoms
    if not hasattr(atoms, "radii"):
        raise PackingFileError(f"{path} has no radii for MDAnalysis: write it with radii, as CSV or extended XYZ.")
    columns = dict(zip("xyz", np.asarray(atoms.positions, dtype=np.float64).T, strict=True))
    columns["radius"] = np.asarray(atoms.radii, dtype=np.float64)
    size = universe.dimensions
    period = float(size[0]) if size is not None and size[0] > 0 else None
    return of_columns(str(path), columns, box_length=period, remark=MDANALYSIS_PRECISION)
