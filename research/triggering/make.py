"""The packing of scenes/triggered.toml: seeds are tried until one is found whose packing erupts, by a rule.

The load is a thousandth below the first onset. The rule: with the weakened friction, D grows by `LEAST_GROWTH` decades
after its jump in the time of the scene's run, and has `LEAST_ROOM` decades for that, by the linear theory
(:mod:`~faultgouge.studies.triggering`); and the packing has an onset for the weakened friction at a lower
load, below which the control is. No run is made.

python -m research.triggering.make [FIRST] > research/triggering/triggered.jsonl
"""

import json
import sys
from collections.abc import Iterable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

from faultgouge.analysis import NoEquilibriumError, OnsetError
from faultgouge.pywrap import Scene, SceneError, onset_run, reach
from faultgouge.studies.triggering import Forecast, forecast
from research.packing_tools import with_seed

SCENE = Path(__file__).parents[2] / "scenes" / "triggered.toml"

BELOW = 1e-3
"""How far below the onset the load of the rule is, relative."""

LEAST_ROOM = 4.5
"""Decades of D, from the jump to the end of linear motion, that the rule asks for."""

LEAST_GROWTH = 4.0
"""Decades by which D grows in the linear motion, from the jump to the end of the run, that the rule asks for."""


def choose_seed(scene: Scene, seeds: Iterable[int]) -> Iterator[dict[str, Any]]:
    """Try seeds until one is found whose packing erupts, by the rule; the last one that is yielded is it.

    Parameters
    ----------
    scene : Scene
        With [ramp], [perturb] for the time, and [friction]; its seed and fx do not matter.
    seeds : iterable of int
        In the order in which they are tried.

    Yields
    ------
    dict
        seed; says : why it is not the one, empty for the one that is; fx : the load, None if there is no onset;
        forecast : of a run there, as a dict, or None.
    """
    for seed in seeds:
        found = _try_seed(with_seed(scene, seed), seed)
        yield found
        if not found["says"]:
            return


def _try_seed(scene: Scene, seed: int) -> dict[str, Any]:
    friction, perturb = scene.friction, scene.perturb
    assert friction is not None
    assert perturb is not None
    time = perturb.time
    mu = scene.law.mus[0]
    try:
        fx = float(f"{(1 - BELOW) * onset_run(scene, mu).fx_c:.5g}")
        *_, start = reach(scene, fx)
        foreseen = forecast(start, mu * friction.mu_ss, time)
        says = _falls_short(foreseen)
        if not says and onset_run(scene, mu * friction.mu_ss).fx_c >= fx:
            says = "the onset of the weakened friction is not below it"
    except (OnsetError, NoEquilibriumError, SceneError) as error:
        return {"seed": seed, "says": str(error), "fx": None, "forecast": None}
    return {"seed": seed, "says": says, "fx": fx, "forecast": foreseen._asdict()}


def _falls_short(foreseen: Forecast) -> str:
    if foreseen.room < LEAST_ROOM:
        return f"a jump {foreseen.room:.1f} decades below the end of linear motion"
    if foreseen.growth < LEAST_GROWTH:
        return f"a growth by {foreseen.growth:.1f} decades"
    return ""


if __name__ == "__main__":
    first = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    for tried in choose_seed(Scene.from_toml(SCENE), count(first)):
        print(json.dumps(tried), flush=True)
