"""The task "trigger": the critical amplitudes of waves for one scene."""

from __future__ import annotations

from ...pywrap import Scene
from ..packing_tools import Start
from ..trigger.compute import (
    Row,
    Wave,
    bisect_amplitude,
    equilibria,
    map_predictions,
    middle,
    settings,
    spread_over_map,
    threshold,
)
from .onset import onset


def trigger(scene: Scene, start: Start) -> Row:
    """The map of one scene, with the bisections that [trigger] asks for.

    Raises SceneError if the scene has no section [ramp], or no v_0.
    """
    threshold(scene)
    wave, first = settings(scene), onset(scene, start)
    if first["ends"] != "onset":
        return {"ends": first["ends"], "fx_c": None, "map": [], "measured": []}
    packings = equilibria(scene, [first["fx_c"] * (1 - each) for each in wave.distance])
    predicted = [row for _, rows in map_predictions(scene, packings, first["fx_c"], wave.distance) for row in rows]
    measured = [
        bisect_amplitude(Wave(scene, packings[each["fx"]], each)) for each in spread_over_map(predicted, wave.runs)
    ]
    return {
        "ends": "onset",
        "fx_c": first["fx_c"],
        "map": predicted,
        "measured": [each | {"amplitude": middle(each["below"], each["above"])} for each in measured],
    }
