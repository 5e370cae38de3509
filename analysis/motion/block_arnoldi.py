r"""Eigenvalues next to a shift, with right and left vectors, by a block Arnoldi iteration with the inverse.

In the block Krylov space of :math:`(A - \sigma)^{-1}` the eigenvalues :math:`\lambda` closest to :math:`\sigma` come
first: they are the largest :math:`\theta = 1/(\lambda - \sigma)` of the projection H. A residual r of the inverse
changes :math:`\lambda` by :math:`\kappa\, r / |\theta|^2` at the most to first order. `ShiftedDisc` has all
eigenvalues up to the first one that has not converged.

**Vectors.** The left vectors are the right ones of :math:`A^T`, from a second space with the same factors. Of two
eigenvalues that nearly coalesce the vectors are nearly parallel, and uncertain; the planes of both are not. So vectors
come from the invariant subspaces of many eigenvalues: with orthonormal bases V of the right one and U of the left one,
all that is wanted is in the small matrix :math:`B = (U^T V)^{-1} U^T A V`, whose error is the product of the errors of
V and U (Stewart and Sun, *Matrix Perturbation Theory*, 1990, ch. V).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, schur
from scipy.sparse import csc_array, eye_array

from ..arrays import Complexes, Floats
from ..errors import FaultgougeError
from ..factors.lanczos import BlockKrylov
from ..factors.sparse_lu import Factors, general_lu
from .modes import Modes

ROOM = 1.06
"""Vectors of the next space, in units of those that would have been enough for the last one."""


class SpectrumError(FaultgougeError):
    """Eigenvalues were not found: one sentence."""


class Krylov(BlockKrylov):
    """A space with vectors and subspaces of single eigenvalues."""

    def vector(self, wanted: complex) -> Complexes:
        """The vector of the space that belongs to one eigenvalue of H, by inverse iteration."""
        shifted = self.square - wanted * (1 + np.finfo(float).eps) * np.eye(self.used)
        found = np.ones(self.used, complex)
        for _ in range(2):
            found = np.linalg.solve(shifted, found)
            found /= np.linalg.norm(found)
        return np.asarray(self.basis[: self.used].T @ found)

    def subspace(self, wanted: Complexes) -> Floats:
        """An orthonormal basis of the invariant subspace of some eigenvalues of H, closed under conjugation."""
        from scipy.optimize import linear_sum_assignment

        every = np.linalg.eigvals(self.square)
        distance = np.abs(wanted[:, None] - every)
        chosen = every[linear_sum_assignment(distance)[1]]
        others = np.setdiff1d(every, chosen)

        def is_chosen(real: float, imaginary: float) -> bool:
            value = complex(real, imaginary)
            return bool(np.abs(chosen - value).min() < np.abs(others - value).min(initial=np.inf))

        apart = f"{len(wanted)} eigenvalues are not set apart from {len(others)} others of one space"
        try:
            _, vectors, count = schur(self.square, output="real", sort=is_chosen, check_finite=False)
        except np.linalg.LinAlgError as error:  # rounding has moved one of a cluster
            raise SpectrumError(apart) from error
        if count != len(wanted):
            raise SpectrumError(apart)
        return np.asarray(self.basis[: self.used].T @ vectors[:, :count])


@dataclass(frozen=True)
class Reach:
    """What a disc has to hold.

    Attributes
    ----------
    low, high : float
        Real parts.
    beyond : float
        Radius, in units of the distance of the farther of these.
    accuracy : float
        Error of an eigenvalue at the most.
    most : int
        Vectors of a space at the most.
    """

    low: float
    high: float
    beyond: float
    accuracy: float
    most: int

    def radius(self, shift: float, values: Complexes) -> float:
        """Radius about a shift within which all eigenvalues with these real parts lie, given those that are known."""
        inside = values[(values.real >= self.low) & (values.real <= self.high)]
        height = 1.5 * float(np.abs(inside.imag).max(initial=0.0))
        return float(np.hypot(self.beyond * max(self.high - shift, shift - self.low), height))


@dataclass(frozen=True, eq=False)
class ShiftedDisc:
    """What is known about a shift.

    Attributes
    ----------
    shift : float
    radius : float
        All eigenvalues that are closer are known.
    values : ndarray of complex, shape (k,)
        These.
    overlap : ndarray, shape (k,)
        |y^H x|, as the space has it.
    krylov : Krylov
    """

    matrix: csc_array
    factors: Factors
    shift: float
    radius: float
    values: Complexes
    overlap: Floats
    krylov: Krylov

    @classmethod
    def about(
        cls, matrix: csc_array, shift: float, reach: Reach, block: int, first: int, seed: int = 0
    ) -> "ShiftedDisc":
        """The eigenvalues about a shift.

        Parameters
        ----------
        matrix : scipy.sparse.csc_array, shape (n, n)
            A, its coordinates in the order of elimination.
        shift : float
        reach : Reach
        block, first : int
            Vectors of a block, and vectors of the space before its eigenvalues are looked at.
        seed : int
            Of the first block.

        Raises
        ------
        SpectrumError
            If the largest space does not hold them.
        """
        factors = general_lu(csc_array(matrix - shift * eye_array(matrix.shape[0])), ordered=True)
        start = np.random.default_rng(seed)
        krylov = Krylov(factors.solve, start.standard_normal((block, matrix.shape[0])), reach.most)
        while True:
            krylov.extend(first)
            values, overlap, errors = ritz_values(krylov, shift)
            failed = np.flatnonzero(errors > reach.accuracy * overlap)
            count = int(failed[0]) if len(failed) else len(values)
            radius = abs(values[count - 1] - shift) if count else 0.0
            if radius >= reach.radius(shift, values[:count]) or (krylov.full and count == matrix.shape[0]):
                return cls(matrix, factors, shift, float(radius), values[:count], overlap[:count], krylov)
            if krylov.full:
                raise SpectrumError(
                    f"a space of {krylov.used} vectors about {shift:.6g} does not hold the eigenvalues from "
                    f"{reach.low:.6g} to {reach.high:.6g}"
                )
            # the radius grows as the space does
            first = int(krylov.used * min(1.5, max(1.05, reach.radius(shift, values[:count]) / max(radius, 1e-300))))

    def enough(self, reach: Reach) -> int:
        """Vectors that would have been enough for what a disc has to hold, and a few more, as looks cost more."""
        return int(ROOM * self.krylov.used * min(1.0, reach.radius(self.shift, self.values) / self.radius))

    def marked(self, chosen: NDArray[np.bool_], accuracy: float) -> Modes:
        """Some of the eigenvalues, closed under conjugation, with right and left vectors.

        Raises
        ------
        SpectrumError
            If the left vectors are not found.
        """
        wanted = self.values[chosen]
        theta = 1 / (wanted - self.shift)
        right = self.krylov.subspace(theta)
        mirror = self._left_space(right, wanted, accuracy)
        left = mirror.subspace(theta)
        both = left.T @ right
        small = np.linalg.solve(both, left.T @ (self.matrix @ right))
        values, y, x = eig(small, left=True, right=True)
        x, y = right @ x, left @ np.linalg.solve(both.T, y)
        return Modes(values, x / np.linalg.norm(x, axis=0), y / np.linalg.norm(y, axis=0))

    def _left_space(self, right: Floats, wanted: Complexes, accuracy: float) -> Krylov:
        """The space of the transposed inverse, until it has the eigenvalues that are wanted."""
        from scipy.optimize import linear_sum_assignment

        block = self.krylov.block
        # few left vectors are next to what the right space has
        start = right.T if right.shape[1] <= block else np.random.default_rng(1).standard_normal((block, len(right)))
        krylov = Krylov(lambda columns: self.factors.solve(columns, trans="T"), start, self.krylov.most)
        first = min(self.krylov.used, 6 * len(start)) if len(start) == len(wanted) else self.krylov.used * 3 // 4
        while True:
            krylov.extend(first)
            values, overlap, errors = ritz_values(krylov, self.shift)
            values = values[errors <= accuracy * overlap]
            if len(values) >= len(wanted):
                distance = np.abs(wanted[:, None] - values)
                near = distance[linear_sum_assignment(distance)]
                if near.max(initial=0.0) < np.sqrt(accuracy):
                    return krylov
            if krylov.full:
                raise SpectrumError(f"left vectors of eigenvalues about {self.shift:.6g} were not found")
            first = krylov.used * 5 // 4


def ritz_values(krylov: Krylov, shift: float) -> tuple[Complexes, Floats, Floats]:
    """Eigenvalues from a space of the inverse, the next to the shift first, their |y^H x|, and first-order errors."""
    theta, left, right = eig(krylov.square, left=True, right=True, check_finite=False)
    order = np.argsort(-np.abs(theta), kind="stable")
    theta, left, right = theta[order], left[:, order], right[:, order]
    overlap = np.abs(np.sum(left.conj() * right, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = krylov.residuals(right) / np.abs(theta) ** 2
        values = shift + 1 / theta
    return values, overlap, np.where(theta == 0, np.inf, errors)
