"""Driven runs with both laws, and the eigenvalues of some of their states.

**The rule.** `scene` has the numbers of scenes/drive.toml. Seeds 1, 2, 3, ... in this order, each with the smoothed
law (history `total`) and then with the standard one (`coulomb`), as many as a quarter of an hour allows; every run that
was over counts, with its slips or without. The choice of states was written down before their eigenvalues were
computed; what counts as growth, and the tests, were settled after four seeds had been seen.

Of a run these states count:

- `before`: the state in which a slip begins;
- `control`: the stored state nearest to a third of the time from the end of the last slip, or from the beginning;
- `even`: the stored states nearest to the multiples of `EVERY`, but for those within a slip.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.analysis import RunFile
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.motion.slips import Slip
from faultgouge.pywrap import Equilibrium, Scene
from faultgouge.pywrap.runs.drive import settle_for_drive
from faultgouge.pywrap.runs.drive_recorder import DriveRecord, slips_in
from faultgouge.studies.cycle.compute import cycle_state
from faultgouge.studies.result_rows import append_row
from research.tables import read_rows

LAWS = ("total", "coulomb")
SPRING = 10.0
LOADING = 1e-2
"""Rate of the force on each disk while the layer sticks, force / time: the far end is slower with a stiffer spring."""

UNTIL = 480.0

EVERY = 24.0
"""Time between the even states."""


def scene(seed: int, law: str, spring: float = SPRING) -> Scene:
    """The scene of one run."""
    return Scene.from_mapping(
        {
            "packing": {"seed": seed},
            "law": {"kn": 2e5, "mu": 1.0, "history": law},
            "load": {"fy": 3.0},
            "damping": {"cn": 60.0, "ct": 17.0},
            "drive": {"spring": spring, "velocity": LOADING / spring, "until": UNTIL},
        }
    )


def run(path: Path, wanted: Scene) -> None:
    """Drive the layer of a scene, unless the file has that run to its end; an interrupted run continues."""
    with DriveRecord(path, wanted) as record:
        if record.last is None:
            record.append(Equilibrium.of(settle_for_drive(wanted)))
        for _ in record.drive():
            pass
        record.finish()


def compute(table: Path, runs: Path, seeds: range, laws: Sequence[str] = LAWS) -> None:
    """Rows of the table that are missing, one for each run; the files of the runs stay in a folder."""
    runs.mkdir(parents=True, exist_ok=True)
    known = {(row["seed"], row["law"]) for row in read_rows(table)} if table.exists() else set()
    for seed, law in product(seeds, laws):
        if (seed, law) not in known:
            path = runs / f"{law}_{seed}.h5"
            run(path, scene(seed, law))
            append_row(table, {"seed": seed, "law": law} | numbers(path))


def numbers(path: Path) -> dict[str, Any]:
    """The slips of a run, and the numbers of its chosen states by the rule."""
    with RunFile(path) as file:
        times, slips = file.observable("time"), slips_in(file)
        states = [
            where(kind, slip, float(times[frame]), float(file.fx[frame]), slips)
            | cycle_state(file.packing(frame), SPRING)
            for kind, slip, frame in chosen(times, slips)
        ]
    return {"slips": [sizes_of(slip) for slip in slips], "states": states}


def where(kind: str, slip: int | None, time: float, force: float, slips: list[Slip]) -> dict[str, Any]:
    """Which state of a run a row is of."""
    return {"kind": kind, "slip": slip, "time": time, "force": force} | since_and_until(time, slips)


def sizes_of(slip: Slip) -> dict[str, float]:
    """What is kept of a slip."""
    columns = ("begins", "ends", "force_before", "force_after", "slip", "kinetic_energy")
    return {name: getattr(slip, name) for name in columns}


def chosen(times: Floats, slips: list[Slip]) -> Iterator[tuple[str, int | None, int]]:
    """Kind, number of the slip that follows, and frame of each state that counts."""
    last = 0.0
    for number, slip in enumerate(slips):
        frame = int(np.searchsorted(times, slip.begins, side="right") - 1)
        yield "before", number, frame
        third = last + (slip.begins - last) / 3
        yield "control", number, int(np.argmin(np.abs(times - third)))
        last = slip.ends
    for time in np.arange(EVERY, times[-1], EVERY):
        frame = int(np.argmin(np.abs(times - time)))
        if not any(slip.begins <= times[frame] <= slip.ends for slip in slips):
            following = [number for number, slip in enumerate(slips) if slip.begins > times[frame]]
            yield "even", following[0] if following else None, frame


def since_and_until(time: float, slips: list[Slip]) -> dict[str, float | None]:
    """Time since the end of the last slip, or since the beginning; and until the next one begins, if one does."""
    ended = [slip.ends for slip in slips if slip.ends < time]
    begin = [slip.begins for slip in slips if slip.begins >= time]
    return {"since": time - max(ended, default=0.0), "until": min(begin) - time if begin else None}
