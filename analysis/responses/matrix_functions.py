r"""Functions f(A, t) of a matrix with eigenvalues that nearly coalesce.

An eigen-decomposition :math:`f(A) = X f(\Lambda) X^{-1}` loses the digits of
:math:`\kappa = 1/|y^H x|`, all of them at an exceptional point. Pairs with a small :math:`|y^H x|` are
therefore not diagonalised: an ordered Schur form puts such a pair first, a Sylvester equation decouples its 2 x
2 block B from the rest, and both steps stay well conditioned while the two eigenvectors become one. There
:math:`B = m + N` with tr N = 0 and :math:`N^2 = \tfrac14(\lambda_1 - \lambda_2)^2`, hence

.. math:: f(B) = \tfrac12 [f(\lambda_1) + f(\lambda_2)] + f[\lambda_1, \lambda_2]\, N .

The divided difference :math:`f[\lambda_1, \lambda_2]` is the quotient of the differences if the two motions have
separated. Otherwise it is Cauchy's integral on a circle around both eigenvalues, a sum of values of f. Stepping with
``expm`` of the first-order system would be as stable, but it needs a step of a matrix of twice the size for each time,
and rounds in each step.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eig, schur, solve_sylvester

from ..motion.eigenvalues import Complexes
from ..packing.packing import Floats, Indices

LONE_COSINE = 0.1
"""Eigenvalues with a smaller |y^H x| are kept together with their partner; eigenvalues with a larger |y^H x| lose at
most one digit."""

LEAST_COSINE = 1e-3
"""Where no plane of two eigenvectors can be set apart, as among the modes of overdamped motions, which are oblique
without being close to each other, eigenvectors serve that lose no more digits than this |y^H x|."""

CIRCLE_SHARE = 0.1
"""Half the distance of two eigenvalues, in units of the circle's radius, up to which Cauchy's integral is used.
The quotient of differences loses a digit there, and the integral over `CIRCLE_POINTS` points has an error of
CIRCLE_SHARE^CIRCLE_POINTS."""

CIRCLE_POINTS = 16
"""Points on the circle."""

Function = Callable[[Complexes, Floats], Sequence[Complexes]]
"""(eigenvalues, times) -> some arrays, entire in the eigenvalue."""

CircleRadius = Callable[[complex, Floats], Floats]
"""(eigenvalue, times) -> how far the eigenvalue may move while its motion grows by no more than a factor e."""


def second_order(middle: complex, time: Floats) -> Floats:
    """The reach of an eigenvalue lambda of x'' = -lambda x."""
    inverse = 1 / np.where(time > 0, time, 1.0)  # frequencies on this circle are 1/t from the centre's
    return np.asarray(inverse * (2 * np.sqrt(abs(middle)) + inverse))


def first_order(middle: complex, time: Floats) -> Floats:
    """The reach of an eigenvalue s of x' = s x."""
    return np.asarray(1 / np.where(time > 0, time, 1.0))


@dataclass(frozen=True, eq=False)
class BlockDiagonal:
    """A matrix as A = X diag(lambda.., B_1, B_2, ..) X^(-1) with well-conditioned X.

    Attributes
    ----------
    basis, inverse : ndarray of complex, shape (n, n)
        X and its inverse.
    values : ndarray of complex, shape (n,)
        Eigenvalues, 1 / time^2, in the order of the columns of X.
    blocks : dict of int to ndarray of complex, shape (2, 2)
        Upper triangular blocks of coalescing pairs, by the first of their two columns.
    reach : callable
        Radius of Cauchy's circle, `second_order` or `first_order`: what the eigenvalues are to a motion.
    """

    basis: Complexes
    inverse: Complexes
    values: Complexes
    blocks: dict[int, Complexes]
    reach: CircleRadius = second_order

    @classmethod
    def of(cls, matrix: ArrayLike, reach: CircleRadius = second_order) -> "BlockDiagonal":
        """Decompose a square matrix.

        Parameters
        ----------
        matrix : array_like, shape (n, n)
            A, real or complex, 1 / time^2.
        reach : callable
            `first_order` for the matrix of a first-order system, 1 / time.

        Returns
        -------
        BlockDiagonal

        Raises
        ------
        numpy.linalg.LinAlgError
            If more than two eigenvalues coalesce: a family of one parameter does not meet such a point.
        """
        rest = np.asarray(matrix)
        size = len(rest)
        basis, inverse = np.eye(size, dtype=np.complex128), np.eye(size, dtype=np.complex128)
        values, blocks, done = np.zeros(size, np.complex128), {}, 0
        while done < size:
            found, left, right = eig(rest, left=True, right=True)
            overlap = np.abs(np.sum(left.conj() * right, axis=0))
            worst = int(np.argmin(overlap))
            parallel = np.abs(right[:, worst].conj() @ right)
            parallel[worst] = 0.0
            pair = [worst, int(np.argmax(parallel))]
            parts = _split_off_pair(rest, found, pair) if overlap[worst] < LONE_COSINE else None
            if parts is None:
                if overlap[worst] < LEAST_COSINE:
                    raise np.linalg.LinAlgError(f"more than two eigenvalues coalesce near {found[worst]:.6g}")
                basis[:, done:] = basis[:, done:] @ right
                inverse[done:] = np.linalg.solve(right, inverse[done:])
                values[done:] = found
                break
            block, rest, turn, back = parts
            basis[:, done:] = basis[:, done:] @ turn
            inverse[done:] = back @ inverse[done:]
            values[done : done + 2] = np.diag(block)
            blocks[done] = block
            done += 2
        return cls(basis, inverse, values, blocks, reach)

    def apply(
        self, function: Function, time: Floats, vector: Floats, observed: Floats | None = None
    ) -> list[Complexes]:
        """f(A, t) b for every time.

        Parameters
        ----------
        function : callable
            (lambda, t) -> some arrays, entire in lambda.
        time : ndarray, shape (T,)
            Times.
        vector : ndarray, shape (n,)
            b.
        observed : ndarray, shape (m, n), optional
            Only O f(A, t) b is wanted, which is cheaper; all n coordinates by default.

        Returns
        -------
        list of ndarray, shape (T, m) or (T, n)
            Of what the function returns; real to rounding if A, b and O are.
        """
        weight = self.inverse @ vector
        parts = [part * weight for part in function(self.values, time[:, None])]
        for column, cores in self._cores(function, time):
            pair = slice(column, column + 2)
            for part, core in zip(parts, cores, strict=True):
                part[:, pair] = core @ weight[pair]
        basis = self.basis if observed is None else observed @ self.basis
        return [part @ basis.T for part in parts]

    def between(self, function: Function, time: Floats, left: Complexes, right: Complexes) -> Complexes:
        """L F(t) R of f(A, t) = X F(t) X^(-1) for every time, shape (T, a, b).

        Parameters
        ----------
        function, time
            As of `apply`; of what the function returns, the first array is taken.
        left : ndarray, shape (a, n)
            L, a column for each column of X.
        right : ndarray, shape (n, b)
            R.
        """
        factor = function(self.values, time[:, None])[0]
        for column in self.blocks:
            factor[:, column : column + 2] = 0.0
        found = (factor[:, None, :] * left) @ right
        for column, cores in self._cores(function, time):
            pair = slice(column, column + 2)
            found += left[:, pair] @ cores[0] @ right[pair]
        return np.asarray(found)

    def some(self, columns: Indices) -> "BlockDiagonal":
        """Some of the columns of X and rows of its inverse, in ascending order, both of a pair or none."""
        blocks = {int(np.searchsorted(columns, k)): block for k, block in self.blocks.items() if k in columns}
        return BlockDiagonal(self.basis[:, columns], self.inverse[columns], self.values[columns], blocks, self.reach)

    def oscillation_modes(self) -> "BlockDiagonal":
        """The modes of the system (z, z')' = ((0, 1), (-A, 0)) (z, z'), which has the rates +-i sqrt(A).

        Raises
        ------
        numpy.linalg.LinAlgError
            If an eigenvalue is zero: a motion that no force opposes does not oscillate.
        """
        if not np.all(self.values):
            raise np.linalg.LinAlgError("a motion that no force opposes does not oscillate")
        root = 1j * np.sqrt(self.values)
        rate, inverse = np.diag(root), np.diag(1 / root)
        blocks = {}
        for column, block in self.blocks.items():
            pair = slice(column, column + 2)
            rate[pair, pair] = blocks[column] = 1j * _root(block)
            inverse[pair, pair] = np.linalg.inv(blocks[column])
        turned, back = self.basis @ rate, inverse @ self.inverse
        size = len(root)
        outward: Complexes = np.block([[self.basis, self.basis], [turned, -turned]])
        inward: Complexes = np.block([[self.inverse, back], [self.inverse, -back]])
        return BlockDiagonal(
            outward,
            0.5 * inward,
            np.concatenate([root, -root]),
            blocks | {column + size: -block for column, block in blocks.items()},
            first_order,
        )

    def _cores(self, function: Function, time: Floats) -> Iterator[tuple[int, list[Complexes]]]:
        """The functions of each 2 x 2 block, shape (T, 2, 2), by its first column."""
        unit = np.eye(2)
        for column, block in self.blocks.items():
            first, second = np.diag(block)
            traceless = block - 0.5 * (first + second) * unit
            mean = [0.5 * part for part in map(np.add, function(first, time), function(second, time))]
            slope = _divided_difference(function, first, second, time, self.reach(0.5 * (first + second), time))
            parts = zip(mean, slope, strict=True)
            yield column, [np.multiply.outer(a, unit) + np.multiply.outer(b, traceless) for a, b in parts]


def _root(block: Complexes) -> Complexes:
    """The square root of an upper triangular 2 x 2 matrix with eigenvalues off the negative axis."""
    first, second = np.sqrt(np.diag(block))
    return np.array([[first, block[0, 1] / (first + second)], [0.0, second]])


def _split_off_pair(
    rest: NDArray, values: Complexes, pair: list[int]
) -> tuple[Complexes, Complexes, Complexes, Complexes] | None:
    """Block of a pair, the rest, and the transformation to both with its inverse; None if the rest comes too close."""
    triangle, unitary, count = schur(
        rest, output="complex", sort=lambda value: int(np.argmin(np.abs(values - value))) in pair
    )
    turn, back = np.eye(len(rest), dtype=np.complex128), np.eye(len(rest), dtype=np.complex128)
    if len(rest) > 2:
        coupling = solve_sylvester(triangle[:2, :2], -triangle[2:, 2:], -triangle[:2, 2:])
        # Two planes that are nearly parallel: no better than the vectors that were to be avoided.
        if count != 2 or not np.linalg.norm(coupling) < LONE_COSINE**-2:
            return None
        turn[:2, 2:], back[:2, 2:] = coupling, -coupling
    return triangle[:2, :2], triangle[2:, 2:], unitary @ turn, back @ unitary.conj().T


def _divided_difference(
    function: Function, first: complex, second: complex, time: Floats, radius: Floats
) -> list[Complexes]:
    """f[first, second] of all that the function returns, at every time; with the radius of Cauchy's circle."""
    middle, half = 0.5 * (first + second), 0.5 * abs(first - second)
    offset = radius[:, None] * np.exp(2j * np.pi * np.arange(CIRCLE_POINTS) / CIRCLE_POINTS)
    near = half <= CIRCLE_SHARE * radius
    safe = first - second if first != second else 1.0
    with np.errstate(divide="ignore", invalid="ignore"):  # a point may hit an eigenvalue where it is not needed
        weight = offset / ((middle + offset - first) * (middle + offset - second))
    around = function(middle + offset, time[:, None])
    apart = map(np.subtract, function(np.asarray(first), time), function(np.asarray(second), time))
    return [
        np.where(near, np.mean(circle * weight, axis=1), difference / safe)
        for circle, difference in zip(around, apart, strict=True)
    ]
