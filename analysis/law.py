r"""The contact law: a Hertz-type repulsion and a tangential force that meets Coulomb's bound smoothly.

Two disks overlap by :math:`\delta > 0` and have slid by :math:`s` along the contact since they met.

.. math::

    f_n &= k_n \delta^{3/2} \\
    f_t &= -k_t \delta^{1/2} (1 + x - x^2)\, s, \qquad
    x = |s| / t^*, \quad t^* = \mu \frac{k_n}{k_t} \delta

The slip is clamped to :math:`[-t^*, t^*]`, where :math:`|f_t| = \mu f_n` exactly. The derivatives that the
stability operator needs are

.. math::

    \frac{\partial f_n}{\partial \delta} &= \tfrac32 k_n \delta^{1/2} \\
    a = \frac{\partial f_t}{\partial s} &= -k_t \delta^{1/2} (1 + 2x - 3x^2) \\
    b = \frac{\partial f_t}{\partial \delta} &= \frac{f_t}{2\delta} - k_t \delta^{1/2} s\, \frac{2x^2 -
    x}{\delta}

The tangential stiffness :math:`-a` first rises, to :math:`\tfrac43 k_t \delta^{1/2}` at :math:`x = 1/3`, and
falls to zero at :math:`x = 1`. There :math:`b = \tfrac32 f_t / \delta`, which is also the derivative of the
clamped branch :math:`f_t = \mp \mu k_n \delta^{3/2}`: the force is once continuously differentiable at the
bound, so the clamp needs no case of its own in the derivatives.

:math:`k_n` and :math:`k_t` are in force / length\ :sup:`3/2`; no effective radius enters. :math:`\mu = 0` or
:math:`k_t = 0` means no tangential force at all, and no memory of the slip.
"""

from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class Derivatives(NamedTuple):
    """Forces of contacts and what the stability operator needs of them; arrays over contacts.

    Attributes
    ----------
    normal_force, tangential_force : ndarray
        f_n and f_t, force.
    normal_stiffness, slip_derivative, overlap_derivative : ndarray
        d f_n / d overlap, a = d f_t / d slip, and b = d f_t / d overlap, force / length.
    """

    normal_force: Floats
    tangential_force: Floats
    normal_stiffness: Floats
    slip_derivative: Floats
    overlap_derivative: Floats


@dataclass(frozen=True)
class MindlinLaw:
    """The smooth Mindlin law; every method is vectorised over contacts.

    A contact whose overlap is not positive is open and exerts nothing.

    Parameters
    ----------
    kn : float
        Normal stiffness, force / length^(3/2), positive.
    kt : float
        Tangential stiffness, force / length^(3/2), not negative.
    mu : float
        Coulomb's coefficient of friction, not negative.

    Raises
    ------
    ValueError
        If a parameter is not finite or has the wrong sign.
    """

    kn: float
    kt: float
    mu: float

    def __post_init__(self) -> None:
        for name in ("kn", "kt", "mu"):
            value = float(getattr(self, name))
            object.__setattr__(self, name, value)
            if not isfinite(value) or value < 0 or (name == "kn" and value == 0):
                sign = "positive" if name == "kn" else "not negative"
                raise ValueError(f"{name} = {value} must be finite and {sign}.")

    @property
    def frictional(self) -> bool:
        """Whether there is a tangential force at all."""
        return self.kt > 0 and self.mu > 0

    def slip_limit(self, overlap: ArrayLike) -> Floats:
        """Slip t* at which the tangential force reaches Coulomb's bound.

        Parameters
        ----------
        overlap : array_like
            Overlaps, length.

        Returns
        -------
        ndarray
            t* = mu kn overlap / kt, length; zero for a law without friction.
        """
        overlap = _closed(overlap)
        return overlap * self.mu * self.kn / self.kt if self.frictional else np.zeros_like(overlap)

    def clamped(self, overlap: ArrayLike, slip: ArrayLike) -> Floats:
        """Slip brought back into [-t*, t*], length: what a contact remembers after an increment."""
        limit = self.slip_limit(overlap)
        return np.clip(np.asarray(slip, dtype=np.result_type(slip, np.float64)), -limit, limit)

    def normal_force(self, overlap: ArrayLike) -> Floats:
        """Repulsion f_n = kn overlap^(3/2), force."""
        overlap = _closed(overlap)
        return self.kn * overlap * np.sqrt(overlap)

    def normal_stiffness(self, overlap: ArrayLike) -> Floats:
        """d f_n / d overlap = (3/2) kn overlap^(1/2), force / length."""
        return 1.5 * self.kn * np.sqrt(_closed(overlap))

    def tangential_force(self, overlap: ArrayLike, slip: ArrayLike) -> Floats:
        """Tangential force f_t along tau, force; at Coulomb's bound beyond the slip limit.

        Parameters
        ----------
        overlap, slip : array_like
            Overlap and slip of each contact, length.

        Returns
        -------
        ndarray
            f_t = -kt overlap^(1/2) (1 + x - x^2) slip: it opposes the slip.
        """
        overlap = _closed(overlap)
        slip, x = self._reduced(overlap, slip)
        return -self.kt * np.sqrt(overlap) * (1 + x - x * x) * slip

    def tangential_slip_derivative(self, overlap: ArrayLike, slip: ArrayLike) -> Floats:
        """a = d f_t / d slip at constant overlap, force / length; never positive, zero at the bound."""
        overlap = _closed(overlap)
        _, x = self._reduced(overlap, slip)
        # Factored, 1 + 2x - 3x^2 vanishes at the bound to the last bit.
        return -self.kt * np.sqrt(overlap) * ((1 - x) * (1 + 3 * x)) * self.frictional

    def tangential_overlap_derivative(self, overlap: ArrayLike, slip: ArrayLike) -> Floats:
        """b = d f_t / d overlap at constant slip, force / length: what makes the forces non-conservative."""
        overlap = _closed(overlap)
        slip, x = self._reduced(overlap, slip)
        # f_t/2 and the term of d x/d overlap = -x/overlap, joined: both carry kt s / overlap^(1/2).
        factor = 0.5 * (1 + x - x * x) + (2 * x * x - x)
        return -self.kt * factor * _ratio(slip, np.sqrt(overlap))

    def derivatives(self, overlap: Floats, slip: Floats) -> Derivatives:
        """All of the above at once, at a fraction of the cost; overlaps that are not positive give zeros."""
        overlap = np.maximum(overlap, 0.0)
        root = np.sqrt(overlap)
        normal_force, normal_stiffness = self.kn * overlap * root, 1.5 * self.kn * root
        if not self.frictional:
            zero = np.zeros_like(root)
            return Derivatives(normal_force, zero, normal_stiffness, zero, zero)
        limit = overlap * (self.mu * self.kn / self.kt)
        slip = np.minimum(np.maximum(slip, -limit), limit)
        if limit.all():
            x, steep = np.abs(slip) / limit, slip / root
        else:  # an open contact has no slip either
            x, steep = _ratio(np.abs(slip), limit), _ratio(slip, root)
        rest, triple, soft = 1 - x, 3 * x, -self.kt * root
        return Derivatives(
            normal_force,
            soft * (1 + x * rest) * slip,
            normal_stiffness,
            soft * (rest * (1 + triple)),  # vanishes at the bound to the last bit
            (1 + x * (triple - 1)) * (-0.5 * self.kt * steep),
        )

    def _reduced(self, overlap: Floats, slip: ArrayLike) -> tuple[Floats, Floats]:
        """The slip within its bound and x = |slip| / t*."""
        slip = self.clamped(overlap, slip)
        return slip, _ratio(np.abs(slip), self.slip_limit(overlap))


def _closed(overlap: ArrayLike) -> Floats:
    """Overlaps, those of open contacts set to zero; long doubles stay so."""
    return np.maximum(np.asarray(overlap, dtype=np.result_type(overlap, np.float64)), 0.0)


def _ratio(numerator: Floats, denominator: Floats) -> Floats:
    """numerator / denominator, zero where the denominator is: an open contact has no slip either."""
    zeros = np.zeros(np.shape(numerator), np.result_type(numerator, denominator))
    return np.divide(numerator, denominator, out=zeros, where=denominator > 0)
