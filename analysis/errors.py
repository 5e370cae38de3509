"""The errors that a user is told in one sentence: what is wrong, where, and what to do.

Every such error is a `FaultgougeError`. A search for complex pairs may catch `NoEquilibriumError` and nothing above it:
an engine that fails, a lost rank or a full disk always reaches the command. Any other exception that reaches the
command is a mistake in this program.
"""


class FaultgougeError(Exception):
    """The root of the family; its text is the sentence.

    Attributes
    ----------
    exit_code : int
        What the command exits with: 1 for a computation that failed, 2 for bad input.
    one_rank : bool
        Whether one MPI rank alone knows of the error. The other ranks wait, and only MPI's Abort ends them.
    """

    exit_code = 1
    one_rank = False


class BadInputError(FaultgougeError, ValueError):
    """What the user gave cannot be used: a scene, a file, an option."""

    exit_code = 2


class PackingFileError(BadInputError):
    """A file is missing, broken, or not what it should be; the message names the file."""


class OutputError(FaultgougeError):
    """A result cannot be written: a full disk, a folder without permission. Rank 0 alone writes, and knows."""

    one_rank = True


class NoEquilibriumError(FaultgougeError):
    """There is no equilibrium at this load, or none that can be found.

    Parameters
    ----------
    says : str
        The sentence.
    beyond : float, optional
        The largest F_x that had an equilibrium, where a ramp tells.
    """

    def __init__(self, says: str, beyond: float | None = None) -> None:
        super().__init__(says)
        self.beyond = beyond


class TurningPointError(NoEquilibriumError):
    """The branch of stable equilibria ends before this load: an eigenvalue of the equilibrium found is negative."""
