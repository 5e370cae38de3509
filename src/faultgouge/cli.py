"""The command ``faultgouge``: :mod:`faultgouge.commands` has its parts, :mod:`faultgouge.exit_status` its errors."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

from .signal_guard import guarded, raise_interrupt_in

STANDARD_OUTPUT = "standard output"
"""The name of the file behind it in errors."""


def main() -> NoReturn:
    """Run the command; what goes wrong is said in one sentence."""
    # one thread for BLAS: its threads cost more than they bring at these sizes, and change the last digits of a solve
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # threads of a deck's `package omp` sleep while they wait: where other processes want the cores, they wait long
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    # pydantic would look for plugins of its own in the metadata of all installed packages
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
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
    if isinstance(out := sys.stdout, io.TextIOWrapper):
        how = {name: getattr(out, name) for name in ("encoding", "errors", "line_buffering", "write_through")}
        sys.stdout = StandardOutput(out.detach(), **how)


class StandardOutput(io.TextIOWrapper):
    """Standard output, whose errors name it, as those of a full disk."""

    def write(self, text: str) -> int:
        """Write a text."""
        with _naming_standard_output():
            return super().write(text)

    def flush(self) -> None:
        """Write what is left."""
        with _naming_standard_output():
            super().flush()


@contextmanager
def _naming_standard_output() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        error.filename = STANDARD_OUTPUT
        raise


def _command() -> None:
    from .commands import program
    from .exit_status import fail

    try:
        program()(standalone_mode=False)
        sys.stdout.flush()
    except Exception as error:
        raise_interrupt_in(error)
        if getattr(error, "filename", None) == STANDARD_OUTPUT:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # for what Python still writes at its end
        if isinstance(error, BrokenPipeError):  # whoever read the output has gone
            sys.exit(1)
        fail(error)
