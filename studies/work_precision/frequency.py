r"""Error of a frequency and of a growth rate over the time step.

A mode of a packing is excited and measured (:mod:`~faultgouge.studies.work_precision.mode`). What velocity Verlet makes
of a frequency is known exactly, :math:`\sin\tfrac12\Omega\,\Delta t = \tfrac12\omega\,\Delta t`: the error is
:math:`\omega^3 \Delta t^2/24`, and it can be taken out of what was measured.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ...analysis import discrete_frequency
from ...pywrap import Engine, Equilibrium
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
    shares = SHARES[: len(SHARES) - settings.quick]
    steps = [share * mode.limit for share in shares]
    fine_mode = Mode.of(compensated(equilibrium).packing, mode.growing)
    with Engine(mode.packing) as engine, Engine(fine_mode.packing) as fine_engine:
        jobs: list[Callable[[], complex]] = [partial(mode.measured, engine, dt, time) for dt in steps]
        jobs += [partial(fine_mode.measured, fine_engine, dt, time) for dt in steps]
        *runs, (alone, seconds_alone) = timed([*jobs, mode.from_spectrum], settings.repeats, settings.progress)
    plain, careful = runs[: len(steps)], runs[len(steps) :]
    points = []
    for method, one, found_at, change in (
        (RUN, mode, plain, lambda found, _: found),
        (CAREFUL_RUN, fine_mode, careful, lambda found, _: found),
        (CORRECTED, mode, plain, corrected),
        (COMPENSATED, fine_mode, careful, corrected),
    ):
        for dt, (found, seconds) in zip(steps, found_at, strict=True):
            off = max(abs(one.quantity(change(found, dt)) / one.exact - 1), float(np.finfo(float).eps))
            points.append(Point(method, dt, off, seconds, int(time / dt)))
    own = max(abs(alone / exact - 1), float(np.finfo(float).eps))
    points.append(Point(SPECTRUM, None, own, seconds_alone, None))
    noise, careful_noise = (
        float(np.median([point.error for point in points if point.method == method]))
        for method in (CORRECTED, COMPENSATED)
    )
    raw = {share: point.error for share, point in zip(shares, points, strict=False)}
    fine = np.geomspace(steps[-1], steps[0], 60)
    predicted = [abs(mode.quantity(complex(discrete_frequency(mode.eigenvalue, dt))) / exact - 1) for dt in fine]
    order = fit_order(points, CAREFUL_RUN, 2, least=10 * careful_noise, most=0.01)
    figures = {
        "coarse": shares[1],
        "noise": noise,
        "default": raw[0.05],
        "raw": raw[shares[1]],
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
        theory=(
            Theory("velocity Verlet on a frozen K", tuple(map(float, predicted)), tuple(map(float, fine))),
            Theory("rounding of K", (mode.resolution,)),
        ),
        remarks=(
            f"With the dispersion taken out, runs in doubles differ from K's eigenvalue by {noise:.0e}: the "
            "rounding of the coordinates, and that the packing is not quite linear at displacements of "
            f"{mode.amplitude:g}. In compensated arithmetic, at {fine_mode.amplitude:g}, it is {careful_noise:.0e}.",
        ),
    )
