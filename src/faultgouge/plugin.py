"""Where the LAMMPS plugin lies.

The entry point ``lammps.plugins`` names :func:`directory`; LAMMPS asks it when it starts, and loads every
file there whose name ends in ``plugin.so``.
"""

from importlib.resources import files


def directory() -> str:
    """Folder that holds ``mindlinsmoothplugin.so``.

    LAMMPS calls this at import, so that it neither imports ``lammps`` nor raises.
    """
    return str(files("faultgouge") / "lib")
