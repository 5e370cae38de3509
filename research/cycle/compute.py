"""Driven runs with both laws, and the eigenvalues of some of their states.

**The rule.** `scene` has the numbers of scenes/drive.toml. Seeds 1, 2, 3, ... in this order, each with the smoothed
law (history `total`) and then with the standard one (`coulomb`), as many as the time allows; every run that
was over counts, with its slips or without. The choice of states was written down before their eigenvalues were
computed; what counts as growth, and the tests, were settled after four seeds had been seen.

Of a run these states count:

- `before`: the state in which a slip begins;
- `control`: the stored state nearest to a third of the time from the end of the last slip, or from the beginning;
- `even`: the stored states nearest to the multiples of `EVERY`, but for those within a slip.

**400 disks.** The same scene with four times as many disks in a box of twice the width: the layer is as thick again,
and one disk in ten is drawn by the spring, as before. The rule, written down before the first run: seeds 1 to 10 in
this order with the standard law, then the same seeds with the smoothed law, as many runs as the time allowed. All slips
count for sizes and recurrence. The states `before` and `control` of the first `LOOKED_AT` slips of a run are looked at,
half a minute each; none are `even`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import sqrt
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from faultgouge.analysis import Floats, RunFile, Slip
from faultgouge.pywrap import Equilibrium, Record, Scene, settle_for_drive
from faultgouge.pywrap.runs.drive import slips_in
from faultgouge.studies.cycle import cycle_state
from faultgouge.studies.result_rows import append_row
from research.modes.sets import WIDTH
from research.tables import known_rows

LAWS = ("total", "coulomb")
SPRING = 10.0
LOADING = 1e-2
"""Rate of the force on each disk while the layer sticks, force / time: the far end is slower with a stiffer spring."""

UNTIL = 480.0

EVERY = 24.0
"""Time between the even states."""

DISKS, MANY = 100, 400
LOOKED_AT = 3
"""Slips of a run of `MANY` disks before which states are looked at."""


def scene(seed: int, law: str, spring: float = SPRING, disks: int = DISKS) -> Scene:
    """The scene of one run."""
    return Scene.from_mapping(
        {
            "packing": {"seed": seed, "disks": disks, "width": WIDTH * sqrt(disks / DISKS)},
            "law": {"kn": 2e5, "mu": 1.0, "history": law},
            "load": {"fy": 3.0},
            "damping": {"cn": 60.0, "ct": 17.0},
            "drive": {"spring": spring, "velocity": LOADING / spring, "until": UNTIL},
        }
    )


def run(path: Path, wanted: Scene) -> None:
    """Drive the layer of a scene, unless the file has that run to its end; an interrupted run continues."""
    with Record(path, wanted, task="drive") as record:
        if record.last is None:
            record.append(Equilibrium.of(settle_for_drive(wanted)))
        for _ in record.drive():
            pass
        record.finish()


def compute(table: Path, runs: Path, seeds: range, laws: Sequence[str] = LAWS) -> None:
    """Rows of the table that are missing, one for each run; the files of the runs stay in a folder."""
    for seed, law in product(seeds, laws):
        _compute_run(table, runs, seed, law, DISKS)


def compute_many(table: Path, runs: Path, seeds: range) -> None:
    """The same of runs of `MANY` disks, one law after the other."""
    for law, seed in product(reversed(LAWS), seeds):
        _compute_run(table, runs, seed, law, MANY)


def _compute_run(table: Path, runs: Path, seed: int, law: str, disks: int) -> None:
    if any((row["seed"], row["law"]) == (seed, law) for row in known_rows(table)):
        return
    runs.mkdir(parents=True, exist_ok=True)
    begin, path = process_time(), runs / f"{law}_{seed}.h5"
    run(path, scene(seed, law, disks=disks))
    found = numbers(path, None if disks == DISKS else LOOKED_AT)
    append_row(table, {"seed": seed, "law": law} | found | {"cpu_seconds": process_time() - begin})


def numbers(path: Path, looked_at: int | None = None) -> dict[str, Any]:
    """The slips of a run, and the numbers of its chosen states by the rule; only of those before the first slips."""
    with RunFile(path) as file:
        times, slips = file.observable("time"), slips_in(file)[0]
        states = [
            where(kind, slip, float(times[frame]), float(file.fx[frame]), slips)
            | cycle_state(file.packing(frame), SPRING)
            for kind, slip, frame in chosen(times, slips)
            if looked_at is None or (kind != "even" and slip is not None and slip < looked_at)
        ]
    return {"slips": [sizes_of(slip) for slip in slips], "states": states}


def where(kind: str, slip: int | None, time: float, force: float, slips: list[Slip]) -> dict[str, Any]:
    """Which state of a run a row is of."""
    return {"kind": kind, "slip": slip, "time": time, "force": force} | since_and_until(time, slips)


def sizes_of(slip: Slip) -> dict[str, float]:
    """The numbers of a slip that a row has."""
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
