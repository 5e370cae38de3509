r"""Which coordinates of the particles move, and which of them move as one, by the fixes of a deck.

The particles of a lid that `fix aveforce` moves have common translations: q = P Q, with the lid's coordinates at its
first particle. `fix aveforce` gives each particle the same force, so that
:math:`m_i \ddot x_i = \frac1n \sum_k F_k`, and :math:`x_i = (m_1/m_i) X`: particles of different mass move by different
amounts. The particles of a body of fix rigid that does not rotate have one displacement. A component that `fix
setforce` sets to zero, and whatever no fix moves, is held: its row of P is empty.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from ...analysis.arrays import Floats
from ...analysis.counted import counted
from .granular_commands import BODIES, NotTakenError, without_suffix
from .translating_bodies import translating_bodies

INTEGRATES = ("nve", "nve/limit", "nve/sphere", "nve/disc", "overdamped/disc", *BODIES)
"""Fixes that move particles."""


def refuse_two_integrators(lines: dict[str, str], members: dict[str, NDArray[np.bool_]]) -> None:
    """Refuse particles that two fixes move: LAMMPS moves them twice in each step.

    Parameters
    ----------
    lines, members
        As of :func:`mobility`; other fixes among them do not matter.

    Raises
    ------
    NotTakenError
        With both fixes.
    """
    moves = {
        name: _members_of_bodies(name, members) if without_suffix(line.split()[3]) in BODIES else members[name]
        for name, line in lines.items()
        if without_suffix(line.split()[3]) in INTEGRATES
    }
    for one, other in combinations(moves, 2):
        both = int(np.count_nonzero(moves[one] & moves[other]))
        if both:
            raise NotTakenError(
                f"fix {one} and fix {other} both move {counted(both, 'particle')}, which LAMMPS then moves twice in "
                "each step: unfix one of them, or have it move other particles."
            )


def _members_of_bodies(name: str, members: dict[str, NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Who is in a body of a fix rigid, which moves no other particle of its own group."""
    return np.any([each for key, each in members.items() if key.startswith(f"{name} ")], axis=0)


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


class _Coordinates:
    """What moves, component by component of (translation, rotation), shape (6, N); who leads, by how much."""

    def __init__(self, mass: Floats) -> None:
        self.mass = mass
        self.moves = np.zeros((6, len(mass)), np.bool_)
        self.leader = np.tile(np.arange(len(mass)), (6, 1))
        self.weight = np.ones((6, len(mass)))
        self.factor = np.full(len(mass), 0.4)

    def join(self, component: int, members: NDArray[np.bool_], weight: Floats | float = 1.0) -> None:
        """Have a component of some particles led by the first of them, by these weights."""
        self.leader[component, members] = np.flatnonzero(members)[0]
        self.weight[component, members] = weight


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
    refuse_two_integrators(lines, members)
    found, felt = _Coordinates(mass), np.array(mass)
    # forces are set after all integrators are known, whatever the order of the deck
    for name in sorted(lines, key=lambda each: without_suffix(lines[each].split()[3]) in ("setforce", "aveforce")):
        words = lines[name].split()
        if without_suffix(words[3]) in BODIES:
            for body in translating_bodies(lines[name], dimension):
                inside = members[f"{name} {body.group}"]
                felt[inside] = mass[inside].sum()
                _move_body(found, body.axes, inside)
        else:
            _apply(found, name, without_suffix(words[3]), words[4:], members[name])
    for name, line in lines.items():
        if without_suffix(line.split()[3]) == "freeze":
            found.moves[:, members[name]] = False
    axes = np.arange(6) if dimension == 3 else np.array([0, 1, 5])
    if not found.moves[axes].any():
        raise NotTakenError(
            "Nothing moves the particles: give the line of fix nve/sphere, or set it up, so that it is known which of "
            "them are free and what their moments of inertia are."
        )
    row = np.flatnonzero(found.moves[axes])
    column = (found.leader[axes] + len(mass) * np.arange(len(axes))[:, None]).ravel()
    size = len(axes) * len(mass)
    constraint = csr_array((found.weight[axes].ravel()[row], (row, column[row])), shape=(size, size))
    return Mobility(constraint, found.factor, felt)


def _apply(found: _Coordinates, name: str, style: str, words: list[str], members: NDArray[np.bool_]) -> None:
    """Apply one fix, which moves, holds or joins coordinates."""
    if style in ("nve/sphere", "nve/disc", "overdamped/disc"):
        found.moves[:, members] = True
        own = {"nve/disc": 0, "overdamped/disc": 1}.get(style)
        found.factor[members] = (0.5 if "disc" in words else 0.4) if own is None else float(words[own])
    elif style in ("nve", "nve/limit"):  # a limit of steps does not act on small motion
        found.moves[:3, members] = True
    elif style == "setforce":
        for k in range(3):
            if words[k] != "NULL" and float(words[k] if "v_" not in words[k] else "nan") != 0.0:
                raise NotTakenError(f"fix {name} setforce drives particles: only 0.0 and NULL hold them.")
            if words[k] != "NULL":
                found.moves[k, members] = False
    elif style in ("lineforce", "planeforce"):
        along = np.array([float(word) for word in words[:3]]) != 0.0
        if along.sum() != 1:
            raise NotTakenError(f"fix {name} {style} has a direction along no axis, which is not known here: unfix it.")
        for k in np.flatnonzero(along if style == "planeforce" else ~along).tolist():
            found.moves[k, members] = False
    elif style == "aveforce":
        for k in range(3):
            if words[k].startswith("v_"):  # K by differences takes this fix away, and its force with it
                raise NotTakenError(
                    f"fix {name} aveforce adds the force {words[k]}, which may change with the place: give this force "
                    "to fix addforce, and 0.0 to fix aveforce."
                )
            joined = members & found.moves[k]
            if words[k] != "NULL" and joined.any():
                found.join(k, joined, found.mass[joined][0] / found.mass[joined])


def _move_body(found: _Coordinates, axes: tuple[bool, bool, bool], members: NDArray[np.bool_]) -> None:
    """Apply a body that does not rotate."""
    found.moves[:, members] = False
    for k in range(3):
        if axes[k] and members.any():
            found.moves[k, members] = True
            found.join(k, members)
