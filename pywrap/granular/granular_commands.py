"""The commands of a deck that say how particles interact and move.

LAMMPS hands out neither kn, kt and mu of its granular styles nor the words of its fixes. Of a deck that runs here, it
tells each command as it carries it out (:mod:`~faultgouge.pywrap.granular.run_deck`). Of another instance, the log has
the commands, with variables filled in: a command with a $ stands there twice, as it was written and as LAMMPS
understood it. What is printed stands there, too, and is left out: the output of `print`, and all that a run writes.

Lists of styles say which laws can be measured and which coordinates move. Whether anything else acts on the particles
is for :mod:`~faultgouge.pywrap.granular.motion_proof`.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ...analysis import FaultgougeError

HISTORY = ("gran/hooke/history", "gran/hertz/history", "granular")
"""LAMMPS's pair styles with a tangential history."""

OWN = "mindlin/smooth"

WALLS = ("wall/gran", "wall/mindlin/smooth")

BODIES = ("rigid", "rigid/nve")
"""Fixes whose bodies may be kept from rotating (:mod:`~faultgouge.pywrap.granular.mobility`)."""

TURNS = ("nve/sphere", "nve/disc", "overdamped/disc")
"""Fixes that move particles and turn them."""

MOBILE = (*TURNS, *BODIES, "nve", "nve/limit", "freeze", "setforce", "aveforce")
"""Fixes that move or hold coordinates as is known here."""

MOVES = ("nve", "rigid", "poems", "move", "overdamped", "nvt", "nph", "npt", "deform", "press/berendsen")
"""Fixes that move particles or the box, by the beginnings of their styles."""

HOLDS = ("freeze", "setforce", "aveforce", "lineforce", "planeforce")
"""Fixes that change forces of coordinates that are held, or that move as one."""

CHANGES = (*MOVES, *HOLDS, "momentum", "temp/", "oneway", "recenter", "propel/self")
"""Fixes with which no packing is taken, but for those that are known."""

GIVE_LINES = (
    "give the lines pair_style, pair_coeff, fix wall/gran and fix nve/sphere of the deck as "
    "from_lammps(lmp, commands=[...])"
)

NORMAL = ("hooke", "hertz", "hertz/material")
TANGENTIAL = (
    "linear_history", "linear_history_classic", "mindlin", "mindlin_classic", "mindlin/force", "mindlin_rescale",
    "mindlin_rescale/force",
)  # fmt: skip
PLANES = ("xplane", "yplane", "zplane")

PRINT = re.compile(r"""(?sm)^[ \t]*print[ \t]+(?:(?P<quote>\"{3}|["'])(?P<text>.*?)(?P=quote)|\S+)(?P<more>[^\n]*)\n""")
"""The command `print` in a log. LAMMPS writes the text into the lines that follow."""

RUN = re.compile(r"(?ms)^[ \t]*(?:(run|minimize|rerun)[ \t][^\n]*\n|Per MPI rank memory ).*?^Loop time of [^\n]*$")
"""A run in a log, with all that is written meanwhile, by `fix print` among others."""


class NotTakenError(FaultgougeError):
    """A packing of LAMMPS cannot be taken as it stands: one sentence with the reason and the way out."""


class NotLinearisedError(NotTakenError):
    """Contacts cannot be linearised by their laws: K and C by differences of forces may serve."""


@dataclass(frozen=True)
class Commands:
    """What a deck says of contacts and of motion: pair_style with the pair_coeff that hold, and fixes by their IDs."""

    pair: tuple[str, ...]
    fixes: dict[str, str]

    @property
    def style(self) -> str:
        """The pair style, without the suffix of an accelerator."""
        return without_suffix(self.pair[0].split()[1])


def rolls(line: str) -> bool:
    """Whether the contacts of a line have rolling friction, which only the style `granular` has."""
    words = line.split()
    return "rolling" in words and words[words.index("rolling") + 1 :][:1] != ["none"]


def without_suffix(style: str) -> str:
    """A style as LAMMPS's manual names it."""
    return re.sub("/(omp|kk|intel|gpu|opt)$", "", style)


def read_commands(lines: "Iterable[str] | Commands", *, log: bool = False) -> Commands:
    """Commands from the lines, or the text, of a log, or from some that a user gives.

    Raises
    ------
    NotTakenError
        If no line is a pair_style, or a line that a user gives has a variable in it.
    """
    if isinstance(lines, Commands):
        return lines
    text = lines if isinstance(lines, str) else "\n".join(lines)
    text = RUN.sub(r"\1", _without_prints(text)) if log else text
    found = []
    for line in re.sub(r"&[ \t]*\n", " ", text).splitlines():
        words = line.split("#")[0].split()
        if any("$" in word for word in words) and words[0] in ("pair_style", "pair_coeff", "fix"):
            if log:
                continue  # the line that follows has numbers
            raise NotTakenError(f"{line.strip()!r} has a variable: write its number, as a log of LAMMPS has it.")
        found.append(words)
    return commands_of(found, "The log of this LAMMPS has" if log else "The commands have")


def _without_prints(text: str) -> str:
    """A log without the commands `print` and their output, which may read as a command."""
    kept, at = "", 0
    for each in PRINT.finditer(text):
        if each.start() >= at:
            kept, at = kept + text[at : each.start()], each.end()
            for _ in range(0 if "screen no" in each["more"] else 1 + (each["text"] or "").count("\n")):
                at = text.find("\n", at) + 1 or len(text)
    return kept + text[at:]


def commands_of(carried_out: Iterable[Sequence[str]], source: str) -> Commands:
    """Commands that hold after those that LAMMPS has carried out, one after the other, in words; `source` has them.

    Raises
    ------
    NotTakenError
        If no pair_style is among them.
    """
    style = cleared = ""
    coefficients, fixes = dict[tuple[str, ...], str](), dict[str, str]()
    for words in carried_out:
        name, line = words[0] if words else "", " ".join(words)
        if name == "clear":
            style, coefficients, fixes, cleared = "", {}, {}, " after `clear`, which takes all away"
        elif name == "pair_style" and len(words) > 1:
            coefficients = coefficients if style.split()[1:2] == [words[1]] else {}
            style = line
        elif name == "pair_coeff":
            coefficients.pop(key := tuple(words[1:3]), None)
            coefficients[key] = line  # the last line of two types holds
        elif name == "fix" and len(words) > 3:
            fixes[words[1]] = line
        elif name == "unfix" and len(words) == 2:
            fixes.pop(words[1], None)
    if not style:
        raise NotTakenError(f"{source} no pair_style{cleared}: {'leave it out' if cleared else GIVE_LINES}.")
    return Commands((style, *(coefficients.values() or ["pair_coeff * *"])), fixes)


def unmeasured_pair(commands: Commands) -> str:
    """Why the laws of a pair style are not measured; empty if they are."""
    if commands.style not in (*HISTORY, OWN):
        return f"pair_style {commands.style} is none of {', '.join(HISTORY)} and {OWN}: use one of these."
    models = commands.pair[1:] if commands.style == "granular" else ()
    return next(filter(None, (_unmeasured_model(line.split()[3:], line) for line in models)), "")


def _unmeasured_model(words: list[str], line: str) -> str:
    """What a model of `granular` has beside normal, tangential and rolling forces with a history; empty if nothing."""
    given = dict(zip(words, [*words[1:], ""], strict=True))
    tangential = given.get("tangential", "none")
    if others := [word for word in ("twisting", "heat") if given.get(word, "none") != "none"]:
        return f"{line!r}: {others[0]} is not linearised here."
    if words and words[0] not in NORMAL:
        return f"{line!r}: {words[0]} is none of {', '.join(NORMAL)}."
    if words and tangential not in TANGENTIAL:
        return f"{line!r}: tangential {tangential} keeps no history; use {', '.join(TANGENTIAL)}."
    return ""


def check_fixes(styles: dict[str, str], commands: Commands) -> str:
    """Refuse fixes, by ID and style, with which no packing rests, or that move or hold particles in a way that is not
    known. Why the laws of contacts with walls are not measured; empty if they are."""
    unmeasured = ""
    for name, style in styles.items():
        plain, line = without_suffix(style), commands.fixes.get(name, "")
        if plain.startswith(CHANGES) and plain not in MOBILE:
            raise NotTakenError(
                f"fix {name} {style} moves or holds particles, or changes velocities, in a way that is not known here: "
                "unfix it, or use fix nve/sphere and fix setforce, and let the packing come to rest."
            )
        if plain in (*WALLS, *MOBILE) and without_suffix(" ".join(line.split()[3:4])) != plain:
            raise NotTakenError(f"The commands have no line of fix {name} {style}: {GIVE_LINES}.")
        if plain == "wall/gran":
            unmeasured = unmeasured or _unmeasured_wall(name, line)
        elif plain.startswith("wall/") and plain not in WALLS:
            unmeasured = unmeasured or f"fix {name} {style} is not linearised here: use planes of fix wall/gran."
    return unmeasured


def _unmeasured_wall(name: str, line: str) -> str:
    """Why the laws of a wall are not measured; empty if they are."""
    words = line.split()
    at = next((k for k, word in enumerate(words) if word in (*PLANES, "zcylinder", "region")), len(words))
    if len(words) < at + (3 if at < len(words) and words[at] in PLANES else 2):
        raise NotTakenError(f"The line of fix {name} wall/gran does not say where the wall is: give all of it.")
    if words[at] not in PLANES or "temperature" in words:
        return f"The wall of fix {name} is no plane without heat: use {', '.join(PLANES)}."
    if words[4] == "hooke":
        return f"fix {name} wall/gran hooke has no tangential history: use hooke/history."
    return _unmeasured_model(words[5:at], line) if words[4] == "granular" else ""
