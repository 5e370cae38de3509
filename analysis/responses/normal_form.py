r"""The normal form of two coalescing modes.

In the paper's equations 12 to 23, in units of time in which the mean of the two eigenvalues is one,

.. math::

    \ddot{\mathbf x} = -\begin{pmatrix} 1 - \delta & \eta \\ -\eta & 1 + \delta \end{pmatrix} \mathbf x
    - \frac1\tau \dot{\mathbf x}, \qquad \nu = \eta/\delta, \quad \epsilon = 1 - \nu .

The matrix is 1 + N with tr N = 0 and :math:`N^2 = r^2`,

.. math:: \lambda_{1,2} = 1 \mp r, \qquad r = \delta \sqrt{1 - \nu^2} = \delta \sqrt{\epsilon (2 - \epsilon)} ,

complex for :math:`\nu > 1` (where the paper has :math:`\eta > 1`). With half the sum s and half the difference d
= r/2s of :math:`\sqrt{1 \pm r}`, the start orthogonal to :math:`\mathbf v^* = (1, 1)/\sqrt2` has the exact solution

.. math::

    \mathbf x = \mathbf e_\perp \cos st \cos dt + g\, \mathbf v^* \sin st \sin dt, \qquad
    \mathbf e_\perp = \frac{(1, -1)}{\sqrt2}, \quad g = \sqrt{\frac{1 + \nu}{1 - \nu}} = \sqrt{\frac{2 - \epsilon}
    \epsilon} ,

because :math:`N \mathbf e_\perp = -\delta (1 + \nu)\, \mathbf v^*`. The solution becomes the paper's Eq. 18 for
:math:`\epsilon \to 0`: the amplitude is :math:`\sqrt{2/\epsilon}`, reached after the time :math:`\pi/2d`.

**Damping** changes the frequencies to :math:`\sqrt{1 - \gamma^2 \pm r}`, :math:`\gamma = 1/2\tau`, and multiplies the
solution by :math:`e^{-\gamma t} = e^{-t/2\tau}` (the paper has :math:`e^{-t/\tau}`), so that for small :math:`\epsilon`
and
:math:`\gamma`

.. math::

    A \approx g \max_t e^{-t/2\tau} \sin dt = g \sin\theta\, e^{-\theta / \tan\theta}, \qquad \tan\theta = 2 d \tau ,

a function of :math:`\tau/\tau_d` alone with :math:`\tau_d = 1/\delta\sqrt\epsilon`: half of g at :math:`\tau =
1.36\,\tau_d`, g far above and :math:`(2/e)\, g\, d\, \tau`, which does not depend on :math:`\epsilon`, far below.

**Of a packing.** On the right invariant subspace of two modes the operator A of a packing is a real 2 x 2 block. In an
orthonormal basis of that plane its traceless part is a symmetric one, which a rotation makes diag(-p, p), and an
antisymmetric one, q times the quarter turn, which a rotation leaves alone. With the mean m of the eigenvalues,
:math:`\delta = p/m`, :math:`\eta = q/m` and :math:`t \to \sqrt m\, t`, it is the normal form without an approximation;
a reflection takes care of the sign of q. What is oblique is only how the plane sees the other coordinates: a
displacement z of the packing enters it by the left plane, :math:`W^T z`, with :math:`W^T V = 1`.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..packing.packing import Floats

ORTHOGONAL = np.array([1.0, -1.0]) / np.sqrt(2)
"""The direction across v* = (1, 1)/2^(1/2), which both eigenvectors take at the coalescence: the response starts in
it."""

LEAST_CROSSOVER = 4.0
"""Undamped amplitude from which on damping may halve the amplitude: half of a smaller one would be the start itself."""

PERIODS_ABOUT_MAXIMUM = 3
"""Periods of the fast oscillation on either side of the envelope's maximum among which the largest is looked for: the
neighbouring ones may win by their phase, those further out lie lower on the envelope."""


@dataclass(frozen=True, eq=False)
class NormalForm:
    """Two modes near their coalescence; of a packing with where they stand in its coordinates.

    `delta` is half the distance of the uncoupled eigenvalues over their mean, 0 < delta < 1. `epsilon`, 1 - eta/delta,
    is the distance from the coalescence, at most 1, and negative where the pair is complex: eta would lose the digits
    of a small one. `frequency` is the square root of the mean eigenvalue; its inverse is the unit of time of the
    equations.

    `right` (n, 2) is V, orthonormal directions of the two coordinates x in mass-weighted coordinates of the packing,
    and `left` W, with W^T V = 1: coordinates of a displacement z are W^T z.
    """

    delta: float
    epsilon: float
    frequency: float = 1.0
    right: Floats = field(default_factory=lambda: np.eye(2), repr=False)
    left: Floats = field(default_factory=lambda: np.eye(2), repr=False)

    @classmethod
    def of_block(cls, block: Floats, discriminant: float, right: Floats, left: Floats) -> "NormalForm":
        """That of A on the plane of two modes: of W^T A V, the discriminant of its characteristic polynomial, and
        orthonormal V and W with W^T V = 1, shape (n, 2)."""
        mean = 0.5 * (block[0, 0] + block[1, 1])
        # Traceless part: ((-c, k), (k, c)) + q ((0, 1), (-1, 0)); c = p cos 2a, k = -p sin 2a.
        c, (k, q) = 0.5 * (block[1, 1] - block[0, 0]), 0.5 * (block[0, 1] + np.array([1, -1]) * block[1, 0])
        p, angle = np.hypot(c, k), 0.5 * np.arctan2(-k, c)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turn[:, 1] *= 1.0 if q >= 0 else -1.0
        # (p - |q|)/p by way of the discriminant, the one number that is linear in the load.
        epsilon = discriminant / (4 * p * (p + abs(q)))
        return cls(float(p / mean), float(epsilon), float(np.sqrt(mean)), right @ turn, left @ turn)

    @property
    def start(self) -> Floats:
        """The unit displacement across the coalescing eigenvectors, mass-weighted, shape (n,)."""
        return self.right @ ORTHOGONAL

    @property
    def nu(self) -> float:
        """eta / delta."""
        return 1.0 - self.epsilon

    @property
    def eta(self) -> float:
        """The antisymmetric coupling."""
        return self.delta * self.nu

    @property
    def gain(self) -> float:
        """g, the least upper bound of the undamped response over all times; infinite where the pair is complex."""
        return float(np.sqrt((2 - self.epsilon) / self.epsilon)) if self.epsilon > 0 else np.inf

    @property
    def tau_d(self) -> float:
        """1 / (delta epsilon^(1/2)), time that the response takes to build up; infinite where it never ends."""
        return float(1 / (self.delta * np.sqrt(self.epsilon))) / self.frequency if self.epsilon > 0 else np.inf

    def solution(self, time: ArrayLike, damping_time: float | None = None) -> Floats:
        """The exact motion x from rest at a displacement across v*, shape (T, 2), with a damping time or without; the
        displacement of the packing is V x."""
        t, gamma = np.asarray(time, dtype=float) * self.frequency, self._gamma(damping_time)
        r, s, d = self._rates(gamma)
        # The motion is exp(-gamma t) (cos(St) + gamma sin(St)/S), each as its parts along 1 and along N.
        # S = s + N/2s, and sin(N t/2s) = N q with q = sin(dt)/r, finite where r vanishes.
        slow, q = np.cos(d * t), t / (2 * s) * np.sinc(d * t / np.pi)
        fast, turn, decay = np.cos(s * t), np.sin(s * t), np.exp(-gamma * t)
        # S^-1 = (s - N/2s)/(s^2 - d^2), and N^2 = r^2.
        norm, r2 = s * s - d * d, r**2
        sine = (turn * slow * s - fast * q * r2 / (2 * s)) / norm, (fast * q * s - turn * slow / (2 * s)) / norm
        cosine = decay * fast * slow, -decay * turn * q
        even, odd = (c.real + gamma * (decay * s).real for c, s in zip(cosine, sine, strict=True))
        traceless = np.array([[-self.delta, self.eta], [-self.eta, self.delta]])
        return np.outer(even, ORTHOGONAL) + np.outer(odd, traceless @ ORTHOGONAL)

    def amplitude(self, damping_time: float | None = None) -> float:
        """Largest |x(t)| of the response to a start across v*, over the first beat of the two modes, by default without
        damping.

        It is exact, and at least the 1 of the start; infinite for a complex pair without damping, and for one that
        grows faster than the damping. Later beats are lower by the damping or, without, higher than the first by a
        share (pi d/2s)^2/2 at most: `gain` bounds them all. Raises ValueError if the damping time is not positive, or
        so short that nothing oscillates.
        """
        from scipy.optimize import minimize_scalar

        gamma = self._gamma(damping_time)
        _, s, d = self._rates(gamma)
        if not (s.imag == 0 and s.real > 0):
            raise ValueError(f"damping_time = {damping_time} damps the oscillation itself away: there is no beat.")
        if self.epsilon <= 0:
            if abs(d) >= gamma:
                return np.inf
            peak = np.arctanh(abs(d) / gamma) / abs(d) if d else 1 / gamma
        else:
            peak = np.arctan2(d.real, gamma) / d.real
        period = 2 * np.pi / s.real
        # |x| has two maxima a period; 64 points see each of them.
        time = peak + period * np.arange(-64 * PERIODS_ABOUT_MAXIMUM, 64 * PERIODS_ABOUT_MAXIMUM + 1) / 64
        time = time[time >= 0]

        def size(t: ArrayLike) -> Floats:
            return np.linalg.norm(self.solution(np.atleast_1d(t) / self.frequency, damping_time), axis=1)

        best = time[np.argmax(size(time))]
        # Offsets from a late time keep their digits; at a flat maximum, half of them give all digits of the height.
        near = (max(-best, -period / 64), period / 64)
        found = minimize_scalar(lambda t: -size(best + t)[0], bounds=near, options={"xatol": 1e-8})
        return float(max(1.0, -found.fun))

    def half_gain_time(self) -> float:
        """tau at which damping takes half of the undamped amplitude, the crossover; about 1.36 tau_d.

        Raises
        ------
        ValueError
            If the undamped amplitude is less than `LEAST_CROSSOVER`.
        """
        from scipy.optimize import brentq

        full = self.amplitude()
        if not LEAST_CROSSOVER <= full < np.inf:
            raise ValueError(f"An amplitude of {full:.3g} shows no crossover: take an epsilon between 0 and 0.1.")
        bounds = 0.3 * self.tau_d, 10 * self.tau_d
        return float(brentq(lambda tau: self.amplitude(tau) - 0.5 * full, *bounds, rtol=1e-9))

    def _rates(self, gamma: float) -> tuple[complex, complex, complex]:
        """r, imaginary where the pair is complex, and s and d of the damped frequencies."""
        r, c = self.delta * np.emath.sqrt(self.epsilon * (2 - self.epsilon)), 1 - gamma**2
        s = complex(0.5 * (np.emath.sqrt(c + r) + np.emath.sqrt(c - r)))
        return r, s, complex(0.5 * r / s)

    def _gamma(self, damping_time: float | None) -> float:
        """gamma = 1/2 tau, in the unit of time of the equations."""
        if damping_time is None:
            return 0.0
        if not 0 < damping_time < np.inf:
            raise ValueError(f"damping_time = {damping_time} must be positive and finite.")
        return 0.5 / (damping_time * self.frequency)
