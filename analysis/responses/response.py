r"""Linear response of a packing to a force, to a displacement and to an impulse.

Small motion about an equilibrium, under a force f on the coordinates q and the dissipation C, obeys

.. math:: M \ddot q + C \dot q + K q = f \cos\omega t .

**In time** (`linear_response`). The cosine is one more oscillator, :math:`\ddot y = -\omega^2 y` from y = 1 at rest, so
that the motion is that of one system without a force, :math:`\ddot z = -B z - G \dot z`, :math:`z = (M^{1/2} q, y)`. A
step is the exponential of the first-order system (C. F. Van Loan, IEEE Trans. Autom. Control 23, 395, 1978). Velocity
Verlet of a step dt has a matrix of its own in place of the exponential,

.. math:: \begin{pmatrix} 1 - \tfrac12 B\,dt^2 & dt \\ -B\,(1 - \tfrac14 B\,dt^2)\,dt & 1 - \tfrac12 B\,dt^2
    \end{pmatrix},

with :math:`(2/dt) \sin\tfrac12 \omega\,dt` in place of :math:`\omega`. No matrix is diagonalised, so that nothing is
lost at a coalescence of eigenvalues or in resonance.

**In frequency** (`impulse_response`). One number matters for triggering: the mean velocity v of the upper layer, on
which friction depends. A unit impulse gives :math:`v(t) = \sum_k c_k e^{s_k t}`, with the rates s_k of all motions
(without damping :math:`\pm i \sqrt\lambda`) and weights c_k from their right and left vectors. The force
cos(omega t), from rest at t = 0, gives

.. math:: v(t) = \mathrm{Re} \sum_k c_k \frac{e^{i\omega t} - e^{s_k t}}{i\omega - s_k} ,

a stationary part, which is the transfer function :math:`H(\omega) = \sum_k c_k / (i\omega - s_k)`, and a transient,
which never decays in an undamped packing. Towards the onset the weights of the transient grow with the condition of the
pair: this is the giant sensitivity. The largest |v| up to a given time decides whether friction weakens, and is
proportional to the amplitude.

Coordinates on which no force acts, those of rattlers, are held fixed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eig, expm

from ..arrays import Complexes, Floats
from ..errors import BadInputError
from ..has_configuration import HasConfiguration
from ..motion.motion import Motion
from ..packing.packing import Packing

LOOKS_A_PERIOD, LOOKS_AT_ONCE = 20, 2000
"""Times a period of the fastest motion at which the largest velocity is looked for, and times that are kept at once."""

RESONANCE_WIDTH = 1e-9
"""Relative distance of a frequency from that of a motion below which the quotient of differences would lose all its
digits. Such a frequency is moved by twice as much: a part in a million of the response after t = 1e3/omega."""


@dataclass(frozen=True, eq=False)
class Response:
    """Motion of a packing about its equilibrium: `displacement` q = (x.., y.., R theta..) and `velocity`, shape (T,
    3N), at `time` (T,).

    `top` (N,) are the disks of the upper layer, none of a Configuration; `dimension` is 2 of disks, 3 of spheres.
    """

    time: Floats
    displacement: Floats
    velocity: Floats
    top: NDArray[np.bool_]
    dimension: int = 2

    @property
    def msd(self) -> Floats:
        """D, mean over disks of dx^2 + dy^2 (+ dz^2), length^2, shape (T,)."""
        return np.sum(self.displacement[:, : self.dimension * len(self.top)] ** 2, axis=1) / len(self.top)

    @property
    def layer_velocity(self) -> Floats:
        """Mean velocity of the upper layer along x, length / time, shape (T,)."""
        return self.velocity[:, : len(self.top)][:, self.top].mean(axis=1)


def linear_response(
    packing: HasConfiguration,
    times: ArrayLike,
    *,
    force: ArrayLike | None = None,
    omega: float = 0.0,
    initial: ArrayLike | None = None,
    dt: float | None = None,
) -> Response:
    """Compute the motion of the linearised packing from rest, with its dashpots and drag.

    Parameters
    ----------
    packing : Packing
        The equilibrium.
    times : array_like, shape (T,)
        Times, in any order, not negative; quickest where they are equally spaced.
    force : array_like, shape (3N,), or (6N,) of spheres, optional
        Amplitude f of the force f cos(omega t) on (x.., y.., R theta..), as from `layer_force`; none by default.
    omega : float
        Angular frequency of the force, radian / time.
    initial : array_like, shape (3N,), optional
        Displacement at t = 0, length; none by default.
    dt : float, optional
        Time step of the undamped velocity Verlet run to compare with; exact dynamics by default.

    Returns
    -------
    Response

    Raises
    ------
    ValueError
        If a shape does not fit, a time is negative, a step is not positive or is given with dissipation, or the
        times are not multiples of the step.
    """
    time = np.array(times, dtype=np.float64)
    if time.ndim != 1 or not np.all(np.isfinite(time)) or np.any(time < 0):
        raise ValueError("The times of a response must be a list of finite numbers, none of them negative.")
    if dt is not None and not 0 < dt < np.inf:
        raise ValueError(f"dt = {dt} must be positive and finite.")
    if dt is not None and packing.damped:
        raise ValueError("The dispersion of velocity Verlet is that of undamped runs: give dt without dissipation.")
    instants, where = np.unique(time, return_inverse=True)
    gaps = np.diff(instants, prepend=0.0)
    unit = dt or gaps[gaps > 0].min(initial=np.inf)
    # a part in a million of a step is far above the rounding of times that were printed or summed
    steps = np.round(gaps / unit, 6)
    if dt is not None and np.any(steps != np.round(steps)):
        raise ValueError(f"The times of a run with the step {dt:g} are multiples of it.")
    system = Motion.of(packing)
    active, root, size = system.active, system.root_mass, len(system.active)
    b, start = np.zeros((size + 1, size + 1)), np.zeros(2 * size + 2)
    b[:size, :size], start[size] = system.stiffness.toarray(), 1.0
    b[size, size] = omega**2 if dt is None else (2 / dt * np.sin(0.5 * omega * dt)) ** 2
    if force is not None:
        b[:size, size] = -_coordinates(packing, "force", force)[active] / root
    if initial is not None:
        start[:size] = _coordinates(packing, "initial", initial)[active] * root
    # velocities in units in which they are as large as displacements
    speed, one = float(np.sqrt(np.abs(b).max())) or 1.0, np.eye(size + 1)
    damping = np.zeros_like(b)
    damping[:size, :size] = system.damping.toarray()
    first_order = np.block([[0 * one, speed * one], [-b / speed, -damping]])
    step = np.zeros_like(first_order)  # of velocity Verlet
    if dt is not None:
        half = one - 0.5 * dt**2 * b
        step = np.block([[half, speed * dt * one], [-dt / speed * b @ (one - 0.25 * dt**2 * b), half]])
    states, ahead = np.empty((len(instants), len(start))), dict[float, Floats]()
    with np.errstate(over="ignore", invalid="ignore"):  # of motions that grow for long
        for k, count in enumerate(steps.tolist()):
            if count not in ahead:  # equal gaps differ by rounding
                gap = gaps[steps == count].mean()
                ahead[count] = expm(gap * first_order) if dt is None else np.linalg.matrix_power(step, int(count))
            states[k] = start = ahead[count] @ start
    displacement, velocity = np.zeros((2, len(time), packing.coordinates))
    displacement[:, active] = states[where, :size] / root
    velocity[:, active] = speed * states[where, size + 1 : 2 * size + 1] / root
    return Response(time, displacement, velocity, packing.top, packing.dimension)


def layer_force(packing: HasConfiguration, amplitude: float) -> Floats:
    """Force vector for a force along x on the upper layer.

    Parameters
    ----------
    packing : Packing
        With an upper layer.
    amplitude : float
        Force a on each disk of the layer.

    Returns
    -------
    ndarray, shape (3N,)
        Force on the coordinates (x.., y.., R theta..).

    Raises
    ------
    BadInputError
        If the packing has no upper layer, as no Configuration has.
    """
    if not packing.top.any():
        forces = f"forces of shape {(packing.coordinates,)}"
        raise BadInputError(f"layer_force acts on an upper layer, and this packing has none: give {forces} instead.")
    force = np.zeros(packing.coordinates)
    force[: len(packing)] = amplitude * packing.top
    return force


def floor_force(packing: Packing) -> Floats:
    """The force -m along x on every disk, (x.., y.., R theta..), shape (3N,): in the frame of a floor with a unit
    acceleration."""
    return np.concatenate([-packing.mass, np.zeros(2 * len(packing))])


def _coordinates(packing: HasConfiguration, name: str, values: ArrayLike) -> Floats:
    """Numbers of all coordinates; a ValueError if they have another shape."""
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (packing.coordinates,):
        raise ValueError(f"{name} has shape {vector.shape}; {(packing.coordinates,)} is needed.")
    return vector


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

    def parts(self, omega: ArrayLike) -> tuple[Floats, Complexes]:
        """The frequencies, off resonance, and c_k/(i omega - s_k), of the shape of omega and (n,) at its end."""
        omegas, least = np.array(omega, dtype=np.float64)[..., None], RESONANCE_WIDTH * np.abs(self.rate)
        hit = np.abs(1j * omegas - self.rate) < least
        omegas = omegas + 2 * np.max(np.where(hit, least, 0.0), axis=-1, keepdims=True)
        return omegas[..., 0], self.weight / (1j * omegas - self.rate)

    def transfer(self, omega: ArrayLike) -> Complexes:
        """H(omega): amplitude and phase of the stationary velocity under the force cos(omega t), of omega's shape."""
        return np.sum(self.parts(omega)[1], axis=-1)

    def velocity(self, omega: float, time: ArrayLike) -> Floats:
        """v(t) under the force cos(omega t) from rest at t = 0, shape of `time`."""
        apart, part = self.parts(omega)
        t = np.asarray(time, dtype=np.float64)
        return np.real(np.exp(1j * apart * t) * part.sum() - np.exp(np.multiply.outer(t, self.rate)) @ part)

    def largest(self, omega: ArrayLike, duration: float) -> tuple[Floats, Floats]:
        """The largest |v| up to a time from the first push under the force cos(omega t), and when it is reached, of
        each omega."""
        omegas, part = self.parts(omega)
        fastest = max(np.abs(self.rate.imag).max(), omegas.max())
        count = int(np.ceil(duration * fastest / (2 * np.pi) * LOOKS_A_PERIOD)) + 1
        step, largest, where = duration / (count - 1), *np.zeros((2, len(omegas)))
        motion = np.exp(np.multiply.outer(step * np.arange(min(LOOKS_AT_ONCE, count)), self.rate))
        for first in range(0, count, LOOKS_AT_ONCE):
            t = step * np.arange(first, min(first + LOOKS_AT_ONCE, count))
            transient = motion[: len(t)] @ (np.exp(step * first * self.rate) * part).T
            v = np.abs(np.real(np.exp(1j * np.multiply.outer(t, omegas)) * part.sum(axis=1) - transient))
            best = v.argmax(axis=0)
            where, largest = np.where(v.max(axis=0) > largest, t[best], where), np.maximum(v.max(axis=0), largest)
        for k, each in enumerate(omegas):  # between the times that were looked at
            near = np.clip(np.linspace(where[k] - step, where[k] + step, 65), 0.0, duration)
            v = np.abs(self.velocity(float(each), near))
            where[k], largest[k] = near[v.argmax()], v.max()
        return largest, where


def impulse_response(packing: Packing, force: ArrayLike) -> ImpulseResponse:
    """How the upper layer moves after an impulse f on (x.., y.., R theta..), as of `layer_force` or `floor_force`."""
    system = Motion.of(packing)
    drive = _coordinates(packing, "force", force)[system.active] / system.root_mass
    mean = np.concatenate([packing.top / max(1, packing.top.sum()), np.zeros(2 * len(packing))])
    watch, still = mean[system.active] / system.root_mass, np.zeros_like(drive)
    if system.dissipative:
        rate, right = eig(system.first_order)
        weight = (np.concatenate([still, watch]) @ right) * np.linalg.solve(right, np.concatenate([still, drive]))
        return ImpulseResponse(rate + 0j, weight)
    value, right = eig(system.stiffness.toarray())
    weight = (watch @ right) * np.linalg.solve(right, drive)
    frequency = np.sqrt(value.astype(np.complex128))
    return ImpulseResponse(np.concatenate([1j * frequency, -1j * frequency]), np.tile(0.5 * weight, 2) + 0j)
