"""Run a LAMMPS deck and take its last state as it stands."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

from mpi4py import MPI

from ...analysis import BadInputError, Snapshot
from ..lammps.instance import lammps_instance
from . import forked_look
from .from_lammps import BALANCE, from_lammps
from .granular_commands import SnapshotError


def run_deck(path: Path, *, slides: bool = False, balance: float = BALANCE) -> Snapshot:
    """Run a deck in its own folder, as `lmp -in` there, and take its last state.

    Parameters
    ----------
    path : Path
        The deck.
    slides, balance
        As of :func:`~faultgouge.pywrap.from_lammps`.

    Raises
    ------
    BadInputError
        If the deck is missing, or has a wall that does not hand out its contacts.
    SnapshotError
        If LAMMPS stops, or the packing cannot be taken.
    """
    if not path.is_file():
        raise BadInputError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    _refuse_silent_walls(path)
    here = Path.cwd()
    with TemporaryDirectory(prefix="faultgouge") as folder:
        world = MPI.COMM_WORLD
        log = Path(world.bcast(folder, root=0)) / "log.lammps"
        lmp = lammps_instance(world, log)
        try:
            os.chdir(path.parent.resolve())
            lmp.file(path.name)
        except Exception as error:  # LAMMPS raises what its bindings choose
            raise SnapshotError(f"{path}: {forked_look.explain_error(error)}") from error
        finally:
            os.chdir(here)
        found = from_lammps(lmp, slides=slides, balance=balance)
        lmp.close()
        world.barrier()
    return found


def _refuse_silent_walls(path: Path) -> None:
    """Say before a long run that a wall of the deck lacks the word contacts, if the wall stays."""
    text = path.read_text(errors="replace").replace("&\n", " ")
    lines = [line.split("#")[0].split() for line in text.splitlines()]
    gone = {words[1] for words in lines if words[:1] == ["unfix"] and len(words) > 1}
    for words in lines:
        if words[:1] == ["fix"] and words[3:4] == ["wall/gran"] and "contacts" not in words and words[1] not in gone:
            raise BadInputError(
                f"{path}: fix {words[1]} wall/gran does not hand out its contacts: write contacts at its end."
            )
