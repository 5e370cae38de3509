"""Packings of files, of whatever kind."""

from pathlib import Path

from .analysis import BadInputError, Configuration, Packing, RunFile, read_dump
from .analysis.files.configuration_file import holds_configuration, read_configuration


def load(file: str | Path, frame: int = -1) -> Packing | Configuration:
    """Read a packing: a run.h5, the dumps that decks write (NAME.disks), or a LAMMPS deck (NAME.in), which is run.

    Parameters
    ----------
    file : str or Path
        The file.
    frame : int
        Number of the equilibrium, or of the dump; negative numbers count from the last.

    Returns
    -------
    Packing or Configuration

    Raises
    ------
    BadInputError
        If the file is none of these.
    PackingFileError
        If the file is missing or damaged.
    """
    path = Path(file)
    if path.suffix == ".disks":
        return read_dump(path, frame=frame)
    if path.suffix == ".in" or path.name.startswith("in."):
        from .pywrap.granular.run_deck import run_deck

        return run_deck(path)
    if path.suffix in (".csv", ".json", ".data", ".xyz", ".gsd", ".dump", ".restart"):
        raise BadInputError(
            f"{path} does not say law and load: `faultgouge import {path} --top 10 --kn 2e5 --fy 3 -o packing.h5` "
            "makes a run.h5 of it."
        )
    if holds_configuration(path):
        return read_configuration(path)
    with RunFile(path) as run:
        return run.packing(frame)
