r"""All modes of a packing at one load, and which of them is which at the next.

The operator is :math:`A = M^{-1/2} K M^{-1/2}`, with right vectors x and left vectors y.
Modes at neighbouring loads a, b are assigned by :math:`|x_a^H x_b|\,|y_a^H y_b|` over unit vectors, so modes that cross
do not swap names. (:math:`|y_a^H x_b|`, the obvious weight, vanishes at an exceptional point, where it is needed most.)
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias, TypeVar, cast

import numpy as np
from scipy.sparse import csr_array

from ..configuration import HasConfiguration
from ..motion.eigenvalues import Complexes, all_modes, exceeds_rounding, mass_weighted, unit_rounding
from ..operators.stiffness import stiffness_matrix
from ..packing.packing import Floats, Indices
from .eigenvalue_pair import Pair
from .limits import LIMITS, Limits

Members = tuple[int, int]  # the numbers of the two modes of a pair
Operator: TypeAlias = Floats | csr_array
AnyConfiguration = TypeVar("AnyConfiguration", bound=HasConfiguration)


def full_operator(packing: HasConfiguration, limits: Limits = LIMITS) -> csr_array:
    """A = M^(-1/2) K M^(-1/2) of the contacts that bear a force, of all coordinates, with its zero rows; 1 / time^2."""
    packing = force_bearing(packing, limits)
    return mass_weighted(stiffness_matrix(packing), packing)


def force_bearing(packing: AnyConfiguration, limits: Limits = LIMITS) -> AnyConfiguration:
    """The packing without the contacts whose force is no more than the packing's own imbalance.

    A disk that only such contacts hold comes to rest just about touching. Its overlap is rounding noise, and with the
    overlap its stiffness, of order (residual / k_n)^(1/3): it differs from one equilibrium to the next, and would open
    and shut windows at random.
    """
    largest = packing.normal_force.max(initial=0.0)
    return cast(
        AnyConfiguration, packing.loaded(min(limits.unknown_force * packing.residual, limits.small_force * largest))
    )


def contact_states(packing: HasConfiguration, limits: Limits = LIMITS) -> bytes:
    """Which contacts bear a force, and which of them slide to which side; equal for equal states."""
    return force_bearing(packing, limits).contact_states


@dataclass(frozen=True, eq=False)
class Modes:
    """The modes of the operator A, shape (n, n), 1 / time^2, at the load fx.

    Attributes
    ----------
    values : ndarray of complex, shape (E,)
        Eigenvalues by real part, then imaginary part. Complex pairs that are rounding noise have lost their
        imaginary parts.
    right, left : ndarray of complex, shape (n, E)
        Unit vectors in columns.
    partner : ndarray of int, shape (E,)
        Index of the complex conjugate; -1 for a real eigenvalue.
    """

    fx: float
    matrix: csr_array
    values: Complexes
    right: Complexes
    left: Complexes
    partner: Indices
    _pairs: dict[Members, Pair] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, fx: float, matrix: Operator) -> "Modes":
        """Solve the dense eigenproblem, without the coordinates whose rows are zero."""
        sparse = csr_array(matrix)
        values, right, left = all_modes(sparse)
        rounding, partner = unit_rounding(sparse.data), np.full(len(values), -1)
        for k in (int(each) for each in np.flatnonzero(values.imag > 0)):
            conjugate = int(np.argmin(np.abs(values - values[k].conj())))
            if exceeds_rounding(values[k], abs(np.vdot(left[:, k], right[:, k])), rounding):
                partner[k], partner[conjugate] = conjugate, k
            else:
                values[[k, conjugate]] = values[k].real
        return cls(fx, sparse, values, right, left, partner)

    @property
    def complex_pairs(self) -> list[Members]:
        """The members of each complex pair, that with the positive imaginary part first."""
        return [(int(k), int(self.partner[k])) for k in np.flatnonzero(self.values.imag > 0)]

    def conjugate(self, members: Members) -> bool:
        """Whether two modes are a complex pair."""
        return bool(self.partner[members[0]] == members[1])

    def together(self, members: Members) -> bool:
        """Whether two modes are a complex pair, or both are real."""
        return self.conjugate(members) or bool(self.partner[members[0]] == self.partner[members[1]] == -1)

    def pair(self, members: Members) -> Pair:
        """The pair of two modes."""
        if members not in self._pairs:
            two = list(members)
            self._pairs[members] = Pair(self.fx, self.matrix, span(self.right[:, two]), span(self.left[:, two]))
        return self._pairs[members]

    def nearest(self, pair: Pair) -> Members:
        """The two modes, conjugates or both real, that lie closest to the planes of a pair at a neighbouring load."""
        weight = np.linalg.norm(pair.right.T @ self.right, axis=0) * np.linalg.norm(pair.left.T @ self.left, axis=0)
        real = np.flatnonzero(self.partner < 0)
        candidates = self.complex_pairs
        if len(real) > 1:
            first, second = real[np.argsort(weight[real])[-2:]]
            candidates = [*candidates, (int(first), int(second))]
        return max(candidates, key=lambda members: float(weight[list(members)].sum()))

    def about(self, eigenvalue: float, among: Sequence[Members] = ()) -> Members:
        """The pair among some with the closest eigenvalue; without pairs, the two modes closest to a real number."""
        if among:
            return min(among, key=lambda members: abs(self.values[members[0]].real - eigenvalue))
        first, second = np.argsort(np.abs(self.values - eigenvalue))[:2]
        return int(first), int(second)


@dataclass(frozen=True, eq=False)
class LoadPoint:
    """A load, the operator there, and all of its modes as soon as somebody asks for them."""

    fx: float
    matrix: csr_array

    @property
    def matrices(self) -> tuple[csr_array, ...]:
        """All that describes the operator."""
        return (self.matrix,)

    @cached_property
    def modes(self) -> Modes:
        """All modes, by LAPACK."""
        return Modes.of(self.fx, self.matrix)


def assign_modes(here: Modes, there: Modes) -> Indices:
    """Which mode there each mode here has become, shape (E,); -1 where there are fewer modes there.

    The assignment maximises the sum of |x^H x'| |y^H y'|.
    """
    partner = assign_columns(products(here.right, there.right) * products(here.left, there.left))
    # Members of one pair have the same weights: let the one above the axis stay above.
    for up, down in here.complex_pairs:
        if partner[up] >= 0 and there.partner[partner[up]] == partner[down] and there.values[partner[up]].imag < 0:
            partner[[up, down]] = partner[[down, up]]
    return partner


def neighbours(before: Floats, after: Floats, places: int) -> tuple[Indices, Indices]:
    """Pairs of modes at most so many places apart in either order, before or after, or in another order after."""
    p, q = np.triu_indices(len(before), 1)
    ranks = [np.argsort(np.argsort(each, kind="stable")) for each in (before, after)]
    near = [np.abs(rank[p] - rank[q]) <= places for rank in ranks]
    swapped = (ranks[0][p] < ranks[0][q]) != (ranks[1][p] < ranks[1][q])
    kept = near[0] | near[1] | swapped
    return p[kept], q[kept]


def assign_columns(weight: Floats) -> Indices:
    """A column for each row, none twice, with the largest sum of weights; -1 where columns are too few."""
    from scipy.optimize import linear_sum_assignment

    column = np.full(len(weight), -1)
    rows, columns = linear_sum_assignment(weight, maximize=True)
    column[rows] = columns
    return column


def products(a: Complexes, b: Complexes) -> Floats:
    """|a_j^H b_k| over columns: in real arithmetic, but for the few columns that have imaginary parts."""
    p, q = np.flatnonzero(np.any(a.imag, axis=0)), np.flatnonzero(np.any(b.imag, axis=0))
    x, y = (np.ascontiguousarray(part) for part in (a.real, b.real))
    u, v = a.imag[:, p], b.imag[:, q]
    real, imag = x.T @ y, np.zeros((a.shape[1], b.shape[1]))
    real[np.ix_(p, q)] += u.T @ v
    imag[:, q] = x.T @ v
    imag[p] -= u.T @ y
    return np.hypot(real, imag)


def span(vectors: Complexes) -> Floats:
    """Orthonormal real basis, shape (n, 2), of the plane of two real or two complex conjugate vectors."""
    real_plane = np.hstack([vectors.real, vectors.imag])
    return np.linalg.svd(real_plane, full_matrices=False)[0][:, :2]
