"""Growth with dashpots in LAMMPS, beside the pencil's: the task "lossy runs".

At each load of [modes] and for each restitution of `RESTITUTIONS` with which the pencil says that motion grows by at
least `LEAST`, the disks are displaced at random by `SEED` and let go from rest. Without that displacement nothing would
be seen: a velocity times the time step would be less than the last place of a coordinate. D is fitted by an exponential
between `FROM` and `TO`, in logarithms. That is long after the motions that decay have gone, and far below the overlaps.

Each run is made with and without tangential dashpots. A contact at Coulomb's bound has no derivative by the velocity
where it has a tangential dashpot, and the pencil leaves that dashpot out; without tangential dashpots there is nothing
to leave out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from faultgouge.analysis import Packing
from faultgouge.pywrap import Engine, Equilibrium, Scene, dashpot, time_step
from faultgouge.studies.modes import along_ramp
from research.modes.loss import TANGENTIAL, fastest, impact_velocity, with_dashpots
from research.packing_tools import distance_of_bearing_disks, shake_disks

RESTITUTIONS = (0.97, 0.9, 0.8)

LEAST = 0.3
"""Re s of the slowest growth that is measured, 1 / time."""

SEED = 1e-12
"""Standard deviation of the displacement of each coordinate, length."""

FROM, TO = 1e-20, 1e-15
"""D between which its growth is fitted: five decades, above the noise and below what the law's curvature bends."""

LOOKS = 20
"""Looks at D in the time in which it grows e-fold."""

LONGEST = 60.0
"""Time of a run, in units of that in which D grows e-fold."""

GOLDEN = 0.618
"""Golden section of one."""


def lossy_runs(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """The runs of a packing along its ramp, as a row of a sweep."""
    velocity = impact_velocity(scene)

    def look(packing: Packing) -> dict[str, Any]:
        runs = []
        for each in RESTITUTIONS:
            cn = dashpot(scene.law.kn, each, 1.0, velocity)
            for ratio in (TANGENTIAL, 0.0):
                damped = with_dashpots(packing, cn, ratio)
                rate = fastest(damped)
                if rate.real >= LEAST:
                    run: dict[str, Any] = {"restitution": each, "ct_over_cn": ratio, "predicted": 2 * rate.real}
                    runs.append(run | {"measured": measure_growth(damped, rate)})
        return {"runs": runs, "sliding": int(np.count_nonzero(packing.sliding))}

    return along_ramp(scene, rest, look)


def measure_growth(packing: Packing, rate: complex) -> float | None:
    """Growth rate of D from a small random displacement, 1 / time; None if D does not come to `TO`.

    Looks that were a multiple of the period of D apart would all see it in the same phase, or drift through its phases
    slowly; the golden section of a period spreads them over all phases.
    """
    dt = time_step(packing)
    period = np.pi / rate.imag
    periods = GOLDEN + max(0, round(1 / (LOOKS * 2 * rate.real * period)))
    steps = max(1, round(periods * period / dt))
    times, squares = [], []
    with Engine(packing, MPI.COMM_SELF) as engine:
        shake_disks(engine, packing, SEED, 0)
        with engine.undamped(dt) as dynamics:
            for _ in range(int(LONGEST / (2 * rate.real * steps * dt))):
                dynamics.advance(steps)
                times.append(engine.steps * dt)
                squares.append(distance_of_bearing_disks(packing, engine.packing))
                if squares[-1] > TO:
                    break
    if not squares or squares[-1] < TO:
        return None
    course = np.array(squares)
    begin = int(np.flatnonzero(course < FROM)[-1]) + 1
    return float(np.polyfit(times[begin:], np.log(course[begin:]), 1)[0])
