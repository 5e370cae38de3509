"""States before slips and their controls once more: contacts that slid in the last period, and what counts as alone.

A state that moves is seen at one instant, at which a contact that has just slid may have left Coulomb's bound by 1e-6.
Here a contact counts if it was at the bound in any row of the last period of the slowest vibration. Growth and folds
are counted with three numbers of disks below which a motion is that of one disk.

The rule: the standard law, the seeds of the table of cycles in their order, none left out; the control is the row
nearest to a third of the wait. These are runs of their own: rounding decides when a slip comes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from faultgouge.analysis import Packing
from faultgouge.analysis.responses.slips import find_slips
from faultgouge.pywrap import Engine, settle_for_drive
from faultgouge.pywrap.runs.drive import layer_period, steps_of
from faultgouge.studies.cycle import cycle_state
from research.cycle.compute import SPRING, scene

LAW = "coulomb"

LONE = (1.2, 1.5, 2.0)
"""Disks that take part in a motion, below which the motion is that of one disk."""

KEPT = ("damped_sliding", "lowest_sliding")

Row = dict[str, Any]


def rows_of(seed: int) -> Iterator[Row]:
    """The row of one run: the states before its slips, and their controls."""
    wanted = scene(seed, LAW)
    assert wanted.drive is not None
    start, series, packings = settle_for_drive(wanted), list[tuple[float, ...]](), list[Packing]()
    with Engine(start) as engine, engine.undamped(spring=wanted.drive.spring, stages=wanted.drive.stages) as dynamics:
        dt, last = dynamics.time_step, 0
        part, every, total = steps_of(wanted.drive, start, dt)
        while last < total:
            step = min(total, last - last % every + every, last - last % part + part)
            motion = dynamics.advance(step - last)
            force, displacement = dynamics.drawn
            series.append((step * dt, force, displacement, motion.kinetic_energy(start)))
            packings.append(replace(engine.packing, fx=force))
            last = step
    columns = np.array(series).T
    period = layer_period(wanted.drive, start)
    assert period is not None
    time, force, displacement, energy = columns
    slips, _ = find_slips(time, force, displacement, energy, wanted.drive.fastest, period)
    states, ended = list[Row](), 0.0
    for number, slip in enumerate(slips):
        for kind, time in (("before", slip.begins), ("control", ended + (slip.begins - ended) / 3)):
            at = int(np.argmin(np.abs(columns[0] - time)))
            states.append(
                {"kind": kind, "slip": number, "time": float(columns[0, at])} | _state(columns[0], packings, at)
            )
        ended = slip.ends
    yield {"seed": seed, "slips": len(slips), "states": states}


def _state(times: Any, packings: Sequence[Packing], at: int) -> Row:
    found = {lone: cycle_state(packings[at], SPRING, lone) for lone in LONE}
    period = 2 * np.pi / np.sqrt(max(found[LONE[1]]["lowest_sticking"], 1.0))
    first = int(np.searchsorted(times, times[at] - period))
    slid = {
        (int(i), int(j))
        for packing in packings[first : at + 1]
        for i, j, slides in zip(packing.contacts.i, packing.contacts.j, packing.sliding, strict=True)
        if slides
    }
    return {
        "period": float(period),
        "at_bound": int(np.sum(packings[at].sliding)),
        "slid": len(slid),
        "lone": {str(lone): {name: state[name] for name in KEPT} for lone, state in found.items()},
    }


def summary(rows: Sequence[Row], flipped_signs: Any) -> Row:
    """Counts before slips and in the controls, with p by sign flips over runs."""

    def compared(value: Any) -> Row:
        both = {kind: [value(each) for row in rows for each in row["states"] if each["kind"] == kind]
                for kind in ("before", "control")}  # fmt: skip
        sums = [
            sum(float(value(each)) * (1 if each["kind"] == "before" else -1) for each in row["states"]) for row in rows
        ]
        told: Row = {kind: int(np.sum(values)) for kind, values in both.items()}
        return told | {"median": [float(np.median(both[kind])) for kind in both], "p": flipped_signs(sums)}

    return {
        "runs": len(rows),
        "slips": sum(row["slips"] for row in rows),
        "period": float(np.median([each["period"] for row in rows for each in row["states"]])),
        "instant": compared(lambda state: state["at_bound"]),
        "slid": compared(lambda state: state["slid"]),
        "lone": {
            lone: {
                "growth": compared(lambda state, lone=lone: (state["lone"][lone]["damped_sliding"] or 0.0) > 0),
                "fold": compared(lambda state, lone=lone: state["lone"][lone]["lowest_sliding"] < 0),
            }
            for lone in map(str, LONE)
        },
    }
