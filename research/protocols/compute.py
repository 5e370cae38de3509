r"""Velocity steps and holds of a sheared layer, each beside the same run without the step or the hold.

The upper layer of 100 disks is drawn rigidly (`spring = "rigid"`): friction is the mean force per disk that keeps it
at its velocity, over F_y. Once it has slid by `SLID`, at the velocity `VELOCITY` from `FAST` of the way on, the run
*divides* at one moment, to the bit:

- *control*: the velocity goes on;
- *step*: the velocity is multiplied by each of `FACTORS`;
- *hold*: the far end stands still for each of `HOLDS`, and slides on with the velocity `VELOCITY`.

All are compared at the same displacement since they divided, in bins with the edges `EDGES`: what a step or a hold does
is the difference from the control, so that the fluctuations that both share fall out as long as both remember the
common past. In rate- and state-dependent friction (C. Marone, Annu. Rev. Earth Planet. Sci. 26, 643, 1998) the
friction after a step changes by a ln(factor) at once and by (a - b) ln(factor) in the end, and the peak after a hold
grows with the logarithm of its time.

**The rule.** Seeds 1, 2, 3, ... in this order, all that is asked of one seed before the next, none left out; the number
of seeds is what the time allowed. Bins, steps, holds and what is compared were written down before the first run.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from faultgouge.pywrap import DriveSample, Scene
from research.driven_runs import DrivenRun

FY = 3.0
VELOCITY = 1e-3
FAST, SLID, LAST = 1e-2, 1.1, 0.1
"""The layer slides by SLID - LAST at the velocity FAST, and by LAST at VELOCITY, length."""

FACTORS = (10.0, 3.0, 1 / 3)
HOLDS = (10.0, 30.0, 100.0, 300.0)

EDGES = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
"""Displacements since the run divided, length; each run ends at an edge, or a time step later."""

LATER = 1e-3
"""By this share of an edge a row may lie beyond it."""

ENDS = {"control": 0.5, 10.0: 0.5, 3.0: 0.5, 1 / 3: 0.1, "hold": 0.1}

WEAKER = 4.0
"""By this factor all dashpots are weaker in the step by the first of `FACTORS` that is done once more."""

PART = 4.0
"""Time of a part of a run; the run divides at the end of a part."""


def scene(seed: int, protocol: list[tuple[float, float]]) -> Scene:
    """A scene of the standard law whose layer has velocities one after the other."""
    return Scene.from_mapping(
        {
            "packing": {"seed": seed},
            "law": {"kn": 2e5, "mu": 1.0, "history": "coulomb"},
            "load": {"fy": FY},
            "damping": {"cn": 60.0, "ct": 17.0},
            "drive": {"spring": "rigid", "protocol": protocol, "states": PART},
        }
    )


class Divided:
    """A run up to where it divides, and runs that go on from there."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.before = [(FAST, (SLID - LAST) / FAST), (VELOCITY, LAST / VELOCITY)]
        run = DrivenRun.of(scene(seed, self.before))
        self.start, self.moment = run.start, run.moments[-1]
        self.rows, self.time = self.moment.rows, self.moment.time

    def go_on(self, stages: list[tuple[float, float]], weaker: float = 1.0) -> list[DriveSample]:
        """Rows of the series after the run has divided, from then on with weaker dashpots."""
        (fast, first), _ = self.before
        wanted = scene(self.seed, [(fast, first), (VELOCITY, self.time - first), *stages])
        law = self.start.law
        start = replace(self.start, law=replace(law, cn=law.cn / weaker, ct=law.ct / weaker))
        return [step.sample for step in self.moment.go_on(wanted, start)]


def in_bins(rows: list[DriveSample], origin: float) -> dict[str, list[float]]:
    """Mean and largest friction, and mean thickness, in the bins that a run passes through."""
    moved = np.array([row.displacement for row in rows]) - origin
    friction = np.array([row.force for row in rows]) / FY
    thickness = np.array([row.thickness for row in rows])
    found: dict[str, list[float]] = {"mean": [], "largest": [], "thickness": []}
    edges = np.array(EDGES) * (1 + LATER)
    for low, high in pairwise(edges):
        inside = (moved > low) & (moved <= high)
        if inside.any():
            found["mean"].append(float(friction[inside].mean()))
            found["largest"].append(float(friction[inside].max()))
            found["thickness"].append(float(thickness[inside].mean()))
    return found


def rows_of(seed: int) -> Iterator[dict[str, Any]]:
    """All rows of one seed."""
    begin = time.process_time()
    run = Divided(seed)
    origin = run.rows[-1].displacement
    late = [row for row in run.rows if row.displacement > origin - LAST]
    base = {
        "friction": float(np.mean([row.force for row in late]) / FY),
        "spread": float(np.std([row.force for row in late]) / FY),
        "thickness": late[-1].thickness,
        "displacement": origin,
        "time": run.time,
    }
    yield {"seed": seed, "kind": "before"} | base | {"cpu_seconds": time.process_time() - begin}
    end = ENDS["control"]
    yield {"seed": seed, "kind": "control"} | in_bins(run.go_on([(VELOCITY, end / VELOCITY)]), origin)
    for factor in FACTORS:
        velocity = factor * VELOCITY
        rows = run.go_on([(velocity, ENDS[factor] / velocity)])
        yield {"seed": seed, "kind": "step", "factor": factor} | in_bins(rows, origin)
    for hold in HOLDS:
        rows = run.go_on([(0.0, hold), (VELOCITY, ENDS["hold"] / VELOCITY)])
        held = [row for row in rows if row.time <= run.time + hold]
        after = [row for row in rows if row.time > run.time + hold]
        last = held[-max(1, len(held) // 10) :]
        stood = {
            "held": float(np.mean([row.force for row in last]) / FY),
            "compaction": base["thickness"] - held[-1].thickness,
        }
        yield {"seed": seed, "kind": "hold", "hold": hold} | stood | in_bins(after, origin)


def weak_rows_of(seed: int) -> Iterator[dict[str, Any]]:
    """The first bin of the control and of the largest step, with weaker dashpots after the run has divided."""
    run = Divided(seed)
    origin = run.rows[-1].displacement
    for kind, velocity in (("control", VELOCITY), ("step", FACTORS[0] * VELOCITY)):
        rows = run.go_on([(velocity, EDGES[1] / velocity)], WEAKER)
        yield {"seed": seed, "kind": f"weak {kind}"} | in_bins(rows, origin)
