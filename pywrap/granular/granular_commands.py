"""The commands of a deck that say how particles interact and move.

LAMMPS hands out neither kn, kt and mu of its granular styles nor the words of its fixes. Of a deck that runs here, it
tells each command as it carries it out (:mod:`~faultgouge.pywrap.granular.run_deck`). Of another instance, the log has
the commands, with variables filled in: a command with a $ stands there twice, as it was written and as LAMMPS
understood it. What is printed stands there, too, and is left out: the output of `print`, and all that a run writes.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from ...analysis import FaultgougeError

HISTORY = ("gran/hooke/history", "gran/hertz/history", "granular")
"""LAMMPS's pair styles with a tangential history."""

OWN = "mindlin/smooth"

WALLS = ("wall/gran", "wall/mindlin/smooth")

INTEGRATORS = ("nve/sphere", "nve/disc", "overdamped/disc")
"""Fixes that move particles and turn them."""

BODIES = ("rigid", "rigid/nve")
"""Fixes whose bodies may be kept from rotating (:mod:`~faultgouge.pywrap.granular.mobility`)."""

AFTER_RUN = ("write_restart", "rerun", "delete_atoms", "reset_atoms")
"""Commands that take tangential histories away from particles."""

MOBILE = (
    *INTEGRATORS, *BODIES, "nve", "nve/limit", "freeze", "setforce", "aveforce", "lineforce", "planeforce",
)  # fmt: skip
"""Fixes that move or hold coordinates as is known here."""

MOVES = ("nve", "rigid", "move", "overdamped", "nvt", "nph", "npt")
"""Fixes that move particles, by the beginnings of their styles."""

HOLDS = ("freeze", "setforce", "aveforce", "lineforce", "planeforce", "momentum", "recenter", "temp/")
"""Fixes that change forces or velocities of coordinates that are held, or that move as one."""

GIVE_LINES = (
    "give the lines pair_style, pair_coeff, fix wall/gran and fix nve/sphere of the deck as "
    "from_lammps(lmp, commands=[...])"
)

GIVE_LINE = "give the line that the deck has among commands"

COHESIVE = ("jkr", "dmt", "mdr")
TANGENTIAL = (
    "linear_history", "linear_history_classic", "mindlin", "mindlin_classic", "mindlin/force", "mindlin_rescale",
    "mindlin_rescale/force",
)  # fmt: skip


PRINT = re.compile(
    r"""(?sm)^[ \t]*print[ \t]+(?:(?P<quote>\"{3}|["'])(?P<text>.*?)(?P=quote)|(?P<word>\S+))(?P<more>[^\n]*)\n"""
)
"""The command `print` in a log. LAMMPS writes the text into the lines that follow."""

RUN = re.compile(r"(?ms)^[ \t]*(?:(run|minimize|rerun)[ \t][^\n]*\n|Per MPI rank memory ).*?^Loop time of [^\n]*$")
"""A run in a log, with all that is written meanwhile, by `fix print` among others."""


class NotTakenError(FaultgougeError):
    """A packing of LAMMPS cannot be taken as it stands: one sentence with the reason and the way out."""


class NotLinearisedError(NotTakenError):
    """Contacts cannot be linearised by their laws: K and C by differences of forces may serve."""


@dataclass(frozen=True)
class Commands:
    """What a deck says of contacts and of motion: pair_style with the pair_coeff that hold, fixes and regions by their
    IDs; and the last command of `AFTER_RUN` that comes after the last run."""

    pair: tuple[str, ...]
    fixes: dict[str, str]
    regions: dict[str, str] = field(default_factory=dict)
    after_run: str = ""

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
    """Commands from the lines of a log, or from some that a user gives.

    Raises
    ------
    NotTakenError
        If no line is a pair_style, or a line that a user gives has a variable in it.
    """
    if isinstance(lines, Commands):
        return lines
    whole = lines if isinstance(lines, str) else "\n".join(lines)
    found = []
    for line in re.sub(r"&[ \t]*\n", " ", RUN.sub(r"\1", _without_prints(whole)) if log else whole).splitlines():
        text = line.split("#")[0]
        if "$" in text and text.split()[0] in ("pair_style", "pair_coeff", "fix", "region"):
            if log:
                continue  # the line that follows has numbers
            raise NotTakenError(f"{line.strip()!r} has a variable: write its number, as a log of LAMMPS has it.")
        found.append(text.split())
    return commands_of(found, "The log of this LAMMPS has" if log else "The commands have")


def commands_of(carried_out: Iterable[Sequence[str]], source: str) -> Commands:
    """Commands that hold after those that LAMMPS has carried out, one after the other, in words; `source` has them.

    Raises
    ------
    NotTakenError
        If no pair_style is among them.
    """
    style = after = ""
    cleared = False
    coefficients: list[str] = []
    fixes: dict[str, str] = {}
    regions: dict[str, str] = {}
    for words in carried_out:
        name, line = words[0] if words else "", " ".join(words)
        if name == "clear":
            style, coefficients, fixes, regions, cleared = "", [], {}, {}, True
        elif name == "pair_style" and len(words) > 1:
            if not style or style.split()[1] != words[1]:
                coefficients = []
            style = line
        elif name == "pair_coeff":
            # the last line of two types holds; in hybrid styles, of one style
            mine = list(words[1 : 4 if style.split()[1:2] and style.split()[1].startswith("hybrid") else 3])
            coefficients = [each for each in coefficients if each.split()[1 : 1 + len(mine)] != mine]
            coefficients.append(line)
        elif name == "fix" and len(words) > 3:
            fixes[words[1]] = line
        elif name == "unfix" and len(words) == 2:
            fixes.pop(words[1], None)
        elif name == "region" and len(words) > 2:
            regions[words[1]] = line
        elif name in ("run", "minimize"):
            after = ""
        elif name in AFTER_RUN and list(words[-2:]) != ["compress", "no"]:
            after = line
    if not style:
        if cleared:
            raise NotTakenError(f"{source} no pair_style after `clear`, which takes all away: leave it out.")
        raise NotTakenError(f"{source} no pair_style: {GIVE_LINES}.")
    return Commands((style, *(coefficients or ["pair_coeff * *"])), fixes, regions, after)


def _without_prints(text: str) -> str:
    """A log without the commands `print` and their output, which may read as a command."""
    kept, at = "", 0
    for each in PRINT.finditer(text):
        if each.start() < at:
            continue
        kept += text[at : each.start()]
        says = re.sub(r"\\\$.*", ".*", re.escape(each["text"] or each["word"] or ""))  # variables have other values
        output = None if "screen no" in each["more"] else re.compile(rf"{says}(?:\n|\Z)").match(text, each.end())
        at = each.end() if output is None else output.end()
    return kept + text[at:]


def check_pair(commands: Commands, styles: Iterable[str]) -> None:
    """Refuse pair styles and models without linearised contacts here; `styles` are all that this LAMMPS knows."""
    words, known = commands.pair[0].split(), set(styles)
    used = [without_suffix(words[1])]
    if used[0].startswith("hybrid"):
        used = [without_suffix(word) for word in words[2:] if word in known]
        if "overlay" in words[1] and len(used) > 1:
            raise NotLinearisedError(f"pair_style {words[1]} adds several forces at a contact: use one granular style.")
    for style in used:
        if style not in HISTORY and (style != OWN or len(used) > 1):
            raise NotLinearisedError(f"pair_style {style} is none of {', '.join(HISTORY)} and {OWN}: use one of these.")
    for line in commands.pair[1:] if "granular" in used else ():
        _check_model(line.split("granular", 1)[-1].split() if "granular" in line else line.split()[3:], line)


def _check_model(words: list[str], line: str) -> None:
    """Refuse what a model of `granular` has beside normal, tangential and rolling forces."""
    if not words or words[0] in HISTORY[:2]:
        return
    given = {word: words[k + 1] if k + 1 < len(words) else "" for k, word in enumerate(words)}
    tangential = given.get("tangential", "none")
    says = [f"{word} is cohesive; use hooke, hertz or hertz/material" for word in words if word in COHESIVE]
    says += [f"{word} is not linearised here" for word in ("twisting", "heat") if given.get(word, "none") != "none"]
    if tangential not in TANGENTIAL:
        says.append(f"tangential {tangential} keeps no history; use {', '.join(TANGENTIAL)}")
    if says:
        raise NotLinearisedError(f"{line!r}: {says[0]}.")


COMES_TO_REST = ", and let the packing come to rest"
MOVING = {
    "poems": "holds particles together in bodies, whose rotation is not linearised here: use single particles",
    "move": "moves particles: unfix it" + COMES_TO_REST,
    "deform": "moves the box: unfix it" + COMES_TO_REST,
    "press/berendsen": "moves the box: unfix it" + COMES_TO_REST,
    **dict.fromkeys(("nph", "npt"), "moves the box: use fix nve/sphere in its place" + COMES_TO_REST),
    "nvt": "has a thermostat: use fix nve/sphere in its place" + COMES_TO_REST,
    "propel/self": "pushes particles along their velocities as soon as they move: unfix it",
}
"""Fixes, by the beginnings of their styles, with which no packing of particles rests."""

PLANES = ("xplane", "yplane", "zplane")


def check_fixes(styles: dict[str, str], commands: Commands) -> None:
    """Refuse fixes, by ID and style, with which no packing rests, however K is found; and those that hold or move
    particles or walls otherwise than contacts do."""
    plain = {name: without_suffix(style) for name, style in styles.items()}
    for name, style in plain.items():
        for begin, says in MOVING.items():
            if style.startswith(begin):
                raise NotTakenError(f"fix {name} {styles[name]} {says}.")
        for word in {"wiggle", "shear"} & set(commands.fixes.get(name, "").split()[4:] if style == "wall/gran" else ()):
            raise NotTakenError(f"The wall of fix {name} moves: let it rest without {word}.")
    for name, style in plain.items():
        if style.startswith(("wall/", "nve")) and style not in (*WALLS, *MOBILE):
            raise NotLinearisedError(
                f"fix {name} {styles[name]} is not linearised here: use fix nve/sphere, and planes of fix wall/gran."
            )
        if style not in (*WALLS, *MOBILE):
            continue
        line = commands.fixes.get(name)
        if line is None or without_suffix(line.split()[3]) != style:
            raise NotTakenError(f"The commands have no line of fix {name} {styles[name]}: {GIVE_LINE}.")
        if style == "wall/gran":
            _check_wall(name, line)


def _check_wall(name: str, line: str) -> None:
    words = line.split()
    at = [k for k, word in enumerate(words) if word in (*PLANES, "zcylinder", "region")]
    if not at or len(words) < at[0] + (3 if words[at[0]] in PLANES else 2):
        raise NotTakenError(f"The line of fix {name} wall/gran does not say where the wall is: give all of it.")
    if words[at[0]] not in PLANES or "temperature" in words:
        raise NotLinearisedError(f"The wall of fix {name} is no plane without heat: use {', '.join(PLANES)}.")
    if words[4] == "hooke":
        raise NotLinearisedError(f"fix {name} wall/gran hooke has no tangential history: use hooke/history.")
    if words[4] == "granular":
        _check_model(words[5:], line)
