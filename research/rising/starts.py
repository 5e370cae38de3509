"""One layer, two vibrations: motion under a load that rises, from two starts, one-sided and in LAMMPS.

The layers are those of :mod:`.compute` at `COMPARED`. A drag fades out at first, on all coordinates or not on
rotations; then windows are measured for `FOLLOWED` chunks, more than twice as long as the rows of the layers.

**The rule.** The two seeds whose vibration in LAMMPS is not that of one-sided motion from the first start; then the
seeds 1, 2, 3, ... in this order, as many as the time allowed.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from research.rising.compute import APART, COMPARED, RATES, STARTS, at_rest, with_restitution
from research.rising.windows import FADE, Windows, drift_and_vibration, follow_one_sided, rise_in_plugin

FOLLOWED = 60


def rows_of(seed: int) -> Iterator[dict[str, Any]]:
    """Vibration over the rate in one window after the other, of both starts."""
    begin, (load, restitution) = time.process_time(), COMPARED
    scene, at, _ = at_rest(seed, "coulomb", [load])
    packing = with_restitution(at[load], scene, restitution)
    chunk, windows = follow_one_sided(packing, FOLLOWED)
    followed_there = Windows(chunk, FOLLOWED, FOLLOWED - FADE)
    motions = [rise_in_plugin(packing, min(RATES), followed_there, spins) for spins in STARTS]
    lammps = [[drift_and_vibration([part], chunk, min(RATES)) for part in motion] for motion in motions]
    yield {
        "seed": seed,
        "chunk": chunk,
        "one_sided": {"drift": windows[:, 0].T.tolist(), "vibration": windows[:, 1].T.tolist()},
        "lammps": {name: [[part[name] for part in motion] for motion in lammps] for name in ("drift", "vibration")},
        "cpu_seconds": time.process_time() - begin,
    }


def order(seeds: int) -> list[int]:
    """Seeds in the order of the rule."""
    return [*APART, *(seed for seed in range(1, seeds + 1) if seed not in APART)]
