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
from .study import Point, Settings, Study, Theory, fit_order
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
    study = partial(
        Study,
        name="time step: frequency",
        question=f"The frequency of the fastest mode of a packing of {len(mode.packing)} disks, {mode.exact:.6g}, from "
        f"{periods} of its periods.",
        error="relative error of the frequency",
    )
    return _study(
        settings,
        equilibrium,
        mode,
        study,
        periods * 2 * np.pi / mode.exact,
        "Take {coarse:g} of the limit 2/omega_max and take the dispersion out, omega = 2/dt sin(Omega dt/2): the error "
        "is then {noise:.0e}, whatever the step.",
        "Take 0.05 of the limit where the motion itself has to be right, which leaves {default:.0e} on the fastest "
        "mode, and no run at all where frequencies are all that is wanted: K has them to {spectrum:.0e}.",
    )


def growth(settings: Settings) -> Study:
    """The growth rate of D in a packing above its onset."""
    equilibrium = settings.at(0.024)
    mode = Mode.of(equilibrium.packing, growing=True)
    time = 5.0 if settings.quick else 10.0
    study = partial(
        Study,
        name="time step: growth rate",
        question=f"The growth rate 2 |Im omega| = {mode.exact:.6g} of the mean square displacement D at F_x = "
        f"{mode.packing.fx:g}, above the onset, from a run of time {time:g}.",
        error="relative error of the growth rate",
    )
    return _study(
        settings,
        equilibrium,
        mode,
        study,
        time,
        "Take {coarse:g} of the limit 2/omega_max, and take the dispersion out if {raw:.0e} is too much: the pair is "
        "{slower:.0f} times slower than the fastest mode, so that the rate hardly feels the step.",
        "Take the spectrum of K where the growth at one load is all that is wanted: it needs no run and has the rate "
        "to {spectrum:.0e}.",
    )


Measured = tuple[Mode, Sequence[tuple[complex, float]]]
"""A mode, and the frequency and the seconds of each run."""


def _study(
    settings: Settings,
    equilibrium: Equilibrium,
    mode: Mode,
    study: Callable[..., Study],
    time: float,
    many_steps: str,
    otherwise: str,
) -> Study:
    """Runs of a length over the time step; the advice is filled in."""
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
    figures = {
        "coarse": SHARES[1],
        "noise": noise,
        "default": points[SHARES.index(0.05)].error,
        "raw": points[1].error,
        "spectrum": max(own, mode.resolution),
        "slower": 2 / mode.limit / abs(np.sqrt(mode.eigenvalue)),
    }
    return study(
        parameter="time step",
        evaluations="steps",
        abscissa="parameter",
        reference="the eigenvalue of the frozen K, refined in extended precision; its error is what the rounding "
        "of K's entries amounts to",
        reference_error=mode.resolution,
        points=tuple(points),
        advice=(many_steps.format(**figures), otherwise.format(**figures)),
        orders=(order,),
        theory=(_dispersion(mode, steps), Theory("rounding of K", (mode.resolution,))),
        remarks=(_remark(mode, fine_mode, noise, careful_noise),),
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


def _remark(mode: Mode, fine_mode: Mode, noise: float, careful_noise: float) -> str:
    return (
        f"With the dispersion taken out, runs in doubles differ from K's eigenvalue by {noise:.0e}: the "
        "rounding of the coordinates, and that the packing is not quite linear at displacements of "
        f"{mode.amplitude:g}. In compensated arithmetic, at {fine_mode.amplitude:g}, it is {careful_noise:.0e}."
    )
