"""Growth with loss in LAMMPS, under both laws: the task "growth".

The plugin integrates what :mod:`.both_laws` decomposes: at each load of [modes] the equilibrium of the smoothed law,
the same disks and forces with the slider, and the equilibrium to which the slider's own ramp leads, each with dashpots
of a restitution. Disks are displaced at random by `SEED` and let go from rest, `DRAWS` times. Nothing but the dashpots
damps.

With the slider D rises at once, by up to four decades: contacts at the bound give way to the push, and the layer rests
beside where it was. How far is proportional to the push. So motion is said to grow only where D comes to `TO`, nine
decades above its start.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from faultgouge.analysis import Packing
from faultgouge.pywrap import Engine, Equilibrium, Scene, dashpot, time_step
from research.laws.both_laws import as_slider, at_loads
from research.modes.loss import fastest, impact_velocity, with_dashpots
from research.packing_tools import distance_of_bearing_disks, shake_disks

RESTITUTIONS = (0.97, 0.9)

DRAWS = 3
"""Draws of noise: one draw may have next to nothing of the motion that grows."""

SEED = 1e-11
"""Standard deviation of the displacement of each coordinate, length. D of what the rounding of forces moves meanwhile
is 1e-22."""

FROM, TO = 1e-18, 1e-13
"""D between which its growth is fitted; at `TO` a run ends. A layer with the slider whose contacts have been shaken
down rests beside where it was, at a D of up to 1e-18."""

TIME, LOOK = 50.0, 0.037
"""Length of a run and time between looks at D. A motion that grows at 2 Re s = 0.45 comes from `SEED` to `TO`."""


def growth(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """The runs of one packing, as a row of a sweep."""
    strengths = {each: dashpot(scene.law.kn, each, 1.0, impact_velocity(scene)) for each in RESTITUTIONS}

    def runs(packing: Packing) -> dict[str, Any]:
        found = []
        for each, cn in strengths.items():
            damped = with_dashpots(packing, cn)
            rates = [grow(damped, draw) for draw in range(DRAWS)]
            found.append({"restitution": each, "predicted": 2 * fastest(damped).real, "draws": rates})
        return {"runs": found}

    smooth = at_loads(scene, rest, lambda packing: {"smooth": runs(packing), "same": runs(as_slider(packing))})
    law = scene.law.model_copy(update={"history": "coulomb"})
    start = replace(rest, packing=as_slider(rest.packing))
    own = at_loads(scene.model_copy(update={"law": law}), start, lambda packing: {"loaded": runs(packing)})
    return {"ends": smooth["ends"], "ends_loaded": own["ends"], "loads": [*smooth["loads"], *own["loads"]]}


def grow(packing: Packing, draw: int) -> dict[str, Any]:
    """D at the end of a run over that at its first look, and the rate of its growth, 1 / time, None if it grows not."""
    dt = time_step(packing)
    steps = max(1, round(LOOK / dt))
    times: list[float] = []
    squares: list[float] = []
    with Engine(packing, MPI.COMM_SELF) as engine:
        shake_disks(engine, packing, SEED, draw)
        with engine.undamped(dt) as dynamics:
            while engine.steps * dt < TIME and (not squares or squares[-1] < TO):
                dynamics.advance(steps)
                times.append(engine.steps * dt)
                squares.append(distance_of_bearing_disks(packing, engine.packing))
    return growth_of_course(times, squares)


def growth_of_course(times: list[float], squares: list[float]) -> dict[str, Any]:
    """Growth of D, length^2, in a run: the last look over the first, and the rate if D came to `TO`."""
    course = np.array(squares)
    row: dict[str, Any] = {"last_over_first": float(course[-1] / course[0]), "time": times[-1], "rate": None}
    if course[-1] >= TO:
        begin = int(np.flatnonzero(course < FROM)[-1]) + 1
        row["rate"] = float(np.polyfit(times[begin:], np.log(course[begin:]), 1)[0])
    return row
