"""One pair of modes through equilibria on the way to its onset: its normal form and its eigenvalues at each load."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError

from ..arrays import Complexes, Floats
from ..packing.packing import Packing
from ..responses.normal_form import NormalForm
from .motions import DENSE, Motions, System


@dataclass(frozen=True, eq=False)
class Plane:
    """Two modes of a system without dissipation by the planes that they span, smooth where the two coalesce.

    Attributes
    ----------
    system : System
        A.
    right, left : ndarray, shape (n, 2)
        Orthonormal bases V and U of the right and of the left plane.
    """

    system: System
    right: Floats
    left: Floats

    @classmethod
    def of(cls, state: Motions, members: Sequence[int]) -> "Plane":
        """Of one of a complex pair, or of two real modes of a state."""
        both = (each[:, list(members)] for each in (state.right, state.left))
        right, left = (np.linalg.svd(np.hstack([v.real, v.imag]), full_matrices=False)[0][:, :2] for v in both)
        return cls(state.system, right, left)

    @classmethod
    def about(cls, state: Motions, eigenvalue: float) -> "Plane":
        """Of the complex pair, or the two real modes, closest to an eigenvalue, 1 / time^2."""
        return cls.of(state, _largest(state, 1 / (np.abs(state.values - eigenvalue) + np.finfo(float).tiny)))

    @cached_property
    def block(self) -> Floats:
        """(U^T V)^-1 U^T A V, shape (2, 2), 1 / time^2."""
        return np.asarray(np.linalg.solve(self.left.T @ self.right, self.left.T @ (self.system.stiffness @ self.right)))

    @property
    def mean(self) -> float:
        """Half the trace of the block, 1 / time^2."""
        return 0.5 * float(np.trace(self.block))

    @property
    def discriminant(self) -> float:
        """(lambda_1 - lambda_2)^2, 1 / time^4."""
        b = self.block
        return float((b[0, 0] - b[1, 1]) ** 2 + 4 * b[0, 1] * b[1, 0])

    def like(self, other: "Plane") -> bool:
        """Whether both have the same planes rather than not: all principal angles below 60 degrees."""
        cosines = (self.right.T @ other.right, self.left.T @ other.left)
        return min(float(np.linalg.norm(each, -2)) for each in cosines) > 0.5

    def closest(self, state: Motions) -> list[int]:
        """One of a complex pair, or two real modes, that lie closest to these planes; ValueError of a single mode."""
        weight = np.linalg.norm(self.right.T @ state.right, axis=0) * np.linalg.norm(self.left.T @ state.left, axis=0)
        return _largest(state, weight)

    def at(self, system: System) -> "Plane":
        """The closest two modes at another load."""
        state = _modes_near(system, self.mean)
        return Plane.of(state, self.closest(state))


def _largest(state: Motions, weight: Floats) -> list[int]:
    """One of a complex pair, or two real modes, with the largest sum of weights."""
    alone, pairs = np.flatnonzero(~state.grows), np.flatnonzero(state.grows)
    best = alone[np.argsort(weight[alone])[-2:]]
    pair = pairs[np.argsort(weight[pairs])[-1:]]
    if len(best) < 2 and not len(pair):
        raise ValueError("a system of one mode has no pair")
    two = weight[best].sum() if len(best) == 2 else -np.inf
    return [int(k) for k in (pair if len(pair) and 2 * weight[pair[0]] > two else best)]


def normal_forms(packings: Sequence[Packing], eigenvalue: float) -> list[NormalForm]:
    """The normal form of one pair, through equilibria on the way to its onset, one for each packing.

    The packings are in order of their distance from the onset, nearest first, and close enough for the planes of the
    pair to be recognised. The two eigenvalues of the first that are nearest to `eigenvalue`, the double one at the
    onset, 1 / time^2, are the pair.
    """
    found = []
    for pair in _follow_pair(packings, eigenvalue):
        dual = np.linalg.solve(pair.left.T @ pair.right, pair.left.T).T
        found.append(NormalForm.of_block(pair.block, pair.discriminant, pair.right, dual))
    return found


def pair_eigenvalues(packings: Sequence[Packing], eigenvalue: float) -> Complexes:
    """Both eigenvalues of one pair, from its onset on through other loads.

    The two are followed by the plane that they span, and computed from the 2 x 2 block on it: half its trace -+ half
    the root of its discriminant. So they are two real numbers or two exact conjugates at every load.

    Parameters
    ----------
    packings : sequence of Packing
        As of :func:`normal_forms`, on one side of the onset.
    eigenvalue : float
        As of :func:`normal_forms`.

    Returns
    -------
    ndarray of complex, shape (S, 2)
        1 / time^2; nan from where on the planes are not recognised any more.
    """
    values = np.full((len(packings), 2), np.nan, dtype=np.complex128)
    before: Plane | None = None
    for row, pair in zip(values, _follow_pair(packings, eigenvalue), strict=True):
        if before is not None and not before.like(pair):
            break
        root = 0.5 * np.emath.sqrt(pair.discriminant)
        row[:] = pair.mean - root, pair.mean + root
        before = pair
    return values


def _follow_pair(packings: Sequence[Packing], eigenvalue: float) -> Iterator[Plane]:
    """The pair at each load: the two modes, conjugates or both real, closest to the planes of the load before."""
    pair: Plane | None = None
    for packing in packings:
        system = System.of(packing)
        pair = pair.at(system) if pair else Plane.about(_modes_near(system, eigenvalue), eigenvalue)
        yield pair


def _modes_near(system: System, value: float) -> Motions:
    """The modes next to an eigenvalue, or all."""
    with suppress(LinAlgError):
        if len(system.active) > DENSE:
            return Motions.near(system, [(value, 12)])
    return Motions.of(system)
