"""A LAMMPS instance of a user: its styles and its log, and looks in a copy of the process (`fork`).

LAMMPS hands out contacts only in a run, and a run of zero steps changes histories. In a copy of the process it may: the
instance itself stays as it is. Several ranks, and threads, cannot be copied.

The copy shares open files with the process, with the positions at which they are written. So the copy first puts the
null device in the place of every file that is open for writing, whoever has opened the file: all that LAMMPS, zlib or
Python write as they close a dump or a log then goes nowhere.
"""

import ctypes
import fcntl
import os
import re
import signal
import stat
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, NamedTuple, TypeVar

from mpi4py import MPI

from ...parent_death import end_with
from .granular_commands import NotTakenError, without_suffix

Found = TypeVar("Found")

PER_STEP = ("ave/", "print", "vector", "halt", "balance", "adapt", "dt/reset", "record")
INSERTS = ("pour", "deposit", "evaporate")
DRAG_STYLES = ("viscous", "langevin", "overdamped", "damping/cundall")
"""Beginnings of the styles of fixes that write or change something in a run, whatever moves; that put particles in or
take them out, with which no time step may be changed; and that take energy away, and may shake."""


def require_instance(lmp: Any, caller: str) -> None:
    """Refuse what is no LAMMPS instance, a closed instance, and one that cannot be copied."""
    if not hasattr(lmp, "extract_setting"):
        raise NotTakenError(f"{caller} takes an instance of lammps.lammps, and no {type(lmp).__name__}.")
    if getattr(lmp, "lmp", None) is None:
        raise NotTakenError(f"{caller} takes an open instance, and this one is closed: call {caller} before close().")
    if MPI.COMM_WORLD.size > 1 or lmp.extract_setting("nthreads") > 1 or not hasattr(os, "fork"):
        why = "looks at LAMMPS in a copy of the process, which several ranks or threads cannot have"
        raise NotTakenError(f"{caller} {why}: use one rank and one thread, as by a restart file of the run.")


class Styles(NamedTuple):
    """Pair style, styles and groups of the fixes by ID, without the suffix of an accelerator, and atom style."""

    pair: str
    fixes: dict[str, str]
    groups: dict[str, str]
    atom: str


def styles_of(lmp: Any) -> Styles:
    """The styles of an instance, as LAMMPS's `info` says them on all ranks."""
    with TemporaryFile("w+") as answer:  # of rank 0, which alone writes and reads
        lmp.command(f"info fixes system out overwrite /dev/fd/{answer.fileno()}")
        info = MPI.COMM_WORLD.bcast(answer.read(), root=0)
    fixes = re.findall(r"^ *Fix\[ *\d+\]: *(\w+), *style = ([^,\s]+), *group = (\S+)", info, re.MULTILINE)
    values = dict(re.findall(r"^ *(Atoms|Atom style) *= *(.*?) *$", info, re.MULTILINE))
    pair = without_suffix(values["Atoms"].rpartition("style = ")[2])  # Atoms = N, types = T, style = the pair style
    styles, groups = {name: without_suffix(style) for name, style, _ in fixes}, {name: each for name, _, each in fixes}
    return Styles(pair, styles, groups, values["Atom style"])


def of_lammps(error: BaseException) -> bool:
    """Whether LAMMPS has raised an error: its bindings raise the plain `Exception`, or one of theirs."""
    return type(error) is Exception or type(error).__module__.split(".")[0] == "lammps"


def explain_error(error: BaseException) -> str:
    """A sentence of an error that LAMMPS has raised."""
    lines = [re.sub(r"^ERROR( on proc \d+)?: ", "", line.strip()) for line in str(error).splitlines() if line.strip()]
    reason = re.sub(r" \(\S+:\d+\)", "", "; ".join(lines) or type(error).__name__)
    return f"LAMMPS stopped: {reason.rstrip('.')}."


OpenFile = tuple[str, int]
"""A file that this process has open for writing, and the place in it that is written next."""


def open_files() -> dict[int, OpenFile]:
    """Files that are open for writing, by their descriptors, where the system has a folder /proc."""
    ctypes.CDLL(None).fflush(None)
    found = {}
    for each in Path("/proc/self/fd").glob("*"):
        with suppress(OSError):
            path, facts = os.readlink(each), Path(f"/proc/self/fdinfo/{each.name}").read_text().split()
            if os.path.isfile(path) and int(facts[3], 8) & os.O_ACCMODE != os.O_RDONLY:
                found[int(each.name)] = path, int(facts[1])
    return found


def log_file(lmp: Any, files: dict[int, OpenFile]) -> OpenFile | None:
    """The log of an instance that is a copy, among the open files of the process itself; the question closes it."""

    def open_here() -> set[int]:
        return {each for each in files if Path(f"/proc/self/fd/{each}").exists()}

    before = open_here()  # without what Python has collected since
    lmp.command("log none")  # a log of the command `log` does not begin as others do
    closed = [files[each] for each in before - open_here()]
    return closed[0] if len(closed) == 1 else None


def silent_copy(*keep: int) -> int:
    """Copy this process; its ID, or in the copy, which writes to no open file but the descriptors to keep, 0. The
    process decides what Ctrl-C ends: call this where :func:`interrupts_wait`."""
    ctypes.CDLL(None).fflush(None)  # buffered text would be written twice
    child = os.fork()
    if child:
        return child
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
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
    return 0


def in_a_copy(work: Callable[[], Found]) -> Found:
    """The result of some work in a copy of this process, or the error that it raises there, of LAMMPS as a
    NotTakenError. All traces of the work end with the copy, and an interrupt of this process ends the copy, too."""
    here, there = Pipe(duplex=False)
    this, child = os.getpid(), 0
    found: Any = NotTakenError("LAMMPS ended while its packing was looked at; does the deck run on as it stands?")
    try:
        with interrupts_wait():
            child = silent_copy(there.fileno())
            if child == 0:
                try:
                    end_with(this)
                    there.send(work())
                except Exception as error:  # whatever it is, the process says it
                    there.send(NotTakenError(explain_error(error)) if of_lammps(error) else error)
                finally:
                    os._exit(0)
        there.close()
        with suppress(EOFError):
            found = here.recv()
    finally:
        here.close()
        if child:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    if isinstance(found, Exception):
        raise found
    return found


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
