r"""Small motion at one load: the matrix Z whose eigenvalues a search follows.

Without dissipation Z is the operator :math:`A = M^{-1/2} K M^{-1/2}`, and motion grows where two of its eigenvalues
:math:`\lambda` are complex. With dashpots and drag small motion :math:`\propto e^{st}` has :math:`s^2 + s G + A`
singular, and Z is the first-order matrix of the same motion in displacements and velocities,

.. math:: Z = \begin{pmatrix} 0 & 1 \\ -A & -G \end{pmatrix}, \qquad r = \begin{pmatrix} x \\ s x \end{pmatrix},
          \qquad l = \begin{pmatrix} (s + G)^H y \\ y \end{pmatrix},

with right vectors :math:`Z r = s r`, left ones :math:`l^H Z = s\, l^H`. Motion grows where :math:`\mathrm{Re}\, s > 0`.
:math:`(Z - \sigma)^{-1}` takes a factorisation of :math:`\sigma^2 + \sigma G + A`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar, cast

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse import csc_array, csr_array, eye_array

from ..arrays import Floats, Matrix
from ..factors.sparse_lu import SingularMatrixError, general_lu, symmetric_lu
from ..has_configuration import HasConfiguration
from ..motion.eigenvalues import mass_weighted, unit_rounding
from ..operators.damping import damping_matrix
from ..operators.stiffness import stiffness_matrix
from .limits import LIMITS, Limits

AnyConfiguration = TypeVar("AnyConfiguration", bound=HasConfiguration)


@dataclass(frozen=True, eq=False)
class Inverse:
    """The inverse of Z - sigma, or of a matrix like it: `solve` is (vectors, adjoint) -> its product with vectors.

    Sparse factors are not exact, being without pivoting or of another load: residuals make up for that.
    """

    solve: Callable[[Any, bool], Any]
    exact: bool


@dataclass(frozen=True, eq=False)
class System:
    """Z at one load, on n coordinates that do not depend on the load.

    Attributes
    ----------
    fx : float
        The load, force per top disk.
    stiffness : scipy.sparse.csr_array or ndarray, shape (n, n)
        A, 1 / time^2, with its zero rows. Of a few dozen coordinates dense matrices take less time.
    damping : scipy.sparse.csr_array, ndarray or None, shape (n, n)
        G, 1 / time; None without dissipation.
    balance : float
        Error of fx that goes with the packing's residual, force.
    states : bytes
        What A is smooth with: where it changes, A bends.
    """

    fx: float
    stiffness: Any = field(repr=False)
    damping: Any = field(default=None, repr=False)
    balance: float = field(default=0.0, kw_only=True)
    states: bytes = field(default=b"", repr=False, kw_only=True)

    @classmethod
    def of(cls, packing: HasConfiguration, dissipation: bool = False, limits: Limits = LIMITS) -> "System":
        """The system of a packing, without the contacts whose force is unknown."""
        bearing = force_bearing(packing, limits)
        stiffness = mass_weighted(stiffness_matrix(bearing), bearing)
        damping = mass_weighted(damping_matrix(bearing), bearing) if dissipation else None
        return cls(packing.fx, stiffness, damping, balance=packing.load_error, states=bearing.contact_states)

    @property
    def dissipative(self) -> bool:
        """Whether there is dissipation."""
        return self.damping is not None

    @property
    def matrices(self) -> tuple[Any, ...]:
        """A and, with dissipation, G."""
        return (self.stiffness,) if self.damping is None else (self.stiffness, self.damping)

    @cached_property
    def transposed(self) -> tuple[Any, ...]:
        """The transposes of `matrices`."""
        return tuple(each.T for each in self.matrices)

    @property
    def size(self) -> int:
        """Rows of Z."""
        return len(self.matrices) * self.stiffness.shape[0]

    @cached_property
    def rounding(self) -> float:
        """u |Z|_F: uncertainty of a perfectly conditioned eigenvalue, with dissipation in coordinates of the energy."""
        if self.damping is None:
            return unit_rounding(entries(self.stiffness))
        squares = 2 * np.abs(self.stiffness.diagonal()).sum() + np.sum(entries(self.damping) ** 2)
        return unit_rounding(np.sqrt(squares))

    @cached_property
    def backward_error(self) -> float:
        """u |Z|_F in displacements and velocities, the measure of residuals."""
        if self.damping is None:
            return self.rounding
        squares = self.stiffness.shape[0] + sum(float(np.sum(entries(each) ** 2)) for each in self.matrices)
        return unit_rounding(np.sqrt(squares))

    def image(self, vectors: Any, adjoint: bool = False) -> Any:
        """Z or Z^H times some vectors in columns."""
        matrices = self.transposed if adjoint else self.matrices
        if len(matrices) == 1:
            return matrices[0] @ vectors
        (first, second), (a, g), image = halves(vectors), matrices, np.empty_like(vectors)
        upper, lower = halves(image)
        if adjoint:
            upper[:], lower[:] = -(a @ second), first - g @ second
        else:
            upper[:], lower[:] = second, -(a @ first) - g @ second
        return image

    def change(self, other: "System", vectors: Any) -> Any:
        """Z of another load less Z of this one, times some vectors."""
        change = [there - here for here, there in zip(self.matrices, other.matrices, strict=True)]
        if len(change) == 1:
            return change[0] @ vectors
        (first, second), image = halves(vectors), np.zeros_like(vectors)
        halves(image)[1][:] = -(change[0] @ first) - change[1] @ second
        return image

    def towards(self, other: "System", share: float) -> "System":
        """The system at a share of the straight line to another one."""
        matrices = [
            (1 - share) * here + share * there for here, there in zip(self.matrices, other.matrices, strict=True)
        ]
        return System((1 - share) * self.fx + share * other.fx, *matrices, balance=max(self.balance, other.balance))

    def in_units_of(self, unit: float) -> "System":
        """The system with A in a unit, 1 / time^2, that is a power of four: no digit changes."""
        damping = None if self.damping is None else self.damping / np.sqrt(unit)
        return replace(self, stiffness=self.stiffness / unit, damping=damping)

    def inverse(self, shift: complex, limits: Limits = LIMITS) -> Inverse | None:
        """The inverse of Z - shift; None if that is singular."""
        return self._inverse_of_operator(shift, limits) if self.damping is None else self._inverse_of_first_order(shift)

    def _inverse_of_operator(self, shift: complex, limits: Limits) -> Inverse | None:
        size = self.stiffness.shape[0]
        if size > limits.dense_factors:
            try:
                sparse = symmetric_lu(csc_array(self.stiffness - shift * eye_array(size)))
            except SingularMatrixError:
                return None
            return Inverse(lambda b, turned: sparse.solve(np.ascontiguousarray(b), trans="H" if turned else "N"), False)
        dense = _dense_factors(to_dense(self.stiffness) - shift * np.eye(size))
        return None if dense is None else Inverse(dense, True)

    def _inverse_of_first_order(self, shift: complex) -> Inverse | None:
        assert self.damping is not None
        a, g, mirror = self.stiffness, self.damping, np.conj(shift)
        if isinstance(a, np.ndarray):
            solve_quadratic = _dense_factors(a + shift * g + shift**2 * np.eye(len(a)))
            if solve_quadratic is None:
                return None
        else:
            solve_quadratic = _sparse_factors(csc_array(a + shift * g + shift**2 * eye_array(a.shape[0])))
        transposed = self.transposed[1]

        def solve(vectors: Any, adjoint: bool) -> Any:
            first, second = halves(np.asarray(vectors, complex))
            solution = np.empty_like(vectors, dtype=complex)
            upper, lower = halves(solution)
            if adjoint:
                lower[:] = -solve_quadratic(first + mirror * second, True)
                upper[:] = second + transposed @ lower + mirror * lower
            else:
                upper[:] = -solve_quadratic(second + g @ first + shift * first, False)
                lower[:] = first + shift * upper
            return solution

        return Inverse(solve, True)


def _dense_factors(matrix: Any) -> Callable[[Any, bool], Any] | None:
    """Solutions with a matrix or its adjoint; None if it is singular."""
    factors = lu_factor(matrix, check_finite=False)
    if not np.all(np.diag(factors[0])):
        return None
    return lambda b, adjoint: lu_solve(factors, b, trans=2 * adjoint, check_finite=False)


def _sparse_factors(matrix: csc_array) -> Callable[[Any, bool], Any]:
    """Solutions with a matrix or its adjoint; a singular matrix gets a rounding on its diagonal."""
    try:
        factors = general_lu(matrix)
    except SingularMatrixError:
        rounding = np.finfo(float).eps * np.abs(matrix.data).max()
        factors = general_lu(csc_array(matrix + rounding * eye_array(matrix.shape[0])))
    return lambda b, adjoint: factors.solve(b, trans="H" if adjoint else "N")


def entries(matrix: Matrix) -> Any:
    """The entries of a matrix, without the zeros of a sparse one."""
    return matrix if isinstance(matrix, np.ndarray) else matrix.data


def to_dense(matrix: Matrix) -> Floats:
    """A matrix as an array."""
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def halves(vectors: Any) -> tuple[Any, Any]:
    """Displacements and velocities of right or left states in columns."""
    size = len(vectors) // 2
    return vectors[:size], vectors[size:]


def unit_of(system: System) -> float:
    """A power of four of the size of the largest element of A, 1 / time^2.

    A search divides A by this unit: its screens square A in single precision, which goes from 1e-38 to 1e38.
    """
    largest = float(np.abs(entries(system.stiffness)).max(initial=0.0))
    return 4.0 ** int(np.floor(0.5 * np.log2(largest))) if largest > 0 else 1.0


def full_operator(packing: HasConfiguration, limits: Limits = LIMITS) -> csr_array:
    """A = M^(-1/2) K M^(-1/2) of the contacts that bear a force, of all coordinates, with its zero rows; 1 / time^2."""
    return System.of(packing, limits=limits).stiffness


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
