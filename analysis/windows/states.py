r"""Eigenvalues and vectors of small motion at one load: all of them, or the few nearest to a point.

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
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, eig, eigvals, lu_factor, lu_solve
from scipy.sparse import csc_array, csr_array, eye_array

from ..arrays import Complexes, Floats
from ..factors.sparse_lu import SingularMatrixError, general_lu
from ..motion.eigenvalues import SAFETY
from .system import System

DENSE = 200
"""Rows of A or Z up to which LAPACK's eigenvalues, all of them, take no longer than the few next to a point."""

DENSE_FACTORS = 600
"""Coordinates up to which dense factors of A - sigma take less time than sparse ones."""


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

    @property
    def fx(self) -> float:
        """The load, force per top disk."""
        return self.system.fx

    @classmethod
    def of(cls, system: System) -> "Motions":
        """All motions, by LAPACK, but for coordinates that feel no force."""
        z = system.first_order
        values, left, right = eig(z, left=True, check_finite=False)
        overlap = np.abs(np.sum(left.conj() * right, axis=0))
        if system.damping is not None:
            half = len(z) // 2
            right, left = right[:half], left[half:]
        return cls._kept(system, values, right, left, overlap)

    @classmethod
    def none(cls, system: System) -> "Motions":
        """No motion at all."""
        nothing = np.zeros((system.stiffness.shape[0], 0))
        return cls(system, np.zeros(0, complex), nothing, nothing, np.zeros(0), np.zeros(0, bool), False)

    @classmethod
    def near(cls, system: System, points: Sequence[complex], counts: Sequence[int]) -> "Motions":
        """The motions nearest to some points, so many about each; LinAlgError if they do not converge.

        Right and left vectors come from two Krylov spaces. The left ones are turned to be dual to the right ones, which
        also tells which belongs to which where two motions nearly coalesce.
        """
        size, found = len(system.active), []
        for point, count in zip(points, counts, strict=True):
            inverse = Inverse(system, point)
            values, right = inverse.eigenpairs(count)
            others, left = inverse.eigenpairs(count, adjoint=True)
            apart = np.abs(values[:, None] - others.conj())
            common = apart.min(axis=1) < 1e-5 * np.abs(values), apart.min(axis=0) < 1e-5 * np.abs(others)
            if common[0].sum() != common[1].sum():
                raise LinAlgError("right and left vectors differ in number")
            values, right, left = values[common[0]], right[:, common[0]], left[:, common[1]]
            left = left @ np.linalg.inv(left.conj().T @ right).conj().T
            found.append((values, right, left))
        values, right, left = (np.concatenate(each, axis=-1) for each in zip(*found, strict=True))
        if system.damping is not None:
            right[:size] *= system.frequency  # to the vectors of Z, of displacements and velocities in one unit
            left[:size] /= system.frequency
        overlap = np.abs(np.sum(left.conj() * right, axis=0))
        overlap /= np.linalg.norm(left, axis=0) * np.linalg.norm(right, axis=0)
        _, once = np.unique(np.round(values / np.abs(values).max(), 9), return_index=True)
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
        values, x, y = (
            np.concatenate([each, each[..., pairs].conj()], axis=-1) for each in (self.values, self.right, self.left)
        )
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
    parts = 1 if system.damping is None else 2
    if parts * len(system.active) <= DENSE:
        return np.asarray(eigvals(system.first_order, check_finite=False))
    return Inverse(system, point).eigenpairs(count)[0]


def overlap_near(system: System, value: complex) -> float:
    """|y^H x| of the motion next to a value, with dissipation |y^H (2 s + G) x| / |2 s|, by inverse iteration."""
    inverse, size, shapes = Inverse(system, value), len(system.active), []
    for adjoint in (False, True):
        shape = np.random.default_rng(0).standard_normal(size)
        for _ in range(4):
            shape = inverse.solve(shape, adjoint)
            shape = shape / np.linalg.norm(shape)
        shapes.append(shape)
    x, y = shapes
    if system.damping is None:
        return float(abs(np.vdot(y, x)))
    return float(abs(np.vdot(y, 2 * inverse.shift * x + inverse.damping @ x)) / abs(2 * inverse.shift))


class Inverse:
    """(A - sigma)^(-1) or (Z - sigma)^(-1) next to a point, from factors of A - sigma or sigma^2 + sigma G + A.

    Here Z is that of displacements x and velocities s x, in the scene's own units.
    """

    def __init__(self, system: System, point: complex) -> None:
        self.system, parts = system, 1 if system.damping is None else 2
        unit = system.frequency ** (2 / parts)
        self.shift = shift = point * (1 + 1e-9) + 1e-9 * unit  # no eigenvalue to the last digit
        active = system.active
        a = csr_array(system.stiffness)[active][:, active]
        size = a.shape[0]
        self.size = parts * size
        if system.damping is None:
            matrix = a - shift * eye_array(size)
        else:
            self.damping = csr_array(system.damping)[active][:, active]
            matrix = a + shift * self.damping + shift**2 * eye_array(size)
        if size <= DENSE_FACTORS:
            dense = lu_factor(matrix.toarray(), overwrite_a=True, check_finite=False)
            self._solve = lambda b, adjoint: lu_solve(dense, b, trans=2 * adjoint, check_finite=False)
        else:
            try:
                sparse = general_lu(csc_array(matrix))
            except SingularMatrixError:
                sparse = general_lu(csc_array(matrix + 1e-15 * abs(matrix).max() * eye_array(size)))
            self._solve = lambda b, adjoint: sparse.solve(np.asarray(b, matrix.dtype), trans="H" if adjoint else "N")

    def solve(self, vector: Any, adjoint: bool = False) -> Any:
        """(A - sigma)^(-1) or (sigma^2 + sigma G + A)^(-1), or its adjoint, times a vector."""
        return self._solve(vector, adjoint)

    def _first_order(self, state: Any, adjoint: bool) -> Any:
        (first, second), shift = np.split(state, 2), self.shift
        if adjoint:
            lower = -self.solve(first + np.conj(shift) * second, True)
            return np.concatenate([second + self.damping.T @ lower + np.conj(shift) * lower, lower])
        upper = -self.solve(second + self.damping @ first + shift * first)
        return np.concatenate([upper, first + shift * upper])

    def eigenpairs(self, count: int, adjoint: bool = False) -> tuple[Complexes, Any]:
        """The nearest eigenvalues with right vectors, or those of the adjoint (ARPACK); LinAlgError if they do not
        converge."""
        from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

        kind = float if self.system.damping is None else complex
        apply = self.solve if self.system.damping is None else self._first_order
        operator = LinearOperator((self.size,) * 2, matvec=lambda state: apply(state.ravel(), adjoint), dtype=kind)
        start = np.random.default_rng(0).standard_normal(self.size).astype(kind)
        try:
            inverse, vectors = eigs(operator, k=min(count, self.size - 2), v0=start)
        except ArpackError as error:
            raise LinAlgError("the eigenvalues next to a point do not converge") from error
        shift = np.conj(self.shift) if adjoint else self.shift
        return np.asarray(shift + 1 / inverse, complex), vectors
