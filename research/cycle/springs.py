"""Driven runs with three springs, and what `stability` says of their states once they have come to rest.

**The rule.** The scene is that of :mod:`research.cycle.compute` with the springs `SPRINGS`; the far end is slower with
a stiffer spring, so that the force on a layer that sticks rises at the same rate. Seeds 1, 2, 3, ... in this order, all
that is asked of one seed before the next, none left out; the number of seeds is what the time allowed. All slips of
both laws count. Of the first `LOOKED_AT` slips of the standard law three states are looked at, those nearest to the
shares `SHARES` of the wait for the slip: from the end of the last slip, or from the beginning, to the beginning of the
slip.

A state of a driven run moves a little, and a verdict is of an equilibrium. Each state is therefore first brought to
rest under its own force on each disk of the layer (:func:`faultgouge.pywrap.settling.relax.bring_to_rest`): whether an
equilibrium is found near by, by how much the mean position of the layer moves on the way, and the one-sided verdict
with the dashpots, the spring and contacts at the bound as they are, under a load that is held and one that rises.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from faultgouge.analysis import Floats, NoEquilibriumError, Packing, RunFile, Slip, stability
from faultgouge.pywrap import bring_to_rest
from faultgouge.pywrap.runs.drive import slips_in
from faultgouge.studies.cycle import cycle_state, with_spring
from research.cycle.compute import LAWS, run, scene, sizes_of, where

SPRINGS = (3.0, 10.0, 30.0)

LOOKED_AT = 3
SHARES = {"control": 1 / 3, "late": 0.9, "before": 1.0}
"""`before` is the state in which the slip begins, at the largest force."""


def rows_of(seed: int) -> Iterator[dict[str, Any]]:
    """The rows of one seed."""
    return (row_of(seed, law, spring) for spring, law in product(SPRINGS, LAWS))


def row_of(seed: int, law: str, spring: float) -> dict[str, Any]:
    """The row of one run."""
    begin = time.process_time()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "drive.h5"
        run(path, scene(seed, law, spring))
        with RunFile(path) as file:
            times, slips = file.observable("time"), slips_in(file)[0]
            states = [
                where(kind, number, float(times[frame]), float(file.fx[frame]), slips)
                | cycle_state(file.packing(frame), spring)
                | {"rest": at_rest(file.packing(frame), spring)}
                for kind, number, frame in chosen(times, slips if law == "coulomb" else [])
            ]
    key = {"seed": seed, "law": law, "spring": spring}
    found = {"slips": [sizes_of(slip) for slip in slips], "states": states}
    return key | found | {"cpu_seconds": time.process_time() - begin}


def chosen(times: Floats, slips: list[Slip]) -> Iterator[tuple[str, int, int]]:
    """Kind, number of the slip that follows, and frame of each state that is looked at."""
    last = 0.0
    for number, slip in enumerate(slips[:LOOKED_AT]):
        for kind, part in SHARES.items():
            time = last + part * (slip.begins - last)
            before = int(np.searchsorted(times, slip.begins, side="right") - 1)
            yield kind, number, before if kind == "before" else int(np.argmin(np.abs(times - time)))
        last = slip.ends


def at_rest(packing: Packing, spring: float) -> dict[str, Any]:
    """The verdict on a state once it has come to rest under its force."""
    try:
        rest, _ = bring_to_rest(packing)
    except NoEquilibriumError:
        return {"found": False}
    told = stability(with_spring(rest.packing, spring), rise="fx").as_dict()
    before, after = (each.position[packing.top, 0] for each in (packing, rest.packing))
    away = after - before
    if packing.box_length is not None:
        away = away - packing.box_length * (away / packing.box_length).round()
    names = ("stable", "growth_rate", "at_bound", "one_sided", "rising", "reasons")
    rates = {name: told[name]["growth_rate"] for name in ("sticking", "sliding")}
    return {"found": True, "moved": float(away.mean())} | {name: told[name] for name in names} | rates
