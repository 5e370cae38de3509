"""Run a LAMMPS deck and take its last state as it stands."""

import os
import re
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
        lmp.command("log none")
        lmp.command("timer timeout unlimited")  # else `run 0` is skipped where fix halt has ended the deck
        commands = world.bcast(_commands_run(log, path.parent) if world.rank == 0 else None, root=0)
        found = from_lammps(lmp, commands, slides=slides)
        lmp.close()
        world.barrier()
    return found


def _commands_run(log: Path, folder: Path) -> list[str]:
    """The commands with variables filled in, from the log and from those to which the deck turns by `log`."""
    text, read = "", set()
    while log not in read and log.is_file():
        read.add(log)
        text += log.read_text(errors="replace")
        last = text.rstrip().rpartition("\n")[2].split()
        log = folder / last[1] if last[:1] == ["log"] and len(last) > 1 else log
    return [line for line in re.sub(r"&[ \t]*\n", " ", text).splitlines() if "$" not in line]


BRANCHES = ("if", "include", "jump", "next", "python")
"""Commands with which LAMMPS runs other lines than those of a deck, one after the other."""


def _check_deck(path: Path) -> None:
    """Refuse before a long run what the lines of a deck say that stands at its end, as far as they have no variables.

    What is seen here is looked at again after the run, when all lines have numbers.
    """
    lines = re.sub(r"&[ \t]*\n", " ", path.read_text(errors="replace")).splitlines()
    words = [line.split("#")[0].split() for line in lines]
    at = next((k for k, line in enumerate(words) if line[:1] == ["pair_style"]), 0)
    for line in {line[0]: line for line in words[:at] if line[:1] in (["echo"], ["log"])}.values():
        if line[:2] in (["echo", "none"], ["echo", "screen"], ["log", "none"]):
            raise BadInputError(
                f"{path}: {' '.join(line[:2])} keeps commands out of the log, from which they are read: leave it out."
            )
    gone = {line[1] for line in words if line[:1] == ["unfix"] and len(line) > 1}
    if any("$" in name for name in gone):
        return
    fixes = {line[1]: line for line in words if line[:1] == ["fix"] and len(line) > 3 and line[1] not in gone}
    for name, line in fixes.items():
        if line[3] == "wall/gran" and "contacts" not in line:
            raise BadInputError(
                f"{path}: fix {name} wall/gran does not hand out its contacts: write contacts at its end."
            )
    # lines before the first jump are run; what is named behind it, or after `if`, may be different in the end
    leaves = (re.search(r"\b(clear|include|jump|next|python|quit)\b", line) for line in lines)
    jumps = [k for k, found in enumerate(leaves) if found and words[k] and words[k][0] in BRANCHES]
    at = jumps[0] if jumps else len(lines)
    rest = " ".join([*lines[at:], *(line for line in lines[:at] if line.split()[:1] == ["if"])])
    if re.search(r"\b(clear|include|python)\b|\bunfix\s+\S*\$", rest):
        return
    names = set(re.findall(r"[^\s\"']+", rest))
    words = [line for line in words[:at] if line[:1] != ["fix"] or names.isdisjoint(line[1:2])]
    first = {line[0] for line in words if line}
    if "quit" in first:
        raise BadInputError(f"{path}: quit ends this program, too, before the packing is taken: leave it out.")
    if "pair_style" not in first and "pair_style" not in rest:
        raise BadInputError(f"{path} has no pair_style: write it, behind read_restart, too.")
    varies = "pair_" in rest or any("$" in word for line in words if line[:1] == ["pair_style"] for word in line)
    plain = [_without_variables(line) for line in words]
    try:
        commands = read_commands([*plain, *["pair_style none"] * varies], log=True)
        if not varies:
            check_pair(commands, [])
        check_fixes({name: line.split()[3] for name, line in commands.fixes.items()}, commands)
    except SnapshotError as error:
        raise BadInputError(f"{path}: {error}") from error


def _without_variables(line: list[str]) -> str:
    """A line as far as variables do not matter: a fix up to its style, and a wall with what moves or bends it."""
    if line[:1] != ["fix"] or line[4:5] == ["granular"]:
        return " ".join(line)
    return " ".join([*line[:4], *(word.replace("$", "") for word in line[4:])])
