"""A command works in its own process, and a second process, the guard, ends it: in one sentence, within two seconds.

Python runs the handler of a signal between two Python instructions, and LAMMPS or LAPACK may run for minutes before the
next; SciPy's `eig` does not even let another thread run. The process that the shell or mpiexec has started therefore
forks before it imports any heavy package. The child does the work. The guard waits for the child and for signals,
passes SIGINT (Ctrl-C), SIGTERM and SIGHUP on, and gives the child the time `GRACE` to close files and to end other
processes. Nothing is lost, because files of results are complete at any moment
(:mod:`faultgouge.analysis.files.atomic_write`). The guard then prints what is kept, in words that the child has left in
memory shared by both (`keeps`), and exits with 128 plus the number of the signal: 130, 143 or 129. When the guard ends,
for any reason, the kernel kills the child. If a library (SIGSEGV, SIGABRT, or SIGKILL for lack of memory) or a limit of
CPU time (SIGXCPU) ends the child, the guard prints a sentence as well; also if a library calls `exit`, as LAMMPS does
at its command `quit`, with whatever code.

Under mpiexec every rank has its guard. mpiexec passes a signal to all ranks, and kills the other ranks when the work of
one rank has ended. The guards therefore end `SECONDS_TO_END`, and the work after them. Only rank 0 prints. Commands
that need no MPI (``spectrum``, ``--help``) do not import mpi4py: the launchers tell the rank through the environment.
"""

from __future__ import annotations

import fcntl
import mmap
import os
import signal
import sys
import threading
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

NOTHING = "nothing was written: give the same command again"
_shared = mmap.mmap(-1, 4096)
"""Shared by guard and work: what an interrupt leaves, as UTF-8, a place and words that each end with a zero, `CLOSED`
and `ENDED`."""

_lock = mmap.mmap(-1, 4096)
"""Shared by guard and work: the name of the lock file that goes with the work, which ends in a zero."""

CLOSED, ENDED = 4094, 4095
"""The bytes of the shared memory that are not zero once the work has closed its files after a signal, and once it has
come to its end and has said what there is to say."""


RANKS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK", "SLURM_PROCID")
"""Where MPICH, PMIx, OpenMPI and Slurm tell a process its rank."""

RANK_VARIABLES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
"""Where launchers tell the number of ranks; SLURM_NTASKS would be that of a whole allocation."""


def rank() -> int:
    """Rank of this process in MPI's world; 0 without MPI."""
    world = _world()
    return _first(RANKS, 0) if world is None else int(world.rank)


def size() -> int:
    """Number of ranks in MPI's world; 1 without MPI."""
    world = _world()
    return _first(RANK_VARIABLES, 1) if world is None else int(world.size)


def is_root() -> bool:
    """Whether this process is the one that speaks and writes."""
    return rank() == 0


def _world() -> Any:
    """MPI's world communicator where a module has imported MPI, and MPI has not ended; None otherwise."""
    mpi = sys.modules.get("mpi4py.MPI")
    return None if mpi is None or mpi.Is_finalized() else mpi.COMM_WORLD


def _first(names: tuple[str, ...], otherwise: int) -> int:
    return next((int(os.environ[name]) for name in names if os.environ.get(name, "").isdecimal()), otherwise)


class Interrupted(BaseException):
    """A signal asks the work to end. No `Exception`: nothing on the way may take it for a failure."""


def raise_interrupt_in(error: BaseException) -> None:
    """Raise the interrupt that an error was made of: Python before 3.12 makes one of what `__set_name__` raises."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, Interrupted):
            raise cause
        cause = cause.__cause__ or cause.__context__


def keeps(words: str, path: str | os.PathLike[str] = "") -> None:
    """Set what is said at an interrupt: what is kept, and how to go on; and the file or folder that must be there."""
    place = os.path.abspath(path) if path else ""
    _shared[:CLOSED] = f"{place}\0{words}".encode(errors="surrogateescape")[: CLOSED - 1].ljust(CLOSED, b"\0")


def holds(lock: str | os.PathLike[str]) -> None:
    """Set which lock file the guard removes if a library ends the work, which then cannot do so."""
    _lock[:] = os.fsencode(os.path.abspath(lock))[: len(_lock) - 1].ljust(len(_lock), b"\0")


def has_ended() -> None:
    """Tell the guard that the work has come to its end: what exits without this has been ended by a library."""
    _shared[ENDED] = 1


def guarded(work: Callable[[], None]) -> NoReturn:
    """Do the work of a command, and exit with its exit code."""
    if threading.active_count() > 1 or "numpy" in sys.modules:  # no fresh process: not one to be forked
        _work(work, guard=False)
    keeps(NOTHING)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    waited = {*SIGNALS, signal.SIGCHLD}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, waited)
    guard = os.getpid()
    child = os.fork()
    if child == 0:
        parent_death.end_with(guard)
        for number in SIGNALS:  # also where they were ignored, as in the background of a script
            signal.signal(number, _raise)
        sys.unraisablehook = _raised_where_nothing_passes
        signal.pthread_sigmask(signal.SIG_SETMASK, before - set(SIGNALS))
        _work(work, guard=True)
    _watch(child, waited)


def _work(work: Callable[[], None], guard: bool) -> NoReturn:
    """The work of the child."""
    try:
        work()
    except Interrupted as signalled:
        sys.stdout.flush()
        if not guard:
            os._exit(128 + signalled.args[0])
        _shared[CLOSED] = 1
        os.kill(os.getppid(), signalled.args[0])  # where the work alone was signalled
        if size() > 1:
            parent_death.outlive()
        time.sleep(max(0.0, signalled.args[1] + SECONDS_TO_WAIT - time.monotonic()))
        os._exit(128 + signalled.args[0])
    finally:
        has_ended()
    sys.exit(0)


def _raise(number: int, frame: FrameType | None) -> None:
    for each in SIGNALS:
        signal.signal(each, signal.SIG_IGN)  # the guard's copy of the same signal
    raise Interrupted(number, time.monotonic())


def _raised_where_nothing_passes(lost: sys.UnraisableHookArgs) -> None:
    """Raise an interrupt anew that came in a callback or a destructor, which let no exception pass."""
    if not isinstance(lost.exc_value, Interrupted):
        sys.__unraisablehook__(lost)
        return
    number = lost.exc_value.args[0]
    signal.signal(signal.SIGALRM, lambda *_: _raise(number, None))
    signal.setitimer(signal.ITIMER_REAL, 0.01)


def _watch(child: int, waited: set[signal.Signals]) -> NoReturn:
    """Wait for the child or a signal."""
    while True:
        number = signal.sigwait(waited)
        if number == signal.SIGCHLD:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                _end(status, time.monotonic())
        else:
            _hand_on(child, number)


def _hand_on(child: int, number: int) -> NoReturn:
    """Let the child close its files after a signal; the kernel ends it when the guard has ended."""
    begin = time.monotonic()
    os.kill(child, number)
    while not _shared[CLOSED] and time.monotonic() < begin + GRACE:
        ended, _ = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        time.sleep(0.01)
    else:
        if not _shared[CLOSED]:
            os.kill(child, signal.SIGSTOP)  # so that it writes no more than is said to be kept
            _remove_lock(child)
            if sys.stderr.isatty():
                sys.stderr.write("\x1b[?25h\n")  # the cursor, which a progress bar has hidden
    _interrupted(number, begin)


def _interrupted(number: int, begin: float) -> NoReturn:
    if is_root():
        _say(f"{SIGNALS[signal.Signals(number)]}: {_kept()}")
    if size() > 1:
        time.sleep(max(0.0, begin + SECONDS_TO_END - time.monotonic()))
    os._exit(128 + number)


def _end(status: int, now: float) -> NoReturn:
    """End as the child has ended."""
    code = os.waitstatus_to_exitcode(status)
    if code - 128 in set(SIGNALS):
        _interrupted(code - 128, now)
    if code < 0 or not _shared[ENDED]:
        _remove_lock()
    if code == -signal.SIGKILL:
        _say(f"killed from outside, possibly for lack of memory: {_kept()}")
        os._exit(128 + signal.SIGKILL)
    if code == -signal.SIGXCPU:
        _say(f"the limit of CPU time (ulimit -t) is reached: {_kept()}")
        os._exit(128 + signal.SIGXCPU)
    if code < 0:
        _say(f"a library has ended the command ({signal.Signals(-code).name}); please report it: {_kept()}")
        os._exit(1)
    if not _shared[ENDED]:
        if is_root():
            _say(
                "a library has ended the command, as LAMMPS does at quit, which a deck and what it includes are to "
                f"leave out: {_kept()}"
            )
        os._exit(1)
    os._exit(code)


def _remove_lock(stopped: int | None = None) -> None:
    """Remove the lock file of a work that is gone or stopped, unless another work has taken it."""
    with suppress(OSError), open(os.fsdecode(_lock[:].rstrip(b"\0")), "rb") as stream:
        if stopped is None:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        elif not any(each.samefile(stream.name) for each in Path(f"/proc/{stopped}/fd").iterdir() if each.exists()):
            return
        os.unlink(stream.name)


def _kept() -> str:
    place, words, *_ = _shared[:CLOSED].decode(errors="surrogateescape").split("\0")
    if place and not os.path.exists(place):
        return f"{place} is not there, and the same command starts from the beginning"
    return words


def _say(sentence: str) -> None:
    with suppress(OSError):  # nobody may be there to read it
        print(f"Error: {sentence}.", file=sys.stderr, flush=True)
