"""Run a LAMMPS deck and take its last state as it stands."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

from mpi4py import MPI

from ...analysis import BadInputError, Configuration
from ..lammps.instance import lammps_instance
from .deck_trial import try_without_runs
from .from_lammps import BALANCE
from .granular_commands import SnapshotError, commands_in, logged_text
from .instance_queries import explain_error
from .kept_state import take_or_keep


def run_deck(path: Path, *, slides: bool = False, balance: float = BALANCE, keep: Path | None = None) -> Configuration:
    """Run a deck in its own folder, as `lmp -in` there, and take its last state as `from_lammps` does.

    A state that cannot be taken is kept in a restart file beside `keep`.

    Raises
    ------
    BadInputError
        If the deck is missing, or what cannot be taken stands in its lines.
    SnapshotError
        If LAMMPS stops, or the packing cannot be taken.
    """
    if not path.is_file():
        raise BadInputError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    try_without_runs(path)
    here = Path.cwd()
    with TemporaryDirectory(prefix="faultgouge") as folder:
        world = MPI.COMM_WORLD
        log = Path(world.bcast(folder, root=0)) / "log.lammps"
        lmp = lammps_instance(world, log)
        try:
            os.chdir(path.parent.resolve())
            lmp.file(path.name)
        except Exception as error:  # LAMMPS raises what its bindings choose
            raise SnapshotError(f"{path}: {explain_error(error)}") from error
        finally:
            os.chdir(here)
        lmp.command("log none")  # which writes it
        lmp.command("timer timeout unlimited")  # else `run 0` is skipped where fix halt has ended the deck
        text = world.bcast(logged_text(log, path.parent) if world.rank == 0 else None, root=0)
        found = take_or_keep(lmp, commands_in(text), keep, slides=slides, balance=balance)
        lmp.close()
        world.barrier()
    return found
