"""A LAMMPS deck is tried without its runs: what cannot be taken at its end is refused before they begin.

LAMMPS itself goes through the deck and skips the runs (its option -skiprun). It does so in a process of its own and in
a copy of the folder, since decks write files, and may quit. Where this trial ends with an error, or does not end, the
run itself has the word: particles may have to move before a deck goes on.
"""

import os
import re
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from mpi4py import MPI

from ...analysis import BadInputError
from ..lammps.instance import lammps_instance
from .from_lammps import check_instance
from .granular_commands import NotLinearisedError, SnapshotError, commands_in, logged_text, read_commands
from .instance_queries import styles_of

TRIAL = 10.0
"""Seconds for a deck without its runs: a loop that waits for what a run changes never ends."""

COPIED = 100e6
"""Bytes of the files of a folder up to which they are copied for the trial: a second."""

REFUSED = "refused: "
"""What the trial says of a deck, before the reason."""

RANKS = ("PMI", "HYDI", "OMPI", "PMIX")
"""Variables by which a launcher of MPI tells a process that it is a rank: the trial is none."""


def try_without_runs(path: Path) -> None:
    """Refuse what cannot be taken at the end of a deck, as far as that does not depend on its runs."""
    files = [each for each in path.parent.iterdir() if each.is_file()]
    if MPI.COMM_WORLD.size > 1 or sum(each.stat().st_size for each in files) > COPIED:
        return
    with TemporaryDirectory(prefix="faultgouge") as folder:
        copy = Path(folder) / "deck"  # not where Python starts: it would take its modules from there
        copy.mkdir()
        for each in files:
            with suppress(OSError):  # a file that the deck does not read may be unreadable
                shutil.copyfile(each, copy / each.name)
        alone = {name: value for name, value in os.environ.items() if not name.startswith(RANKS)}
        words = [sys.executable, "-m", __name__, str(copy / path.name)]
        try:
            done = subprocess.run(
                words, cwd=folder, env=alone, capture_output=True, text=True, timeout=TRIAL, check=False
            )
        except subprocess.TimeoutExpired:
            return
    if done.returncode == 0 and not done.stdout and re.search(r"(?m)^\s*quit\b", path.read_text(errors="replace")):
        raise BadInputError(f"{path}: quit ends this program, too, before the packing is taken: leave it out.")
    if done.stdout.startswith(REFUSED):
        raise BadInputError(f"{path}: {done.stdout.removeprefix(REFUSED).strip()}")


def _skip_runs(deck: Path) -> str:
    """What is said of a deck after it has run without its runs."""
    log = Path.cwd() / "log"
    lmp = lammps_instance(MPI.COMM_WORLD, log, "-skiprun")
    os.chdir(deck.parent)
    try:
        lmp.file(deck.name)
    except Exception:  # LAMMPS raises what its bindings choose, and will say it in the run
        return "stopped"
    lmp.command("log none")
    try:
        check_instance(lmp, styles_of(lmp), read_commands(commands_in(logged_text(log, Path())), log=True))
    except NotLinearisedError:
        return "fine"  # by differences of forces
    except SnapshotError as error:
        return f"{REFUSED}{error}"
    return "fine"


if __name__ == "__main__":
    print(_skip_runs(Path(sys.argv[1])))
