"""Look into a LAMMPS instance in a copy of the process (`fork`).

LAMMPS hands out contacts in a run alone, and a run of zero steps sorts particles, may cut a history once more at
Coulomb's bound, and scales a rescaled one. In a copy, with dumps, averages and log closed, all of this may happen: the
instance stays as it is. A copy of one of several ranks could not speak with the others, and a copy of a process has
none of its threads (:mod:`~faultgouge.pywrap.granular.lammps_arrays`).
"""

import ctypes
import os
from collections.abc import Callable
from multiprocessing import Pipe
from typing import Any, TypeVar

from mpi4py import MPI

from .granular_commands import SnapshotError
from .instance_queries import explain_error, styles_of

Found = TypeVar("Found")

PER_STEP = ("ave/", "print", "vector", "halt", "balance", "adapt", "dt/reset", "record")
"""Fixes that write or change something in a run of zero steps, by the beginnings of their styles."""

DRAG = ("viscous", "langevin", "overdamped")
"""Fixes that take energy away."""


def can_copy(lmp: Any) -> bool:
    """Whether the process can be copied: one rank, one thread."""
    threads = lmp.extract_setting("nthreads")
    return hasattr(os, "fork") and MPI.COMM_WORLD.size == 1 and threads <= 1


def silent_copy() -> int:
    """Copy this process; its ID, or in the copy, which prints nothing, 0."""
    ctypes.CDLL(None).fflush(None)  # what is buffered would be written twice
    child = os.fork()
    if child == 0:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
    return child


def in_a_copy(work: Callable[[], Found]) -> Found:
    """What some work finds in a copy of this process, whose traces end with it.

    Raises
    ------
    SnapshotError
        With what went wrong in the copy.
    """
    here, there = Pipe(duplex=False)
    child = silent_copy()
    if child == 0:
        try:
            there.send(work())
        except Exception as error:  # whatever it is, the parent says it
            there.send(error if isinstance(error, SnapshotError) else SnapshotError(explain_error(error)))
        finally:
            os._exit(0)
    there.close()
    try:
        found = here.recv()
    except EOFError:
        found = SnapshotError("LAMMPS ended while its packing was looked at; does the deck run on as it stands?")
    here.close()
    os.waitpid(child, 0)
    if isinstance(found, SnapshotError):
        raise found
    return found


def quieten(lmp: Any, *, drag: bool = False) -> None:
    """Close dumps, averages and restarts of a copy; drag too, if asked."""
    lmp.command("restart 0")
    lmp.command("timer timeout unlimited")  # fix halt, too, has runs skipped
    for name in lmp.available_ids("dump"):
        lmp.command(f"undump {name}")
    for name, style in styles_of(lmp).fixes.items():
        if style.startswith(PER_STEP) or (drag and style.startswith(DRAG)):
            lmp.command(f"unfix {name}")
