"""A command works in its own process, and a second process, the guard, ends it: in one sentence, within two seconds.

Python runs the handler of a signal between two Python instructions, and LAMMPS or LAPACK may run for minutes before the
next. The process that the shell or mpiexec has started therefore forks before it imports any heavy package, and the
child does the work. The guard waits for the child and for signals, passes SIGINT (Ctrl-C), SIGTERM and SIGHUP on, and
gives the child the time `GRACE` to close files and to end other processes. Nothing is lost, because files of results
are complete at any moment (:mod:`faultgouge.analysis.files.atomic_write`). The guard then prints what is kept, in words
that the child has left in shared memory (`keeps`), and exits with 128 plus the number of the signal. When the guard
ends, the kernel kills the child. If a library or a limit of CPU time ends the child, the guard prints a sentence as
well.

Under mpiexec every rank has its guard. mpiexec passes a signal to all ranks, and kills the other ranks when the work of
one rank has ended. The guards therefore end `SECONDS_TO_END`, and the work after them. Only rank 0 prints. Commands
that need no MPI (``spectrum``, ``--help``) do not import mpi4py: the launchers tell the rank through the environment.
"""

from __future__ import annotations

import mmap
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from . import parent_death

GRACE = 0.8
"""Seconds that the work has after a signal to close files and to end other processes."""

SECONDS_TO_END, SECONDS_TO_WAIT = 1.2, 1.7
"""Seconds after a signal at which the guards of several ranks end, all with the same exit code, and until which their
work is there: mpiexec kills all ranks as soon as the work of one is gone, and then reports the kill."""

SIGNALS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # `nohup` has a command go on without its terminal
    SIGNALS[signal.SIGHUP] = "the terminal or the connection was closed"

OUTSIDE = {
    signal.SIGKILL: "killed from outside, possibly for lack of memory",
    signal.SIGXCPU: "the limit of CPU time (ulimit -t) is reached",
}
"""Ends of the work that are no fault of a library."""

WORDS, LOCK, CLOSED, ENDED = slice(0, 4096), slice(4096, 8192), 8192, 8193
"""Places in the memory that guard and work share: what an interrupt leaves, in words; the lock file of the work; and
the bytes that are not zero once the work has closed its files after a signal, and once it has come to its end."""

_shared = mmap.mmap(-1, ENDED + 1)
_signalled: list[float] = []
"""Of the work: the signal that has come, and when."""

RANKS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK", "SLURM_PROCID")
"""Where MPICH, PMIx, OpenMPI and Slurm tell a process its rank."""

SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
"""Where launchers tell the number of ranks; SLURM_NTASKS would be that of a whole allocation."""


def rank() -> int:
    """Rank of this process in MPI's world; 0 without MPI."""
    return _of_world("rank", RANKS, 0)


def size() -> int:
    """Number of ranks in MPI's world; 1 without MPI."""
    return _of_world("size", SIZES, 1)


def is_root() -> bool:
    """Whether this process is the one that speaks and writes."""
    return rank() == 0


def _of_world(what: str, variables: tuple[str, ...], otherwise: int) -> int:
    mpi: Any = sys.modules.get("mpi4py.MPI")
    if mpi is not None and not mpi.Is_finalized():
        return int(getattr(mpi.COMM_WORLD, what))
    return next((int(os.environ[name]) for name in variables if os.environ.get(name, "").isdecimal()), otherwise)


class Interrupted(BaseException):
    """A signal asks the work to end. No `Exception`: nothing on the way may take it for a failure."""


def interrupted() -> bool:
    """Whether a signal has come: an error is then its consequence, as of what wraps every exception in its own."""
    return bool(_signalled)


def keeps(words: str, path: object = None) -> None:
    """Set what is said at an interrupt: what is kept (a record tells its file, too), and how to go on."""
    _put(WORDS, words)


def holds(lock: Path) -> None:
    """Set which lock file the guard removes if the work hangs in a library, and cannot do so."""
    _put(LOCK, os.path.abspath(lock))


def _put(place: slice, text: str) -> None:
    _shared[place] = text.encode(errors="surrogateescape")[:4095].ljust(4096, b"\0")


def _text(place: slice) -> str:
    return _shared[place].rstrip(b"\0").decode(errors="surrogateescape")


def has_ended() -> None:
    """Tell the guard that the work has come to its end: what exits without this has been ended by a library."""
    _shared[ENDED] = 1


def guarded(work: Callable[[], None]) -> NoReturn:
    """Do the work of a command in a child of this process, and exit with its exit code."""
    if "numpy" in sys.modules:  # a script calls the command: no fresh process, and none to be forked
        work()
        sys.exit()
    keeps("nothing was written: give the same command again")
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    waited = {*SIGNALS, signal.SIGCHLD}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, waited)
    guard = os.getpid()
    if child := os.fork():
        _watch(child, waited)
    parent_death.end_with(guard)
    for number in SIGNALS:  # also where they were ignored, as in the background of a script
        signal.signal(number, _raise)
    # callbacks and destructors let no exception pass: the guard then ends the work after the time of grace
    sys.unraisablehook = lambda lost: None if interrupted() else sys.__unraisablehook__(lost)
    signal.pthread_sigmask(signal.SIG_SETMASK, before - set(SIGNALS))
    try:
        work()
    except BaseException:
        if not interrupted():
            raise
        with suppress(OSError):
            sys.stdout.flush()
        _shared[CLOSED] = 1
        code, begin = int(_signalled[0]), _signalled[1]
        os.kill(guard, code)  # where the work alone was signalled
        if size() > 1:
            parent_death.outlive()
        time.sleep(max(0.0, begin + SECONDS_TO_WAIT - time.monotonic()))
        os._exit(128 + code)
    finally:
        has_ended()
    sys.exit()


def _raise(number: int, frame: FrameType | None) -> None:
    for each in SIGNALS:
        signal.signal(each, signal.SIG_IGN)  # the guard's copy of the same signal
    _signalled[:] = number, time.monotonic()
    raise Interrupted


def _watch(child: int, waited: set[signal.Signals]) -> NoReturn:
    """Wait for the end of the child; after a signal, let it close its files. The kernel ends it with the guard."""
    while (number := signal.sigwait(waited)) == signal.SIGCHLD:
        gone, status = os.waitpid(child, os.WNOHANG)
        if gone:
            _end(os.waitstatus_to_exitcode(status))
    begin, gone = time.monotonic(), 0
    os.kill(child, number)
    while not (gone or _shared[CLOSED]) and time.monotonic() < begin + GRACE:
        time.sleep(0.01)
        gone, _ = os.waitpid(child, os.WNOHANG)
    if not (gone or _shared[CLOSED]):
        os.kill(child, signal.SIGSTOP)  # so that it writes no more than is said to be kept
        with suppress(OSError):  # the lock, unless another work has it
            if any(each.exists() and each.samefile(_text(LOCK)) for each in Path(f"/proc/{child}/fd").iterdir()):
                os.unlink(_text(LOCK))
        if sys.stderr.isatty():
            sys.stderr.write("\x1b[?25h\n")  # the cursor, which a progress bar has hidden
    _say(SIGNALS[signal.Signals(number)])
    if size() > 1:
        time.sleep(max(0.0, begin + SECONDS_TO_END - time.monotonic()))
    os._exit(128 + number)


def _end(code: int) -> NoReturn:
    """End as the child has ended."""
    if code < 0:
        number = signal.Signals(-code)
        _say(OUTSIDE.get(number, f"a library has ended the command ({number.name}); please report it"))
        code = 128 + number if number in OUTSIDE else 1
    elif not _shared[ENDED]:
        _say("a library has ended the command; please report it")
        code = 1
    os._exit(code)


def _say(what: str) -> None:
    if is_root():
        with suppress(OSError):  # nobody may be there to read it
            print(f"Error: {what}: {_text(WORDS)}.", file=sys.stderr, flush=True)
