r"""The commands of a deck that say how particles interact and move.

LAMMPS hands out neither kn, kt and mu of its granular styles nor the words of its fixes. Of a deck that runs here, it
tells each command as it carries it out (:mod:`~faultgouge.pywrap.granular.run_deck`). Of another instance, the log has
the commands, with variables filled in: a command with a $ stands there twice, as it was written and as LAMMPS
understood it. What is printed stands there, too, and is left out: the output of `print`, and all that a run writes.

Lists of styles say which laws can be measured and which coordinates move. Whether anything else acts on the particles
is for :mod:`~faultgouge.pywrap.granular.motion_proof`.

**What moves as one.** The particles of a lid that `fix aveforce` moves have common translations: q = P Q, with the
lid's coordinates at its first particle. `fix aveforce` gives each particle the same force, so that
:math:`m_i \ddot x_i = \frac1n \sum_k F_k`, and :math:`x_i = (m_1/m_i) X`: particles of different mass move by different
amounts. The particles of a body of fix rigid that does not rotate have one displacement, and the force on the body is
the sum of theirs. A component that `fix setforce` sets to zero, and whatever no fix moves, is held: its row of P is
empty.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from ...analysis import FaultgougeError
from ...analysis.arrays import Floats

HISTORY = ("gran/hooke/history", "gran/hertz/history", "granular")
"""LAMMPS's pair styles with a tangential history."""

OWN = "mindlin/smooth"

WALLS = ("wall/gran", "wall/mindlin/smooth")

BODIES = ("rigid", "rigid/nve")
"""Fixes whose bodies may be kept from rotating."""

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


YES = ("on", "yes", "true")


def translating_bodies(line: str, dimension: int) -> dict[str, NDArray[np.bool_]]:
    """The groups of the bodies of a command fix rigid, and along which axes each translates, shape (3,).

    Raises
    ------
    NotTakenError
        If they may rotate, or the command has what is not known here.
    """
    words = line.split()
    name, style, kind = words[1], words[3], words[4]
    groups = [words[2]] if kind == "single" else words[6 : 6 + int(words[5])] if kind == "group" else []
    axes, turns = np.ones((2, len(groups), 3), np.bool_)
    at = 5 if kind == "single" else 6 + len(groups)
    while groups and at < len(words):
        if words[at] == "reinit" and words[at + 1] in YES:
            at += 2
            continue
        if words[at] not in ("force", "torque"):
            raise NotTakenError(
                f"fix {name} {style} has {' '.join(words[at : at + 2])}, which is not known here: leave it out."
            )
        low, star, high = words[at + 1].partition("*")
        which = slice(int(low or 1) - 1, int(high or len(groups)) if star else int(low))
        (axes if words[at] == "force" else turns)[which] = [word in YES for word in words[at + 2 : at + 5]]
        at += 5
    if without_suffix(style) not in BODIES or not groups or (turns if dimension == 3 else turns[:, 2:]).any():
        raise NotTakenError(
            f"fix {name} {style} {kind} holds particles together in bodies that may rotate, and rotations of bodies "
            "are not linearised here: for lids that do not rotate use fix rigid single, or group, with `torque * off "
            "off off` at the end of its line."
        )
    return dict(zip(groups, axes, strict=True))


class Mobility(NamedTuple):
    """P of q = P Q, square, and `needed` where it says more than which particles are free, shape (N,); I/(m R^2) of
    each particle; and the mass that dashpots feel, of a body all of its own, infinite where frozen."""

    constraint: csr_array
    needed: csr_array | None
    free: NDArray[np.bool_]
    factor: Floats
    felt_mass: Floats


def mobility(lines: dict[str, str], members: dict[str, NDArray[np.bool_]], mass: Floats, dimension: int) -> Mobility:
    """The coordinates that the fixes move.

    Parameters
    ----------
    lines : dict of str
        The commands of the fixes by their IDs, in the order of the deck.
    members : dict of ndarray of bool, shape (N,)
        Who is in the group of each, and in those of the bodies of a fix rigid, by the ID and the group.
    mass : ndarray, shape (N,)
        Masses.
    dimension : int
        2 or 3.

    Raises
    ------
    NotTakenError
        If a fix moves or holds particles otherwise.
    """
    styles = {name: without_suffix(line.split()[3]) for name, line in lines.items()}
    bodies = {name: translating_bodies(lines[name], dimension) for name, style in styles.items() if style in BODIES}
    # fix rigid moves the particles of its bodies alone, whatever its own group is
    inside = members | {
        name: np.any([members[f"{name} {group}"] for group in each], axis=0) for name, each in bodies.items()
    }
    # of each component of (translation, rotation): whether it moves, who leads it, and by how much
    moves, leader = np.zeros((6, len(mass)), np.bool_), np.tile(np.arange(len(mass)), (6, 1))
    weight, factor, felt = np.ones((6, len(mass))), np.full(len(mass), 0.4), np.array(mass)
    # forces are set after all integrators are known, whatever the order of the deck, and freeze comes last
    order = ("setforce", "aveforce", "freeze")
    for name in sorted(lines, key=lambda each: 1 + order.index(styles[each]) if styles[each] in order else 0):
        style, words, here = styles[name], lines[name].split()[4:], inside[name]
        if style in TURNS:
            moves[:, here] = True
            own = {"nve/disc": 0, "overdamped/disc": 1}.get(style)
            factor[here] = (0.5 if "disc" in words else 0.4) if own is None else float(words[own])
        elif style in ("nve", "nve/limit"):  # a limit of steps does not act on small motion
            moves[:3, here] = True
        elif style == "freeze":
            moves[:, here], felt[here] = False, np.inf
        for group, along in bodies.get(name, {}).items():
            body = members[f"{name} {group}"]
            felt[body], moves[:3, body], leader[:3, body] = mass[body].sum(), along[:, None], np.flatnonzero(body)[:1]
        for k, word in enumerate(words[:3] if style in ("setforce", "aveforce") else ()):
            if word == "NULL":
                continue
            if "v_" in word or (style == "setforce" and float(word) != 0.0):
                raise NotTakenError(
                    f"fix {name} {style} drives particles by the force {word}: use 0.0 or NULL, and fix addforce."
                )
            if style == "setforce":
                moves[k, here] = False
                continue
            joined = np.flatnonzero(here & moves[k])
            leader[k, joined], weight[k, joined] = joined[:1], mass[joined[:1]] / mass[joined]
    axes = np.arange(6) if dimension == 3 else np.array([0, 1, 5])
    if not moves[axes].any():
        raise NotTakenError(
            "Nothing moves the particles: give the line of fix nve/sphere, or set it up, so that it is known which of "
            "them are free and what their moments of inertia are."
        )
    row = np.flatnonzero(moves[axes])
    column = (leader[axes] + len(mass) * np.arange(len(axes))[:, None]).ravel()
    size = len(axes) * len(mass)
    constraint, free = (
        csr_array((weight[axes].ravel()[row], (row, column[row])), shape=(size, size)),
        moves[axes].any(0),
    )
    plain = abs(constraint - diags_array(np.tile(free, len(axes)).astype(np.float64))).nnz == 0
    return Mobility(constraint, None if plain else constraint, free, factor, felt)
