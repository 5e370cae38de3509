r"""The fastest growing motions of an operator of any size, by products with matrices alone.

Small motion after the time t is a function of the operator, in which what grows stands out. Without dissipation it is

.. math:: f = \cos(t \sqrt A) = J_0(z) + 2 \sum_k J_{2k}(z)\, T_k(1 - 2 A / L), \qquad z = t \sqrt L ,

with Bessel functions, Chebyshev polynomials and the largest eigenvalue L of A (Tal-Ezer and Kosloff, J. Chem. Phys. 81,
3967 (1984)). Every real positive eigenvalue of A gives one of f from -1 to 1. Growth at the rate g of the amplitude
gives one of modulus :math:`\sinh g t` or more. With dissipation the state (:math:`\sqrt L x`, v) obeys
:math:`\dot u = Z u`, and f is a power of :math:`e^{\tau Z} = \sum_k c_k J_k(\tau \sqrt L)\, P_k(Z/\sqrt L)` with
:math:`P_{k+1} = 2 Z P_k / \sqrt L + P_{k-1}`: a motion gives :math:`e^{s t}`, of modulus 1 at the most unless it grows.
Dissipation makes the terms larger than the sum, so that :math:`\tau` is short where dissipation is strong.

A block Krylov space of f has the eigenvalues of the largest modulus first: the fastest growing motions. The eigenvalues
of A, or of Z, are those of the projection on their invariant subspace, with the residuals of A or Z itself. The time is
tripled as long as nothing has grown enough to be seen. Memory is proportional to the number of coordinates, and the
computing time to the number of coordinates and of products.

**Without convergence.** If many motions grow nearly alike, the search may end before it has converged. That motion
grows is then certain, but the eigenvalues of a mixture of motions may be wrong by a factor of two. So the mixture is
followed for some more times t. The mixture grows nearly as fast as its fastest motion, and never faster: its rate is a
lower bound.

**What is left out.** After j blocks a motion whose share in the random start is not below :math:`\delta / \sqrt n`
appears with an error of 1 % where :math:`T_j(|f|)`, or :math:`|f|^j` with dissipation, is
:math:`200 \sqrt n / \delta`. With :math:`\delta = 10^{-3}` and some twenty blocks, nothing else grows at a rate of more
than about 3/t, in the square of the amplitude. This counts every motion as well conditioned; and a start may be unlucky
with the probability :math:`\delta`. So this is no proof.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, qr
from scipy.sparse import bsr_array, csr_array
from scipy.sparse.linalg import eigs

from ..arrays import Complexes, Floats
from ..errors import BadInputError
from ..factors.lanczos import DEPENDENT
from ..progress import report_progress
from .block_arnoldi import Krylov

BLOCK = 4
"""Vectors of a start for two motions, and half of those for many. What grows alike, as in a crystal, needs several."""

MOST_BLOCKS = 30
"""Blocks of a space at the most."""

FIRST_BLOCKS = 12
"""Blocks before the eigenvalues are looked at, and of a time at which nothing is seen to grow."""

TRIPLE = 3.0
"""Factor from one time to the next."""

EIGENVALUE_MARGIN = 1.03
"""By how much the largest eigenvalue is taken larger, of which Arnoldi's iteration misses a hundredth."""

CHANCE = 1e-3
"""Probability that a motion is overlooked: its share in the start is smaller then."""

APPEARS = 1e-2
"""Error with which a motion appears in a space."""

CONVERGED = 1e-5
"""Relative residual of eigenvalues with which the search ends."""

GROWTH_OVER_RESIDUAL = 10.0
"""Growth over what the residual may change, from which an eigenvalue is a growing one when the search ends otherwise.
Many motions that grow nearly alike converge slowly."""

FOLLOWED = 4
"""Times t that a motion is followed whose eigenvalue has not converged; it grows evenly after the first."""

CANCELLATION = 12.0
"""Logarithm of the largest term of the exponential over the sum: five digits are lost."""


@dataclass(frozen=True, eq=False)
class FastestGrowth:
    """The fastest growing motions that were found, each for certain, and what may grow besides.

    Attributes
    ----------
    rates : ndarray, shape (k,)
        2 |Im sqrt(lambda)|, or 2 Re s with dissipation, 1 / time, the fastest first: D grows as exp(rate t).
    values : ndarray of complex, shape (k,)
        The eigenvalues lambda of A, 1 / time^2, or s of the motion with dissipation, 1 / time; of each pair the one
        with the positive imaginary part.
    residuals : ndarray, shape (k,)
        |A x - lambda x| / |lambda| of unit vectors, or |Z u - s u| / |s|.
    vectors : ndarray of complex, shape (n, k)
        Displacements, in the coordinates of A.
    time : float
        t, the longest time that was looked at.
    limit : float
        Nothing else is likely to grow at a larger rate, 1 / time; see the module.
    least : float
        What the fastest motion grows at at least, 1 / time: its rate, or, where the search ends before that has
        converged, the least rate at which the motion was seen to grow over a time t; zero if none was found.
    products : int
        Products of a matrix with a vector.
    """

    rates: Floats
    values: Complexes
    residuals: Floats
    vectors: Complexes
    time: float
    limit: float
    least: float
    products: int

    @property
    def converged(self) -> bool:
        """Whether the fastest motion is known as precisely as asked; otherwise only that it grows, at `least`."""
        return not len(self.residuals) or bool(self.residuals[0] <= CONVERGED)


def fastest_growing(
    matrix: csr_array | bsr_array,
    damping: csr_array | bsr_array | None = None,
    count: int = 8,
    periods: tuple[float, float] = (30.0, 1000.0),
) -> FastestGrowth:
    """Find the fastest growing motions.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array or bsr_array, shape (n, n)
        A = M^(-1/2) K M^(-1/2), 1 / time^2, of the coordinates that feel a force.
    damping : scipy.sparse.csr_array or bsr_array, shape (n, n), optional
        G = M^(-1/2) C M^(-1/2), 1 / time.
    count : int
        Motions that are wanted. A space of one vector serves if it is one, in an eighth of the time.
    periods : tuple of (float, float)
        The first and the longest time that is looked at, in periods of the fastest motion. What grows more slowly than
        about 3 over the longest time is not looked for.

    Returns
    -------
    FastestGrowth

    Raises
    ------
    BadInputError
        If the count or the times are out of range.
    """
    if count < 1 or not 0 < periods[0] <= periods[1]:
        raise BadInputError(
            f"{count} motions in {periods[0]:g} to {periods[1]:g} periods: take one or more, ascending."
        )
    size = matrix.shape[0]
    if size <= 2 * BLOCK:
        raise BadInputError(
            f"An operator of {size} coordinates is for `spectrum`: products serve more than {2 * BLOCK}."
        )
    motion = _Undamped.of(matrix) if damping is None else _Damped.of(matrix, damping)
    block = 1 if count == 1 else min(2 * count, 2 * BLOCK)
    start = np.random.default_rng(0).standard_normal((block, motion.size))
    length, products = periods[0], 0
    while True:
        step = motion.propagator(2 * np.pi * length / motion.frequency)
        report_progress(f"motion over {length:.0f} periods, {step.products} products each")
        space, krylov = _search(motion, step, start, count)
        products += step.products * krylov.used
        if space.found >= count or length == periods[1]:
            return space.result(count, products)
        start = space.next_start(start)
        length = min(TRIPLE * length, periods[1])


@dataclass(frozen=True, eq=False)
class Step:
    """The propagator over a time, of columns, and how many products one column takes."""

    apply: Callable[[Floats], Floats]
    time: float
    products: int


@dataclass(frozen=True, eq=False)
class _Undamped:
    """x'' = -A x."""

    matrix: csr_array | bsr_array
    frequency: float

    @classmethod
    def of(cls, matrix: csr_array | bsr_array) -> "_Undamped":
        return cls(matrix, np.sqrt(EIGENVALUE_MARGIN * _largest(matrix)))

    @property
    def size(self) -> int:
        return int(self.matrix.shape[0])

    def product(self, columns: NDArray) -> NDArray:
        """A of columns."""
        return np.asarray(self.matrix @ columns)

    def propagator(self, time: float) -> Step:
        """cos(t sqrt A)."""
        from scipy.special import jv

        argument = time * self.frequency
        degree = int(argument / 2 + 6 * (argument / 2) ** (1 / 3) + 20)
        weight = 2 * jv(2 * np.arange(degree + 1), argument)
        weight[0] /= 2
        scaled = self.matrix * (-2 / self.frequency**2)
        return Step(lambda x: _chebyshev(lambda y: y + scaled @ y, weight, -1, x), time, degree)

    def growth(self, values: Complexes) -> Floats:
        """Rate of eigenvalues of A."""
        return np.asarray(2 * np.abs(np.sqrt(values.astype(complex)).imag))

    def uncertainty(self, values: Complexes, residuals: Floats) -> Floats:
        """Error of the rates by the residuals, for well-conditioned eigenvalues."""
        return residuals * np.sqrt(np.abs(values))

    def outstanding(self, chance: float) -> float:
        """Modulus of f beyond which an eigenvalue stands out, where the logarithm of its share grows so in a block."""
        return float(np.cosh(chance))

    def least_growth(self, modulus: float) -> float:
        """Least Re s, times t, of which f has this modulus."""
        return float(np.arccosh(max(modulus, 1.0)))

    def visible(self, chance: float) -> float:
        """Rate times t of a motion that stands out."""
        return float(2 * np.arcsinh(np.cosh(chance)))

    def displacement(self, vectors: Complexes) -> Complexes:
        """Of vectors."""
        return vectors


@dataclass(frozen=True, eq=False)
class _Damped:
    """The state (sqrt(L) x, v) of x'' = -A x - G x'."""

    matrix: csr_array | bsr_array
    damping: csr_array | bsr_array
    frequency: float
    loss: float

    @classmethod
    def of(cls, matrix: csr_array | bsr_array, damping: csr_array | bsr_array) -> "_Damped":
        frequency = np.sqrt(EIGENVALUE_MARGIN * _largest(matrix))
        # no motion loses more than the largest sum of a row
        return cls(matrix, damping, frequency, float(abs(damping).sum(axis=1).max()) / frequency)

    @property
    def size(self) -> int:
        return int(2 * self.matrix.shape[0])

    def product(self, columns: NDArray) -> NDArray:
        """Z of columns."""
        size = self.matrix.shape[0]
        x, v = columns[:size], columns[size:]
        force = self.matrix @ x
        force *= -1 / self.frequency
        force -= self.damping @ v
        return np.concatenate([self.frequency * v, force])

    @cached_property
    def longest_step(self) -> float:
        """tau sqrt(L) of one sum: its terms go up to exp(loss tau sqrt(L)), as the generating function of J_k says."""
        return float(min(30.0, CANCELLATION / max(self.loss, 1e-3)))

    def propagator(self, time: float) -> Step:
        """exp(t Z)."""
        from scipy.special import jv

        steps = int(np.ceil(time * self.frequency / self.longest_step))
        argument = time * self.frequency / steps
        order = np.arange(int(4 * (1 + self.loss) * argument) + 60)
        weight = 2 * jv(order, argument)
        weight[0] /= 2
        # an eigenvalue of Z / sqrt(L) of modulus 1 or `loss` makes a term so much larger
        ellipse = np.exp(np.minimum(order * np.arcsinh(self.loss), 600.0))
        degree = int(np.flatnonzero(np.abs(weight) * ellipse > 1e-15)[-1])

        def apply(columns: Floats) -> Floats:
            for _ in range(steps):
                columns = _chebyshev(lambda y: self.product(y) / self.frequency, weight[: degree + 1], 1, columns)
            return columns

        return Step(apply, time, steps * degree)

    def growth(self, values: Complexes) -> Floats:
        """Rate of eigenvalues of Z."""
        return np.asarray(2 * values.real)

    def uncertainty(self, values: Complexes, residuals: Floats) -> Floats:
        """As without dissipation."""
        return 2 * residuals * np.abs(values)

    def outstanding(self, chance: float) -> float:
        """As without dissipation."""
        return float(np.exp(chance))

    def least_growth(self, modulus: float) -> float:
        """As without dissipation."""
        return float(np.log(modulus))

    def visible(self, chance: float) -> float:
        """As without dissipation."""
        return 2 * chance

    def displacement(self, vectors: Complexes) -> Complexes:
        """Of states."""
        return vectors[: self.matrix.shape[0]]


Equation = _Undamped | _Damped


def _chebyshev(product: Callable[[Floats], Floats], weight: Floats, sign: int, columns: Floats) -> Floats:
    """sum_k weight_k P_k of columns, with P_{k+1} = 2 B P_k + sign P_{k-1}."""
    before, now = columns, product(columns)
    total = weight[0] * before + weight[1] * now
    for each in weight[2:]:
        after = product(now)
        after *= 2
        after += sign * before
        total += each * after
        before, now = now, after
    return total


@dataclass(frozen=True, eq=False)
class _Space:
    """What a space has of the motions that grow, the fastest first; `fastest` is a basis of what grows most."""

    motion: Equation
    step: Step
    fastest: Floats
    values: Complexes
    vectors: Complexes
    residuals: Floats
    limit: float

    @property
    def found(self) -> int:
        """Motions, one of each pair, that grow faster than the limit and have converged, without a gap."""
        failed = np.flatnonzero(self.residuals > CONVERGED)
        return int(failed[0]) if len(failed) else len(self.values)

    def next_start(self, start: Floats) -> Floats:
        """A block for a longer time, from the fastest motions."""
        known = min(len(start) // 2, self.fastest.shape[1])
        fresh = np.random.default_rng(1).standard_normal(start.shape)
        fresh[:known] = np.sqrt(start.shape[1]) * self.fastest[:, :known].T
        return fresh

    def result(self, count: int, products: int) -> FastestGrowth:
        """The fastest motions whose growth is certain."""
        rates = self.motion.growth(self.values)
        uncertain = rates < GROWTH_OVER_RESIDUAL * self.motion.uncertainty(self.values, self.residuals)
        kept = slice(0, min(count, int(np.argmax([*uncertain, True]))))
        moved = self.motion.displacement(self.vectors[:, kept])
        others = rates[kept.stop :].max(initial=0.0)
        least = 0.0
        if kept.stop:
            least = float(rates[0]) if self.found else self._seen_to_grow(self.vectors[:, 0])
        return FastestGrowth(
            rates[kept],
            self.values[kept],
            self.residuals[kept],
            moved / np.linalg.norm(moved, axis=0),
            self.step.time,
            float(max(others, self.limit)),
            least,
            products,
        )

    def _seen_to_grow(self, vector: Complexes) -> float:
        """Least rate at which D of a motion grows in a time t, but for the first: a mixture of motions of about one
        rate has eigenvalues of any rate in the space, and grows at that rate, more and more nearly, from below."""
        columns, sizes = np.column_stack([vector.real, vector.imag]), []
        for _ in range(FOLLOWED):
            columns = self.step.apply(columns / np.linalg.norm(columns))
            sizes.append(np.linalg.norm(columns))
        return 2 * self.motion.least_growth(float(min(sizes[1:]))) / self.step.time


def _search(motion: Equation, step: Step, start: Floats, count: int) -> tuple[_Space, Krylov]:
    """The motions that grow over a time, and the Krylov space in which they are found."""
    block = len(start)
    krylov = Krylov(step.apply, start, MOST_BLOCKS * block)
    blocks = FIRST_BLOCKS
    while True:
        krylov.extend(blocks * block)
        chance = np.log(2 * np.sqrt(motion.size) / (CHANCE * APPEARS)) / (krylov.used // block)
        space = _growing(motion, step, krylov, float(chance), count)
        if space.found >= count or krylov.full or (len(space.values) == 0 and blocks >= FIRST_BLOCKS):
            return space, krylov
        blocks += 3


def _growing(motion: Equation, step: Step, krylov: Krylov, chance: float, count: int) -> _Space:
    """The motions of a space that stand out, solved for anew in the space of these."""
    theta, small = eig(krylov.square)
    order = np.argsort(-np.abs(theta), kind="stable")[: 2 * count + 6]  # both of a pair count
    fastest = krylov.basis[: krylov.used].T @ _real_basis(small[:, order[: krylov.block]])
    order = order[np.abs(theta[order]) > motion.outstanding(chance)]
    basis = krylov.basis[: krylov.used].T @ _real_basis(small[:, order])
    image = motion.product(basis)
    values, x = eig(basis.T @ image) if len(order) else (np.zeros(0, complex), np.zeros((0, 0), complex))
    limit = motion.visible(chance) / step.time
    rates = motion.growth(values)
    grows = np.flatnonzero((rates > limit) & (values.imag >= 0))
    grows = grows[np.argsort(-rates[grows], kind="stable")]
    values, x = values[grows], x[:, grows]
    residuals = np.linalg.norm(image @ x - (basis @ x) * values, axis=0) / np.abs(values)
    return _Space(motion, step, fastest, values, basis @ x, residuals, limit)


def _real_basis(vectors: Complexes) -> Floats:
    """An orthonormal basis of the real and the imaginary parts of vectors."""
    if vectors.shape[1] == 0:
        return np.zeros(vectors.shape)
    parts = np.concatenate([vectors.real, vectors.imag], axis=1)
    basis, triangle, _ = qr(parts, mode="economic", pivoting=True)
    return np.asarray(basis[:, np.abs(np.diag(triangle)) > DEPENDENT * abs(triangle[0, 0])])


def _largest(matrix: csr_array | bsr_array) -> float:
    """The largest eigenvalue of A, to a hundredth."""
    start = np.random.default_rng(0).standard_normal(matrix.shape[0])
    return float(abs(eigs(matrix, 1, which="LM", v0=start, tol=1e-2, ncv=24, return_eigenvectors=False)[0]))
