"""Look into a LAMMPS instance in a copy of the process (`fork`).

LAMMPS hands out contacts in a run alone, and a run of zero steps sorts particles, may cut a history once more at
Coulomb's bound, and scales a rescaled one. In a copy, with dumps, averages and log closed, all of this may happen: the
instance stays as it is. A copy of one of several ranks could not speak with the others, and a copy of a process has
none of its threads: there the look is taken in place (:mod:`~faultgouge.pywrap.granular.look_in_place`).
"""

import ctypes
import os
import pickle
from collections.abc import Callable
from typing import Any, TypeVar

from mpi4py import MPI

from .granular_commands import SnapshotError
from .instance_queries import explain_error, styles_of

Found = TypeVar("Found")

PER_STEP = ("ave/", "print", "vector", "halt", "balance", "adapt", "dt/reset", "record")
"""Fixes that write or change something in a run of zero steps, by the beginnings of their styles."""

DRAG = ("viscous", "langevin", "nve/limit", "overdamped")
"""Fixes that take energy away."""


def can_copy(lmp: Any) -> bool:
    """Whether the process can be copied: one rank, one thread."""
    threads = lmp.extract_setting("nthreads")
    return hasattr(os, "fork") and MPI.COMM_WORLD.size == 1 and threads <= 1


def in_a_copy(work: Callable[[], Found]) -> Found:
    """What some work finds in a copy of this process, whose traces end with it.

    Raises
    ------
    SnapshotError
        With what went wrong in the copy.
    """
    ctypes.CDLL(None).fflush(None)  # what is buffered would be written twice
    source, sink = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(source)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 1)
            os.dup2(nowhere, 2)
            try:
                said = pickle.dumps((True, work()))
            except Exception as error:  # whatever it is, the parent says it
                said = pickle.dumps((False, error if isinstance(error, SnapshotError) else explain_error(error)))
            with os.fdopen(sink, "wb") as stream:
                stream.write(said)
            code = 0
        finally:
            os._exit(code)
    os.close(sink)
    with os.fdopen(source, "rb") as stream:
        said = stream.read()
    os.waitpid(child, 0)
    if not said:
        raise SnapshotError("LAMMPS ended while its packing was looked at; does the deck run on as it stands?")
    good, found = pickle.loads(said)
    if good:
        return found
    raise found if isinstance(found, SnapshotError) else SnapshotError(found)


def quieten(lmp: Any, *, drag: bool = False) -> None:
    """Close dumps, averages and restarts of a copy; drag too, if asked."""
    lmp.command("restart 0")
    for name in lmp.available_ids("dump"):
        lmp.command(f"undump {name}")
    for name, style in styles_of(lmp)[1].items():
        if style.startswith(PER_STEP) or (drag and style.startswith(DRAG)):
            lmp.command(f"unfix {name}")
