"""The command ``faultgouge``, and its end after an error: one sentence and one exit code, on all ranks.

Exit codes: 1 for a computation that failed, 2 for bad input; 130 and 143 for signals, see
:mod:`faultgouge.signal_guard`.

After an error on one rank alone, the other ranks would wait for ever. Ranks with an error therefore wait for each
other: a rank that is alone for `SECONDS_TO_MEET` ends all ranks.
"""

from __future__ import annotations

import errno
import os
import sys
import time
import traceback
from pathlib import Path
from typing import NoReturn

from .signal_guard import guarded, has_ended, interrupted, is_root, size

SECONDS_TO_MEET = 3.0
"""Seconds within which all ranks come to an error that all of them meet."""

SECONDS_TO_READ = 0.5
"""Seconds between the sentence and the end of all ranks: an abort drops what mpiexec has not yet passed on."""


def main() -> NoReturn:
    """Run the command; what goes wrong is said in one sentence."""
    # one thread for BLAS: its threads cost more than they bring at these sizes, and change the last digits of a solve
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # threads of a deck's `package omp` sleep while they wait: where other processes want the cores, they wait long
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    # pydantic would look for plugins of its own in the metadata of all installed packages
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # the null device for closed standard streams, in whose place the next opened file would come otherwise
    while (number := os.open(os.devnull, os.O_RDWR)) < 3:
        pass
    os.close(number)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r"))
    guarded(_command)


def _command() -> None:
    from .commands import program

    try:
        program()(standalone_mode=False)
        sys.stdout.flush()
    except Exception as error:
        if interrupted():
            raise
        if isinstance(error, OSError) and error.filename is None:  # of standard output: Python writes there at its end
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        if isinstance(error, BrokenPipeError):  # whoever read the output has gone
            sys.exit(1)
        fail(error)


def fail(error: Exception) -> NoReturn:
    """Say what went wrong and end."""
    sentence, code = _sentence(error), int(getattr(error, "exit_code", 1))
    known_to_one = isinstance(error, OSError) or getattr(error, "one_rank", False)
    alone = size() > 1 and (known_to_one or not _all_are_here())
    if sentence and (alone or is_root()):
        import typer

        typer.secho("Error: ", fg="red", bold=True, nl=False, err=True)
        print(sentence, file=sys.stderr, flush=True)
    if alone:
        from mpi4py import MPI

        has_ended()
        time.sleep(SECONDS_TO_READ)
        MPI.COMM_WORLD.Abort(code)
    sys.exit(code)


def _all_are_here() -> bool:
    """Whether all ranks come here: a rank that meets an error alone waits in vain."""
    if "mpi4py.MPI" not in sys.modules:
        return True  # MPI is not there to be waited in
    from mpi4py import MPI

    meeting, deadline = MPI.COMM_WORLD.Ibarrier(), time.monotonic() + SECONDS_TO_MEET
    while not meeting.Test():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def _sentence(error: Exception) -> str:
    if show := getattr(error, "format_message", None):
        return str(show()).strip()
    from faultgouge.analysis import FaultgougeError

    if isinstance(error, FaultgougeError):
        return str(error).strip()
    if isinstance(error, OSError) and error.strerror:
        if error.filename or error.errno == errno.ENOSPC:
            return f"{error.filename or 'standard output'}: {error.strerror}"
        return f"{error.strerror} (is the folder in which this command was called still there?)"
    if isinstance(error, MemoryError):
        what = str(error) or "a request was refused"
        return f"there is not enough memory ({what}): take a smaller packing, or a machine with more memory"
    places = traceback.extract_tb(error.__traceback__)
    where = f"{Path(places[-1].filename).name}:{places[-1].lineno}" if places else "unknown place"
    return f"this should not have happened ({type(error).__name__} at {where}: {error}): please report it"
