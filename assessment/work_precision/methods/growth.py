r"""Error of a growth rate over the time step.

The mode of a packing that grows fastest is excited in LAMMPS and measured: the packing is displaced along the mode and
left to undamped dynamics. The velocity, projected on the mode's left vector, :math:`b = y^H M^{1/2} \dot q`, contains
that mode alone, and at equal intervals h obeys

.. math:: b_{n+1} + b_{n-1} = 2 \cos(\Omega h)\, b_n ,

with complex :math:`\Omega`: least squares give :math:`\cos\Omega h`. The frequency that velocity Verlet gives is known
exactly, :math:`\sin\tfrac12\Omega\,\Delta t = \tfrac12\omega\,\Delta t`: the error is :math:`\omega^3 \Delta t^2/24`,
and it can be subtracted from the measured frequency.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import eig

from ....analysis import Packing, discrete_frequency, dynamical_matrix, spectrum, stable_timestep
from ....analysis.motion.eigenvalues import Complexes, unit_rounding
from ....pywrap import Engine
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
    """The mode of a packing that grows fastest, in mass-weighted coordinates.

    Attributes
    ----------
    packing : Packing
        The equilibrium, whose arithmetic is that of the run.
    right, left : ndarray of complex, shape (3N,)
        Unit vectors; zero on coordinates that feel no force.
    eigenvalue : complex
        Refined in extended precision, 1 / time^2.
    resolution : float
        Relative error of the growth rate that the rounding of the operator's entries amounts to.
    limit : float
        2 / omega_max, time.
    amplitude : float
        Largest coordinate of the displacement that a run starts with, length.
    """

    packing: Packing
    right: Complexes
    left: Complexes
    eigenvalue: complex
    resolution: float
    limit: float
    amplitude: float

    @classmethod
    def of(cls, packing: Packing) -> FastestMode:
        """Solve the eigenproblem of a packing and choose the mode."""
        sparse, active = dynamical_matrix(packing)
        matrix = sparse.toarray()
        values, left, right = eig(matrix, left=True, right=True)
        k = int(np.argmin(np.sqrt(values).imag))
        spread = np.zeros((2, 3 * len(packing)), dtype=np.complex128)
        spread[:, active] = right[:, k], left[:, k]
        condition = 1 / abs(np.vdot(left[:, k], right[:, k]))
        refined = refine_eigenvalue(matrix, complex(values[k]), right[:, k], condition)
        value, error = complex(refined.value), unit_rounding(matrix) * condition + refined.error
        resolution = float(error / np.sqrt(abs(value)) / rate_of(np.sqrt(value)))
        limit = stable_timestep(float(np.sqrt(np.abs(values).max())))
        amplitude = CAREFUL_AMPLITUDE if packing.compensated else DISPLACED_BY
        return cls(packing, spread[0], spread[1], value, resolution, limit, amplitude)

    @property
    def exact(self) -> float:
        """The growth rate of D from the refined eigenvalue, 1 / time."""
        return rate_of(np.sqrt(self.eigenvalue))

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


def rate_of(frequency: complex) -> float:
    """Growth rate of D, 1 / time."""
    return float(2 * abs(frequency.imag))


def correct_dispersion(frequency: complex, dt: float) -> complex:
    """omega with velocity Verlet's dispersion taken out of Omega: 2/dt sin(Omega dt/2), radian / time."""
    return complex(2 / dt * np.sin(0.5 * dt * frequency))


def growth(settings: Settings) -> Study:
    """The growth rate of D in a packing above its onset: runs in both arithmetics over the time step, as they are and
    with the dispersion taken out, and K's eigenvalue."""
    equilibrium, time = settings.at(0.024), 5.0 if settings.quick else 10.0
    mode, fine_mode = FastestMode.of(equilibrium.packing), FastestMode.of(compensate(equilibrium).packing)
    steps = (mode.limit * np.array(STEP_SHARES[: len(STEP_SHARES) - settings.quick])).tolist()
    with Engine(mode.packing) as engine, Engine(fine_mode.packing) as fine_engine:
        runs = [("", mode, engine, dt) for dt in steps]
        runs += [(COMPENSATED_SUFFIX, fine_mode, fine_engine, dt) for dt in steps]
        jobs: list[Callable[[], complex]] = [partial(one.measure_frequency, on, dt, time) for _, one, on, dt in runs]
        jobs.append(lambda: spectrum(mode.packing).growth_rate())
        (*found, alone), seconds = time_jobs(jobs, settings)

    def error(one: FastestMode, rate: float) -> float:
        """Relative error, no less than the rounding of a number."""
        return max(abs(rate / one.exact - 1), float(np.finfo(float).eps))

    plain, out = [], []
    for (suffix, one, _, dt), value, spent in zip(runs, found, seconds[:-1], strict=True):
        corrected, work = correct_dispersion(value, dt), (spent, int(time / dt))
        plain.append(Point(RUN + suffix, dt, error(one, rate_of(value)), *work))
        out.append(Point(RUN_CORRECTED + suffix, dt, error(one, rate_of(corrected)), *work))
    points = *plain, *out, Point(SPECTRUM, None, error(mode, alone.real), seconds[-1], None)
    noise, careful_noise = (
        float(np.median([point.error for point in points if point.method == RUN_CORRECTED + suffix]))
        for suffix in ("", COMPENSATED_SUFFIX)
    )
    default, fifth = points[STEP_SHARES.index(0.05)], points[STEP_SHARES.index(0.2)]
    fine = np.geomspace(steps[-1], steps[0], 60).tolist()
    predicted = (rate_of(complex(discrete_frequency(mode.eigenvalue, dt))) for dt in fine)
    frozen = tuple(float(abs(rate / mode.exact - 1)) for rate in predicted)
    numbers = {
        "mode": mode,
        "fine_mode": fine_mode,
        "length": time,
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
        "growth",
        points=points,
        numbers=numbers,
        reference_error=mode.resolution,
        orders=(fit_order(points, RUN + COMPENSATED_SUFFIX, 2, least=10 * careful_noise, most=0.01),),
        theory=(
            Theory("velocity Verlet on a frozen K", frozen, tuple(fine)),
            Theory("rounding of K", (mode.resolution,)),
        ),
    )
