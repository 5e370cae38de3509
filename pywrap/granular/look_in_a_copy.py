"""Look into a LAMMPS instance in a copy of the process (`fork`).

LAMMPS hands out contacts only in a run. A run of zero steps sorts particles, may cut a history once more at Coulomb's
bound, and scales rescaled histories. In a copy of the process all of this may happen: the instance itself stays as it
is.

**Files.** The copy shares open files with the process, with the positions at which they are written. So the copy first
puts the null device in the place of every file that is open for writing, whoever has opened the file. All that LAMMPS,
zlib or Python write as they close a dump or a log then goes nowhere.

**No copy** is possible on several ranks, since a copy cannot communicate with the other ranks, or with threads, which a
copy does not have (:mod:`~faultgouge.pywrap.granular.lammps_arrays`).
"""

import ctypes
import fcntl
import os
import signal
import stat
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, NoReturn, TypeVar

from mpi4py import MPI

from ...parent_death import end_with
from .granular_commands import NotTakenError
from .instance_queries import explain_error, of_lammps, styles_of

Found = TypeVar("Found")

PER_STEP = ("ave/", "print", "vector", "halt", "balance", "adapt", "dt/reset", "record")
"""Fixes that write or change something in a run of zero steps, by the beginnings of their styles."""

INSERTS = ("pour", "deposit", "evaporate")
"""Fixes that put particles in or take them out, with which no time step may be changed."""

DRAG_STYLES = ("viscous", "langevin", "overdamped", "damping/cundall")
"""Fixes that take energy away, and may shake."""


def can_copy(lmp: Any) -> bool:
    """Whether the process can be copied: one rank, one thread."""
    threads = lmp.extract_setting("nthreads")
    return hasattr(os, "fork") and MPI.COMM_WORLD.size == 1 and threads <= 1


def silent_copy(*keep: int) -> int:
    """Copy this process; its ID, or in the copy, which writes to no open file but the descriptors to keep, 0.

    The process decides what Ctrl-C ends: call this where :func:`interrupts_wait`.
    """
    ctypes.CDLL(None).fflush(None)  # buffered text would be written twice
    child = os.fork()
    if child == 0:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        _silence(keep)
    return child


def _silence(keep: tuple[int, ...]) -> None:
    """Put the null device in the place of all files, pipes and terminals that are open for writing."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in map(int, os.listdir("/dev/fd")):
        with suppress(OSError):  # the file of the list itself is closed
            writes = fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE != os.O_RDONLY
            kind = os.fstat(descriptor).st_mode
            shared = stat.S_ISREG(kind) or stat.S_ISFIFO(kind) or os.isatty(descriptor)
            if writes and shared and descriptor not in keep:
                os.dup2(nowhere, descriptor)
    for descriptor in (1, 2):
        os.dup2(nowhere, descriptor)


def in_a_copy(work: Callable[[], Found]) -> Found:
    """The result of some work in a copy of this process. All traces of the work end with the copy, and an interrupt of
    this process ends the copy, too.

    Raises
    ------
    NotTakenError
        With what went wrong in the copy.
    """
    here, there = Pipe(duplex=False)
    this, child = os.getpid(), 0
    try:
        with interrupts_wait():
            child = silent_copy(there.fileno())
            if child == 0:
                _send_and_end(work, there, this)
        there.close()
        found = here.recv()
    except EOFError:
        found = NotTakenError("LAMMPS ended while its packing was looked at; does the deck run on as it stands?")
    finally:
        here.close()
        if child:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)  # it has sent all that it has to say, unless there was an interrupt
            os.waitpid(child, 0)
    if isinstance(found, Exception):
        raise found
    return found


def _send_and_end(work: Callable[[], Found], there: Connection, parent: int) -> NoReturn:
    """The life of a copy: its work, and what it has found for the parent."""
    try:
        end_with(parent)
        there.send(work())
    except Exception as error:  # whatever it is, the parent says it
        there.send(NotTakenError(explain_error(error)) if of_lammps(error) else error)
    finally:
        os._exit(0)


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Let Ctrl-C wait: at a fork it would leave a copy that nobody ends, or let the copy go on as the program."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is None:
        yield  # Ctrl-C goes to another thread, or is not Python's
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came:
            signal.raise_signal(signal.SIGINT)


def quieten(lmp: Any, *, drag: bool = False) -> None:
    """Close dumps, averages and restarts of a copy, and let it have the particles that it has, and single steps; leave
    drag out, too, if asked."""
    lmp.command("restart 0")
    lmp.command("run_style verlet")  # r-RESPA has no steps without a set-up
    lmp.command("timer timeout unlimited")  # fix halt, too, has runs skipped
    for name in lmp.available_ids("dump"):
        lmp.command(f"undump {name}")
    for name, style in styles_of(lmp).fixes.items():
        if style.startswith((*PER_STEP, *INSERTS)) or (drag and style.startswith(DRAG_STYLES)):
            lmp.command(f"unfix {name}")
