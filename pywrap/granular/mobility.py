r"""Which coordinates of the particles move, and which of them move as one, by the fixes of a deck.

The particles of a lid that `fix aveforce` moves have common translations: q = P Q, with the lid's coordinates at its
first particle. `fix aveforce` gives each particle the same force, so that
:math:`m_i \ddot x_i = \frac1n \sum_k F_k`, and :math:`x_i = (m_1/m_i) X`: particles of different mass move by different
amounts. The particles of a body of fix rigid that does not rotate have one displacement, and the force on the body is
the sum of theirs. A component that `fix setforce` sets to zero, and whatever no fix moves, is held: its row of P is
empty.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from ...analysis.arrays import Floats
from .granular_commands import BODIES, TURNS, NotTakenError, without_suffix

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
