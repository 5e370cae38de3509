"""Run a LAMMPS deck as `lmp -in` does in its folder, and take its last state as it stands.

LAMMPS alone reads the deck: loops, includes and labels, `shell cd`, `if ... then ... quit`, logs and files are as
LAMMPS has them, and no command is left out, added or carried out twice. The plugin watches LAMMPS
(`pair_mindlin_smooth/deck_watch.cpp`): LAMMPS tells each command that it has carried out, with variables filled in, and
at `quit` hands the instance back. Once the deck has ended, the log is closed, and no file of the deck is written any
more.

**A state that cannot be taken** is kept, so that hours of a run are not lost. A run of one step writes the restart
file: in a file that `write_restart` writes after a run, LAMMPS leaves tangential histories out. The deck beside it goes
on from there with the commands that hold.
"""

import ctypes
import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

from ...analysis import BadInputError, Configuration, NoEquilibriumError
from ...plugin import directory
from ..lammps.instance import lammps_instance
from ..lammps.plain_file_names import shared_folder
from .balance import BALANCE, check_balance, moving_region
from .from_lammps import from_lammps
from .granular_commands import GIVE_LINE, GIVE_LINES, NotLinearisedError, NotTakenError, commands_of
from .look_in_a_copy import INSERTS, can_copy, communicator, explain_error, in_a_copy, name_of, of_lammps, styles_of
from .looks import check_instance
from .relax import relax

AS_THE_PROGRAM = ("-log", "log.lammps", "-cite", "log")
"""Words of the command line for what the program lmp does without any."""

QUIT = "faultgouge: the deck ends by quit"
"""What LAMMPS stops with where a deck quits (`deck_watch.cpp`)."""

LIGGGHTS = (
    "hard_particles", "atom_style granular", "gran model", "property/global", "particletemplate",
    "particledistribution", "mesh/surface", "insert/", "nve/sphere/", "modify_timing", "coarsegraining",
)  # fmt: skip
"""Words of LIGGGHTS's commands that LAMMPS does not have."""

WRITERS = ("print", "ave/", "record")
"""Fixes that write files, by the beginnings of their styles."""

Notice = Callable[[str], None]


@dataclass(frozen=True)
class EndedDeck:
    """A LAMMPS after its deck: the instance, the commands that it has carried out, in words, and why it stopped, if an
    error has ended the deck."""

    lmp: Any
    carried_out: list[list[str]]
    stopped: str


def run_deck(
    path: Path,
    *,
    slides: bool = False,
    balance: float = BALANCE,
    relaxes: bool = False,
    keep: Path | None = None,
    notice: Notice | None = None,
    show: Notice | None = None,
    use: Callable[[Any, Configuration], None] | None = None,
) -> Configuration:
    """Run a deck in its own folder, as `lmp -in` there, and take its last state as `from_lammps` does.

    Parameters
    ----------
    path : Path
        The deck.
    slides, balance
        As of :func:`~faultgouge.pywrap.from_lammps`.
    relaxes : bool
        Whether the last state comes to rest first, by :func:`~faultgouge.pywrap.granular.relax.relax`.
    keep : Path, optional
        A state that cannot be taken, or at which LAMMPS stops, is kept in a new restart file beside this one.
    notice : callable, optional
        Gets a sentence before the first run if what is set up cannot be taken as it stands; the deck may change that.
    show : callable, optional
        Gets how far `relaxes` has come.
    use : callable, optional
        Gets the instance and its packing before the instance is closed.

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
    deck = carry_out_deck(path, notice)
    try:
        found = _take(deck, path, slides=slides, balance=balance, relaxes=relaxes, show=show)
        if use is not None:
            use(deck.lmp, found)
        return found
    except (NotTakenError, NoEquilibriumError) as error:
        kept = keep_state(deck.lmp, deck.carried_out, keep, path) if keep else ""
        raise NotTakenError(f"{_of_deck(str(error)).rstrip('.')}. {kept}".rstrip()) from error
    finally:
        deck.lmp.close()


def _of_deck(says: str) -> str:
    """A sentence about commands that are missing, for a deck in place of a script in Python."""
    hidden = "leave `echo none` and `echo log` out of the deck, which keep commands from this program"
    return says.replace(GIVE_LINES, hidden).replace(GIVE_LINE, hidden)


def carry_out_deck(path: Path, notice: Notice | None = None) -> EndedDeck:
    """Have LAMMPS carry out a deck in its folder; the caller closes the instance, whose files are closed."""
    here, carried_out = os.getcwd(), list[list[str]]()
    os.chdir(path.parent)
    try:
        try:
            lmp = lammps_instance(MPI.COMM_WORLD, None, *AS_THE_PROGRAM, "-echo", "both")
        except Exception as error:
            if not of_lammps(error):
                raise
            raise NotTakenError(f"{path}: {explain_error(error)}") from error
        plugin = ctypes.CDLL(str(Path(directory()) / "mindlinsmoothplugin.so"))

        @ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.POINTER(ctypes.c_char_p))
        def told(count: int, words: Any) -> None:
            carried_out.append([os.fsdecode(word) for word in words[:count]])

        @ctypes.CFUNCTYPE(None)
        def runs() -> None:
            says = _not_taken_yet(lmp, carried_out) if notice and can_copy(lmp) else ""
            if notice and says:
                notice(f"{path}: as it stands before the first run, the packing cannot be taken: {says}")

        stopped, complete = "", False
        plugin.faultgouge_watch(lmp.lmp, told, runs)
        try:
            with open(path.name, "rb") as stream:  # LAMMPS's bindings do not take any name
                lmp.file(name_of(stream))
            complete = True
        except Exception as error:  # LAMMPS's bindings raise any error
            stopped = "" if QUIT in str(error) else explain_error(error)
        finally:
            plugin.faultgouge_end_watch(lmp.lmp, int(complete))
    finally:
        os.chdir(here)
    carried_out = communicator(lmp).bcast(carried_out, root=0)
    if lmp.extract_setting("box_exist"):
        _close_files(lmp, carried_out)
    return EndedDeck(lmp, carried_out, stopped)


def _close_files(lmp: Any, carried_out: list[list[str]]) -> None:
    """Close the files that a deck has open; and have no run of this program end early, or need what is taken away."""
    lost = [words[words.index("lost") + 1] for words in carried_out if "lost" in words and words[0] == "thermo_modify"]
    lmp.command("thermo_style custom step")
    lmp.command(f"thermo_modify lost {lost[-1] if lost else 'error'}")
    for name in lmp.available_ids("dump"):
        lmp.command(f"undump {name}")
    for name, style in styles_of(lmp).fixes.items():
        if style.startswith(WRITERS):
            lmp.command(f"unfix {name}")
    lmp.command("restart 0")
    lmp.command("timer timeout unlimited")


def _not_taken_yet(lmp: Any, carried_out: list[list[str]]) -> str:
    """Why a packing cannot be taken as it stands before a run; empty if no reason is known yet."""

    def look() -> None:
        commands = commands_of(carried_out, "The deck has")
        try:
            check_instance(lmp, styles_of(lmp), commands)
        except NotLinearisedError:  # K by differences of forces may serve
            if says := moving_region(lmp, commands):
                raise NotTakenError(says) from None

    try:
        in_a_copy(look)
    except NotTakenError as error:
        return _of_deck(str(error)) if "LAMMPS stopped" not in str(error) else ""
    return ""


def _take(
    deck: EndedDeck, path: Path, *, slides: bool, balance: float, relaxes: bool, show: Notice | None
) -> Configuration:
    """What `from_lammps` takes of an ended deck, after `relax` if that is asked for."""
    if deck.stopped:
        raise NotTakenError(f"{path}: {_explain_stop(deck)}")
    commands = commands_of(deck.carried_out, "The deck has")
    if relaxes:
        for name, style in styles_of(deck.lmp).fixes.items():
            if style.startswith((*INSERTS, "halt")):  # only the particles that there are come to rest
                deck.lmp.command(f"unfix {name}")
        relax(deck.lmp, commands, watch=show)
    return from_lammps(deck.lmp, commands, slides=slides, balance=balance)


def _explain_stop(deck: EndedDeck) -> str:
    """What LAMMPS says, and whether the deck is one of LIGGGHTS."""
    lines = [" ".join(words) for words in deck.carried_out[-1:]]
    if any(word in line for line in (deck.stopped, *lines) for word in LIGGGHTS):
        return (
            f"{deck.stopped.rstrip('.')}: this is a deck of LIGGGHTS, whose commands LAMMPS does not have; write "
            "pair_style, fix wall/gran and what makes particles as LAMMPS's manual has them (docs/decks.md)."
        )
    return deck.stopped


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
        deck = os.fsencode("\n".join(lines).replace(RESTART, file.name) + "\n")
        number += 1
        made: list[Path] = []
        try:
            for path, fill in ((file, state.read_bytes()), (Path(f"{file}.in"), deck)):
                with path.open("xb") as stream:
                    made.append(path)
                    stream.write(fill)
                    stream.flush()
                    os.fsync(stream.fileno())
            return file, ""
        except OSError as error:
            for path in made:
                path.unlink(missing_ok=True)
            if not isinstance(error, FileExistsError):
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
