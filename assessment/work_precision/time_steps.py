r"""Error over the time step: of a trajectory, and of a growth rate.

**Trajectory.** Three disks: one is pressed down between two others that lie on the floor. They roll and slide apart.
All four contacts stay closed and slide at some time, two stick again, two turn by 16 and 19 degrees, and the overlaps
swing by their own size. The packing is soft, so that all this shows in the slips.

Velocity Verlet is of second order as long as the slip increment is. The force is continuously differentiable at
Coulomb's bound and the clamp is applied at the end of the step, so that passing the bound costs no order. A contact
that *forms* during the run would: its slip begins with zero at the end of a step.

**Growth rate.** The mode of a packing that grows fastest is excited in LAMMPS and measured: the packing is displaced
along the mode and left to undamped dynamics. The velocity, projected on the mode's left vector,
:math:`b = y^H M^{1/2} \dot q`, contains that mode alone, and at equal intervals h obeys

.. math:: b_{n+1} + b_{n-1} = 2 \cos(\Omega h)\, b_n ,

with complex :math:`\Omega`: least squares give :math:`\cos\Omega h`. The frequency that velocity Verlet gives is known
exactly, :math:`\sin\tfrac12\Omega\,\Delta t = \tfrac12\omega\,\Delta t`: the error is :math:`\omega^3 \Delta t^2/24`,
and it can be subtracted from the measured frequency.

The reference is the eigenvalue of the frozen K. The rounding of K's entries moves it by :math:`u |A|_F \kappa`, with
the condition :math:`\kappa = 1/|y^H x|`.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.linalg import eig

from ...analysis import MindlinLaw, Packing, dynamical_matrix, stable_timestep, touching
from ...analysis.arrays import Floats
from ...analysis.motion.eigenvalues import unit_rounding
from ...pywrap import Engine
from .study import Settings, Study, compensate, fit_order, study_of, timed

TIME, COARSEST = 2.0, 200
"""Length of the run of three disks, two swings of the overlaps, and its fewest steps: 60 to a period of the fastest
mode."""

STEP_SHARES = (0.8, 0.4, 0.2, 0.1, 0.05, 0.025)
"""Time steps in units of the limit 2/omega_max."""

RUN, RUN_CORRECTED = "run", "run, dispersion taken out"

AMPLITUDE = 1e-12
"""Largest coordinate of the displacement that a run starts with, length: far above what a coordinate is known to,
1e-23, and far below the overlaps, 1e-5 and more, so that the packing is nearly linear."""


def three_disks() -> Packing:
    """A disk between two on the floor, under a load that is not straight down; forces are out of balance."""
    overlap, gap, radius = 0.03, 0.02, np.array([0.5, 0.5, 0.4])
    x, y = 0.5 * (1 + gap), 0.5 - overlap
    position = np.array([[-x, y], [x, y], [0.0, y + np.sqrt((0.9 - overlap) ** 2 - x**2)]])
    law, top = MindlinLaw(kn=100.0, kt=100.0 * 2 / 7, mu=0.5), np.array([False, False, True])
    contacts = touching(position, radius)
    return Packing(position=position, radius=radius, contacts=contacts, law=law, top=top, fx=0.3, fy=3.0)


def trajectory(settings: Settings) -> Study:
    """Where three disks are after a time. The reference is Richardson's extrapolation of the runs with the most
    steps."""
    packing, (runs, finest) = three_disks(), (8, 204_800) if settings.quick else (10, 819_200)
    with Engine(packing) as engine:

        def run(steps: int) -> tuple[Floats, int]:
            engine.restore(packing)
            with engine.undamped(TIME / steps) as dynamics:
                dynamics.advance(steps)
                end = engine.packing
            return np.array([*end.position.T, end.scaled_angle]), steps

        ends = [run(finest // part)[0] for part in (4, 2, 1)]
        rough, exact = ((4 * ends[k + 1] - ends[k]) / 3 for k in (0, 1))
        steps = [COARSEST * 2**k for k in range(runs)]
        timings = [("LAMMPS", TIME / n, partial(run, n)) for n in steps]
        points, _ = timed(timings, settings, lambda end: float(np.abs(end - exact).max()))
    reference_error = float(np.abs(exact - rough).max())
    order = fit_order(points, "LAMMPS", 2, least=100 * reference_error)
    return study_of("trajectory", points, reference_error, {}, orders=[order])


def growth(settings: Settings) -> Study:
    """The growth rate of D in a packing above its onset: runs in compensated arithmetic over the time step, as they are
    and with the dispersion taken out."""
    packing, time = compensate(settings.at(0.024)).packing, 5.0 if settings.quick else 10.0
    sparse, active = dynamical_matrix(packing)
    matrix = sparse.toarray()
    values, left, right = eig(matrix, left=True, right=True)
    k = int(np.argmin(np.sqrt(values).imag))
    omega, limit = complex(np.sqrt(values[k])), stable_timestep(float(np.sqrt(np.abs(values).max())))
    exact, condition = 2 * abs(omega.imag), 1 / abs(np.vdot(left[:, k], right[:, k]))
    resolution = float(unit_rounding(matrix) * condition / abs(omega) / exact)
    root = np.sqrt(np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass]))
    displacement, onto = np.zeros((2, len(root)), dtype=np.complex128)
    displacement[active], onto[active] = right[:, k], left[:, k]
    start = displacement.real / root
    start *= AMPLITUDE / np.abs(start).max()
    with Engine(packing) as engine:

        def run(dt: float) -> tuple[list[float], int]:
            """Errors of the rate that a run shows, as it is, and with the dispersion taken out, no less than the
            rounding of a number; and its steps."""
            every = max(1, round(0.25 * np.pi / omega.real / dt))  # an eighth of a period
            engine.restore(engine.displace(packing, start))
            signal = []
            with engine.undamped(dt) as dynamics:
                for _ in range(max(4, int(time / dt / every))):
                    motion = dynamics.advance(every)
                    velocity = np.concatenate([*motion.velocity.T, packing.radius * motion.spin])
                    signal.append(np.vdot(onto, root * velocity))
            b = np.array(signal)
            cosine = np.vdot(b[1:-1], b[2:] + b[:-2]) / (2 * np.vdot(b[1:-1], b[1:-1]).real)
            seen = np.arccos(cosine) / (every * dt)
            off = (abs(2 * abs(each.imag) / exact - 1) for each in (seen, 2 / dt * np.sin(0.5 * dt * seen)))
            return [max(each, float(np.finfo(float).eps)) for each in off], int(time / dt)

        steps = (limit * np.array(STEP_SHARES[: len(STEP_SHARES) - settings.quick])).tolist()
        points, errors = timed([(RUN, dt, partial(run, dt)) for dt in steps], settings, lambda errors: errors[0])
    off = (each for _, each in errors)
    corrected = [point._replace(method=RUN_CORRECTED, error=each) for point, each in zip(points, off, strict=True)]
    noise = float(np.median([point.error for point in corrected]))
    order = fit_order(points, RUN, 2, least=10 * noise, most=0.01)
    numbers = {"packing": packing, "rate": exact, "length": time, "noise": noise, "amplitude": AMPLITUDE}
    numbers |= {"slower": 2 / limit / abs(omega), "resolution": resolution}
    return study_of("growth", points + corrected, resolution, numbers, orders=[order])
