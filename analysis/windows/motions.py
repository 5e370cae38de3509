r"""Small motion at one load: the matrices A and G, their eigenvalues and vectors, all or the few nearest to a point.

Without dissipation these are the eigenvalues :math:`\lambda` of A with right vectors x and left vectors y. With
dashpots and drag small motion :math:`\propto e^{st}` has :math:`(s^2 + s G + A) x = 0` and
:math:`y^H (s^2 + s G + A) = 0`; the s are the eigenvalues of

.. math:: Z = \begin{pmatrix} 0 & \omega_0 \\ -A/\omega_0 & -G \end{pmatrix}, \qquad
          r = \begin{pmatrix} \omega_0 x \\ s x \end{pmatrix}, \qquad
          l = \begin{pmatrix} (s + G)^H y / \omega_0 \\ y \end{pmatrix},

where :math:`\omega_0^2` is the largest diagonal element of A. One of each two conjugates is kept. A load that changes A
and G by dA and dG moves an eigenvalue by

.. math:: \mathrm d\lambda = \frac{y^H\, \mathrm dA\, x}{y^H x}, \qquad
          \mathrm ds = - \frac{y^H (\mathrm dA + s\, \mathrm dG)\, x}{y^H (2 s + G)\, x} .
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, eig, eigvals
from scipy.sparse import csc_array, csr_array, eye_array, issparse

from ..arrays import Complexes, Floats, Indices
from ..factors.sparse_lu import SingularMatrixError, general_lu
from ..has_configuration import HasConfiguration
from ..motion.eigenvalues import SAFETY, mass_weighted, unit_rounding
from ..operators.damping import damping_matrix
from ..operators.stiffness import stiffness_matrix

DENSE = 200
"""Rows of A or Z up to which LAPACK's eigenvalues, all of them, take no longer than the few next to a point."""

AnyConfiguration = TypeVar("AnyConfiguration", bound=HasConfiguration)


def force_bearing(packing: AnyConfiguration) -> AnyConfiguration:
    """The packing without the contacts whose force is no more than the packing's own imbalance.

    A disk that only such contacts hold comes to rest just about touching. Its overlap is rounding noise, and with the
    overlap its stiffness, of order (residual / k_n)^(1/3): it differs from one equilibrium to the next, and would open
    and shut windows at random. Ten times the imbalance, as a disk may rest between two contacts without force whose
    forces cancel in part; and no more than 1e-6 of the largest force, so that a packing out of balance keeps contacts.
    """
    largest = packing.normal_force.max(initial=0.0)
    return cast(AnyConfiguration, packing.loaded(min(10 * packing.residual, 1e-6 * largest)))


@dataclass(frozen=True, eq=False)
class System:
    """Small motion at one load, on n coordinates that do not depend on the load.

    Attributes
    ----------
    fx : float
        The load, force per top disk.
    stiffness : scipy.sparse.csr_array or ndarray, shape (n, n)
        A = M^(-1/2) K M^(-1/2), 1 / time^2, with its zero rows.
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
    def of(cls, packing: HasConfiguration, dissipation: bool = False) -> "System":
        """The system of a packing, without the contacts whose force is unknown."""
        bearing = force_bearing(packing)
        stiffness = mass_weighted(stiffness_matrix(bearing), bearing)
        damping = mass_weighted(damping_matrix(bearing), bearing) if dissipation else None
        return cls(packing.fx, stiffness, damping, balance=packing.load_error, states=bearing.contact_states)

    @cached_property
    def active(self) -> Indices:
        """Coordinates that feel a force: the rows of A that are not zero."""
        rows = np.diff(self.stiffness.indptr) if issparse(self.stiffness) else self.stiffness.any(axis=1)
        return np.flatnonzero(rows)

    @cached_property
    def frequency(self) -> float:
        """The root of the largest diagonal element of A, radian / time."""
        return float(np.sqrt(np.abs(self.stiffness.diagonal()).max(initial=0.0))) or 1.0

    @property
    def inner(self) -> list[Any]:
        """A and, with dissipation, G on the active coordinates."""
        given = [self.stiffness] if self.damping is None else [self.stiffness, self.damping]
        return [each[self.active][:, self.active] for each in given]

    @property
    def first_order(self) -> Floats:
        """A or, with dissipation, Z of displacements and velocities, dense, on the active coordinates."""
        a, *g = (each.toarray() if issparse(each) else each for each in self.inner)
        if not g:
            return np.asarray(a)
        return np.block([[np.zeros_like(a), self.frequency * np.eye(len(a))], [-a / self.frequency, -g[0]]])

    @cached_property
    def rounding(self) -> float:
        """u |A|_F, or u |Z|_F: the uncertainty of a perfectly conditioned eigenvalue."""
        a, *g = (each.data if issparse(each) else np.ravel(each) for each in self.inner)
        if not g:
            return unit_rounding(a)
        return unit_rounding(np.concatenate([a / self.frequency, g[0], np.full(len(self.active), self.frequency)]))


@dataclass(frozen=True, eq=False)
class Motions:
    """Motions at one load, by increasing real part of lambda, or imaginary part of s; one of each two conjugates.

    Attributes
    ----------
    system : System
        A, and G with dissipation, at this load.
    values : ndarray of complex, shape (k,)
        lambda, 1 / time^2, or s, 1 / time, with an imaginary part that is not negative.
    right, left : ndarray, shape (n, k)
        Unit vectors x and y on all coordinates.
    overlap : ndarray, shape (k,)
        |y^H x|, with dissipation of the vectors of Z: zero at an exceptional point.
    grows : ndarray of bool, shape (k,)
        Which grow beyond rounding: complex lambda, or Re s > 0.
    whole : bool
        Whether these are all motions.
    """

    system: System
    values: Complexes
    right: Any
    left: Any
    overlap: Floats
    grows: NDArray[np.bool_]
    whole: bool = True

    @classmethod
    def of(cls, system: System) -> "Motions":
        """All motions, by LAPACK, but for coordinates that feel no force."""
        values, left, right = eig(system.first_order, left=True, check_finite=False)
        overlap = np.abs(np.sum(left.conj() * right, axis=0))
        size = len(system.active)
        return cls._kept(system, values, right[:size], left[-size:], overlap)

    @classmethod
    def near(cls, system: System, points: Sequence[tuple[complex, int]]) -> "Motions":
        """The motions nearest to some points, so many about each; LinAlgError if they do not converge.

        Right and left vectors come from two Krylov spaces. The left ones are turned to be dual to the right ones, which
        also tells which belongs to which where two motions nearly coalesce.
        """
        size = len(system.active)
        none = np.zeros((size if system.damping is None else 2 * size, 0))
        found: list[tuple[Any, Any, Any]] = [(np.zeros(0, complex), none, none)]
        for point, count in points:
            inverse = Inverse(system, point)
            (values, right), (others, left) = (inverse.eigenpairs(count, adjoint) for adjoint in (False, True))
            apart = np.abs(values[:, None] - others.conj())
            rows, columns = apart.min(axis=1) < 1e-5 * np.abs(values), apart.min(axis=0) < 1e-5 * np.abs(others)
            if rows.sum() != columns.sum():
                raise LinAlgError("right and left vectors differ in number")
            right, left = right[:, rows], left[:, columns]
            found.append((values[rows], right, left @ np.linalg.inv(left.conj().T @ right).conj().T))
        values, right, left = (np.concatenate(each, axis=-1) for each in zip(*found, strict=True))
        if system.damping is not None:
            right[:size] *= system.frequency  # to the vectors of Z, of displacements and velocities in one unit
            left[:size] /= system.frequency
        overlap = np.abs(np.sum(left.conj() * right, axis=0))
        overlap /= np.linalg.norm(left, axis=0) * np.linalg.norm(right, axis=0)
        _, once = np.unique(np.round(values / np.abs(values).max(initial=1e-300), 9), return_index=True)
        right, left = right[:size, once], left[-size:, once]
        return replace(cls._kept(system, values[once], right, left, overlap[once]), whole=False)

    @classmethod
    def _kept(cls, system: System, values: Any, right: Any, left: Any, overlap: Floats) -> "Motions":
        noise = SAFETY * system.rounding
        if system.damping is None:
            grows = values.imag * overlap > noise
            alone = np.abs(values.imag) * overlap <= noise  # both members of a pair that is noise are real
            kept = grows | alone
            values = np.where(alone, values.real, values)
            order = np.lexsort((values.imag, values.real))
        else:
            slow = np.abs(values) <= 1e-6 * system.frequency  # free motions: a double zero, to the root of rounding
            grows, kept = (values.real * overlap > noise) & ~slow, values.imag >= 0
            order = np.lexsort((values.real, values.imag))
        order = order[kept[order]]
        full = np.zeros((2, system.stiffness.shape[0], len(order)), np.result_type(right, left))
        full[0, system.active], full[1, system.active] = right[:, order], left[:, order]
        with np.errstate(divide="ignore", invalid="ignore"):
            full /= np.linalg.norm(full, axis=1)[:, None]
        return cls(system, np.asarray(values[order], complex), full[0], full[1], overlap[order], grows[order])

    def with_conjugates(self) -> tuple[Complexes, Any, Any]:
        """Eigenvalues with right and left vectors, both of each two conjugates, by real part."""
        pairs = np.flatnonzero(self.values.imag > 0)
        arrays = (self.values, self.right, self.left)
        values, x, y = (np.concatenate([each, each[..., pairs].conj()], axis=-1) for each in arrays)
        order = np.lexsort((values.imag, values.real))
        return values[order], x[:, order], y[:, order]

    def slopes(self, other: System) -> Complexes:
        """First-order change of each eigenvalue over the load, on the way to another load, shape (k,)."""
        x, y, here = self.right, self.left.conj(), self.system
        force, slant = (other.stiffness - here.stiffness) @ x, x
        if here.damping is not None:
            force = -(force + ((other.damping - here.damping) @ x) * self.values)
            slant = 2 * self.values * x + here.damping @ x
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.sum(y * force, axis=0) / np.sum(y * slant, axis=0) / (other.fx - here.fx)
        return np.nan_to_num(np.asarray(found, complex), nan=0.0, posinf=0.0, neginf=0.0)

    def alike(self, other: "Motions", rows: Any = slice(None), columns: Any = slice(None)) -> Floats:
        """|x^H x'| |y^H y'| of motions of two loads, shape (k, k')."""
        x, y = self.right[:, rows].conj().T, self.left[:, rows].conj().T
        return np.asarray(np.abs(x @ other.right[:, columns]) * np.abs(y @ other.left[:, columns]))


def eigenvalues_near(system: System, point: complex, count: int = 8) -> Complexes:
    """Eigenvalues next to a point, both of each two conjugates: all of them by LAPACK, or by shift and invert (ARPACK).

    Both are backward stable: what is a smooth function of the matrix, such as :math:`(\\lambda_1 - \\lambda_2)^2`, errs
    by rounding of A and not by its root.

    Parameters
    ----------
    system : System
        Of any size.
    point : complex
        1 / time^2, or 1 / time with dissipation; real without dissipation.
    count : int
        How many at least, as far as there are so many.

    Returns
    -------
    ndarray of complex, shape (k,)
    """
    if (1 if system.damping is None else 2) * len(system.active) <= DENSE:
        return np.asarray(eigvals(system.first_order, check_finite=False))
    return Inverse(system, point).eigenpairs(count)[0]


class Inverse:
    """(A - sigma)^(-1) or (Z - sigma)^(-1) next to a point, from factors of A - sigma or sigma^2 + sigma G + A.

    Here Z is that of displacements x and velocities s x, in the scene's own units; sigma is `shift`, and `damping` G.
    """

    def __init__(self, system: System, point: complex) -> None:
        unit = system.frequency**2 if system.damping is None else system.frequency
        self.shift = shift = point * (1 + 1e-9) + 1e-9 * unit  # no eigenvalue to the last digit
        self.size, one = len(system.active), eye_array(len(system.active))
        a, self.damping = (*map(csr_array, system.inner), None)[:2]
        matrix = a - shift * one if self.damping is None else a + shift * self.damping + shift**2 * one
        try:
            self._factors = general_lu(csc_array(matrix))
        except SingularMatrixError:
            self._factors = general_lu(csc_array(matrix + 1e-15 * abs(matrix).max() * one))
        self._number = matrix.dtype

    def solve(self, b: Any, adjoint: bool = False) -> Any:
        """(A - sigma)^(-1) or (sigma^2 + sigma G + A)^(-1), or its adjoint, times vectors."""
        return self._factors.solve(np.asarray(b, self._number), trans="H" if adjoint else "N")

    def eigenpairs(self, count: int, adjoint: bool = False) -> tuple[Complexes, Any]:
        """The nearest eigenvalues with right vectors, or those of the adjoint (ARPACK); LinAlgError if they do not
        converge."""
        from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

        solve, damping, shift = self.solve, self.damping, np.conj(self.shift) if adjoint else self.shift

        def apply(state: Any) -> Any:
            if damping is None:
                return solve(state.ravel(), adjoint)
            first, second = np.split(state.ravel(), 2)
            if adjoint:
                lower = -solve(first + shift * second, True)
                return np.concatenate([second + damping.T @ lower + shift * lower, lower])
            upper = -solve(second + damping @ first + shift * first)
            return np.concatenate([upper, first + shift * upper])

        size, kind = (self.size, float) if damping is None else (2 * self.size, complex)
        start = np.random.default_rng(0).standard_normal(size).astype(kind)
        try:
            inverse, vectors = eigs(LinearOperator((size, size), apply, dtype=kind), min(count, size - 2), v0=start)
        except ArpackError as error:
            raise LinAlgError("the eigenvalues next to a point do not converge") from error
        return np.asarray(shift + 1 / inverse, complex), vectors
