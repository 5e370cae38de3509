r"""Error of a frequency and of a growth rate over the time step.

A mode of a packing is excited and measured (:mod:`~faultgouge.assessment.error_and_time.work_precision.mode`). What
velocity Verlet makes of a frequency is known exactly,
:math:`\sin\tfrac12\Omega\,\Delta t = \tfrac12\omega\,\Delta t`: the error is
:math:`\omega^3 \Delta t^2/24`, and it can be taken out of what was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from ....analysis import discrete_frequency
from ....pywrap import Engine, Equilibrium
from .mode import Mode
from .precision import compensated
from .study import Point, Settings, Study, Theory, fit_order, study_of
from .timing import timed

SHARES = (0.8, 0.4, 0.2, 0.1, 0.05, 0.025)
"""Time steps in units of the limit 2/omega_max."""

METHODS = (
    "run",
    "run, compensated",
    "run, dispersion taken out",
    "run, dispersion taken out, compensated",
    "eigenvalue of K, no run",
)
RUN, CAREFUL_RUN, CORRECTED, COMPENSATED, SPECTRUM = METHODS


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


Measured = tuple[Mode, Sequence[tuple[complex, float]]]
"""A mode, and the frequency and the seconds of each run."""


def _study(name: str, settings: Settings, equilibrium: Equilibrium, mode: Mode, length: float, time: float) -> Study:
    """Runs of a time, which is called a length in the words, over the time step."""
    exact = mode.exact
    steps = [share * mode.limit for share in SHARES[: len(SHARES) - settings.quick]]
    fine_mode = Mode.of(compensated(equilibrium).packing, mode.growing)
    *runs, (alone, seconds_alone) = _measured(settings, mode, fine_mode, steps, time)
    plain, careful = runs[: len(steps)], runs[len(steps) :]
    points = _points((mode, plain), (fine_mode, careful), steps, time)
    own = max(abs(alone / exact - 1), float(np.finfo(float).eps))
    points.append(Point(SPECTRUM, None, own, seconds_alone, None))
    noise, careful_noise = (_typical(points, method) for method in (CORRECTED, COMPENSATED))
    order = fit_order(points, CAREFUL_RUN, 2, least=10 * careful_noise, most=0.01)
    return study_of(
        name,
        "one mode",
        points=points,
        reference_error=mode.resolution,
        orders=(order,),
        theory=(_dispersion(mode, steps), Theory("rounding of K", (mode.resolution,))),
        mode=mode,
        fine_mode=fine_mode,
        disks=len(mode.packing),
        length=length,
        coarse=SHARES[1],
        noise=noise,
        careful_noise=careful_noise,
        default=points[SHARES.index(0.05)].error,
        raw=points[1].error,
        spectrum=max(own, mode.resolution),
        slower=2 / mode.limit / abs(np.sqrt(mode.eigenvalue)),
    )


def _measured(
    settings: Settings, mode: Mode, fine_mode: Mode, steps: Sequence[float], time: float
) -> list[tuple[complex, float]]:
    """Frequency and seconds of the runs in doubles, of those in compensated arithmetic, and of K's eigenvalue."""
    with Engine(mode.packing) as engine, Engine(fine_mode.packing) as fine_engine:
        jobs: list[Callable[[], complex]] = [partial(mode.measured, engine, dt, time) for dt in steps]
        jobs += [partial(fine_mode.measured, fine_engine, dt, time) for dt in steps]
        return timed([*jobs, mode.from_spectrum], settings.repeats, settings.progress)


def _typical(points: Sequence[Point], method: str) -> float:
    return float(np.median([point.error for point in points if point.method == method]))


def _points(plain: Measured, careful: Measured, steps: Sequence[float], time: float) -> list[Point]:
    """The runs in both arithmetics, as they are and with the dispersion taken out."""
    points = []
    for method, one, found_at, change in (
        (RUN, *plain, lambda found, _: found),
        (CAREFUL_RUN, *careful, lambda found, _: found),
        (CORRECTED, *plain, corrected),
        (COMPENSATED, *careful, corrected),
    ):
        for dt, (found, seconds) in zip(steps, found_at, strict=True):
            off = max(abs(one.quantity(change(found, dt)) / one.exact - 1), float(np.finfo(float).eps))
            points.append(Point(method, dt, off, seconds, int(time / dt)))
    return points


def _dispersion(mode: Mode, steps: Sequence[float]) -> Theory:
    """What velocity Verlet makes of a mode of a frozen K."""
    fine = np.geomspace(steps[-1], steps[0], 60)
    predicted = [abs(mode.quantity(complex(discrete_frequency(mode.eigenvalue, dt))) / mode.exact - 1) for dt in fine]
    return Theory("velocity Verlet on a frozen K", tuple(map(float, predicted)), tuple(map(float, fine)))
