r"""Linear response of a packing to a force and to a displacement, exact at all times.

Small motion about an equilibrium, under a force f on the coordinates q and the dissipation C, obeys

.. math:: M \ddot q + C \dot q + K q = f \cos\omega t .

Without dissipation the motion is a function of one matrix, that of one oscillator
(:mod:`~faultgouge.analysis.responses.oscillator`).

**Dissipation** (:mod:`~faultgouge.analysis.operators.damping`): dashpots have no modes in common with K. The motion is
then that of the first-order system of :mod:`~faultgouge.analysis.motion.motion`, whose eigenvalues s give
:math:`e^{st}` and, under the force, :math:`(e^{i\omega t} - e^{st}) / (i\omega - s)`. If all Re s < 0, the motion
finally is the stationary response with the transfer function :math:`H(\omega) = (K - \omega^2 M + i\omega C)^{-1}`
(`transfer` in :mod:`~faultgouge.analysis.responses.forcing`).

Functions of the matrix of a packing close to a coalescence of two eigenvalues keep their digits
(:mod:`~faultgouge.analysis.responses.matrix_functions`).

Coordinates on which no force acts, those of rattlers, are held fixed.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import BadInputError
from ..has_configuration import HasConfiguration
from ..motion.motion import Motion
from ..packing.packing import Floats
from .matrix_functions import BlockDiagonal, first_order
from .oscillator import Oscillator, driven_motion, released_motion


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
        The disks of the upper layer; none of a Configuration.
    dimension : int
        2 of disks, 3 of spheres.
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


@dataclass(frozen=True, eq=False)
class LinearMotion:
    """The linearised motion of a packing, decomposed once for any number of forces, starts and times.

    Attributes
    ----------
    packing : Packing
        The equilibrium.
    system : Motion
        Its operators.
    modes : BlockDiagonal
        Of A without dissipation, of the first-order system with it.
    """

    packing: HasConfiguration
    system: Motion
    modes: BlockDiagonal

    @classmethod
    def of(cls, packing: HasConfiguration) -> "LinearMotion":
        """Decompose a packing; errors as of `linear_response`."""
        system = Motion.of(packing)
        if packing.damped:
            return cls(packing, system, BlockDiagonal.of(system.first_order, first_order))
        return cls(packing, system, BlockDiagonal.of(system.stiffness.toarray()))

    @property
    def dissipative(self) -> bool:
        """Whether the packing has dashpots or drag."""
        return self.modes.reach is first_order

    def response(
        self,
        times: ArrayLike,
        *,
        force: ArrayLike | None = None,
        omega: float = 0.0,
        initial: ArrayLike | None = None,
        dt: float | None = None,
    ) -> Response:
        """Motion from rest; parameters and errors as of `linear_response`."""
        if dt is not None and self.dissipative:
            raise ValueError("The dispersion of velocity Verlet is that of undamped runs: give dt without dissipation.")
        oscillator, time = Oscillator(float(omega), dt), _times(times, dt)
        active, root, count = self.system.active, self.system.root_mass, self.packing.coordinates
        displacement, velocity = np.zeros((2, len(time), count))
        for given, name, scale in ((force, "force", 1 / root), (initial, "initial", root)):
            if given is None:
                continue
            vector = coordinates(self.packing, name, given)
            x, v = self._motion(oscillator, name == "force", vector[active] * scale, time, np.diag(1 / root))
            displacement[:, active] += x
            velocity[:, active] += v
        return Response(time, displacement, velocity, self.packing.top, self.packing.dimension)

    def _motion(
        self, oscillator: Oscillator, forced: bool, vector: Floats, time: Floats, observed: Floats
    ) -> tuple[Floats, Floats]:
        """Displacement and velocity of rows of the mass-weighted coordinates, under a force or from a displacement."""
        if not self.dissipative:
            second = oscillator.forced_motion if forced else oscillator.free_motion
            displacement, velocity = self.modes.apply(second, time, vector, observed)
            return displacement.real, velocity.real
        norm, rest, size = self.system.energy_norm, np.zeros_like(vector), len(observed)
        start = np.concatenate([rest, vector] if forced else [norm.weight @ vector, rest])
        rows = np.block([[observed @ norm.unweight, 0 * observed], [0 * observed, observed]])
        first = partial(driven_motion, oscillator.omega) if forced else released_motion
        (value,) = self.modes.apply(first, time, start, rows)
        return value[:, :size].real, value[:, size:].real


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

    To compute many motions of one packing, decompose it once: :class:`LinearMotion`.

    Parameters
    ----------
    packing : Packing
        The equilibrium.
    times : array_like, shape (T,)
        Times, in any order, not negative.
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
    numpy.linalg.LinAlgError
        If more than two eigenvalues coalesce.
    """
    return LinearMotion.of(packing).response(times, force=force, omega=omega, initial=initial, dt=dt)


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
        raise BadInputError(
            "layer_force acts on an upper layer, and this packing has none: put together the force on its coordinates, "
            f"an array of shape {(packing.coordinates,)}."
        )
    force = np.zeros(packing.coordinates)
    force[: len(packing)] = amplitude * packing.top
    return force


def coordinates(packing: HasConfiguration, name: str, values: ArrayLike) -> Floats:
    """Numbers of all coordinates as an array of shape (3N,); a ValueError if they have another shape."""
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (packing.coordinates,):
        raise ValueError(f"{name} has shape {vector.shape}; {(packing.coordinates,)} is needed.")
    return vector


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
