r"""Linear response of a packing to a force and to a displacement, exact at all times.

Small motion about an equilibrium, under a force f on the coordinates q and the dissipation C, obeys

.. math:: M \ddot q + C \dot q + K q = f \cos\omega t .

Without dashpots it is a function of one matrix, and of one oscillator (:mod:`~faultgouge.analysis.oscillator`).

**Dashpots** (:mod:`~faultgouge.analysis.damping`) have no modes in common with K. The motion is then that of the
first-order system of :mod:`~faultgouge.analysis.state_space`, whose eigenvalues s give :math:`e^{st}` and, under the
force, :math:`(e^{i\omega t} - e^{st}) / (i\omega - s)`. What is left of it in the end, if all Re s < 0, is the
transfer function :math:`H(\omega) = (K - \omega^2 M + i\omega C)^{-1}`: `layer_response` gives the velocity of the
upper layer per unit of force at any frequency, `LinearMotion.layer_velocity` also while it sets in.

Functions of the matrix of a packing close to a coalescence of two eigenvalues keep their digits
(:mod:`~faultgouge.analysis.matrix_functions`).

Coordinates that feel no force, those of rattlers, are held still.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from .damping import damping_matrix
from .matrix_functions import Modes, first_order
from .oscillator import Oscillator
from .packing import Floats, Packing
from .spectrum import Complexes
from .state_space import StateSpace, driven, released
from .stiffness import stiffness_matrix


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


@dataclass(frozen=True, eq=False)
class LinearMotion:
    """The linearised motion of a packing, decomposed once for any number of forces, starts and times.

    Attributes
    ----------
    packing : Packing
        The equilibrium.
    system : StateSpace
        Its matrices.
    damping_time : float or None
        tau of the drag, time.
    modes : Modes
        Of A without dashpots, of the first-order system with them.
    """

    packing: Packing
    system: StateSpace
    damping_time: float | None
    modes: Modes

    @classmethod
    def of(cls, packing: Packing, damping_time: float | None = None) -> "LinearMotion":
        """Decompose a packing; parameters and errors as of `linear_response`."""
        if damping_time is not None:
            packing = replace(packing, drag_time=damping_time)
        system = StateSpace.of(packing)
        modes = Modes.of(system.matrix if packing.law.damped else system.stiffness)
        return cls(packing, system, packing.drag_time, modes)

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
        oscillator, time = self._oscillator(omega, dt), _times(times, dt)
        active, root, count = self.system.active, self.system.root_mass, 3 * len(self.packing)
        displacement, velocity = np.zeros((2, len(time), count))
        for given, name, scale in ((force, "force", 1 / root), (initial, "initial", root)):
            if given is None:
                continue
            vector = np.asarray(given, dtype=np.float64)
            if vector.shape != (count,):
                raise ValueError(f"{name} has shape {vector.shape}; {(count,)} is needed.")
            x, v = self._motion(oscillator, name == "force", vector[active] * scale, time, np.diag(1 / root))
            displacement[:, active] += x
            velocity[:, active] += v
        return Response(time, displacement, velocity, self.packing.top)

    def layer_velocity(self, times: ArrayLike, omega: float, dt: float | None = None) -> Floats:
        """Velocity of the upper layer per unit of a force that sets in at t = 0.

        Parameters
        ----------
        times : array_like, shape (T,)
            Times, not negative.
        omega : float
            Of the force cos(omega t) along x on each disk of the upper layer, radian / time.
        dt : float, optional
            Time step of the undamped velocity Verlet run to be met; exact dynamics by default.

        Returns
        -------
        ndarray, shape (T,)
            Mean velocity along x, length / time / force. It costs as much as the eigenvalues are many, a time.
        """
        push = layer_force(self.packing, 1.0)[self.system.active] / self.system.root_mass
        observed = push[None] / (int(self.packing.top.sum()) or 1)
        return self._motion(self._oscillator(omega, dt), True, push, _times(times, dt), observed)[1][:, 0]

    def _oscillator(self, omega: float, dt: float | None) -> Oscillator:
        if dt is not None and self.packing.law.damped:
            raise ValueError("The dispersion of velocity Verlet is that of undamped runs: leave dt out with dashpots.")
        return Oscillator(float(omega), self.damping_time, dt)

    def _motion(
        self, oscillator: Oscillator, forced: bool, vector: Floats, time: Floats, observed: Floats
    ) -> tuple[Floats, Floats]:
        """Displacement and velocity of rows of the mass-weighted coordinates, under a force or from a displacement."""
        if not self.packing.law.damped:
            second = oscillator.driven if forced else oscillator.released
            motion = self.modes.apply(second, time, vector, observed)
            return motion.displacement.real, motion.velocity.real
        system, rest, size = self.system, np.zeros_like(vector), len(observed)
        start = system.state(rest, vector) if forced else system.state(vector, rest)
        rows = np.block([[observed @ system.unweight, 0 * observed], [0 * observed, observed]])
        first = partial(driven, oscillator.omega) if forced else released
        (value,) = self.modes.apply(first, time, start, rows, first_order)
        return value[:, :size].real, value[:, size:].real


def linear_response(
    packing: Packing,
    times: ArrayLike,
    *,
    force: ArrayLike | None = None,
    omega: float = 0.0,
    initial: ArrayLike | None = None,
    damping_time: float | None = None,
    dt: float | None = None,
) -> Response:
    """Motion of the linearised packing from rest, with its dashpots and drag.

    To ask for many motions of one packing, decompose it once: :class:`LinearMotion`.

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
        tau of the drag -M q'/tau, time; that of the packing by default.
    dt : float, optional
        Time step of the undamped velocity Verlet run to be met; exact dynamics by default.

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
    motion = LinearMotion.of(packing, damping_time)
    return motion.response(times, force=force, omega=omega, initial=initial, dt=dt)


def layer_response(packing: Packing, omega: ArrayLike) -> Complexes:
    """Stationary velocity of the upper layer per unit of force at any frequency.

    The force Re(a exp(i omega t)) along x on each disk of the upper layer goes with the mean velocity
    Re(a V exp(i omega t)) of these disks along x, V = i omega e^T H(omega) f, once the motion that the start has set
    off has died out.

    Parameters
    ----------
    packing : Packing
        The equilibrium, with its dashpots and drag. Without them V is imaginary, and infinite in resonance.
    omega : array_like, shape (W,)
        Angular frequencies, radian / time.

    Returns
    -------
    ndarray of complex, shape (W,)
        V, length / time / force.
    """
    k, c = stiffness_matrix(packing), damping_matrix(packing)
    active = np.flatnonzero(np.diff(k.indptr))
    k, c = (csc_array(matrix[active][:, active]) for matrix in (k, c))
    mass = diags_array(_mass(packing)[active])
    push = layer_force(packing, 1.0)[active]
    count = int(packing.top.sum()) or 1
    found = [
        1j * w * (push @ splu(csc_array(k - w**2 * mass + 1j * w * c)).solve(push.astype(complex))) / count
        for w in np.atleast_1d(np.asarray(omega, dtype=np.float64))
    ]
    return np.reshape(np.array(found, dtype=np.complex128), np.shape(omega))


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


def _mass(packing: Packing) -> Floats:
    """The diagonal of M, shape (3N,)."""
    return np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass])


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
