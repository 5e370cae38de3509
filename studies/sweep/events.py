"""The tasks "trigger" and "eruptions" of a sweep: a row of what the studies of these names compute for one scene."""

from __future__ import annotations

from typing import Any

from ...pywrap import Scene
from ..eruptions.compute import erupt
from ..eruptions.study import starts_of
from ..packings import Start
from ..trigger.compute import bisected, chosen, equilibria, frequencies, middle, predictions, settings, threshold, waves
from .onset import onset


def trigger(scene: Scene, start: Start) -> dict[str, Any]:
    """Critical amplitudes over frequency and distance from the onset, with the bisections that [trigger] asks for.

    Raises
    ------
    SceneError
        If the scene has no section [ramp], or no v_0.
    """
    threshold(scene)
    wave, first = settings(scene), onset(scene, start)
    if first["ends"] != "onset":
        return {"ends": first["ends"], "fx_c": None, "map": [], "measured": []}
    packings = equilibria(scene, [first["fx_c"] * (1 - each) for each in wave.distance])
    by_distance = {each: packings[first["fx_c"] * (1 - each)] for each in sorted(wave.distance, reverse=True)}
    omegas = frequencies(next(iter(by_distance.values())), wave)
    predicted = [row for each, packing in by_distance.items() for row in predictions(scene, packing, each, omegas)]
    measured = [bisected(each) for each in waves(scene, packings, chosen(predicted, wave.runs))]
    return {
        "ends": "onset",
        "fx_c": first["fx_c"],
        "map": predicted,
        "measured": [each | {"amplitude": middle(each["below"], each["above"])} for each in measured],
    }


def eruptions(scene: Scene, _: Start) -> dict[str, Any]:
    """Sizes of the eruptions at each load of [eruptions], and what ended them; without their time series.

    Raises
    ------
    SceneError
        If the scene has no section [ramp] or [eruptions].
    """
    starts, flows_beyond = starts_of(scene)
    runs = [erupt(each) for each in starts]
    return {"runs": [{k: v for k, v in run.items() if k != "series"} for run in runs], "flows_beyond": flows_beyond}
