"""Errors with a sentence for the user: what is wrong, where, and what to do.

Every such error is a `FaultgougeError`. A search for complex pairs may catch `NoEquilibriumError` but no base class of
it: the failure of an engine, a lost rank or a full disk must always reach the command. Any other exception that reaches
the command is a bug in this program.
"""

import traceback
from pathlib import Path


def place_in_user_code(error: BaseException) -> str:
    """Where a function of the user's has failed, as " (FILE, line N)", for whoever has called it and caught the error.

    The line is that of the function's own file, also where a library that it calls has raised the error. Empty if the
    function has no lines, such as one in C.
    """
    _, *frames = traceback.extract_tb(error.__traceback__)
    own = [each for each in frames if each.filename == frames[0].filename]
    return f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""


class FaultgougeError(Exception):
    """Base class of all errors of the package; its text is the sentence for the user.

    Attributes
    ----------
    exit_code : int
        Exit code of the command: 1 for a computation that failed, 2 for bad input.
    one_rank : bool
        Whether one MPI rank alone knows of the error. The other ranks wait, and only MPI's Abort ends them.
    """

    exit_code = 1
    one_rank = False


class BadInputError(FaultgougeError, ValueError):
    """The input of the user (a scene, a file, an option) cannot be used."""

    exit_code = 2


class PackingFileError(BadInputError):
    """A file is missing, broken, or of the wrong kind; the message names the file."""


class OutputError(FaultgougeError):
    """A result cannot be written: a full disk, a folder without permission. Only rank 0 writes and has the error."""

    one_rank = True


class NoEquilibriumError(FaultgougeError):
    """There is no equilibrium at this load, or none that can be found.

    Parameters
    ----------
    says : str
        The sentence.
    beyond : float, optional
        The largest F_x with an equilibrium, if a ramp has found it.
    """

    def __init__(self, says: str, beyond: float | None = None) -> None:
        super().__init__(says)
        self.beyond = beyond


class TurningPointError(NoEquilibriumError):
    """The branch of stable equilibria ends before this load: an eigenvalue of the equilibrium found is negative."""
