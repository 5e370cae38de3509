"""Run a LAMMPS deck as `lmp -in` does in its folder, and take its last state as it stands.

LAMMPS alone reads the deck, and no command is left out, added or carried out twice. The plugin watches LAMMPS
(`pair_mindlin_smooth/deck_watch.cpp`): LAMMPS tells each command that it has carried out, with variables filled in, and
at `quit` hands the instance back. Once the deck has ended, no file of the deck is written any more.

**A state that cannot be taken** is kept. A run of one step writes the restart file: in a file that `write_restart`
writes after a run, LAMMPS leaves tangential histories out. The deck beside it goes on from there with the commands that
hold. Several ranks hand their state in such files to a process of one rank, as a look needs a copy of the process.
"""

import ctypes
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

from mpi4py import MPI

from ...analysis import BadInputError, Configuration, NoEquilibriumError
from ...analysis.errors import OutputError
from ...analysis.files.atomic_write import write_whole
from ...analysis.files.configuration_file import read_configuration
from ...plugin import directory
from ..lammps.instance import lammps_instance
from ..lammps.plain_file_names import shared_folder
from .balance import BALANCE, check_balance
from .from_lammps import from_lammps
from .granular_commands import GIVE_LINES, NotTakenError, commands_of
from .look_in_a_copy import INSERTS, explain_error, of_lammps, styles_of
from .relax import relax

WORLD = MPI.COMM_WORLD

AS_THE_PROGRAM = ("-log", "log.lammps", "-cite", "log", "-echo", "both")
OF_RANKS = "PMI", "MPI", "OMPI", "HYD", "SLURM"
"""Words of the command line for what the program lmp does without any, and so that LAMMPS tells its commands; and
beginnings of the environment's names by which a process is one of several ranks."""

BEFORE_RUNS = ctypes.CFUNCTYPE(None)(lambda: None)
QUIT = "faultgouge: the deck ends by quit"
"""What the plugin calls before the first run, and what LAMMPS stops with where a deck quits (`deck_watch.cpp`)."""

LIGGGHTS = ("hard_particles", "atom_style granular", "gran model", "property/global", "mesh/surface", "insert/")
"""Words of LIGGGHTS's commands that LAMMPS does not have."""

WRITERS, ENDS = ("print", "ave/", "record"), (*INSERTS, "halt")
"""Beginnings of the styles of fixes that write files, and of those that make particles, or end a run."""

BEFORE_THE_BOX = ("package", "suffix", "newton", "processors", "atom_modify", "comm_style")
BEHIND = (
    "lattice", "comm_modify", "neighbor", "neigh_modify", "special_bonds", "timestep", "run_style", "thermo_modify",
    "pair_style", "pair_modify", "pair_coeff", "region", "variable", "fix", "fix_modify",
)  # fmt: skip
NAMED, ADDED = ("region", "variable", "fix"), ("pair_coeff", "fix_modify", "comm_modify", "neigh_modify")
"""Commands of which a deck that goes on has those that hold, before and behind read_restart; those of which the last
one of each name holds, and those of which all hold."""


def run_deck(
    path: Path,
    *,
    balance: float = BALANCE,
    relaxes: bool = False,
    keep: Path | None = None,
    show: Callable[[str], None] | None = None,
    use: Callable[[Any, Configuration], None] | None = None,
) -> Configuration:
    """Run a deck in its own folder, as `lmp -in` there, and take its last state as `from_lammps` does.

    Parameters
    ----------
    path : Path
        The deck.
    balance, relaxes
        As of `from_lammps`; and whether the last state comes to rest first, by `relax`.
    keep : Path, optional
        A state that cannot be taken, or at which LAMMPS stops, is kept in a new restart file beside this one.
    show, use : callable, optional
        Get how far `relaxes` has come; and the instance and its packing before the instance is closed.

    Raises
    ------
    BadInputError
        If the deck is missing.
    NotTakenError
        If LAMMPS stops, or the packing cannot be taken: the sentence says where the state is kept.
    """
    check_balance(balance)
    if not path.is_file():
        raise BadInputError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    lmp, carried_out, stopped = _carry_out(path)
    try:
        if stopped:
            raise NotTakenError(f"{path}: {stopped}")
        if WORLD.size > 1 and use is None:
            return _on_one_rank(lmp, carried_out, path, balance, relaxes=relaxes)
        commands = commands_of(carried_out, "The deck has")
        if relaxes:
            for name, style in styles_of(lmp).fixes.items():
                if style.startswith(ENDS):  # only the particles that there are come to rest
                    lmp.command(f"unfix {name}")
            relax(lmp, commands, watch=show)
        found = from_lammps(lmp, commands, balance=balance)
        if use is not None:
            use(lmp, found)
        return found
    except (NotTakenError, NoEquilibriumError) as error:
        hidden = "leave `echo none` and `echo log` out of the deck, which keep commands from this program"
        says = str(error).replace(GIVE_LINES, hidden).rstrip(".")
        kept = _keep_state(lmp, carried_out, keep, path) if keep else ""
        raise NotTakenError(f"{says}. {kept}".rstrip()) from error
    finally:
        lmp.close()


def _on_one_rank(lmp: Any, carried_out: list[list[str]], deck: Path, balance: float, *, relaxes: bool) -> Configuration:
    """The last state of several ranks, one step on, as `faultgouge import` of its restart file takes it on one rank."""
    with shared_folder(WORLD) as folder:
        kept, found, says = _keep_state(lmp, carried_out, folder / "state.restart", deck), None, ""
        if WORLD.rank == 0:
            words = ["import", "state.restart", "-o", "state.h5", "--balance", repr(balance), *["--relax"] * relaxes]
            alone = {key: each for key, each in os.environ.items() if not key.startswith(OF_RANKS)}
            command = [sys.executable, "-m", "faultgouge", *words]
            done = subprocess.run(command, cwd=folder, env=alone, capture_output=True, text=True, check=False)
            if done.returncode == 0:
                one_on = f"the state is that of one rank, one step after the end of the deck on {WORLD.size} ranks"
                read = read_configuration(folder / "state.h5")
                found = replace(read, remarks=(*read.remarks, one_on))
            else:  # what is kept there goes with the folder
                says = done.stderr.strip().rpartition("Error: ")[2].partition(" The state, ")[0] or kept
        found, says = WORLD.bcast((found, says), root=0)
    if found is None:
        raise NotTakenError(says)
    return found


def _carry_out(path: Path) -> tuple[Any, list[list[str]], str]:
    """Have LAMMPS carry out a deck in its folder: the instance, whose files are closed; the commands that it has
    carried out, in words; and why it stopped, if an error has ended the deck."""
    here, carried_out, stopped, complete = os.getcwd(), list[list[str]](), "", False
    kind = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.POINTER(ctypes.c_char_p))
    told = kind(lambda number, words: carried_out.append([os.fsdecode(word) for word in words[:number]]))
    os.chdir(path.parent)
    try:
        try:
            lmp = lammps_instance(WORLD, None, *AS_THE_PROGRAM)
        except Exception as error:
            if not of_lammps(error):
                raise
            raise NotTakenError(f"{path}: {explain_error(error)}") from error
        plugin = ctypes.CDLL(str(Path(directory()) / "mindlinsmoothplugin.so"))
        plugin.faultgouge_watch(lmp.lmp, told, BEFORE_RUNS)
        try:
            with open(path.name, "rb") as stream:  # LAMMPS's bindings do not take any name
                lmp.file(f"/dev/fd/{stream.fileno()}")
            complete = True
        except Exception as error:  # LAMMPS's bindings raise any error
            stopped = "" if QUIT in str(error) else explain_error(error)
        finally:
            plugin.faultgouge_end_watch(lmp.lmp, int(complete))
    finally:
        os.chdir(here)
    carried_out = WORLD.bcast(carried_out, root=0)
    if stopped and any(word in f"{stopped} {' '.join(carried_out[-1] if carried_out else ())}" for word in LIGGGHTS):
        cure = "write pair_style, fix wall/gran and what makes particles as LAMMPS's manual has them (docs/decks.md)."
        stopped = f"{stopped.rstrip('.')}: this is a deck of LIGGGHTS, whose commands LAMMPS does not have; {cure}"
    if lmp.extract_setting("box_exist"):  # no file of the deck is written any more, and no run ends early
        told_lost = [words for words in carried_out if words[0] == "thermo_modify" and "lost" in words]
        lost = told_lost[-1][told_lost[-1].index("lost") + 1] if told_lost else "error"
        lmp.commands_list([
            "thermo_style custom step", f"thermo_modify lost {lost}", "restart 0", "timer timeout unlimited",
            *(f"undump {name}" for name in lmp.available_ids("dump")),
            *(f"unfix {name}" for name, style in styles_of(lmp).fixes.items() if style.startswith(WRITERS)),
        ])  # fmt: skip
    return lmp, carried_out, stopped


def _keep_state(lmp: Any, carried_out: list[list[str]], keep: Path, deck: Path) -> str:
    """Write the state to a new restart file beside `keep`, and a deck beside it; the sentence that says where they are,
    or why there are none."""
    if lmp.get_natoms() == 0:
        return "No state is kept, as there are no particles."
    with shared_folder(WORLD) as folder:
        try:
            for line in ("restart 0", f"restart 1 {folder}/state.*", "run 1 post no", "restart 0"):
                lmp.command(line)
        except Exception as error:  # LAMMPS's bindings raise any error
            return f"The state is not kept: {explain_error(error)}"
        fixes = styles_of(lmp).fixes
        stem, says = re.sub(r"[^\w.+-]", "_", keep.stem, flags=re.ASCII), ""  # LAMMPS reads the name in a line
        if WORLD.rank == 0:
            names = (keep.with_name(f"{stem}{f'.{number}' * (number > 0)}.restart") for number in count())
            kept = next(name for name in names if not (os.path.lexists(name) or os.path.lexists(f"{name}.in")))
            lines = [f"# goes on where {deck.name} has ended", *_deck_lines(carried_out, fixes, kept.name), ""]
            on = f"goes on from there: faultgouge import {kept} --relax, or with a line run in that deck."
            says = f"The state, one step on, is kept in {kept}, and the deck {kept.name}.in beside it {on}"
            try:
                write_whole(kept, max(folder.iterdir()).read_bytes())
                write_whole(Path(f"{kept}.in"), os.fsencode("\n".join(lines)))
            except OutputError as error:
                says = f"The state is not kept: {error}"
        return WORLD.bcast(says, root=0)


def _deck_lines(carried_out: list[list[str]], fixes: dict[str, str], restart: str) -> list[str]:
    """The lines of a deck that goes on from a restart file: of all commands, in words, that LAMMPS has carried out,
    those that hold; `fixes` are the styles of those that there are, by ID."""
    since = 1 + max((k for k, words in enumerate(carried_out) if words[0] == "clear"), default=-1)
    last: dict[tuple[str, ...], list[str]] = {}
    for words in carried_out[since:]:
        name = words[0]
        if name == "pair_style" and last.get((name,), words)[1] != words[1]:
            last = {key: each for key, each in last.items() if key[0] != "pair_coeff"}
        if name in (*BEFORE_THE_BOX, *BEHIND):
            key = tuple(words if name in ADDED else words[: 1 + (name in NAMED)])
            last.pop(key, None)
            last[key] = words
    stay = {name for name, style in fixes.items() if not style.startswith((*ENDS, *WRITERS))}
    before = [words for words in last.values() if words[0] in BEFORE_THE_BOX]
    behind = [
        words
        for words in last.values()
        if words[0] in BEHIND and words[2:3] != ["delete"] and (not words[0].startswith("fix") or words[1] in stay)
    ]
    return [*map(_line, before), f"read_restart {restart}", *map(_line, behind)]


def _line(words: list[str]) -> str:
    """A command in LAMMPS's language, with the quotes that its words need."""
    quoted = (
        word if re.fullmatch(r"[^\s\"'#$&]+", word) else f'"{word}"' if '"' not in word else f'"""{word}"""'
        for word in words
    )
    return " ".join(quoted)
