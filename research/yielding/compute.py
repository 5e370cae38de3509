r"""The yield of one packing: static, dynamic, and at finite rates of loading.

**Dynamic.** From the equilibria at the shares `SHARES` of the static yield, the disks are moved at random by `NOISE`
and let go, for `TIME`: undamped, and with dashpots of each restitution in `LOSSES`. Where no mode grows the noise stays
what it is: the layer is *stable*, and no run is made. A layer that moves by more than a diameter of the largest disk
flows. A layer that throws a disk out of the box *bursts*. Otherwise the disks are brought to rest by damped dynamics,
under the same load, and the equilibrium that they reach is compared with the first: D, slip of the layer, contacts that
are lost and gained.

**Finite rates.** With dashpots the load rises as F_x = rate t from zero up to the static yield, for each pair of rate
(F_y per unit of time) and restitution in `LOADINGS`. The distance from the quasi-static path is the root of D from the
equilibrium of the same load (between kept ones, by straight lines). The load is given at which this distance first
exceeds each of `BOUNDS`, and the load at which the layer *flows*: its slip exceeds a diameter of the largest disk, or a
disk leaves the box. A layer that flows at the same load with any loss has come to the end of its own branch of
equilibria. A layer that flows with little loss alone has been shaken off.

**The path.** Where a branch of equilibria ends, a layer that moves may come to rest in another configuration than
damped dynamics finds. The static yield is therefore computed with other increments, too, `INCREMENTS`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from faultgouge.analysis import Packing, Signal, nearest_image
from faultgouge.pywrap import Dynamics, Engine, EngineError, Equilibrium, Scene, dashpot, time_step
from faultgouge.studies.eruptions import growth_rate
from faultgouge.studies.packing_tools import contact_pairs
from research.modes.loss import impact_velocity, with_dashpots
from research.packing_tools import distance_of_bearing_disks, shake_disks
from research.yielding.static import Branch, FailedError, branch, layer_slip, rest

SHARES = (0.25, 0.5, 0.75, 0.9, 0.97)
"""Loads of the dynamic runs, in units of the static yield."""

LOSSES = (1.0, 0.9, 0.7)
"""Restitutions of the dynamic runs; 1 is undamped."""

NOISE = 1e-12
"""Standard deviation of the random displacement of each coordinate."""

TIME = 50.0
"""Length of a dynamic run, time."""

LOOKS = 50
"""Looks at the disks in a dynamic run."""

LOADING_LOOKS = 200
"""Looks at the disks while the load rises."""

CONTROLLED_RATE = 0.01
"""Rate of loading, F_y per unit of time, at which layers with more loss are looked at, too."""

LOADINGS = (
    (10.0, 0.9),
    (1.0, 0.9),
    (0.1, 0.9),
    (CONTROLLED_RATE, 0.9),
    (CONTROLLED_RATE, 0.5),
    (CONTROLLED_RATE, 0.1),
    (0.001, 0.9),
)
"""Rates of loading with the restitution."""

INCREMENTS = (0.005, 0.02)
"""Increments of F_x with which the static yield is computed again, in units of F_y."""

BOUNDS = (1e-3, 1e-2)
"""Distances from the quasi-static path, in diameters of a small disk."""


def yielding(scene: Scene, settled: Equilibrium) -> dict[str, Any]:
    """One row: the static yield, the dynamic runs, the runs at finite rates."""
    path = branch(settled)
    fy, last = scene.load.fy, path.equilibria[-1].fx
    return {
        "newton": path.newton / fy,
        "static": last / fy,
        "static_by_increment": [[step, branch(settled, step).equilibria[-1].fx / fy] for step in INCREMENTS],
        "jumps": [[fx / fy, moved] for fx, moved in path.jumps],
        "dynamic": list(dynamic_runs(scene, path)),
        "loading": [
            {"rate": rate, "restitution": loss} | raise_load(path, dashpots(scene, loss), rate)
            for rate, loss in LOADINGS
        ],
    }


def dynamic_runs(
    scene: Scene, path: Branch, losses: Sequence[float] = LOSSES, draws: int = 1, *, all_layers: bool = False
) -> Iterator[dict[str, Any]]:
    """The runs from the equilibria at `SHARES` with each loss; loads between two that are borne may be none.

    A run that noise decides is made with several draws of the noise; a stable layer has one row, unless all layers are
    asked for.
    """
    seed, last = scene.packing.model_dump().get("seed", 0), path.equilibria[-1].fx
    for share in SHARES:
        here = path.borne(share * last)
        if here is None:
            continue
        for loss in losses:
            known = {"share": share, "restitution": loss, "fx_over_fy": here.fx / scene.load.fy}
            for draw in range(draws):
                row = known | dynamic(here, dashpots(scene, loss), noise_seed(seed, draw), all_layers=all_layers)
                yield row | ({"draw": draw} if draws > 1 else {})
                if row["ends"] == "stable":
                    break


def noise_seed(seed: int, draw: int) -> int:
    """Of the noise of a packing: its own seed, and others for further draws."""
    return seed + 1000 * draw


def dashpots(scene: Scene, restitution: float) -> float:
    """C_N of a restitution in a scene."""
    return dashpot(scene.law.kn, restitution, 1.0, impact_velocity(scene))


def dynamic(start: Equilibrium, cn: float, seed: int, *, all_layers: bool = False) -> dict[str, Any]:
    """A run from an equilibrium with noise, and where it comes to rest; of a stable layer only if it is asked for."""
    packing = with_dashpots(start.packing, cn)
    dt = time_step(packing)
    rate = growth_rate(packing)
    if rate == 0 and not all_layers:
        return {"rate": rate, "ends": "stable", "largest_D": NOISE**2, "slip": 0.0, "D": NOISE**2}
    slip = largest = 0.0
    with Engine(packing) as engine:
        shake_disks(engine, packing, NOISE, seed)
        before = engine.packing
        with engine.undamped(dt) as dynamics:
            for _ in range(LOOKS):
                if not _advance(dynamics, int(TIME / dt / LOOKS)):
                    return {"rate": rate, "ends": "bursts", "largest_D": largest, "slip": slip}
                now = engine.packing
                slip, before = slip + layer_slip(before, now), now
                largest = max(largest, distance_of_bearing_disks(packing, now))
                if abs(slip) > 2 * packing.radius.max():
                    return {"rate": rate, "ends": "flows", "largest_D": largest, "slip": slip}
        return {"rate": rate, "largest_D": largest} | _bring_to_rest(engine, packing, slip, start.residual)


def _advance(dynamics: Dynamics, steps: int) -> bool:
    """Go on by some steps; False if a disk leaves the box on the way, after which LAMMPS has no state."""
    try:
        dynamics.advance(steps)
    except EngineError as error:
        if "Lost atoms" not in str(error):
            raise
        return False
    return True


def _bring_to_rest(engine: Engine, packing: Packing, slip: float, residual: float) -> dict[str, Any]:
    """Where the disks come to rest after a run in which the layer has moved by `slip`."""
    try:
        found, moved = rest(engine)
    except FailedError:
        return {"ends": "fails at rest", "slip": slip}
    first, last = (contact_pairs(each.loaded(residual)) for each in (packing, found.packing))
    return {
        "ends": "rests",
        "slip": slip + moved,
        "D": distance_of_bearing_disks(packing, found.packing),
        "lost": len(first - last),
        "gained": len(last - first),
    }


def raise_load(path: Branch, cn: float, rate: float) -> dict[str, Any]:
    """The load rises at a rate up to the static yield: where the layer leaves the quasi-static path, where it flows."""
    before = packing = with_dashpots(path.equilibria[0].packing, cn)
    fy, last = packing.fy, path.equilibria[-1].fx
    duration = last / (rate * fy)
    dt = time_step(packing)
    looks = min(LOADING_LOOKS, int(duration / dt))
    left: dict[float, float | None] = dict.fromkeys(BOUNDS)
    slip, largest, flows = 0.0, 0.0, None
    signal = Signal(np.array([0.0, 2 * duration]), np.array([0.0, 2 * last]))
    with Engine(packing) as engine, engine.undamped(dt, signal=signal) as dynamics:
        for look in range(1, looks + 1):
            steps = int(duration / dt * look / looks) - engine.steps
            if not _advance(dynamics, steps):
                flows = flows or last * look / looks / fy
                break
            now, fx = engine.packing, engine.steps * dt * rate * fy
            slip, before = slip + layer_slip(before, now), now
            if flows is None and abs(slip) > 2 * packing.radius.max():
                flows = fx / fy
            off = _distance_from_path(path, fx, now)
            largest = max(largest, off)
            for bound in BOUNDS:
                if left[bound] is None and off > bound:
                    left[bound] = fx / fy
    return {"left": [left[each] for each in BOUNDS], "largest": largest, "slip": slip, "flows": flows}


def _distance_from_path(path: Branch, fx: float, now: Packing) -> float:
    """Root of D from the equilibrium at fx, disks that carry nothing there left out."""
    place = max(1, next((k for k, each in enumerate(path.equilibria) if each.fx >= fx), len(path.equilibria) - 1))
    below, above = path.equilibria[place - 1].packing, path.equilibria[place].packing
    share = (fx - below.fx) / (above.fx - below.fx)
    between = below.position + share * nearest_image(above.position - below.position, below.box_length)
    away = nearest_image(now.position - between, below.box_length)
    carrying = np.ones(len(now), dtype=bool)
    carrying[below.rattlers] = carrying[above.rattlers] = False
    return float(np.sqrt(np.mean(np.sum(away[carrying] ** 2, axis=1))))
