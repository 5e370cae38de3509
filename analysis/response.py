r"""Linear response of a packing to a force and to a displacement, exact at all times.

Small motion about an equilibrium, under a force f on the coordinates q and with a damping time tau, obeys

.. math:: M \ddot q = -K q + f \cos\omega t - M \dot q / \tau .

In mass-weighted coordinates :math:`z = M^{1/2} q` it is a function of one matrix A, and one oscillator
:math:`\ddot x = -\lambda x - \dot x/\tau + \cos\omega t` gives it. From rest, with
:math:`\Omega = \sqrt\lambda` and no damping,

.. math::

    x = \frac{\cos\omega t - \cos\Omega t}{\Omega^2 - \omega^2} = 2\,
    \frac{\sin\tfrac12(\Omega + \omega) t}{\Omega + \omega}\,
    \frac{\sin\tfrac12(\Omega - \omega) t}{\Omega - \omega} ,

whose last form cancels neither in resonance nor at small times; a start from x = 1 at rest gives
:math:`\cos\Omega t`. With damping, :math:`\gamma = 1/2\tau` and :math:`S^2 = \lambda - \gamma^2`, the motion
is the stationary one less :math:`e^{-\gamma t}` times a combination of :math:`\cos St` and
:math:`\sin(St)/S`; in the first moments the two cancel, to the rounding of the stationary motion. All of these
are entire functions of :math:`\lambda`, so that f(A) exists whatever A is.

**Time steps.** Velocity Verlet with step dt gives the same formulas with
:math:`\sin\tfrac12\Omega\,dt = \tfrac12\sqrt\lambda\,dt` and with
:math:`h \sin(Xt)/\sin(Xh)` for :math:`\sin(Xt)/X`, h = dt for a whole and dt/2 for a half angle: its
positions at the steps are met exactly, and its velocities :math:`(x_{n+1} - x_{n-1})/2dt` as well.

**Coalescing pairs.** An eigen-decomposition :math:`f(A) = X f(\Lambda) X^{-1}` loses the digits of
:math:`\kappa = 1/|y^H x|`, all of them at an exceptional point. Pairs with a small :math:`|y^H x|` are
therefore not diagonalised: an ordered Schur form puts such a pair first, a Sylvester equation decouples its 2 x
2 block B from the rest, and both steps stay well conditioned while the two eigenvectors become one. There
:math:`B = m + N` with tr N = 0 and :math:`N^2 = \tfrac14(\lambda_1 - \lambda_2)^2`, hence

.. math:: f(B) = \tfrac12 [f(\lambda_1) + f(\lambda_2)] + f[\lambda_1, \lambda_2]\, N .

The divided difference :math:`f[\lambda_1, \lambda_2]` is the quotient of the differences where the two motions
have come apart, and Cauchy's integral on a circle about both where they have not, which is a sum of values of f.
Stepping with ``expm`` of the first-order system would be as stable, but it takes a step for each time that is
wanted, of a matrix of twice the size, and rounds in each of them.

Coordinates that feel no force, those of rattlers, are held still.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eig, schur, solve_sylvester

from .packing import Floats, Packing
from .spectrum import Complexes, discrete_frequency, dynamical_matrix
from .stiffness import Form

WELL_CONDITIONED = 0.1
"""Eigenvalues with a smaller |y^H x| are kept together with their partner; the others lose a digit at most."""

TOGETHER = 0.1
"""Half the distance of two eigenvalues, in units of the circle's radius, up to which Cauchy's integral is used.
The quotient of differences loses a digit there, and the integral over `NODES` points has an error of
TOGETHER^NODES."""

NODES = 16
"""Points on the circle."""


class Motion(NamedTuple):
    """Displacement and velocity of an oscillator; arrays of complex numbers."""

    displacement: Complexes
    velocity: Complexes


@dataclass(frozen=True)
class Oscillator:
    """One oscillator x'' = -lambda x - x'/tau + cos(omega t), for any complex lambda.

    Parameters
    ----------
    omega : float
        Angular frequency of the forcing, radian / time.
    damping_time : float, optional
        tau, time; no damping by default.
    dt : float, optional
        Time step of velocity Verlet, for an undamped motion at multiples of dt; exact dynamics by default.

    Raises
    ------
    ValueError
        If the damping time or the step is not positive, or both are given.
    """

    omega: float = 0.0
    damping_time: float | None = None
    dt: float | None = None

    def __post_init__(self) -> None:
        for name in ("damping_time", "dt"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise ValueError(f"{name} = {value} must be positive and finite.")
        if self.damping_time is not None and self.dt is not None:
            raise ValueError("The dispersion of velocity Verlet is that of undamped runs: give dt or damping_time.")

    def released(self, eigenvalue: ArrayLike, time: ArrayLike) -> Motion:
        """From x = 1 at rest, without forcing.

        Parameters
        ----------
        eigenvalue : array_like of complex
            lambda, 1 / time^2.
        time : array_like
            Times; broadcast against the eigenvalues.

        Returns
        -------
        Motion
        """
        value, t = np.asarray(eigenvalue, dtype=np.complex128), np.asarray(time, dtype=np.float64)
        if self.damping_time is not None:
            cosine, sine = self._decaying(value, t)
            return Motion(cosine + 0.5 / self.damping_time * sine, -value * sine)
        frequency = self._frequency(value)
        # (sin(Omega dt) / dt)^2 of Verlet's velocity is lambda itself at dt = 0
        squared = value if self.dt is None else value * (1 - 0.25 * value * self.dt**2)
        return Motion(np.cos(frequency * t), -squared * _sine_over(frequency, t, self.dt))

    def driven(self, eigenvalue: ArrayLike, time: ArrayLike) -> Motion:
        """From rest at x = 0 under the force cos(omega t); parameters as those of `released`."""
        value, t = np.asarray(eigenvalue, dtype=np.complex128), np.asarray(time, dtype=np.float64)
        if self.damping_time is not None:
            return self._driven_and_damped(value, t)
        frequency, half = self._frequency(value), None if self.dt is None else 0.5 * self.dt
        fast, slow = frequency + self.omega, frequency - self.omega
        of_fast, of_slow = _sine_over(fast, 0.5 * t, half), _sine_over(slow, 0.5 * t, half)
        cos_fast, cos_slow = np.cos(0.5 * fast * t), np.cos(0.5 * slow * t)
        if half is not None:  # central differences of the sines in the displacement
            cos_fast, cos_slow = cos_fast * np.cos(slow * half), cos_slow * np.cos(fast * half)
        return Motion(2 * of_fast * of_slow, of_fast * cos_slow + cos_fast * of_slow)

    def _driven_and_damped(self, value: Complexes, t: Floats) -> Motion:
        assert self.damping_time is not None
        gamma, omega = 0.5 / self.damping_time, self.omega
        cosine, sine = self._decaying(value, t)
        detuning, loss = value - omega**2, 2 * gamma * omega
        weight = 1 / (detuning**2 + loss**2)
        a, b = detuning * weight, loss * weight
        c, s = np.cos(omega * t), np.sin(omega * t)
        return Motion(
            a * (c - cosine) + b * s - (gamma * a + omega * b) * sine,
            -omega * a * s + omega * b * (c - cosine) + (value * a + gamma * omega * b) * sine,
        )

    def _decaying(self, value: Complexes, t: Floats) -> tuple[Complexes, Complexes]:
        """exp(-gamma t) times cos(St) and sin(St)/S, without an overflow where S is imaginary."""
        assert self.damping_time is not None
        gamma = 0.5 / self.damping_time
        root = np.sqrt(value - gamma**2)
        root = np.where(root.imag < 0, -root, root)
        slower: Complexes = np.exp((-gamma - 1j * root) * t)
        turn: Complexes = np.expm1(2j * root * t)
        safe = np.where(root == 0, 1, root)
        return slower * (1 + 0.5 * turn), slower * np.where(root == 0, t, turn / (2j * safe))

    def _frequency(self, value: Complexes) -> Complexes:
        return np.sqrt(value) if self.dt is None else discrete_frequency(value, self.dt)


@dataclass(frozen=True, eq=False)
class Modes:
    """A matrix as A = X diag(lambda.., B_1, B_2, ..) X^(-1) with well-conditioned X.

    Attributes
    ----------
    basis, inverse : ndarray of complex, shape (n, n)
        X and its inverse.
    values : ndarray of complex, shape (n,)
        Eigenvalues, 1 / time^2, in the order of the columns of X.
    blocks : dict of int to ndarray of complex, shape (2, 2)
        Upper triangular blocks of coalescing pairs, by the first of their two columns.
    """

    basis: Complexes
    inverse: Complexes
    values: Complexes
    blocks: dict[int, Complexes]

    @classmethod
    def of(cls, matrix: ArrayLike) -> "Modes":
        """Decompose a square matrix.

        Parameters
        ----------
        matrix : array_like, shape (n, n)
            A, real or complex, 1 / time^2.

        Returns
        -------
        Modes

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
            if overlap[worst] >= WELL_CONDITIONED:
                basis[:, done:] = basis[:, done:] @ right
                inverse[done:] = np.linalg.solve(right, inverse[done:])
                values[done:] = found
                break
            parallel = np.abs(right[:, worst].conj() @ right)
            parallel[worst] = 0.0
            block, rest, turn, back = _split(rest, found, [worst, int(np.argmax(parallel))])
            basis[:, done:] = basis[:, done:] @ turn
            inverse[done:] = back @ inverse[done:]
            values[done : done + 2] = np.diag(block)
            blocks[done] = block
            done += 2
        return cls(basis, inverse, values, blocks)

    def apply(self, function: Callable[[Complexes, Floats], Motion], time: Floats, vector: Floats) -> Motion:
        """f(A, t) b for every time.

        Parameters
        ----------
        function : callable
            (lambda, t) -> Motion, entire in lambda.
        time : ndarray, shape (T,)
            Times.
        vector : ndarray, shape (n,)
            b.

        Returns
        -------
        Motion
            Two arrays of shape (T, n); real to rounding if A and b are.
        """
        weight = self.inverse @ vector
        parts = [part * weight for part in function(self.values, time[:, None])]
        for column, block in self.blocks.items():
            pair = slice(column, column + 2)
            first, second = np.diag(block)
            traceless = block - 0.5 * (first + second) * np.eye(2)
            mean = [0.5 * part for part in map(np.add, function(first, time), function(second, time))]
            slope = _divided_difference(function, first, second, time)
            for part, even, odd in zip(parts, mean, slope, strict=True):
                part[:, pair] = np.outer(even, weight[pair]) + np.outer(odd, traceless @ weight[pair])
        return Motion(*(part @ self.basis.T for part in parts))


@dataclass(frozen=True, eq=False)
class Response:
    """Motion of a packing about its equilibrium.

    Attributes
    ----------
    time : ndarray, shape (T,)
        Times.
    displacement : ndarray, shape (T, 3N)
        q = (x.., y.., R theta..) from the equilibrium, length.
    velocity : ndarray, shape (T, 3N)
        Its time derivative, length / time.
    top : ndarray of bool, shape (N,)
        The disks of the upper layer.
    """

    time: Floats
    displacement: Floats
    velocity: Floats
    top: NDArray[np.bool_]

    @property
    def msd(self) -> Floats:
        """D, mean over disks of dx^2 + dy^2, length^2, shape (T,)."""
        return np.sum(self.displacement[:, : 2 * len(self.top)] ** 2, axis=1) / len(self.top)

    @property
    def layer_velocity(self) -> Floats:
        """Mean velocity of the upper layer along x, length / time, shape (T,)."""
        return self.velocity[:, : len(self.top)][:, self.top].mean(axis=1)


def linear_response(
    packing: Packing,
    times: ArrayLike,
    *,
    force: ArrayLike | None = None,
    omega: float = 0.0,
    initial: ArrayLike | None = None,
    damping_time: float | None = None,
    dt: float | None = None,
    form: Form = "consistent",
) -> Response:
    """Motion of the linearised packing from rest.

    Parameters
    ----------
    packing : Packing
        The equilibrium.
    times : array_like, shape (T,)
        Times, in any order, not negative.
    force : array_like, shape (3N,), optional
        f of the force f cos(omega t) on (x.., y.., R theta..), force, as of `layer_force`; none by default.
    omega : float
        Angular frequency of the force, radian / time.
    initial : array_like, shape (3N,), optional
        Displacement at t = 0, length; none by default.
    damping_time : float, optional
        tau of the damping -M q'/tau, time; none by default.
    dt : float, optional
        Time step of the velocity Verlet run to be met; exact dynamics by default.
    form : {"consistent", "paper"}
        As in :func:`~faultgouge.analysis.stiffness_matrix`.

    Returns
    -------
    Response

    Raises
    ------
    ValueError
        If a shape does not fit, a time is negative, a damping time or step is not positive, both are given, or the
        times are not multiples of the step.
    numpy.linalg.LinAlgError
        If more than two eigenvalues coalesce.
    """
    oscillator = Oscillator(float(omega), damping_time, dt)
    time = _times(times, dt)
    sparse, active = dynamical_matrix(packing, form)
    mass = np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass])
    root = np.sqrt(mass[active])
    displacement, velocity = np.zeros((2, len(time), 3 * len(packing)))
    if len(active):
        modes = Modes.of(sparse.toarray())
        for given, name, function, scale in (
            (force, "force", oscillator.driven, 1 / root),
            (initial, "initial", oscillator.released, root),
        ):
            if given is None:
                continue
            vector = np.asarray(given, dtype=np.float64)
            if vector.shape != (3 * len(packing),):
                raise ValueError(f"{name} has shape {vector.shape}; {(3 * len(packing),)} is needed.")
            motion = modes.apply(function, time, vector[active] * scale)
            displacement[:, active] += motion.displacement.real / root
            velocity[:, active] += motion.velocity.real / root
    return Response(time, displacement, velocity, packing.top)


def layer_force(packing: Packing, amplitude: float, disks: ArrayLike | None = None) -> Floats:
    """A force along x on some disks.

    Parameters
    ----------
    packing : Packing
        The configuration.
    amplitude : float
        a, force on each of them.
    disks : array_like of bool, shape (N,), optional
        Which; the upper layer by default.

    Returns
    -------
    ndarray, shape (3N,)
        On (x.., y.., R theta..).
    """
    force = np.zeros(3 * len(packing))
    force[: len(packing)] = amplitude * np.asarray(packing.top if disks is None else disks, dtype=bool)
    return force


def _times(times: ArrayLike, dt: float | None) -> Floats:
    time = np.array(times, dtype=np.float64)
    if time.ndim != 1 or not np.all(np.isfinite(time)) or np.any(time < 0):
        raise ValueError("The times of a response must be a list of finite numbers, none of them negative.")
    if dt is None:
        return time
    steps = np.round(time / dt)
    # Times of a run are multiples of dt, printed or summed: a part in a million of a step is far above rounding.
    if np.any(np.abs(time / dt - steps) > 1e-6 * np.maximum(1.0, steps * 1e-6)):
        raise ValueError(f"The times of a run with the step {dt:g} are multiples of it.")
    return steps * dt


def _split(rest: NDArray, values: Complexes, pair: list[int]) -> tuple[Complexes, Complexes, Complexes, Complexes]:
    """Block of a pair, the rest, and the transformation to both with its inverse."""
    triangle, unitary, count = schur(
        rest, output="complex", sort=lambda value: int(np.argmin(np.abs(values - value))) in pair
    )
    turn, back = np.eye(len(rest), dtype=np.complex128), np.eye(len(rest), dtype=np.complex128)
    if len(rest) > 2:
        coupling = solve_sylvester(triangle[:2, :2], -triangle[2:, 2:], -triangle[:2, 2:])
        # Two planes that are nearly parallel: no better than the vectors that were to be avoided.
        if count != 2 or not np.linalg.norm(coupling) < WELL_CONDITIONED**-2:
            raise np.linalg.LinAlgError(f"more than two eigenvalues coalesce near {values[pair[0]]:.6g}")
        turn[:2, 2:], back[:2, 2:] = coupling, -coupling
    return triangle[:2, :2], triangle[2:, 2:], unitary @ turn, back @ unitary.conj().T


def _sine_over(frequency: Complexes, t: Floats, step: float | None) -> Complexes:
    """sin(Xt)/X, or h sin(Xt)/sin(Xh) with a step h; t where X is zero."""
    below = frequency if step is None else np.sin(frequency * step) / step
    return np.where(below == 0, t, np.sin(frequency * t) / np.where(below == 0, 1, below))


def _divided_difference(
    function: Callable[[Complexes, Floats], Motion], first: complex, second: complex, time: Floats
) -> list[Complexes]:
    """f[first, second] of displacement and velocity at every time."""
    middle, half = 0.5 * (first + second), 0.5 * abs(first - second)
    # On this circle frequencies differ by 1/t from that of its centre, and no motion is larger than about e.
    inverse = 1 / np.where(time > 0, time, 1.0)
    radius = inverse * (2 * np.sqrt(abs(middle)) + inverse)
    offset = radius[:, None] * np.exp(2j * np.pi * np.arange(NODES) / NODES)
    near = half <= TOGETHER * radius
    safe = first - second if first != second else 1.0
    with np.errstate(divide="ignore", invalid="ignore"):  # a point may hit an eigenvalue where it is not needed
        weight = offset / ((middle + offset - first) * (middle + offset - second))
    around = function(middle + offset, time[:, None])
    apart = map(np.subtract, function(np.asarray(first), time), function(np.asarray(second), time))
    return [
        np.where(near, np.mean(circle * weight, axis=1), difference / safe)
        for circle, difference in zip(around, apart, strict=True)
    ]
