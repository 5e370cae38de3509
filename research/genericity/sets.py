"""The sweeps of the study, with the rule by which packings are chosen.

**The rule.** Packings are those of the seeds 1, 2, ..., M, all of them. None is left out: one that does not settle,
or that flows before an onset, is counted as such. M is in `PACKINGS`, `SIZES`, `LEVELS` and `GROWTH`. It was set by
what a packing costs, and not by what came out (the first one that settled with friction took 40 s: hence 10 of these).
A run that ends early has the first packings of each set.

**Rounds.** The sets are computed in rounds, a part of each at a time, so that a study that is cut off has something
of all. What is known already is not computed again.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import Any

from faultgouge.studies.sweep import Sweep

FRICTION = [0.2, 0.4, 0.6, 0.8, 1.0]
FEW = [0.2, 0.6, 1.0]

STANDARD: Mapping[str, Any] = {
    "packing": {"disks": 100, "width": 11.9, "top": 10},
    "law": {"kn": 2e5},
    "load": {"fy": 3.0},
    "ramp": {"step": 2e-3, "until": 0.03},
}
"""100 disks as in the paper's protocol. Increments of 1e-3 and 2.5e-4 have the same onset where no contact opens,
closes or slides."""

HARMONIC_STIFFNESS = 7e3
"""k_n of the law with exponent 1, force / length: the stiffness 3/2 k_n delta^(1/2) that a contact of the law with
3/2 has under the force F_y."""

SURROGATES = "research.genericity.surrogates:surrogates"

SHARES = (0.1, 0.3, 0.6, 1.0)

PACKINGS = {"onsets": 200, "settled with friction": 10, "harmonic": 100, "surrogates": 100, "halved increments": 30}

SIZES = {50: 100, 200: 40, 400: 16, 1000: 16, 3000: 8, 10000: 4}
"""Packings by number of disks, for either way to load them; those of 100 disks are the ones of `onsets` for mu = 1."""

REACH = {50: 0.02, 100: 0.01, 200: 0.0067, 400: 0.006, 1000: 0.003, 3000: 0.0015, 10000: 0.00045}
"""F_x/F_y up to which these are sought for, by number of disks."""

INCREMENTS = {50: 15, 100: 15, 200: 15, 400: 20, 1000: 15, 3000: 12, 10000: 12}

LEVELS = {50: 40, 100: 100, 200: 20, 400: 8, 1000: 4}
"""Packings whose levels are looked at, by number of disks; a dense decomposition grows with the cube."""

GROWTH = {50: 20, 100: 20, 200: 6}

WIDTH, LAYER = 11.9, 10
"""Of the packing of 100 disks: the width of others grows with the root of the number of disks, so that all have one
shape."""


def sets(share: float) -> dict[str, Sweep]:
    """The sweeps of a round, which has this share of the packings of each set."""
    law = {"kn": HARMONIC_STIFFNESS, "exponent": 1.0}
    return {
        "onsets": _onsets("onsets", share, {}),
        "surrogates": _onsets("surrogates", share, {}, SURROGATES, [1.0]),
        "fixed force": _sizes(SIZES, share, "onset", fixed_pressure=False),
        "fixed pressure": _sizes(SIZES, share, "onset", fixed_pressure=True),
        "levels": _sizes(LEVELS, share, "research.genericity.levels:levels", increments=30),
        "growth": _sizes(GROWTH, share, "research.genericity.levels:growth", increments=20, reach=3.0),
        "harmonic": _onsets("harmonic", share, {"law": law}, friction=FEW),
        "halved increments": _onsets("halved increments", share, {"ramp": {"step": 1e-3}}),
        "settled with friction": _onsets(
            "settled with friction", share, {"packing": {"settle_friction": True}}, friction=FEW
        ),
    }


def _onsets(
    name: str, share: float, changes: Mapping[str, Any], task: str = "onset", friction: list[float] = FRICTION
) -> Sweep:
    scene = {section: {**values, **changes.get(section, {})} for section, values in STANDARD.items()}
    seeds = f"1:{ceil(share * PACKINGS[name])}"
    axes = {"packing.seed": seeds, "law.mu": friction}
    return Sweep.from_mapping({"task": task, "sweep": axes, "scene": scene})


def _sizes(
    packings: Mapping[int, int],
    share: float,
    task: str,
    *,
    fixed_pressure: bool = False,
    increments: int | None = None,
    reach: float = 1.0,
) -> Sweep:
    """Packings of one shape and several sizes. Large ones come last, and only with the last round."""
    rows = []
    for disks, count in packings.items():
        if disks > 1000 and share < 1:
            continue
        width = WIDTH * (disks / 100) ** 0.5
        # a layer closes the box, of which few disks are not enough to make a tenth
        top = max(LAYER * disks // 100, round(width / 1.2))
        fy = 3.0 * (LAYER / WIDTH) / (top / width) if fixed_pressure else 3.0
        until = reach * REACH[disks] * fy
        step = until / (increments or INCREMENTS[disks])
        rows += [[disks, width, top, fy, step, until, seed] for seed in range(1, ceil(share * count) + 1)]
    keys = "packing.disks, packing.width, packing.top, load.fy, ramp.step, ramp.until, packing.seed"
    scene = {"packing": {}, "law": {"kn": 2e5, "mu": 1.0}, "load": {}, "ramp": {}}
    return Sweep.from_mapping({"task": task, "sweep": {keys: rows}, "scene": scene})
