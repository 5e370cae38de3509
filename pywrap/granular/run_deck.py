"""Run a LAMMPS deck and take its last state as it stands."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

from mpi4py import MPI

from ...analysis import BadInputError, Snapshot
from ..lammps.instance import lammps_instance
from .from_lammps import from_lammps
from .granular_commands import SnapshotError, check_fixes, check_pair, read_commands
from .instance_queries import explain_error


def run_deck(path: Path, *, slides: bool = False) -> Snapshot:
    """Run a deck in its own folder, as `lmp -in` there, and take its last state as `from_lammps` does.

    Raises
    ------
    BadInputError
        If the deck is missing, or what cannot be taken stands in its lines.
    SnapshotError
        If LAMMPS stops, or the packing cannot be taken.
    """
    if not path.is_file():
        raise BadInputError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    _check_deck(path)
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
        found = from_lammps(lmp, slides=slides)
        lmp.close()
        world.barrier()
    return found


BRANCHES = ("if", "include", "jump", "next", "python", "shell")
"""Commands after which the lines of a deck are not those that LAMMPS runs."""


def _check_deck(path: Path) -> None:
    """Refuse before a long run what the lines of a deck say that stands at its end, as far as they have no variables.

    What is seen here is looked at again after the run, when all lines have numbers.
    """
    lines = path.read_text(errors="replace").replace("&\n", " ").splitlines()
    words = [line.split("#")[0].split() for line in lines]
    gone = {line[1] for line in words if line[:1] == ["unfix"] and len(line) > 1}
    for line in words:
        if line[:1] == ["fix"] and line[3:4] == ["wall/gran"] and "contacts" not in line and line[1] not in gone:
            raise BadInputError(
                f"{path}: fix {line[1]} wall/gran does not hand out its contacts: write contacts at its end."
            )
    if any(line[0] in BRANCHES for line in words if line):
        return
    commands = read_commands(["pair_style none", *lines], log=True)
    varies = any("$" in word for line in words if line[:1] == ["pair_style"] for word in line)
    try:
        if commands.style != "none" and not varies:
            check_pair(commands, [])
        check_fixes({name: line.split()[3] for name, line in commands.fixes.items()}, commands)
    except SnapshotError as error:
        raise BadInputError(f"{path}: {error}") from error
