r"""The commands of a deck that say how particles interact and move.

LAMMPS hands out neither kn, kt and mu nor the words of its fixes. Of a deck that runs here, it tells each command as it
carries it out. Of another instance, the log has the commands: one with a $ stands there twice, as it was written and
as LAMMPS understood it. What `print` and a run write stands there, too, and is left out.

Lists of styles say which laws can be measured and which coordinates move. Whether anything else acts on the particles
is for :mod:`~faultgouge.pywrap.granular.motion_proof`.

**What moves as one.** q = P Q, with the coordinates of a lid at its first particle. `fix aveforce` gives each particle
the same force, so that :math:`m_i \ddot x_i = \frac1n \sum_k F_k`, and :math:`x_i = (m_1/m_i) X`. The particles of a
body of fix rigid that does not rotate have one displacement. A component that `fix setforce` sets to zero, and whatever
no fix moves, is held: its row of P is empty.
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
OWN = "mindlin/smooth"
NORMAL = ("hooke", "hertz", "hertz/material")
TANGENTIAL = (
    "linear_history", "linear_history_classic", "mindlin", "mindlin_classic", "mindlin/force", "mindlin_rescale",
    "mindlin_rescale/force",
)  # fmt: skip
"""Pair styles, and models of `granular`, with a tangential history."""

PLANES = ("xplane", "yplane", "zplane")
WALLS = ("wall/gran", "wall/mindlin/smooth")
BODIES = ("rigid", "rigid/nve")
"""Fixes whose bodies may be kept from rotating."""

TURNS = ("nve/sphere", "nve/disc", "overdamped/disc")
MOBILE = (*TURNS, *BODIES, "nve", "nve/limit", "freeze", "setforce", "aveforce")
"""Fixes that move particles and turn them, and all that move or hold coordinates as is known here."""

MOVES = ("nve", "rigid", "poems", "move", "overdamped", "nvt", "nph", "npt", "deform", "press/berendsen")
HOLDS = ("freeze", "setforce", "aveforce", "lineforce", "planeforce")
CHANGES = (*MOVES, *HOLDS, "momentum", "temp/", "oneway", "recenter", "propel/self")
"""Beginnings of the styles of fixes that move particles or the box, that change forces of coordinates that are held or
move as one, and with which no packing is taken, but for those that are known."""

GIVE_LINES = (
    "give the lines pair_style, pair_coeff, fix wall/gran and fix nve/sphere of the deck as "
    "from_lammps(lmp, commands=[...])"
)

PRINT = re.compile(r"""(?sm)^[ \t]*print[ \t]+(?:(?P<quote>\"{3}|["'])(?P<text>.*?)(?P=quote)|\S+)(?P<more>[^\n]*)\n""")
RUN = re.compile(r"(?ms)^[ \t]*(?:(run|minimize|rerun)[ \t][^\n]*\n|Per MPI rank memory ).*?^Loop time of [^\n]*$")
"""The command `print` in a log, whose text LAMMPS writes into the lines that follow; and a run, with all that is
written meanwhile, by `fix print` among others."""


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


def without_suffix(style: str) -> str:
    """A style as LAMMPS's manual names it."""
    return re.sub("/(omp|kk|intel|gpu|opt)$", "", style)


def read_commands(lines: "Iterable[str] | Commands", *, log: bool = False) -> Commands:
    """Commands from the lines, or the text, of a log, or from some that a user gives; a NotTakenError if no line is a
    pair_style, or a line that a user gives has a variable in it."""
    if isinstance(lines, Commands):
        return lines
    text = whole = lines if isinstance(lines, str) else "\n".join(lines)
    if log:  # without the commands `print` and their output, which may read as a command, and without runs
        text, at = "", 0
        for each in PRINT.finditer(whole):
            if each.start() >= at:
                text, at = text + whole[at : each.start()], each.end()
                for _ in range(0 if "screen no" in each["more"] else 1 + (each["text"] or "").count("\n")):
                    at = whole.find("\n", at) + 1 or len(whole)
        text = RUN.sub(r"\1", text + whole[at:])
    found = []
    for line in re.sub(r"&[ \t]*\n", " ", text).splitlines():
        words = line.split("#")[0].split()
        if any("$" in word for word in words) and words[0] in ("pair_style", "pair_coeff", "fix"):
            if log:
                continue  # the line that follows has numbers
            raise NotTakenError(f"{line.strip()!r} has a variable: write its number, as a log of LAMMPS has it.")
        found.append(words)
    return commands_of(found, "The log of this LAMMPS has" if log else "The commands have")


def commands_of(carried_out: Iterable[Sequence[str]], source: str) -> Commands:
    """Commands that hold after those that LAMMPS has carried out, one after the other, in words; `source` has them. A
    NotTakenError if no pair_style is among them."""
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


def check_fixes(styles: dict[str, str], commands: Commands) -> None:
    """Refuse fixes, by ID and style, with which no packing rests, or that move or hold particles in a way that is not
    known."""
    for name, style in styles.items():
        line = commands.fixes.get(name, "").split()
        if style.startswith(CHANGES) and style not in MOBILE:
            cure = "unfix it, or use fix nve/sphere and fix setforce, and let the packing come to rest."
            does = "moves or holds particles, or changes velocities, in a way that is not known here"
            raise NotTakenError(f"fix {name} {style} {does}: {cure}")
        if style in (*WALLS, *MOBILE) and without_suffix(" ".join(line[3:4])) != style:
            raise NotTakenError(f"The commands have no line of fix {name} {style}: {GIVE_LINES}.")
        at = place_of_wall(line)
        if style == "wall/gran" and len(line) < at + (3 if line[at : at + 1] and line[at] in PLANES else 2):
            raise NotTakenError(f"The line of fix {name} wall/gran does not say where the wall is: give all of it.")


def place_of_wall(words: list[str]) -> int:
    """At which word of a line fix wall/gran the place of the wall begins."""
    return next((k for k, word in enumerate(words) if word in (*PLANES, "zcylinder", "region")), len(words))


def unmeasured_laws(styles: dict[str, str], commands: Commands) -> str:
    """Why the laws of the contacts of an instance are not measured; empty if they are."""
    if commands.style not in (*HISTORY, OWN):
        return f"pair_style {commands.style} is none of {', '.join(HISTORY)} and {OWN}: use one of these."
    models = [(line, line.split()[3:]) for line in commands.pair[1:] if commands.style == "granular"]
    for name, style in styles.items():
        line = commands.fixes.get(name, "")
        words = line.split()
        if style == "wall/gran":
            at = place_of_wall(words)
            if words[at] not in PLANES or "temperature" in words:
                return f"The wall of fix {name} is no plane without heat: use {', '.join(PLANES)}."
            if words[4] == "hooke":
                return f"fix {name} wall/gran hooke has no tangential history: use hooke/history."
            models += [(line, words[5:at])] * (words[4] == "granular")
        elif style.startswith("wall/") and style not in WALLS:
            return f"fix {name} {style} is not linearised here: use planes of fix wall/gran."
    for line, words in models:
        given = dict(zip(words, [*words[1:], ""], strict=True))
        if others := [word for word in ("twisting", "heat") if given.get(word, "none") != "none"]:
            return f"{line!r}: {others[0]} is not linearised here."
        if words and words[0] not in NORMAL:
            return f"{line!r}: {words[0]} is none of {', '.join(NORMAL)}."
        if words and given.get("tangential", "none") not in TANGENTIAL:
            return f"{line!r}: tangential {given.get('tangential')} keeps no history; use {', '.join(TANGENTIAL)}."
    return ""


OF_BODIES = re.compile(r" (force|torque) (\d*)(\*?)(\d*) (\S+) (\S+) (\S+)")
YES = ("on", "yes", "true")


def translating_bodies(line: str, dimension: int) -> dict[str, NDArray[np.bool_]]:
    """The groups of the bodies of a command fix rigid, and along which axes each translates, shape (3,); a
    NotTakenError if they may rotate, or the command has what is not known here."""
    words = line.split()
    name, style, kind = words[1], words[3], words[4]
    groups = [words[2]] if kind == "single" else words[6 : 6 + int(words[5])] if kind == "group" else []
    axes, turns = np.ones((2, len(groups), 3), np.bool_)
    more = re.sub(r" reinit (on|yes|true)\b", "", " ".join(["", *words[5 if kind == "single" else 6 + len(groups) :]]))
    if groups and (unknown := OF_BODIES.sub("", more)):
        raise NotTakenError(f"fix {name} {style} has{unknown}, which is not known here: leave it out.")
    for what, low, star, high, *moves in OF_BODIES.findall(more):
        which = slice(int(low or 1) - 1, int(high or len(groups)) if star else int(low))
        (axes if what == "force" else turns)[which] = [word in YES for word in moves]
    if not groups or (turns if dimension == 3 else turns[:, 2:]).any():
        holds = "holds particles together in bodies that may rotate, and rotations of bodies are not linearised here"
        cure = "for lids that do not rotate use fix rigid single, or group, with `torque * off off off`"
        raise NotTakenError(f"fix {name} {style} {kind} {holds}: {cure} at the end of its line.")
    return dict(zip(groups, axes, strict=True))


class Mobility(NamedTuple):
    """P of q = P Q, square, where it says more than which particles are free, shape (N,); I/(m R^2) of each particle;
    and the mass that dashpots feel, of a body all of its own, infinite where frozen."""

    constraint: csr_array | None
    free: NDArray[np.bool_]
    factor: Floats
    felt_mass: Floats


def mobility(lines: dict[str, str], members: dict[str, NDArray[np.bool_]], mass: Floats, dimension: int) -> Mobility:
    """The coordinates that the fixes move, whose commands are in the order of the deck; a NotTakenError if one moves or
    holds particles otherwise. `members` are who is in the group of each, shape (N,), by the ID; and in those of the
    bodies of a fix rigid, by the ID and the group."""
    # of each component of (translation, rotation): whether it moves, who leads it, and by how much
    moves, leader = np.zeros((6, len(mass)), np.bool_), np.tile(np.arange(len(mass)), (6, 1))
    weight, factor, felt = np.ones((6, len(mass))), np.full(len(mass), 0.4), np.array(mass)
    styles = {name: without_suffix(line.split()[3]) for name, line in lines.items()}
    # forces are set after all integrators are known, whatever the order of the deck, and freeze comes last
    order = ("setforce", "aveforce", "freeze")
    for name in sorted(lines, key=lambda each: 1 + order.index(styles[each]) if styles[each] in order else 0):
        style, words, here = styles[name], lines[name].split()[4:], members[name]
        if style in TURNS:
            moves[:, here] = True
            own = {"nve/disc": 0, "overdamped/disc": 1}.get(style)
            factor[here] = (0.5 if "disc" in words else 0.4) if own is None else float(words[own])
        elif style in ("nve", "nve/limit"):  # a limit of steps does not act on small motion
            moves[:3, here] = True
        elif style == "freeze":
            moves[:, here], felt[here] = False, np.inf
        elif style in BODIES:  # it moves the particles of its bodies alone, whatever its own group is
            for group, along in translating_bodies(lines[name], dimension).items():
                body = members[f"{name} {group}"]
                moves[:3, body], leader[:3, body] = along[:, None], np.flatnonzero(body)[:1]
                felt[body] = mass[body].sum()
        for k, word in enumerate(words[:3] if style in order[:2] else ()):
            if word == "NULL":
                continue
            if "v_" in word or (style == "setforce" and float(word) != 0.0):
                says = f"drives particles by the force {word}: use 0.0 or NULL, and fix addforce."
                raise NotTakenError(f"fix {name} {style} {says}")
            if style == "setforce":
                moves[k, here] = False
            else:
                joined = np.flatnonzero(here & moves[k])
                leader[k, joined], weight[k, joined] = joined[:1], mass[joined[:1]] / mass[joined]
    axes = np.arange(6) if dimension == 3 else np.array([0, 1, 5])
    free = moves[axes].any(axis=0)
    if not free.any():
        why = "so that it is known which of them are free and what their moments of inertia are."
        raise NotTakenError(f"Nothing moves the particles: give the line of fix nve/sphere, or set it up, {why}")
    row = np.flatnonzero(moves[axes])
    column = (leader[axes] + len(mass) * np.arange(len(axes))[:, None]).ravel()[row]
    constraint = csr_array((weight[axes].ravel()[row], (row, column)), shape=2 * (len(axes) * len(mass),))
    plain = abs(constraint - diags_array(np.tile(free, len(axes)).astype(np.float64))).nnz == 0
    return Mobility(None if plain else constraint, free, factor, felt)
