"""Run a LAMMPS deck and take its last state as it stands.

LAMMPS carries out each command of a deck once. It reads the deck in two parts. Between them, before the first run, its
fixes and styles are looked at: what cannot be taken, and stays whatever the rest of the deck does, is refused before
the runs. LAMMPS's log, and the parts, are files without a name, which no end of this program leaves behind.
"""

import ctypes
import os
import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, NamedTuple

from mpi4py import MPI

from ...analysis import BadInputError, Configuration
from ..lammps.instance import lammps_instance
from .balance import BALANCE, check_balance
from .granular_commands import (
    GIVE_LINE,
    GIVE_LINES,
    Commands,
    NotLinearisedError,
    NotTakenError,
    commands_in,
    logged_text,
    read_commands,
    with_one_rank,
)
from .instance_queries import communicator, explain_error, name_of, styles_of
from .kept_state import keep_state, take_or_keep
from .look_in_a_copy import can_copy
from .looks import check_instance
from .moving_regions import moving_region

MARK = "faultgouge_rest_of_the_deck"
"""Label of the first line of the second part of a deck."""

RUN = re.compile(r"\s*(run|minimize)\b")

CHANGES = re.compile(
    r"\b(unfix|clear|pair_style|pair_coeff|include|python|plugin)\b|\bjump\s+(?!SELF\b)"
    r"|^\s*\$|\b(then|else|every)\b.*[\"']\s*\$",
    re.MULTILINE,
)
"""Commands that change what has been set up, or stand in a variable and may do so."""

CONDITION = re.compile(r"""\b(el)?if\s+("[^"]*"|'[^']*'|\S+)""")

UNFIX = re.compile(r"(?m)^[ \t]*unfix[ \t]+(\w+)[ \t]*(?:#.*)?$")
"""A command that takes one fix away, named by its ID."""

REDEFINES = re.compile(r"(?<![\w/])(region|variable)\s")
"""Commands that may bring a region to rest."""

HIDES = re.compile(r"\s*(log|echo)\s")
"""Commands that keep what follows out of LAMMPS's log."""


class Deck(NamedTuple):
    """The text of a deck up to its first run, and from there on."""

    head: str
    rest: str

    @property
    def ahead(self) -> str:
        """Lines that LAMMPS may still carry out after the head, among them those to which a loop goes back."""
        loop = re.search(r"(?m)^\s*label\b", self.head)
        return (self.head[loop.start() :] if loop else "") + self.rest

    @property
    def second_part(self) -> str:
        """A deck that begins with the rest, and has the labels of the head for the jumps of the rest."""
        return f"jump SELF {MARK}\n{self.head}label {MARK}\n{self.rest}"


def run_deck(
    path: Path, *, slides: bool = False, balance: float = BALANCE, relaxes: bool = False, keep: Path | None = None
) -> Configuration:
    """Run a deck in its own folder, as `lmp -in` there, and take its last state as `from_lammps` does.

    If `relaxes`, the last state comes to rest first, by :func:`~faultgouge.pywrap.granular.relax.relax`. A state that
    cannot be taken, or at which LAMMPS stops, is kept in a restart file beside `keep`.

    Raises
    ------
    BadInputError
        If the deck is missing, or before its first run has what cannot be taken.
    NotTakenError
        If LAMMPS stops, or the packing cannot be taken.
    """
    check_balance(balance)
    if not path.is_file():
        raise BadInputError(f"{path} {'is no file' if path.exists() else 'does not exist'}.")
    text = path.read_bytes().decode(errors="surrogateescape")
    with TemporaryFile("w+", errors="replace") as log:
        lmp = lammps_instance(MPI.COMM_WORLD, Path(name_of(log)))
        try:
            _carry_out_deck(lmp, path, text, log)
        except NotTakenError as error:
            ran = bool(lmp.extract_global("ntimestep"))
            says = keep_state(lmp, str(error), keep if ran else None, ", and without what stopped LAMMPS")
            raise NotTakenError(says) from error
        try:
            commands = commands_in(_text_of_logs(lmp, log, path))
            found = take_or_keep(lmp, commands, keep, slides=slides, balance=balance, relaxes=relaxes)
        except NotTakenError as error:
            if (says := _of_deck(str(error), text)) == str(error):
                raise
            raise NotTakenError(says) from error
        lmp.close()
    return found


def _carry_out_deck(lmp: Any, path: Path, text: str, log: IO[str]) -> None:
    """Have LAMMPS carry out all of a deck, and look at its fixes and styles before the first run if that is known."""
    deck = _divide(_before_quit(text))
    if deck is None:
        _carry_out(lmp, path, path.name)
        return
    _carry_out_text(lmp, path, deck.head)
    _refuse_what_stays(lmp, path, _text_of_logs(lmp, log, path), deck)
    _carry_out_text(lmp, path, deck.second_part)


def _before_quit(text: str) -> str:
    """A deck up to the `quit` that ends it, and would end this program, too; all of a deck whose jumps may pass it."""
    if re.search(r"\bjump\b", text):
        return text
    quits = (each.start() for each in re.finditer(r"(?m)^[ \t]*quit\b", text))
    return text[: next((at for at in quits if text.count('"""', 0, at) % 2 == 0), len(text))]


def _divide(text: str) -> Deck | None:
    """The parts of a deck; None if it jumps before its first run, or to its own beginning."""
    lines = text.splitlines(keepends=True)
    at, quoted, continued = 0, False, False
    while at < len(lines) and (quoted or continued or not RUN.match(lines[at])):
        quoted ^= lines[at].count('"""') % 2 == 1
        continued = lines[at].rstrip().endswith("&")
        at += 1
    head, rest = "".join(lines[:at]), "".join(lines[at:])
    if re.search(r"\bjump\b", head) or re.search(r"(?m)\bjump\s+(SELF\s*(?:[\"'#]|$)|\S*\$)", rest):
        return None
    return Deck(head if head.endswith("\n") else f"{head}\n", rest)


def _carry_out_text(lmp: Any, path: Path, text: str) -> None:
    """Have LAMMPS carry out a part of a deck."""
    with TemporaryFile("w+", encoding="utf-8", errors="surrogateescape", newline="") as part:
        part.write(text)
        part.flush()
        _carry_out(lmp, path, name_of(part))


def _carry_out(lmp: Any, path: Path, name: str) -> None:
    """Have LAMMPS read a file in the folder of a deck."""
    here = Path.cwd()
    try:
        os.chdir(path.parent.resolve())
        lmp.file(name)
    except Exception as error:  # LAMMPS's bindings raise any error
        raise NotTakenError(f"{path}: {explain_error(error)}") from error
    finally:
        os.chdir(here)


def _text_of_logs(lmp: Any, log: IO[str], path: Path) -> str:
    """LAMMPS's log so far, on all ranks."""
    ctypes.CDLL(None).fflush(None)
    log.seek(0)
    return communicator(lmp).bcast(logged_text(log.read(), path.parent), root=0)


def _refuse_what_stays(lmp: Any, path: Path, text: str, deck: Deck) -> None:
    """Refuse what an instance cannot be taken with, unless a command ahead may change it."""
    ahead = CONDITION.sub("", deck.ahead)
    gone, ahead = set(UNFIX.findall(ahead)), UNFIX.sub("", ahead)
    if CHANGES.search(ahead):
        return
    try:
        commands, styles = read_commands(commands_in(text), log=True), styles_of(lmp)
        again = re.findall(r"\bfix\s+(\S+)\s", ahead)  # a fix takes the place of one with the same ID
        if any(name in styles.fixes or "$" in name for name in again):
            return
        stay = {name: style for name, style in styles.fixes.items() if name not in gone}
        commands = replace(commands, fixes={name: commands.fixes[name] for name in commands.fixes if name not in gone})
        check_instance(lmp, styles._replace(fixes=stay), commands)
    except NotLinearisedError as error:
        if not can_copy(lmp):  # for K by differences of forces
            raise BadInputError(f"{path}: {_of_deck(with_one_rank(error), deck.head)}") from error
        _refuse_moving_region(lmp, path, commands, ahead)
    except NotTakenError as error:
        raise BadInputError(f"{path}: {_of_deck(str(error), deck.head)}") from error


def _refuse_moving_region(lmp: Any, path: Path, commands: Commands, ahead: str) -> None:
    """Refuse a region that moves, and stays as it is in the lines ahead."""
    says = ""
    if not REDEFINES.search(ahead):
        with suppress(NotTakenError):  # a deck that LAMMPS cannot run yet tells nothing
            says = moving_region(lmp, commands)
    if says:
        raise BadInputError(f"{path}: {says}")


def _of_deck(says: str, text: str) -> str:
    """A sentence about commands that are missing, for a deck in place of a script in Python."""
    hides = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if HIDES.match(line)]
    named = " and ".join(f"line {number}, `{line}`" for number, line in hides)
    advice = f"{named}, may keep it out of LAMMPS's log: leave that out" if hides else "see that LAMMPS's log has it"
    return says.replace(GIVE_LINES, advice).replace(GIVE_LINE, advice)
