r"""A driven oscillator: the matrix function that describes small motion without dissipation.

Small motion about an equilibrium, under a force f on the coordinates q, obeys :math:`M \ddot q = -K q + f \cos\omega
t`. In mass-weighted coordinates :math:`z = M^{1/2} q` the motion is a function of one matrix A. This function is the
solution of one oscillator :math:`\ddot x = -\lambda x + \cos\omega t`. From rest, with :math:`\Omega = \sqrt\lambda`,

.. math::

    x = \frac{\cos\omega t - \cos\Omega t}{\Omega^2 - \omega^2} = 2\,
    \frac{\sin\tfrac12(\Omega + \omega) t}{\Omega + \omega}\,
    \frac{\sin\tfrac12(\Omega - \omega) t}{\Omega - \omega} ,

where the last form has no cancellation, neither in resonance nor at small times. A start from x = 1 at rest gives
:math:`\cos\Omega t`. Both are entire functions of :math:`\lambda`, so that f(A) exists for any A.

**Time steps.** Velocity Verlet with step dt gives the same formulas with :math:`\sin\tfrac12\Omega\,dt =
\tfrac12\sqrt\lambda\,dt` and with :math:`h \sin(Xt)/\sin(Xh)` for :math:`\sin(Xt)/X`, h = dt for a whole and dt/2 for a
half angle. The formulas give the positions at the steps exactly, and also the velocities :math:`(x_{n+1} -
x_{n-1})/2dt`.

**First order.** A motion with dissipation is a function of the first-order matrix Z
(:mod:`~faultgouge.analysis.motion.motion`): `released_motion` or `driven_motion` of its eigenvalues s.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..motion.eigenvalues import Complexes
from ..motion.spectrum import discrete_frequency
from ..packing.packing import Floats


class OscillatorMotion(NamedTuple):
    """Displacement and velocity of an oscillator; arrays of complex numbers."""

    displacement: Complexes
    velocity: Complexes


@dataclass(frozen=True)
class Oscillator:
    """One oscillator x'' = -lambda x + cos(omega t), for any complex lambda.

    Parameters
    ----------
    omega : float
        Angular frequency of the forcing, radian / time.
    dt : float, optional
        Time step of velocity Verlet, for a motion at multiples of dt; exact dynamics by default.

    Raises
    ------
    ValueError
        If the step is not positive.
    """

    omega: float = 0.0
    dt: float | None = None

    def __post_init__(self) -> None:
        if self.dt is not None and not 0 < self.dt < np.inf:
            raise ValueError(f"dt = {self.dt} must be positive and finite.")

    def free_motion(self, eigenvalue: ArrayLike, time: ArrayLike) -> OscillatorMotion:
        """From x = 1 at rest, without forcing.

        Parameters
        ----------
        eigenvalue : array_like of complex
            lambda, 1 / time^2.
        time : array_like
            Times; broadcast against the eigenvalues.

        Returns
        -------
        OscillatorMotion
        """
        value, t = np.asarray(eigenvalue, dtype=np.complex128), np.asarray(time, dtype=np.float64)
        frequency = self._frequency(value)
        # (sin(Omega dt) / dt)^2 of Verlet's velocity is lambda itself at dt = 0
        squared = value if self.dt is None else value * (1 - 0.25 * value * self.dt**2)
        return OscillatorMotion(np.cos(frequency * t), -squared * _sine_over(frequency, t, self.dt))

    def forced_motion(self, eigenvalue: ArrayLike, time: ArrayLike) -> OscillatorMotion:
        """From rest at x = 0 under the force cos(omega t); parameters as those of `free_motion`."""
        value, t = np.asarray(eigenvalue, dtype=np.complex128), np.asarray(time, dtype=np.float64)
        frequency, half = self._frequency(value), None if self.dt is None else 0.5 * self.dt
        fast, slow = frequency + self.omega, frequency - self.omega
        of_fast, of_slow = _sine_over(fast, 0.5 * t, half), _sine_over(slow, 0.5 * t, half)
        cos_fast, cos_slow = np.cos(0.5 * fast * t), np.cos(0.5 * slow * t)
        if half is not None:  # central differences of the sines in the displacement
            cos_fast, cos_slow = cos_fast * np.cos(slow * half), cos_slow * np.cos(fast * half)
        return OscillatorMotion(2 * of_fast * of_slow, of_fast * cos_slow + cos_fast * of_slow)

    def _frequency(self, value: Complexes) -> Complexes:
        return np.sqrt(value) if self.dt is None else discrete_frequency(value, self.dt)


def _sine_over(frequency: Complexes, t: Floats, step: float | None) -> Complexes:
    """sin(Xt)/X, or h sin(Xt)/sin(Xh) with a step h; t where X is zero."""
    below = frequency if step is None else np.sin(frequency * step) / step
    return np.where(below == 0, t, np.sin(frequency * t) / np.where(below == 0, 1, below))


def released_motion(rate: Complexes, time: Floats) -> tuple[Complexes]:
    """x' = s x from x = 1."""
    return (np.exp(rate * time),)


def driven_motion(omega: float, rate: Complexes, time: Floats) -> tuple[Complexes]:
    """x' = s x + cos(omega t) from x = 0: the mean of (exp(i omega t) - exp(s t)) / (i omega - s) and its mirror."""
    rate = np.asarray(rate, dtype=np.complex128)
    return (0.5 * (_quotient(rate, 1j * omega, time) + _quotient(rate, -1j * omega, time)),)


def _quotient(a: Complexes, b: complex, time: Floats) -> Complexes:
    """(exp(a t) - exp(b t)) / (a - b), without cancellation near a = b and without overflow."""
    first, second = np.broadcast_arrays(a, np.complex128(b))
    swap = first.real < second.real
    larger, smaller = np.where(swap, second, first), np.where(swap, first, second)
    difference = smaller - larger  # exp(larger t) expm1(difference t) / difference
    safe = np.where(difference == 0, 1, difference)
    value = np.where(difference == 0, time, np.expm1(difference * time) / safe)
    return np.asarray(np.exp(larger * time) * value)
