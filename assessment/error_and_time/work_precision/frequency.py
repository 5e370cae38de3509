r"""Error of a frequency and of a growth rate over the time step.

A mode of a packing is excited and measured (:mod:`~faultgouge.assessment.error_and_time.work_precision.mode`). What
velocity Verlet makes of a frequency is known exactly,
:math:`\sin\tfrac12\Omega\,\Delta t = \tfrac12\omega\,\Delta t`: the error is
:math:`\omega^3 \Delta t^2/24`, and it can be taken out of what was measured.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ....analysis import discrete_frequency
from ....analysis.packing.packing import Floats
from ....pywrap import Engine, Equilibrium
from .mode import Mode
from .study import Point, Settings, Study, Theory, compensated, fit_order, study_of, timed

SHARES = (0.8, 0.4, 0.2, 0.1, 0.05, 0.025)
"""Time steps in units of the limit 2/omega_max."""

RUN, CORRECTED, SPECTRUM = "run", "run, dispersion taken out", "eigenvalue of K, no run"
CAREFUL = ", compensated"
"""Ends the name of a method in compensated arithmetic."""


def corrected(frequency: complex, dt: float) -> complex:
    """omega with velocity Verlet's dispersion taken out of Omega: 2/dt sin(Omega dt/2), radian / time."""
    return complex(2 / dt * np.sin(0.5 * dt * frequency))


def frequency(settings: Settings) -> Study:
    """The frequency of the fastest mode of a stable packing."""
    equilibrium = settings.at(0.01)
    mode = Mode.of(equilibrium.packing, growing=False)
    periods = 50 if settings.quick else 100
    return _study("frequency", settings, equilibrium, mode, periods, periods * 2 * np.pi / mode.exact)


def growth(settings: Settings) -> Study:
    """The growth rate of D in a packing above its onset."""
    equilibrium = settings.at(0.024)
    time = 5.0 if settings.quick else 10.0
    return _study("growth", settings, equilibrium, Mode.of(equilibrium.packing, growing=True), time, time)


def _study(name: str, settings: Settings, equilibrium: Equilibrium, mode: Mode, length: float, time: float) -> Study:
    """Runs of a time, which is called a length in the words, over the time step."""
    steps = mode.limit * np.array(SHARES[: len(SHARES) - settings.quick])
    fine_mode = Mode.of(compensated(equilibrium).packing, mode.growing)
    points = _points(settings, mode, fine_mode, steps, time)
    noise, careful_noise = (
        float(np.median([point.error for point in points if point.method == method]))
        for method in (CORRECTED, CORRECTED + CAREFUL)
    )
    numbers = {
        "mode": mode,
        "fine_mode": fine_mode,
        "disks": len(mode.packing),
        "length": length,
        "coarse": SHARES[1],
        "noise": noise,
        "careful_noise": careful_noise,
        "default": points[SHARES.index(0.05)].error,
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
        orders=(fit_order(points, RUN + CAREFUL, 2, least=10 * careful_noise, most=0.01),),
        theory=(_dispersion(mode, steps), Theory("rounding of K", (mode.resolution,))),
    )


def _points(settings: Settings, mode: Mode, fine_mode: Mode, steps: Floats, time: float) -> tuple[Point, ...]:
    """The runs in both arithmetics, as they are and with the dispersion taken out, and K's eigenvalue."""
    with Engine(mode.packing) as engine, Engine(fine_mode.packing) as fine_engine:
        runs = [(RUN, mode, engine, dt) for dt in steps.tolist()]
        runs += [(RUN + CAREFUL, fine_mode, fine_engine, dt) for dt in steps.tolist()]
        jobs: list[Callable[[], complex]] = [partial(one.measured, on, dt, time) for _, one, on, dt in runs]
        (*found, alone), seconds = timed([*jobs, mode.from_spectrum], settings)
    plain, out = [], []
    for (method, one, _, dt), value, spent in zip(runs, found, seconds[:-1], strict=True):
        work = spent, int(time / dt)
        plain.append(Point(method, dt, _off(one, one.quantity(value)), *work))
        out.append(
            Point(CORRECTED + method.removeprefix(RUN), dt, _off(one, one.quantity(corrected(value, dt))), *work)
        )
    return *plain, *out, Point(SPECTRUM, None, _off(mode, alone.real), seconds[-1], None)


def _off(mode: Mode, quantity: float) -> float:
    """Relative error, no less than the rounding of a number."""
    return max(abs(quantity / mode.exact - 1), float(np.finfo(float).eps))


def _dispersion(mode: Mode, steps: Floats) -> Theory:
    """What velocity Verlet makes of a mode of a frozen K."""
    fine = np.geomspace(steps[-1], steps[0], 60).tolist()
    predicted = [abs(mode.quantity(complex(discrete_frequency(mode.eigenvalue, dt))) / mode.exact - 1) for dt in fine]
    return Theory("velocity Verlet on a frozen K", tuple(map(float, predicted)), tuple(fine))
