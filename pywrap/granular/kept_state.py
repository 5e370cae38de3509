"""Keep the last state of a deck whose packing cannot be taken, so that hours of a run are not lost.

A run of one step writes the restart file: in a file that `write_restart` writes after a run, LAMMPS leaves tangential
histories out. A deck is written beside the restart file. It goes on from there with the commands of the deck that hold.
"""

import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..lammps.plain_file_names import shared_folder
from .instance_queries import communicator, explain_error, styles_of
from .look_in_a_copy import INSERTS

MDR_HISTORY = "MDR_PARTICLE_HISTORY_VARIABLES"
"""ID of the fix by which LAMMPS keeps what particles of the model mdr remember."""

MDR_WALLS = "LAMMPS of 22 Jul 2025 crashes where a wall of the model mdr stands behind read_restart"

BEFORE_THE_BOX = ("package", "suffix", "newton", "processors", "atom_modify", "comm_style")
SETTINGS = (
    "comm_modify", "neighbor", "neigh_modify", "special_bonds", "timestep", "run_style", "thermo_modify", "pair_modify",
)  # fmt: skip
"""Commands of which a deck that goes on has the last ones, before and behind read_restart."""

RESTART = "RESTART.FILE"

NAMED = ("region", "variable", "compute", "fix")
"""Commands that define something of a name."""

NOT_AGAIN = (*INSERTS, "halt", "print", "ave/", "record")
"""Fixes that would make particles, end a run or write to files of the deck, by the beginnings of their styles."""


def keep_state(lmp: Any, carried_out: Iterable[list[str]], keep: Path, deck: Path) -> str:
    """Write the state to a new restart file beside `keep`, and a deck beside it; the sentence that says where they are,
    or why there are none."""
    if lmp.get_natoms() == 0:
        return "No state is kept, as there are no particles."
    world = communicator(lmp)
    with shared_folder(world) as folder:
        try:
            lmp.command("restart 0")
            lmp.command(f"restart 1 {folder}/state.*")
            lmp.command("run 1 post no")
            lmp.command("restart 0")
        except Exception as error:  # LAMMPS's bindings raise any error
            return f"The state is not kept: {explain_error(error)}"
        lines = deck_lines(list(carried_out), styles_of(lmp).fixes)
        kept, says = None, ""
        if world.rank == 0:
            written = max(Path(folder).iterdir())
            kept, says = _store(written, keep, [f"# goes on where {deck.name} has ended", *lines])
    kept, says = world.bcast((kept, says), root=0)
    if kept is None:
        return f"The state is not kept: {says}."
    if MDR_HISTORY in lmp.available_ids("fix") and any("wall/gran" in each for each in styles_of(lmp).fixes.values()):
        return f"The state, one step on, is kept in {kept}, but {MDR_WALLS}."
    return (
        f"The state, one step on, is kept in {kept}, and the deck {kept.name}.in beside it goes on from there: "
        f"faultgouge import {kept} --relax, or with a line run in that deck."
    )


def _store(state: Path, keep: Path, lines: list[str]) -> tuple[Path | None, str]:
    """Copy a restart file, and write its deck, to names that are not there yet; or the reason why not."""
    stem, number = re.sub(r"[^\w.+-]", "_", keep.stem, flags=re.ASCII), 0  # LAMMPS reads the name in a line
    while True:
        file = keep.with_name(f"{stem}.{number}.restart" if number else f"{stem}.restart")
        beside = file.with_name(f"{file.name}.in")
        number += 1
        if file.exists() or beside.exists():
            continue
        made: list[Path] = []
        try:
            for path, fill in (
                (file, state.read_bytes()),
                (beside, os.fsencode("\n".join([lines[0], *lines[1:]]).replace(RESTART, file.name) + "\n")),
            ):
                with path.open("xb") as stream:
                    made.append(path)
                    stream.write(fill)
                    stream.flush()
                    os.fsync(stream.fileno())
            return file, ""
        except FileExistsError:
            pass  # another process was faster
        except OSError as error:
            for path in made:
                path.unlink(missing_ok=True)
            return None, f"{error.filename or file}: {error.strerror}"


def deck_lines(carried_out: list[list[str]], fixes: dict[str, str]) -> list[str]:
    """The lines of a deck that goes on from a restart file: of all commands, in words, that LAMMPS has carried out,
    those that hold; `fixes` are the styles of those that there are, by ID."""
    since = 1 + max((k for k, words in enumerate(carried_out) if words[0] == "clear"), default=-1)
    last: dict[tuple[str, ...], list[str]] = {}
    for words in carried_out[since:]:
        name = words[0]
        if name == "pair_style" and last.get((name,), words)[1] != words[1]:
            last = {key: each for key, each in last.items() if key[0] != "pair_coeff"}
        keeps_all = name in ("pair_coeff", "fix_modify", "compute_modify", "comm_modify", "neigh_modify")
        if keeps_all or name in (*BEFORE_THE_BOX, *SETTINGS, "pair_style", "region", "variable", "compute", "fix"):
            key = (name, *words[1:]) if keeps_all else (name, *words[1:2]) if name in NAMED else (name,)
            last.pop(key, None)
            last[key] = words
    stay = {name for name, style in fixes.items() if not style.startswith(NOT_AGAIN)}
    used = [words for (name, *more), words in last.items() if name == "fix" and more[0] in stay]
    needed = {id(words) for words in used}
    while used:  # regions, variables and computes that these name
        words = used.pop()
        for (name, *more), other in last.items():
            known = {"region": "", "variable": "v_", "compute": "c_"}.get(name)
            if known is None or id(other) in needed:
                continue
            if re.search(rf"\b{known}{re.escape(more[0])}\b", " ".join(words[2:])):
                needed.add(id(other))
                used.append(other)
    chosen = [
        words
        for (name, *more), words in last.items()
        if name not in (*BEFORE_THE_BOX, *NAMED, "fix_modify", "compute_modify")
        or id(words) in needed
        or (name == "fix_modify" and more[0] in stay)
    ]
    before = [words for (name, *_), words in last.items() if name in BEFORE_THE_BOX]
    return [*map(_line, before), f"read_restart {RESTART}", *map(_line, chosen)]


def _line(words: list[str]) -> str:
    """A command in LAMMPS's language, with the quotes that its words need."""
    quoted = (
        word if re.fullmatch(r"[^\s\"'#$&]+", word) else f'"{word}"' if '"' not in word else f'"""{word}"""'
        for word in words
    )
    return " ".join(quoted)
