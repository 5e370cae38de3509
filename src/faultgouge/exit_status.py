"""The end of a command after an error: one sentence and one exit code, on all ranks.

Exit codes: 1 for a computation that failed, 2 for bad input; 130 and 143 for signals, see
:mod:`faultgouge.signal_guard`.

An error on all ranks ends them one by one. After an error on one rank alone, the other ranks would wait for ever. To
distinguish the two cases, ranks with an error wait for each other: a rank that is alone for `SECONDS_TO_MEET` ends all
ranks.
"""

from __future__ import annotations

import os
import sys
import time
import traceback
from pathlib import Path
from typing import NoReturn

from .mpi_rank import is_root, size
from .signal_guard import has_ended

SECONDS_TO_MEET = 3.0
"""Seconds within which all ranks come to an error that all of them meet."""

SECONDS_TO_READ = 0.5
"""Seconds between the sentence and the end of all ranks: an abort drops what mpiexec has not yet passed on."""


def fail(error: Exception) -> NoReturn:
    """Say what went wrong and end."""
    sentence, code = _sentence(error), int(getattr(error, "exit_code", 1))
    known_to_one = isinstance(error, OSError) or getattr(error, "one_rank", False)
    alone = size() > 1 and (known_to_one or not _all_are_here())
    if sentence and (alone or is_root()):
        _print(sentence)
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


def _print(sentence: str) -> None:
    from rich.console import Console

    Console(stderr=True, soft_wrap=True, highlight=False).print("[bold red]Error:[/bold red] ", end="")
    print(sentence, file=sys.stderr, flush=True)


def _is_folder_gone() -> bool:
    """Whether somebody has deleted the folder in which this process works."""
    try:
        return not os.getcwd()
    except FileNotFoundError:
        return True


def _sentence(error: Exception) -> str:
    show = getattr(error, "format_message", None)
    if show:
        return str(show()).strip()
    from faultgouge.analysis import FaultgougeError

    if isinstance(error, OSError) and error.strerror:
        if error.filename:
            return f"{error.filename}: {error.strerror}"
        gone = "the folder in which this command was called has been deleted: go to another one"
        return gone if _is_folder_gone() else error.strerror
    if isinstance(error, FaultgougeError):
        return str(error).strip()
    if isinstance(error, MemoryError):
        what = str(error) or "a request was refused"
        return f"there is not enough memory ({what}): take a smaller packing, or a machine with more memory"
    places = traceback.extract_tb(error.__traceback__)
    where = f"{Path(places[-1].filename).name}:{places[-1].lineno}" if places else "unknown place"
    return f"this should not have happened ({type(error).__name__} at {where}: {error}): please report it"
