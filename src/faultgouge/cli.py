"""The command ``faultgouge``: :mod:`faultgouge.commands` has its parts, :mod:`faultgouge.exit_status` its errors."""

import os
import sys
from typing import NoReturn

from .signal_guard import guarded, raise_interrupt_in


def main() -> NoReturn:
    """Run the command; what goes wrong is said in one sentence."""
    # one thread for BLAS: its threads cost more than they bring at these sizes, and change the last digits of a solve
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # threads of a deck's `package omp` sleep while they wait: where other processes want the cores, they wait long
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    if os.name == "nt":
        raise SystemExit("Error: faultgouge does not run on Windows itself: install Linux's wheel in WSL.")
    _open_streams()
    guarded(_command)


def _open_streams() -> None:
    """Open the null device for closed standard streams, in whose place the next opened file would come otherwise."""
    while (number := os.open(os.devnull, os.O_RDWR)) < 3:
        pass
    os.close(number)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r"))


def _command() -> None:
    from .commands import program
    from .exit_status import fail

    try:
        program()(standalone_mode=False)
    except Exception as error:
        raise_interrupt_in(error)
        fail(error)
