"""Executors of the work of a study: this process, further processes, ranks of mpiexec, or an executor of the user."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, resource_tracker
from typing import Any

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor

from ..analysis.windows.slices import cores
from ..parent_death import end_with

Say = Callable[[str], None]
"""A function that prints a line of text."""

Progress = Callable[[Iterable[Any], int], Iterable[Any]]
"""A function that takes results as they come, with their number, and passes them on."""

MapRows = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""`map`, whose results may come in any order."""


class Processes(Executor):
    """Processes of this machine, each with its own interpreter; all of them end with this process."""

    def __init__(self, number: int) -> None:
        self._number = number
        self._pool = self._start()

    def _start(self) -> ProcessPoolExecutor:
        # the tracker would warn of semaphores where this process is killed; it frees them all the same
        sys.warnoptions.append("ignore:resource_tracker:UserWarning")
        resource_tracker.ensure_running()
        sys.warnoptions.pop()
        # no fork: MPI and LAMMPS do not survive one
        pool = ProcessPoolExecutor(self._number, get_context("spawn"), initializer=end_with, initargs=(os.getpid(),))
        # Ctrl-C is for this process alone, with which the others end: they inherit that SIGINT is blocked
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        self._first = pool.submit(os.getpid)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return pool

    @property
    def began(self) -> bool:
        """Whether a process has come so far as to work, and has not ended as it started."""
        return self._first.exception() is None

    def renew(self) -> None:
        """Start other processes in place of these, of which one has been killed."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = self._start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._pool.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._pool.shutdown(wait, cancel_futures=cancel_futures)


@contextmanager
def open_executor(workers: int | None, executor: Executor | None = None) -> Iterator[Executor | None]:
    """An executor; None if this process computes by itself, or has worked for another rank.

    The workers are processes, one for each core if `workers` is None. Under mpiexec its ranks replace the processes. An
    executor that is given replaces both, and is not shut down.
    """
    number = cores() if workers is None else workers
    if executor is not None:
        yield executor
    elif MPI.COMM_WORLD.size > 1:
        ranks: Any
        with MPICommExecutor(MPI.COMM_WORLD) as ranks:
            yield ranks
    elif number < 2:
        yield None
    else:
        processes = Processes(number)
        try:
            yield processes
        finally:
            processes.shutdown(wait=False, cancel_futures=True)
