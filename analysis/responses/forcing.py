r"""Response of a packing to any force, with and without dissipation.

Small motion about an equilibrium under a force f s(t) obeys

.. math:: M \ddot q + C \dot q + K q = f\, s(t) ,

with the damping matrix C of the packing, which may be zero. This module solves the equation in two ways.

**In time** (`sampled_response`). With z = (q, q') in mass-weighted coordinates the equation is :math:`\dot z = A z +
b\, s(t)`. If s is linear over a step h, the step is exact: it is the exponential of A with s and its slope as two
further unknowns (C. F. Van Loan, IEEE Trans. Autom. Control 23, 395, 1978). No matrix is diagonalised, so that the
method also works at an exceptional point.

**In frequency** (`impulse_response`). One number matters for triggering: the mean velocity v of the upper layer, on
which friction depends. A unit impulse gives :math:`v(t) = \sum_k c_k e^{s_k t}`, with the rates s_k of all motions
(without damping :math:`\pm i \sqrt\lambda`) and weights c_k from their right and left vectors. The force
cos(omega t), from rest at t = 0, gives

.. math:: v(t) = \mathrm{Re} \sum_k c_k \frac{e^{i\omega t} - e^{s_k t}}{i\omega - s_k} ,

a stationary part, which is the transfer function :math:`H(\omega) = \sum_k c_k / (i\omega - s_k)`, and a transient,
which never decays in an undamped packing. Towards the onset the weights of the transient grow with the condition of the
pair: this is the giant sensitivity. The largest |v| up to a given time decides whether friction weakens, and is
proportional to the amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eig, expm

from ..motion.eigenvalues import Complexes
from ..motion.motion import Motion
from ..packing.packing import Floats, Packing
from .response import Response, coordinates
from .signals import Signal

KNOTS = 4
"""Steps, at the least, between two rows of a signal: its corners are then cut by less than 1/32 of their height."""

LOOKS_A_PERIOD = 20
"""Times a period of the fastest motion at which the largest velocity is looked for; it is refined between them."""

EXPONENTIALS_AT_ONCE = 2000
"""Times whose exponentials are kept at once."""

RESONANCE_WIDTH = 1e-9
"""Relative distance of a frequency from that of a motion below which the quotient of differences would lose all its
digits. Such a frequency is moved by twice as much: a part in a million of the response after t = 1e3/omega."""


@dataclass(frozen=True, eq=False)
class ImpulseResponse:
    """Velocity of the upper layer after a unit impulse: v(t) = sum of c_k exp(s_k t).

    Attributes
    ----------
    rate : ndarray of complex, shape (n,)
        s_k, 1 / time: growth and frequency of a motion.
    weight : ndarray of complex, shape (n,)
        c_k, velocity / impulse.
    """

    rate: Complexes
    weight: Complexes

    def transfer(self, omega: ArrayLike) -> Complexes:
        """H(omega): amplitude and phase of the stationary velocity under the force cos(omega t), of omega's shape."""
        quotient = self.weight / (1j * self._off_resonance(omega)[..., None] - self.rate)
        return np.sum(quotient, axis=-1)

    def velocity(self, omega: float, time: ArrayLike) -> Floats:
        """v(t) under the force cos(omega t) from rest at t = 0, shape of `time`."""
        t = np.asarray(time, dtype=np.float64)
        apart = float(self._off_resonance(omega))
        part = self.weight / (1j * apart - self.rate)
        return np.real(np.exp(1j * apart * t) * part.sum() - np.exp(np.multiply.outer(t, self.rate)) @ part)

    def largest(self, omega: ArrayLike, duration: float) -> tuple[Floats, Floats]:
        """The largest |v| up to a time under the force cos(omega t), and when it is reached.

        Parameters
        ----------
        omega : array_like, shape (W,)
            Angular frequencies, 1 / time.
        duration : float
            Time from the first push.

        Returns
        -------
        velocity, time : ndarray, shape (W,)
        """
        omegas = self._off_resonance(omega)
        fastest = max(np.abs(self.rate.imag).max(), omegas.max())
        count = int(np.ceil(duration * fastest / (2 * np.pi) * LOOKS_A_PERIOD)) + 1
        step = duration / (count - 1)
        part = (self.weight / (1j * omegas[:, None] - self.rate)).T
        stationary = part.sum(axis=0)
        largest, where = np.zeros((2, len(omegas)))
        motion = np.exp(np.multiply.outer(step * np.arange(min(EXPONENTIALS_AT_ONCE, count)), self.rate))
        onward = np.exp(step * EXPONENTIALS_AT_ONCE * self.rate)
        for first in range(0, count, EXPONENTIALS_AT_ONCE):
            t = step * np.arange(first, min(first + EXPONENTIALS_AT_ONCE, count))
            v = np.abs(np.real(np.exp(1j * np.multiply.outer(t, omegas)) * stationary - motion[: len(t)] @ part))
            best = v.argmax(axis=0)
            found = v[best, np.arange(len(omegas))]
            where, largest = np.where(found > largest, t[best], where), np.maximum(found, largest)
            motion *= onward
        for k, each in enumerate(omegas):  # between the times that were looked at
            near = np.clip(np.linspace(where[k] - step, where[k] + step, 65), 0.0, duration)
            v = np.abs(self.velocity(float(each), near))
            where[k], largest[k] = near[v.argmax()], v.max()
        return largest, where

    def _off_resonance(self, omega: ArrayLike) -> Floats:
        """The frequencies, each moved by a few `RESONANCE_WIDTH` if it is that of a motion."""
        omegas = np.array(omega, dtype=np.float64)
        least = RESONANCE_WIDTH * np.abs(self.rate)
        hit = np.abs(1j * omegas[..., None] - self.rate) < least
        return omegas + 2 * np.max(np.where(hit, least, 0.0), axis=-1)


def impulse_response(packing: Packing, force: ArrayLike) -> ImpulseResponse:
    """How the upper layer moves after an impulse.

    Parameters
    ----------
    packing : Packing
        The equilibrium, with its dashpots and drag.
    force : array_like, shape (3N,)
        f on (x.., y.., R theta..), as of :func:`~faultgouge.analysis.responses.response.layer_force` or `floor_force`.

    Returns
    -------
    ImpulseResponse
    """
    system = Motion.of(packing)
    drive = coordinates(packing, "force", force)[system.active] / system.root_mass
    mean = np.concatenate([packing.top / max(1, packing.top.sum()), np.zeros(2 * len(packing))])
    watch = mean[system.active] / system.root_mass
    if not system.dissipative:
        value, right = eig(system.stiffness.toarray())
        weight = (watch @ right) * np.linalg.solve(right, drive)
        frequency = np.sqrt(value.astype(np.complex128))
        return ImpulseResponse(np.concatenate([1j * frequency, -1j * frequency]), np.tile(0.5 * weight, 2) + 0j)
    still = np.zeros_like(drive)
    rate, right = eig(system.first_order)
    weight = (np.concatenate([still, watch]) @ right) * np.linalg.solve(right, np.concatenate([still, drive]))
    return ImpulseResponse(rate + 0j, weight)


def sampled_response(
    packing: Packing,
    signal: Signal,
    times: ArrayLike,
    force: ArrayLike,
) -> Response:
    """Motion of the linearised packing from rest under the force f s(t).

    Parameters
    ----------
    packing : Packing
        The equilibrium, with its dashpots and drag.
    signal : Signal
        s(t).
    times : array_like, shape (T,)
        Equally spaced times h, 2h, ...
    force : array_like, shape (3N,)
        f on (x.., y.., R theta..), as of :func:`~faultgouge.analysis.responses.response.layer_force` or `floor_force`.

    Returns
    -------
    Response

    Raises
    ------
    ValueError
        If the times are not equally spaced from the first step on, or the force has another shape.
    """
    time = np.asarray(times, dtype=np.float64)
    # a part in a million is far above the rounding of times that were printed or summed
    if time.ndim != 1 or not len(time) or np.any(np.abs(time - time[0] * np.arange(1, len(time) + 1)) > 1e-6 * time[0]):
        raise ValueError("The times of a sampled response are h, 2h, 3h and so on.")
    system = Motion.of(packing)
    active, root = system.active, system.root_mass
    pieces = max(1, int(np.ceil(KNOTS * time[0] / signal.shortest)))
    step, size = time[0] / pieces, len(active)
    forced = np.zeros((2 * size + 2, 2 * size + 2))
    forced[: 2 * size, : 2 * size] = system.first_order
    forced[size : 2 * size, 2 * size] = coordinates(packing, "force", force)[active] / root
    forced[2 * size, 2 * size + 1] = 1.0
    onward = expm(step * forced)[: 2 * size]
    values = signal.at(step * np.arange(pieces * len(time) + 1))
    displacement, velocity = np.zeros((2, len(time), 3 * len(packing)))
    state = np.zeros(2 * size + 2)
    for k in range(pieces * len(time)):
        state[2 * size :] = values[k], (values[k + 1] - values[k]) / step
        state[: 2 * size] = onward @ state
        if (k + 1) % pieces == 0:
            displacement[k // pieces, active] = system.energy_norm.unweight @ state[:size] / root
            velocity[k // pieces, active] = state[size : 2 * size] / root
    return Response(time, displacement, velocity, packing.top)


def floor_force(packing: Packing) -> Floats:
    """The force -m along x on every disk, (x.., y.., R theta..), shape (3N,): in the frame of a floor with a unit
    acceleration."""
    return np.concatenate([-packing.mass, np.zeros(2 * len(packing))])
