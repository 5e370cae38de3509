r"""Error of a frequency and of a growth rate over the time step.

One mode of a packing is excited in LAMMPS and measured: the packing is displaced along the mode and left to undamped
dynamics. The velocity, projected on the mode's left vector, :math:`b = y^H M^{1/2} \dot q`, contains that mode alone,
and at equal intervals h obeys

.. math:: b_{n+1} + b_{n-1} = 2 \cos(\Omega h)\, b_n ,

with complex :math:`\Omega` if the eigenvalue is complex: least squares give :math:`\cos\Omega h`.

The frequency that velocity Verlet gives is known exactly,
:math:`\sin\tfrac12\Omega\,\Delta t = \tfrac12\omega\,\Delta t`: the error is
:math:`\omega^3 \Delta t^2/24`, and it can be subtracted from the measured frequency.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import eig

from ....analysis import Packing, discrete_frequency, dynamical_matrix, spectrum, stable_timestep
from ....analysis.arrays import Floats
from ....analysis.motion.eigenvalues import Complexes, unit_rounding
from ....pywrap import Engine, Equilibrium
from .extended import refine_eigenvalue
from .work_precision_study import (
    COMPENSATED_SUFFIX,
    Point,
    Settings,
    Study,
    Theory,
    compensate,
    fit_order,
    study_of,
    time_jobs,
)

STEP_SHARES = (0.8, 0.4, 0.2, 0.1, 0.05, 0.025)
"""Time steps in units of the limit 2/omega_max."""

RUN, RUN_CORRECTED, SPECTRUM = "run", "run, dispersion taken out", "eigenvalue of K, no run"

CAREFUL_AMPLITUDE, DISPLACED_BY = 1e-12, 1e-8
"""Length by which the disk that moves most is displaced: far above what a coordinate is known to, 1e-23 or 2e-15, and
far below the overlaps, 1e-5 and more, so that the packing is nearly linear."""


@dataclass(frozen=True, eq=False)
class FastestMode:
    """A mode of a packing's operator in mass-weighted coordinates.

    Attributes
    ----------
    packing : Packing
        The equilibrium, whose arithmetic is that of the run.
    growing : bool
        Whether it is the mode that grows fastest, or the fastest of a stable packing.
    right, left : ndarray of complex, shape (3N,)
        Unit vectors; zero on coordinates that feel no force.
    eigenvalue : complex
        Refined in extended precision, 1 / time^2.
    error : float
        Uncertainty from the rounding of the operator's entries, 1 / time^2.
    limit : float
        2 / omega_max, time.
    """

    packing: Packing
    growing: bool
    right: Complexes
    left: Complexes
    eigenvalue: complex
    error: float
    limit: float

    @classmethod
    def of(cls, packing: Packing, growing: bool) -> FastestMode:
        """Solve the eigenproblem of a packing and choose the mode."""
        sparse, active = dynamical_matrix(packing)
        matrix = sparse.toarray()
        values, left, right = eig(matrix, left=True, right=True)
        k = int(np.argmin(np.sqrt(values).imag) if growing else np.argmax(values.real))
        spread = np.zeros((2, 3 * len(packing)), dtype=np.complex128)
        spread[:, active] = right[:, k], left[:, k]
        condition = 1 / abs(np.vdot(left[:, k], right[:, k]))
        exact = refine_eigenvalue(matrix, complex(values[k]), right[:, k], condition)
        error = unit_rounding(matrix) * condition + exact.error
        limit = stable_timestep(float(np.sqrt(np.abs(values).max())))
        return cls(packing, growing, spread[0], spread[1], complex(exact.value), error, limit)

    def quantity(self, frequency: complex) -> float:
        """The quantity of the study: the growth rate of D, or the frequency, 1 / time."""
        return float(2 * abs(frequency.imag) if self.growing else abs(frequency.real))

    @property
    def amplitude(self) -> float:
        """Largest coordinate of the displacement that a run starts with, length."""
        return CAREFUL_AMPLITUDE if self.packing.compensated else DISPLACED_BY

    @property
    def exact(self) -> float:
        """The quantity from the refined eigenvalue."""
        return self.quantity(np.sqrt(self.eigenvalue))

    @property
    def resolution(self) -> float:
        """Relative error of the quantity that the rounding of the operator's entries amounts to."""
        return float(self.error / np.sqrt(abs(self.eigenvalue)) / self.exact / (1 if self.growing else 2))

    def from_spectrum(self) -> float:
        """The quantity from the packing's spectrum, without a run."""
        found = spectrum(self.packing)
        return found.growth_rate() if self.growing else found.omega_max

    def measure_frequency(self, engine: Engine, dt: float, time: float) -> complex:
        """Omega from an undamped run in LAMMPS that starts displaced along the mode, radian / time."""
        every = max(1, round(0.25 * np.pi / np.sqrt(self.eigenvalue).real / dt))  # an eighth of a period
        mass, inertia = self.packing.mass, self.packing.inertia_factor
        root = np.sqrt(np.concatenate([mass, mass, inertia * mass]))
        displacement = self.right.real / root
        engine.restore(engine.displace(self.packing, self.amplitude * displacement / np.abs(displacement).max()))
        signal = []
        with engine.undamped(dt) as dynamics:
            for _ in range(max(4, int(time / dt / every))):
                motion = dynamics.advance(every)
                velocity = np.concatenate([*motion.velocity.T, self.packing.radius * motion.spin])
                signal.append(np.vdot(self.left, root * velocity))
        b = np.array(signal)
        cosine = np.vdot(b[1:-1], b[2:] + b[:-2]) / (2 * np.vdot(b[1:-1], b[1:-1]).real)
        return complex(np.arccos(cosine) / (every * dt))


def correct_dispersion(frequency: complex, dt: float) -> complex:
    """omega with velocity Verlet's dispersion taken out of Omega: 2/dt sin(Omega dt/2), radian / time."""
    return complex(2 / dt * np.sin(0.5 * dt * frequency))


def frequency(settings: Settings) -> Study:
    """The frequency of the fastest mode of a stable packing."""
    equilibrium = settings.at(0.01)
    mode = FastestMode.of(equilibrium.packing, growing=False)
    periods = 50 if settings.quick else 100
    return _study("frequency", settings, equilibrium, mode, periods, periods * 2 * np.pi / mode.exact)


def growth(settings: Settings) -> Study:
    """The growth rate of D in a packing above its onset."""
    equilibrium = settings.at(0.024)
    time = 5.0 if settings.quick else 10.0
    return _study("growth", settings, equilibrium, FastestMode.of(equilibrium.packing, growing=True), time, time)


def _study(
    name: str, settings: Settings, equilibrium: Equilibrium, mode: FastestMode, length: float, time: float
) -> Study:
    """Study runs of a given duration (the words call it a length) over the time step."""
    steps = mode.limit * np.array(STEP_SHARES[: len(STEP_SHARES) - settings.quick])
    fine_mode = FastestMode.of(compensate(equilibrium).packing, mode.growing)
    points = _points(settings, mode, fine_mode, steps, time)
    noise, careful_noise = (
        float(np.median([point.error for point in points if point.method == method]))
        for method in (RUN_CORRECTED, RUN_CORRECTED + COMPENSATED_SUFFIX)
    )
    default, fifth = points[STEP_SHARES.index(0.05)], points[STEP_SHARES.index(0.2)]
    numbers = {
        "mode": mode,
        "fine_mode": fine_mode,
        "disks": len(mode.packing),
        "length": length,
        "coarse": STEP_SHARES[1],
        "noise": noise,
        "careful_noise": careful_noise,
        "default": default.error,
        "fifth": fifth.error,
        "fifth_time": fifth.seconds / default.seconds,
        "raw": points[1].error,
        "spectrum": max(points[-1].error, mode.resolution),
        "slower": 2 / mode.limit / abs(np.sqrt(mode.eigenvalue)),
    }
    return study_of(
        name,
        "one mode",
        points=points,
        numbers=numbers,
        reference_error=mode.resolution,
        orders=(fit_order(points, RUN + COMPENSATED_SUFFIX, 2, least=10 * careful_noise, most=0.01),),
        theory=(_dispersion(mode, steps), Theory("rounding of K", (mode.resolution,))),
    )


def _points(
    settings: Settings, mode: FastestMode, fine_mode: FastestMode, steps: Floats, time: float
) -> tuple[Point, ...]:
    """The runs in both arithmetics, as they are and with the dispersion taken out, and K's eigenvalue."""
    with Engine(mode.packing) as engine, Engine(fine_mode.packing) as fine_engine:
        runs = [(RUN, mode, engine, dt) for dt in steps.tolist()]
        runs += [(RUN + COMPENSATED_SUFFIX, fine_mode, fine_engine, dt) for dt in steps.tolist()]
        jobs: list[Callable[[], complex]] = [partial(one.measure_frequency, on, dt, time) for _, one, on, dt in runs]
        (*found, alone), seconds = time_jobs([*jobs, mode.from_spectrum], settings)
    plain, out = [], []
    for (method, one, _, dt), value, spent in zip(runs, found, seconds[:-1], strict=True):
        work = spent, int(time / dt)
        plain.append(Point(method, dt, _relative_error(one, one.quantity(value)), *work))
        out.append(
            Point(
                RUN_CORRECTED + method.removeprefix(RUN),
                dt,
                _relative_error(one, one.quantity(correct_dispersion(value, dt))),
                *work,
            )
        )
    return *plain, *out, Point(SPECTRUM, None, _relative_error(mode, alone.real), seconds[-1], None)


def _relative_error(mode: FastestMode, quantity: float) -> float:
    """Relative error, no less than the rounding of a number."""
    return max(abs(quantity / mode.exact - 1), float(np.finfo(float).eps))


def _dispersion(mode: FastestMode, steps: Floats) -> Theory:
    """Error of velocity Verlet for a mode of a frozen K."""
    fine = np.geomspace(steps[-1], steps[0], 60).tolist()
    predicted = [abs(mode.quantity(complex(discrete_frequency(mode.eigenvalue, dt))) / mode.exact - 1) for dt in fine]
    return Theory("velocity Verlet on a frozen K", tuple(map(float, predicted)), tuple(fine))
