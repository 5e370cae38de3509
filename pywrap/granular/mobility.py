r"""Which coordinates of the particles move, and which of them move as one, by the fixes of a deck.

The particles of a lid that `fix aveforce` moves have common translations: q = P Q, with the lid's coordinates at its
first particle. `fix aveforce` gives each particle the same force, so that
:math:`m_i \ddot x_i = \frac1n \sum_k F_k`, and :math:`x_i = (m_1/m_i) X`: particles of different mass move by different
amounts. A component that `fix setforce` sets to zero, and whatever no fix moves, is held: its row of P is empty.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from ...analysis.arrays import Floats
from .granular_commands import SnapshotError, without_suffix


class Mobility(NamedTuple):
    """P of q = P Q, square, and I/(m R^2) of each particle."""

    constraint: csr_array
    factor: Floats

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

    def join(self, component: int, members: NDArray[np.bool_]) -> None:
        """Have a component of some particles led by the first of them, by inverse masses."""
        self.leader[component, members] = np.flatnonzero(members)[0]
        self.weight[component, members] = self.mass[members][0] / self.mass[members]


def mobility(lines: dict[str, str], members: dict[str, NDArray[np.bool_]], mass: Floats, dimension: int) -> Mobility:
    """What the fixes move.

    Parameters
    ----------
    lines : dict of str
        The commands of the fixes by their IDs, in the order of the deck.
    members : dict of ndarray of bool, shape (N,)
        Who is in the group of each.
    mass : ndarray, shape (N,)
        Masses.
    dimension : int
        2 or 3.

    Raises
    ------
    SnapshotError
        If a fix moves or holds particles otherwise.
    """
    found = _Coordinates(mass)
    # forces are set after all integrators are known, whatever the order of the deck
    for name in sorted(lines, key=lambda each: without_suffix(lines[each].split()[3]) in ("setforce", "aveforce")):
        words = lines[name].split()
        _apply(found, name, without_suffix(words[3]), words[4:], members[name])
    for name, line in lines.items():
        if without_suffix(line.split()[3]) == "freeze":
            found.moves[:, members[name]] = False
    axes = np.arange(6) if dimension == 3 else np.array([0, 1, 5])
    if not found.moves[axes].any():
        raise SnapshotError(
            "Nothing moves the particles: give the line of fix nve/sphere, or set it up, so that it is known which of "
            "them are free and what their moments of inertia are."
        )
    row = np.flatnonzero(found.moves[axes])
    column = (found.leader[axes] + len(mass) * np.arange(len(axes))[:, None]).ravel()
    size = len(axes) * len(mass)
    constraint = csr_array((found.weight[axes].ravel()[row], (row, column[row])), shape=(size, size))
    return Mobility(constraint, found.factor)


def _apply(found: _Coordinates, name: str, style: str, words: list[str], members: NDArray[np.bool_]) -> None:
    """What one fix moves, holds or joins."""
    if style in ("nve/sphere", "nve/disc", "overdamped/disc"):
        found.moves[:, members] = True
        own = {"nve/disc": 0, "overdamped/disc": 1}.get(style)
        found.factor[members] = (0.5 if "disc" in words else 0.4) if own is None else float(words[own])
    elif style == "nve":
        found.moves[:3, members] = True
    elif style == "setforce":
        for k in range(3):
            if words[k] != "NULL" and float(words[k] if "v_" not in words[k] else "nan") != 0.0:
                raise SnapshotError(f"fix {name} setforce drives particles: only 0.0 and NULL hold them.")
            if words[k] != "NULL":
                found.moves[k, members] = False
    elif style == "aveforce":
        for k in range(3):
            if words[k].startswith("v_"):  # K by differences takes this fix away, and its force with it
                raise SnapshotError(
                    f"fix {name} aveforce adds the force {words[k]}, which may change with the place: give this force "
                    "to fix addforce, and 0.0 to fix aveforce."
                )
            joined = members & found.moves[k]
            if words[k] != "NULL" and joined.any():
                found.join(k, joined)
