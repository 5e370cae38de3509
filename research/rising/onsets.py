"""How much the loss raises the first onset: damped over undamped onsets of the smoothed law.

An onset is the first load at which a motion grows, and its growth rate is zero there: a weak loss moves the onset a
little, and a strong one to where the growth of another pair is faster than the loss. The layers are those of
:mod:`.compute` with the smoothed law, and dashpots of a restitution with C_T = 2/7 C_N, up to `UNTIL`.

**The rule.** The seeds 1, 2, 3, ... in this order, each with all of `RESTITUTIONS`, as many as the time allowed.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import faultgouge
from faultgouge.analysis import NoEquilibriumError
from faultgouge.analysis.windows import OnsetError
from faultgouge.pywrap import Scene, dashpot
from research.modes.loss import TANGENTIAL, impact_velocity
from research.modes.sets import sets

RESTITUTIONS = (0.99, 0.9)
UNTIL = 0.2
"""Largest load, F_x/F_y."""


def rows_of(seed: int) -> Iterator[dict[str, Any]]:
    """The onsets of one seed, F_x; None where nothing grows up to `UNTIL`, or up to where the ramp ends."""
    begin, base = time.process_time(), sets()["force 100"].scene
    fy = base["load"]["fy"]
    changes = {"packing": base["packing"] | {"seed": seed}, "ramp": {"step": 1e-3 * fy, "until": UNTIL * fy}}
    scene = Scene.from_mapping(base | changes)
    row: dict[str, Any] = {"seed": seed, "undamped": _onset(scene)}
    for restitution in RESTITUTIONS:
        cn = dashpot(scene.law.kn, restitution, 1.0, impact_velocity(scene))
        lossy = Scene.from_mapping(base | changes | {"damping": {"cn": cn, "ct": TANGENTIAL * cn}})
        row[str(restitution)] = _onset(lossy)
    yield row | {"cpu_seconds": time.process_time() - begin}


def _onset(scene: Scene) -> float | None:
    try:
        return float(faultgouge.onset(scene).fx_c)
    except (OnsetError, NoEquilibriumError):
        return None
