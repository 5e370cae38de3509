r"""Which coordinates of the particles move, and which of them move as one, by the fixes of a deck.

The particles of a lid that `fix aveforce` moves have common translations: q = P Q, with the lid's coordinates at its
first particle. `fix aveforce` gives each particle the same force, so that
:math:`m_i \ddot x_i = \frac1n \sum_k F_k`, and :math:`x_i = (m_1/m_i) X`: particles of different mass move by different
amounts. The particles of a body of fix rigid that does not rotate have one displacement, and the force on the body is
the sum of theirs. A component that `fix setforce` sets to zero, and whatever no fix moves, is held: its row of P is
empty.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from ...analysis.arrays import Floats
from ...analysis.counted import counted
from .granular_commands import BODIES, NotTakenError, without_suffix

TURNS = ("nve/sphere", "nve/disc", "overdamped/disc")
"""Fixes that move particles and turn them."""

INTEGRATES = ("nve", "nve/limit", *TURNS, *BODIES)
"""Fixes that move particles."""


HELD = "force * off off off torque * off off off"
"""Words by which a body keeps its velocity, whatever its particles feel. The fix stays where forces are measured, as
dashpots feel the mass of the body, which takes its velocity from its particles where a run begins."""


class Body(NamedTuple):
    """A group of particles that translate as one, along some of the axes."""

    group: str
    axes: tuple[bool, bool, bool]


def translating_bodies(line: str, dimension: int) -> list[Body]:
    """The bodies of a command fix rigid.

    Raises
    ------
    NotTakenError
        If they may rotate, or the command has what is not known here.
    """
    words = line.split()
    name, style, kind = words[1], words[3], words[4]
    groups = [words[2]] if kind == "single" else words[6 : 6 + int(words[5])] if kind == "group" else []
    if without_suffix(style) not in BODIES or not groups:
        raise NotTakenError(f"fix {name} {style} {kind} {WAY_OUT}.")
    axes, turns = ([[True] * 3 for _ in groups] for _ in range(2))
    at = 5 if kind == "single" else 6 + len(groups)
    while at < len(words):
        if words[at] == "reinit" and words[at + 1] in YES:
            at += 2
            continue
        if words[at] not in ("force", "torque"):
            raise NotTakenError(
                f"fix {name} {style} has {' '.join(words[at : at + 2])}, which is not known here: leave it out."
            )
        low, star, high = words[at + 1].partition("*")
        which = range(int(low or 1) - 1, int(high or len(groups)) if star else int(low))
        for k in which:
            (axes if words[at] == "force" else turns)[k] = [word in YES for word in words[at + 2 : at + 5]]
        at += 5
    if any(any(each if dimension == 3 else each[2:]) for each in turns):
        raise NotTakenError(f"fix {name} {style} {kind} {WAY_OUT}.")
    return [Body(group, (x, y, z)) for group, (x, y, z) in zip(groups, axes, strict=True)]


WAY_OUT = (
    "holds particles together in bodies that may rotate, and rotations of bodies are not linearised here: for lids "
    "that do not rotate use fix rigid single, or group, with `torque * off off off` at the end of its line"
)

YES = ("on", "yes", "true")


class Mobility(NamedTuple):
    """P of q = P Q, square; I/(m R^2) of each particle; and the mass that dashpots feel, of a body all of its own."""

    constraint: csr_array
    factor: Floats
    felt_mass: Floats

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which particles move, shape (N,)."""
        return np.asarray(np.diff(self.constraint.indptr).reshape(-1, len(self.factor)).any(axis=0))

    @property
    def needed(self) -> csr_array | None:
        """P where it says more than which particles move; otherwise None."""
        free = np.tile(self.free, self.constraint.shape[0] // len(self.factor)).astype(np.float64)
        return self.constraint if abs(self.constraint - diags_array(free)).nnz else None


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
        If a fix moves or holds particles otherwise, or two fixes move the same ones.
    """
    styles = {name: without_suffix(line.split()[3]) for name, line in lines.items()}
    bodies = {name: translating_bodies(lines[name], dimension) for name, style in styles.items() if style in BODIES}
    inside = dict(members)  # of a fix rigid, which moves no other particle of its own group, those of its bodies
    inside |= {name: np.any([members[f"{name} {b.group}"] for b in each], axis=0) for name, each in bodies.items()}
    for one, other in combinations([name for name, style in styles.items() if style in INTEGRATES], 2):
        if both := int(np.count_nonzero(inside[one] & inside[other])):
            raise NotTakenError(
                f"fix {one} and fix {other} both move {counted(both, 'particle')}, which LAMMPS then moves twice in "
                "each step: unfix one of them, or have it move other particles."
            )
    # of each component of (translation, rotation): whether it moves, who leads it, and by how much
    moves, leader = np.zeros((6, len(mass)), np.bool_), np.tile(np.arange(len(mass)), (6, 1))
    weight, factor, felt = np.ones((6, len(mass))), np.full(len(mass), 0.4), np.array(mass)
    # forces are set after all integrators are known, whatever the order of the deck, and freeze comes last
    order = ("setforce", "lineforce", "planeforce", "aveforce", "freeze")
    for name in sorted(lines, key=lambda each: 1 + order.index(styles[each]) if styles[each] in order else 0):
        style, words, here = styles[name], lines[name].split()[4:], inside[name]
        if style in TURNS:
            moves[:, here] = True
            own = {"nve/disc": 0, "overdamped/disc": 1}.get(style)
            factor[here] = (0.5 if "disc" in words else 0.4) if own is None else float(words[own])
        elif style in ("nve", "nve/limit"):  # a limit of steps does not act on small motion
            moves[:3, here] = True
        elif style == "freeze":
            moves[:, here] = False
        elif style in ("lineforce", "planeforce"):
            along = np.array([float(word) for word in words[:3]]) != 0.0
            if along.sum() != 1:
                raise NotTakenError(
                    f"fix {name} {style} has a direction along no axis, which is not known here: unfix it."
                )
            moves[:3] &= ~(here & (along if style == "planeforce" else ~along)[:, None])
        for body in bodies.get(name, ()):
            body_members = members[f"{name} {body.group}"]
            felt[body_members] = mass[body_members].sum()
            moves[:3, body_members] = np.array(body.axes)[:, None]
            leader[:3, body_members] = np.flatnonzero(body_members)[:1]
        for k, word in enumerate(words[:3] if style in ("setforce", "aveforce") else ()):
            if word == "NULL":
                continue
            if style == "setforce":
                if "v_" in word or float(word) != 0.0:
                    raise NotTakenError(f"fix {name} setforce drives particles: only 0.0 and NULL hold them.")
                moves[k, here] = False
                continue
            if "v_" in word:  # K by differences takes this fix away, and its force with it
                raise NotTakenError(
                    f"fix {name} aveforce adds the force {word}, which may change with the place: give this force to "
                    "fix addforce, and 0.0 to fix aveforce."
                )
            joined = np.flatnonzero(here & moves[k])
            leader[k, joined] = joined[:1]
            weight[k, joined] = mass[joined[:1]] / mass[joined]
    axes = np.arange(6) if dimension == 3 else np.array([0, 1, 5])
    if not moves[axes].any():
        raise NotTakenError(
            "Nothing moves the particles: give the line of fix nve/sphere, or set it up, so that it is known which of "
            "them are free and what their moments of inertia are."
        )
    row = np.flatnonzero(moves[axes])
    column = (leader[axes] + len(mass) * np.arange(len(axes))[:, None]).ravel()
    size = len(axes) * len(mass)
    constraint = csr_array((weight[axes].ravel()[row], (row, column[row])), shape=(size, size))
    return Mobility(constraint, factor, felt)
