r"""All modes at one load, and which of them is which at the next.

Without dissipation these are the eigenvalues of A, with right vectors x and left vectors y; with dissipation the
eigenvalues s of the first-order matrix with :math:`\mathrm{Im}\, s \ge 0`, from LAPACK in coordinates of the energy
(:mod:`~faultgouge.analysis.motion.energy_norm`), with displacements x and y. Modes at neighbouring loads a, b are
assigned by :math:`|x_a^H x_b|\,|y_a^H y_b|` over unit vectors, so modes that cross do not swap names.
(:math:`|y_a^H x_b|`, the obvious weight, vanishes at an exceptional point, where it is needed most.) For shapes that
two overdamped motions share the eigenvalues decide.

A load that changes A and G by dA and dG moves an eigenvalue by

.. math:: \mathrm d\lambda = \frac{y^H\, \mathrm dA\, x}{y^H x}, \qquad
          \mathrm ds = - \frac{y^H (\mathrm dA + s\, \mathrm dG)\, x}{y^H (2 s + G)\, x} .
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eig
from scipy.sparse import csr_array

from ..arrays import Floats, Indices, Matrix
from ..motion.eigenvalues import Complexes, exceeds_rounding, growing
from ..motion.energy_norm import EnergyNorm
from ..motion.modes import Modes
from .space import Space
from .system import System

Members = tuple[int, int]  # the numbers of the two modes of a pair

PAIRS_AT_A_TIME = 200
"""Pairs that are sought among all modes in one product of matrices: 20 MB for 1,000 disks."""

SHARE_IN_LIKE_PLANES = 0.4
"""Unit vectors of a plane have at least this share in a plane like it: cos 60 degrees, with room for rounding."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SystemModes(Modes):
    """All modes of a system, on n coordinates.

    Without dissipation `values` are eigenvalues of A by real part, then imaginary part, 1 / time^2; complex pairs that
    are rounding noise have lost their imaginary parts. With dissipation they are s by imaginary part, then real part,
    1 / time.

    Attributes
    ----------
    system : System
        Whose modes they are.
    partner : ndarray of int, shape (E,)
        Index of the complex conjugate without dissipation; -1 for a real eigenvalue, and with dissipation.
    first_order_overlap : ndarray, shape (E,), or None
        With dissipation |y^H x| of the vectors of the first-order matrix.
    """

    system: System
    partner: Indices
    first_order_overlap: Floats | None = None
    _spaces: dict[tuple[int, ...], Space] = field(default_factory=dict, repr=False)

    @cached_property
    def overlap(self) -> Floats:
        """|y^H x| of the vectors, with dissipation of the vectors of the first-order matrix, shape (E,)."""
        if self.first_order_overlap is not None:
            return self.first_order_overlap
        return super().overlap

    @classmethod
    def of(cls, system: System) -> "SystemModes":
        """Solve the dense eigenproblem, without the coordinates whose rows are zero."""
        if system.dissipative:
            return _with_dissipation(system)
        return _paired(system, Modes.of_matrix(csr_array(system.stiffness)))

    @classmethod
    def of_spaces(cls, system: System, spaces: Sequence[Space]) -> "SystemModes":
        """The modes of some subspaces of a system without dissipation."""
        pairs = [each.eigenpairs for each in spaces]
        values, right, left = (np.concatenate(parts, axis=-1) for parts in zip(*pairs, strict=True))
        order = np.lexsort((values.imag, values.real))
        return _paired(system, Modes(values[order], right[:, order], left[:, order]))

    @classmethod
    def of_operator(cls, fx: float, matrix: Matrix) -> "SystemModes":
        """The modes of A at a load, shape (n, n), without dissipation."""
        return cls.of(System(fx, csr_array(matrix)))

    @property
    def fx(self) -> float:
        """The load, force per top disk."""
        return self.system.fx

    @property
    def grows(self) -> Indices:
        """Which of them grow beyond rounding, one of each complex pair."""
        if not self.system.dissipative:
            return np.flatnonzero(self.values.imag > 0)
        return np.flatnonzero(growing(self.values, self.overlap, self.system.rounding))

    @property
    def growing(self) -> list[Space]:
        """The subspaces of those that grow."""
        return [
            self.space((int(k),) if self.system.dissipative else (int(k), int(self.partner[k]))) for k in self.grows
        ]

    @property
    def complex_pairs(self) -> list[Members]:
        """The members of each complex pair, that with the positive imaginary part first."""
        return [(int(k), int(self.partner[k])) for k in np.flatnonzero((self.values.imag > 0) & (self.partner >= 0))]

    def conjugate(self, members: Members) -> bool:
        """Whether two modes are a complex pair."""
        return bool(self.partner[members[0]] == members[1])

    def together(self, members: Members) -> bool:
        """Whether two modes are a complex pair, or both are real."""
        return self.conjugate(members) or bool(self.partner[members[0]] == self.partner[members[1]] == -1)

    def space(self, members: tuple[int, ...]) -> Space:
        """The subspace of two modes or, with dissipation, of one."""
        if members not in self._spaces:
            k = list(members)
            rate = complex(self.values[k[0]])
            self._spaces[members] = Space.of(self.system, self.right[:, k], self.left[:, k], rate)
        return self._spaces[members]

    def nearest(self, pair: Space) -> Members:
        """The two modes, conjugates or both real, that lie closest to the planes of a pair at a neighbouring load."""
        return self._nearest(self._shares(pair.right, self.right)[0] * self._shares(pair.left, self.left)[0])

    def images(self, pairs: Sequence[Space]) -> list[Members | None]:
        """Of each of some pairs the `nearest` modes, or None if the planes of these are not like those of the pair."""
        found: list[Members | None] = []
        for begin in range(0, len(pairs), PAIRS_AT_A_TIME):
            some = pairs[begin : begin + PAIRS_AT_A_TIME]
            shares = [
                self._shares(np.hstack([getattr(pair, side) for pair in some]), getattr(self, side))
                for side in ("right", "left")
            ]
            for pair, *both in zip(some, *shares, strict=True):
                members = self._nearest(both[0] * both[1])
                near = min(share[list(members)].min() for share in both) > SHARE_IN_LIKE_PLANES
                found.append(members if near and self.space(members).like(pair) else None)
        return found

    @staticmethod
    def _shares(planes: Any, vectors: Complexes) -> Floats:
        """Lengths of the shares of unit vectors in planes, whose bases stand side by side; shape (planes, E)."""
        return np.linalg.norm((planes.T @ vectors).reshape(-1, 2, vectors.shape[1]), axis=1)

    def _nearest(self, weight: Floats) -> Members:
        """The two modes, conjugates or both real, with the largest sum of weights."""
        first, second = self._conjugates
        best = int(np.argmax(weight[first] + weight[second])) if len(first) else None
        if len(self._real) > 1:
            a, b = self._real[np.argsort(weight[self._real])[-2:]]
            if best is None or weight[a] + weight[b] > weight[first[best]] + weight[second[best]]:
                return int(a), int(b)
        if best is None:
            raise ValueError("a system of one mode has no pair")
        return int(first[best]), int(second[best])

    @cached_property
    def _real(self) -> Indices:
        """The real modes."""
        return np.flatnonzero(self.partner < 0)

    @cached_property
    def _conjugates(self) -> Indices:
        """The members of the complex pairs, shape (2, pairs)."""
        return np.array(self.complex_pairs, dtype=np.int64).reshape(-1, 2).T

    def about(self, eigenvalue: float, among: Sequence[Members] = ()) -> Members:
        """The pair among some with the closest eigenvalue; without pairs, the two modes closest to a real number."""
        if among:
            return min(among, key=lambda members: abs(self.values[members[0]].real - eigenvalue))
        first, second = np.argsort(np.abs(self.values - eigenvalue))[:2]
        return int(first), int(second)

    def drifts(self, other: System) -> Complexes:
        """First-order change of each eigenvalue on the way to another load, shape (E,)."""
        x, y = self.right, self.left.conj()
        changes = [there - here for here, there in zip(self.system.matrices, other.matrices, strict=True)]
        force, slant = changes[0] @ x, x
        if self.system.damping is not None:
            force = -(force + (changes[1] @ x) * self.values)
            slant = 2 * self.values * x + self.system.damping @ x
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.sum(y * force, axis=0) / np.sum(y * slant, axis=0))


def _paired(system: System, modes: Modes) -> SystemModes:
    """Modes without dissipation with the partners of complex ones, without imaginary parts that are noise."""
    values, overlap, partner = modes.values.copy(), modes.overlap, np.full(len(modes), -1)
    for k in (int(each) for each in np.flatnonzero(values.imag > 0)):
        conjugate = int(np.argmin(np.abs(values - values[k].conj())))
        if exceeds_rounding(values[k], overlap[k], system.rounding):
            partner[k], partner[conjugate] = conjugate, k
        else:
            values[[k, conjugate]] = values[k].real
    return SystemModes(values=values, right=modes.right, left=modes.left, system=system, partner=partner)


def _with_dissipation(system: System) -> SystemModes:
    assert system.damping is not None
    a, g = csr_array(system.stiffness), csr_array(system.damping)
    norm = EnergyNorm.of(a)
    active, size = norm.active, len(norm.active)
    values, left, right = eig(norm.first_order(a, g), left=True, check_finite=False)
    kept = np.flatnonzero(values.imag >= 0)
    kept = kept[np.lexsort((values[kept].real, values[kept].imag))]
    overlap = np.abs(np.sum(left[:, kept].conj() * right[:, kept], axis=0))
    x, y = np.zeros((2, system.stiffness.shape[0], len(kept)), complex)
    x[active] = _normalise(norm.unweight @ right[:size, kept])
    y[active] = _normalise(left[size:, kept])
    return SystemModes(
        values=np.asarray(values[kept], complex),
        right=x,
        left=y,
        system=system,
        partner=np.full(len(kept), -1),
        first_order_overlap=overlap,
    )


def _normalise(vectors: Complexes) -> Complexes:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0))


def assign_modes(here: SystemModes, there: SystemModes) -> Indices:
    """Which mode there each mode here has become, shape (E,); -1 where there are fewer modes there.

    The assignment maximises the sum of |x^H x'| |y^H y'|.
    """
    weight = products(here.right, there.right) * products(here.left, there.left)
    if here.system.dissipative:
        a, b = here.values[:, None], there.values[None]
        weight *= 1 - np.abs(a - b) / (np.abs(a) + np.abs(b) + np.finfo(float).tiny)
    partner = assign_columns(weight)
    # Members of one pair have the same weights: let the one above the axis stay above.
    for up, down in here.complex_pairs:
        if partner[up] >= 0 and there.partner[partner[up]] == partner[down] and there.values[partner[up]].imag < 0:
            partner[[up, down]] = partner[[down, up]]
    return partner


def assign_columns(weight: Floats) -> Indices:
    """A column for each row, none twice, with the largest sum of weights; -1 where columns are too few."""
    from scipy.optimize import linear_sum_assignment

    column = np.full(len(weight), -1)
    rows, columns = linear_sum_assignment(weight, maximize=True)
    column[rows] = columns
    return column


def products(a: Complexes, b: Complexes) -> Floats:
    """|a_j^H b_k| over columns: in real arithmetic, but for the columns that have imaginary parts."""
    p, q = np.flatnonzero(np.any(a.imag, axis=0)), np.flatnonzero(np.any(b.imag, axis=0))
    x, y = (np.ascontiguousarray(part) for part in (a.real, b.real))
    u, v = a.imag[:, p], b.imag[:, q]
    real, imag = x.T @ y, np.zeros((a.shape[1], b.shape[1]))
    real[np.ix_(p, q)] += u.T @ v
    imag[:, q] = x.T @ v
    imag[p] -= u.T @ y
    return np.hypot(real, imag)
