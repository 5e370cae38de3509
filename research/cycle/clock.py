"""How much earlier the next slip is after a pulse: over the height and the frequency of the pulse, and the phase.

The run of a scene goes on to the end of its slip number `SLIPS`. The wait for each slip, from the end of the slip
before (or from the beginning), is divided at the shares `PHASES`: from the last part of the run before each, the same
run goes on with a pulse on the layer of each height and frequency, until a slip comes of at least half of the force
drop, or until a wait later than without. A wait too short for a part of the run has no pulse. The runs are the same to
the bit until the pulse begins. What a disturbance as small as rounding does to the time of the slip is the noise floor:
pulses of the height 1e-12 and the frequencies `NOISES` at each phase.

**The rule.** The standard law and the spring of :mod:`research.cycle.compute`; seeds 1, 2, 3, ... in this order, all
that is asked of one seed before the next, none left out; the number of seeds is what the time allowed. Heights,
frequencies and phases were written down before the first run.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from faultgouge.analysis import Slip
from faultgouge.pywrap import DriveStep, Scene
from faultgouge.pywrap.runs.drive import COMPARABLE, advance_of
from faultgouge.pywrap.scenes.run_sections import PROBE_SCALE
from research.cycle.compute import UNTIL, scene
from research.driven_runs import DrivenRun

LAW, PART = "coulomb", 4.0
"""Law, and time of a part of a run."""

SLIPS = 2
"""Slips of each seed."""

PHASES = (0.3, 0.6, 0.9)
HEIGHTS = (0.03, 0.1, 0.3)
"""Largest force on each disk of the layer; F_y is 3, and the force of the spring before a slip some 1."""

FREQUENCIES = (0.5, 2.0, 8.0)
NOISES = (1.0, 4.0)
"""Frequencies of the pulses that stand for noise."""


def driven(seed: int, **signal: Any) -> Scene:
    """The scene of a run, with a pulse."""
    base = scene(seed, LAW)
    assert base.drive is not None
    settings = base.drive.model_dump() | {"states": PART, **signal}
    return base.model_copy(update={"drive": type(base.drive).model_validate(settings)})


def rows_of(seed: int) -> Iterator[dict[str, Any]]:
    """All rows of one seed: one of the slip, and one of each pulse."""
    begin = time.process_time()
    run = DrivenRun.of(driven(seed), SLIPS)
    slips = run.slips
    for number, due in enumerate(slips):
        since = slips[number - 1].ends if number else 0.0
        wait = due.begins - since
        key = {"seed": seed, "slip": number}
        yield key | {"kind": "slip", "begins": due.begins, "wait": wait, "drop": due.force_drop, "moved": due.slip}
        for phase, height, omega in pulses():
            reached = [each for each in run.moments if since <= each.time <= since + phase * wait]
            if not reached:
                yield key | {"kind": "too short", "phase": phase, "height": height, "omega": omega}
                continue
            moment = reached[-1]
            signal = {"signal": "pulse", "at": moment.time, "omega": omega, "scale": height}
            found = next_slip(moment.go_on(driven(seed, **signal), run.start), due, wait)
            yield key | {
                "kind": "noise" if height == PROBE_SCALE else "pulse",
                "phase": phase,
                "at": moment.time,
                "height": height,
                "omega": omega,
                "advance": advance_of(found, [due], moment.time),
                "slips": [[slip.begins, slip.force_drop] for slip in found],
            }
    yield {"seed": seed, "kind": "time", "slips": len(slips), "cpu_seconds": time.process_time() - begin}


def pulses() -> Iterator[tuple[float, float, float]]:
    """Phase, height and frequency of each pulse."""
    for phase in PHASES:
        yield from ((phase, height, omega) for height in HEIGHTS for omega in FREQUENCIES)
        yield from ((phase, PROBE_SCALE, omega) for omega in NOISES)


def next_slip(run: Iterator[DriveStep], due: Slip, wait: float) -> list[Slip]:
    """The slips of a run, until one is comparable with the one that is due, or a wait after that."""
    found = list[Slip]()
    for step in run:
        if step.slip:
            found.append(step.slip)
            if abs(step.slip.force_drop) >= COMPARABLE * abs(due.force_drop):
                break
        if step.sample.time > min(due.begins + wait, UNTIL):
            break
    return found
