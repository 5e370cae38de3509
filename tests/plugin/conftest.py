"""LAMMPS in this process, for the many scripts that end at once."""

from collections.abc import Callable

import pytest


@pytest.fixture(scope="session")
def said_against() -> Callable[[str], str]:
    """Runs an input script that is refused, without the second that a process of its own takes; what LAMMPS says."""
    from mpi4py import MPI

    from faultgouge.pywrap.lammps.instance import lammps_instance

    def run(script: str) -> str:
        instance = lammps_instance(MPI.COMM_SELF, None)
        try:
            with pytest.raises(Exception, match="ERROR") as refusal:
                instance.commands_string(script)
        finally:
            instance.close()
        return str(refusal.value)

    return run
