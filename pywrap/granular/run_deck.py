"""Run a LAMMPS deck and take its last state as it stands.

What cannot be taken at the end of a deck is refused before its runs: LAMMPS itself goes through the deck first, and
skips them (its option -skiprun). It does so in a process of its own and in a copy of the folder, since decks write
files, and may quit. Where this trial ends with an error, or does not end, the run itself has the word: particles may
have to move before a deck goes on.
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

from ...analysis import BadInputError, Snapshot
from ..lammps.instance import lammps_instance
from .from_lammps import check_instance, from_lammps
from .granular_commands import SnapshotError, read_commands
from .instance_queries import explain_error, styles_of

TRIAL = 10.0
"""Seconds for a deck without its runs: a loop that waits for what a run changes never ends."""

COPIED = 100e6
"""Bytes of the files of a folder up to which they are copied for the trial: a second."""

REFUSED = "refused: "
"""What the trial says of a deck, before the reason."""

RANKS = ("PMI", "HYDI", "OMPI", "PMIX")
"""Variables by which a launcher of MPI tells a process that it is a rank: the trial is none."""


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
    _try_without_runs(path)
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
        text = world.bcast(_logged_text(log, path.parent) if world.rank == 0 else None, root=0)
        found = from_lammps(lmp, _commands_in(text), slides=slides)
        lmp.close()
        world.barrier()
    return found


def _logged_text(log: Path, folder: Path) -> str:
    """The log, and those to which the deck turns by `log`, one after the other."""
    text, read = "", set()
    while log not in read and log.is_file():
        read.add(log)
        text += log.read_text(errors="replace")
        last = text.rstrip().rpartition("\n")[2].split()
        log = folder / last[1] if last[:1] == ["log"] and len(last) > 1 else log
    return text


def _commands_in(text: str) -> list[str]:
    """The commands of a log with variables filled in."""
    lines = [line.split("#")[0] for line in re.sub(r"&[ \t]*\n", " ", text).splitlines()]
    lines = [line for line in lines if "$" not in line]
    if not any(line.split()[:1] == ["pair_style"] for line in lines):
        raise SnapshotError(
            "No pair_style is in the log: write one, behind read_restart, too; and leave out log none and echo, which "
            "keep commands out of the log."
        )
    return lines


def _try_without_runs(path: Path) -> None:
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
        check_instance(lmp, styles_of(lmp), read_commands(_commands_in(_logged_text(log, Path())), log=True))
    except SnapshotError as error:
        return f"{REFUSED}{error}"
    return "fine"


if __name__ == "__main__":
    print(_skip_runs(Path(sys.argv[1])))
