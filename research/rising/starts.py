"""One layer, two vibrations: motion under a load that rises, from two starts, one-sided and in LAMMPS.

The layers are those of :mod:`.compute` at `COMPARED`. A drag fades out at first, on all coordinates or not on
rotations; then windows are measured for `FOLLOWED` chunks, more than twice as long as the rows of the layers.

**The rule.** The two seeds whose vibration in LAMMPS is not that of one-sided motion from the first start; then the
seeds 1, 2, 3, ... in this order, as many as the time allowed.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from faultgouge.analysis import Packing
from faultgouge.analysis.motion.one_sided import OneSidedSystem, forces_on_coordinates
from faultgouge.analysis.motion.one_sided_outcome import STEPS_OF_CHUNK, VERDICT_STEP
from faultgouge.analysis.motion.rising_load import FADE, windows_under_load
from faultgouge.pywrap import Scene, dashpot, settle
from research.laws.both_laws import as_slider, at_loads
from research.modes.loss import impact_velocity, with_dashpots
from research.modes.sets import sets
from research.rising.compute import COMPARED, RATES, windows_in_lammps

APART = (11, 15)
"""The seeds that are looked at first."""

FOLLOWED = 60


def layer(seed: int) -> Packing:
    """The layer of the standard law with its dashpots, at `COMPARED`."""
    load, restitution = COMPARED
    base = sets()["force 100"].scene
    fy = base["load"]["fy"]
    changes = {"packing": base["packing"] | {"seed": seed}, "ramp": {"step": 1e-3 * fy, "until": load * fy}}
    scene = Scene.from_mapping(base | changes | {"modes": {"fx_over_fy": [load]}})
    start = settle(scene)
    found = list[Packing]()

    def keep(packing: Packing) -> dict[str, Any]:
        found.append(packing)
        return {}

    law = scene.law.model_copy(update={"history": "coulomb"})
    at_loads(scene.model_copy(update={"law": law}), replace(start, packing=as_slider(start.packing)), keep)
    return with_dashpots(found[0], dashpot(scene.law.kn, restitution, 1.0, impact_velocity(scene)))


def rows_of(seed: int) -> Iterator[dict[str, Any]]:
    """Vibration over the rate in one window after the other, of both starts."""
    begin, packing = time.process_time(), layer(seed)
    system = OneSidedSystem.of(packing, VERDICT_STEP)
    chunk = STEPS_OF_CHUNK * system.time_step / system.step_share
    force = np.zeros((len(packing), 2))
    force[:, 0] = packing.top
    direction = forces_on_coordinates(packing.configuration, force)
    followed = list(islice(windows_under_load(system, direction, chunk), FOLLOWED))[FADE:]
    windows = np.array([window.drift_and_vibration(system) for window in followed])
    lammps = [windows_in_lammps(packing, min(RATES), spins, FOLLOWED) for spins in (True, False)]
    yield {
        "seed": seed,
        "chunk": chunk,
        "one_sided": {"drift": windows[:, 0].T.tolist(), "vibration": windows[:, 1].T.tolist()},
        "lammps": {name: np.array(lammps)[:, :, k].tolist() for k, name in enumerate(("drift", "vibration"))},
        "cpu_seconds": time.process_time() - begin,
    }


def order(seeds: int) -> list[int]:
    """Seeds in the order of the rule."""
    return [*APART, *(seed for seed in range(1, seeds + 1) if seed not in APART)]
