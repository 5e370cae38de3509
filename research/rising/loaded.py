"""Layers that are loaded: F_x rises in LAMMPS from 0 to 0.2 F_y at a constant rate, and the layer does what it does.

The verdicts of :mod:`.compute` are on states at which Newton's method arrives, from equilibrium to equilibrium. A layer
that is loaded at a rate comes by another way: it vibrates, and it may slip. Here each layer starts at rest without
load, and LAMMPS integrates its motion with the dashpots of a restitution of 0.9. The way is divided into `PARTS`; in
each part the motion is taken in windows of `WINDOW`, much longer than the slowest period. Drift is the root mean
square over particles and axes of the mean velocity in a window, and vibration that of the velocity about this mean.

The rule: the seeds 1 to 20 in this order, both laws of a seed and a rate before the next seed, all seeds of the largest
rate first; none left out.
"""

import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from faultgouge.analysis import Packing, Signal, stable_timestep
from faultgouge.pywrap import Engine, Scene, settle
from faultgouge.studies.result_rows import append_row
from faultgouge.studies.statistics import share
from research.laws.both_laws import as_slider
from research.modes.sets import sets
from research.rising.compute import COMPARED, HISTORIES, with_restitution
from research.tables import known_rows

Row = dict[str, Any]

LOADED_RATES = (1e-3, 3e-4, 1e-4)
"""Rates of the force on each disk of the upper layer, force / time."""

PARTS, WINDOW = 60, 10.0
"""Parts of the way, and time of a window; the slowest modes of these layers have periods of 1 to 2."""

STEP_SHARE, STEPS_BETWEEN = 0.2, 20
"""Time step over the largest stable one, and steps between two looks at the velocities, some 0.03 of time."""

START = 20.0
"""Time in which the rate grows from nothing, as half of a cosine: a load that began at once would ring for hundreds."""

VIBRATES = 0.05
"""Vibration over drift of a window from which on it vibrates: what is left of the start is 0.03 at the most."""

VIBRATIONS = (0.01, VIBRATES)
"""The ratios whose shares of windows a row has."""

SLIP = 6
"""In a slip a layer moves in one part of the way so many times as far as in the median: without one 3.4 times at the
most, at the start; with one from 11 times on."""

MOSTLY, LAST_PARTS = 0.5, 3
"""Share of the windows of the last part from which a layer vibrates at the end; parts of which drift and vibration at
the end are means."""


def starts_of(rising: Row) -> list[Row]:
    """Drift and vibration from each start that was followed."""
    return [rising, *([rising["other_start"]] if rising.get("other_start") else [])]


def loaded(seed: int, history: str, rate: float) -> Row:
    """The row of one layer under a load that rises from nothing: lists over the parts of the way."""
    begin = time.process_time()
    load, restitution = COMPARED
    base = sets()["force 100"].scene
    scene = Scene.from_mapping(base | {"packing": base.get("packing", {}) | {"seed": seed}})
    settled = settle(scene).packing
    packing = with_restitution(as_slider(settled) if history == "coulomb" else settled, scene, restitution)
    last = load * float(packing.fy)
    step = STEP_SHARE * float(stable_timestep(packing))
    windows = round(last / rate / PARTS / WINDOW)
    steps = round(WINDOW / step / STEPS_BETWEEN) * STEPS_BETWEEN
    step = WINDOW / steps
    t = np.linspace(0.0, START, 401)
    rises = rate * (t / 2 - START / (2 * np.pi) * np.sin(np.pi * t / START))
    signal = Signal(np.append(t, START + 2 * last / rate), np.append(rises, rises[-1] + 2 * last))
    row: Row = {"seed": seed, "law": history, "rate": rate, "restitution": restitution, "time_step": step}
    parts = list[Row]()
    with Engine(packing, MPI.COMM_SELF) as engine, engine.undamped(step, signal=signal):
        lmp = engine.lammps
        lmp.command(f"run {round(START / step)} post no")
        known = _pairs(packing)
        for _ in range(PARTS):
            seen = np.array([_window(lmp, packing, steps // STEPS_BETWEEN) for _ in range(windows)])
            now = engine.packing
            drift, vibration, peak = seen.T / rate
            pairs = _pairs(now)
            parts.append(
                {
                    "drift": float(np.sqrt(np.mean(drift**2))),
                    "vibration": float(np.sqrt(np.mean(vibration**2))),
                    "vibrates": [float(np.mean(vibration > share * drift)) for share in VIBRATIONS],
                    "peak": float(peak.max()),
                    "moved": float(np.sqrt(np.mean((now.position - packing.position) ** 2))),
                    "mobilised": int(np.sum(now.mobilised)),
                    "changed": len(pairs ^ known),
                }
            )
            known = pairs
            lmp = engine.lammps
            if not np.isfinite(parts[-1]["vibration"]):
                break
    names = parts[0].keys()
    row |= {name: [_six_digits(part[name]) for part in parts] for name in names}
    return row | {"cpu_seconds": round(time.process_time() - begin, 1)}


def _six_digits(value: Any) -> Any:
    return (
        [_six_digits(each) for each in value]
        if isinstance(value, list)
        else value
        if isinstance(value, int)
        else float(f"{value:.4g}")
    )


def _pairs(packing: Packing) -> set[tuple[int, int]]:
    """Contacts by their disks."""
    return set(zip(packing.contacts.i.tolist(), packing.contacts.j.tolist(), strict=True))


def _window(lmp: Any, packing: Packing, looks: int) -> tuple[float, float, float]:
    """Drift, vibration and largest velocity of one window: root mean squares over particles and axes."""
    count = len(packing)
    mean, squares, peak = np.zeros((count, 2)), np.zeros((count, 2)), 0.0
    for _ in range(looks):
        lmp.command(f"run {STEPS_BETWEEN} pre no post no")
        order = np.argsort(lmp.numpy.extract_atom("id")[:count])
        v = lmp.numpy.extract_atom("v")[order, :2]
        mean += v / looks
        squares += v**2 / looks
        peak = max(peak, float(np.mean(v**2)))
    drift = np.mean(mean**2)
    return float(np.sqrt(drift)), float(np.sqrt(max(np.mean(squares) - drift, 0.0))), float(np.sqrt(peak))


def compute_loaded(table: Path, seeds: int, watch: Any = print) -> None:
    """Add the layers that a table lacks, in the order of the rule."""
    known = {(row["seed"], row["law"], row["rate"]) for row in known_rows(table)}
    for rate, seed, history in product(LOADED_RATES, range(1, seeds + 1), HISTORIES):
        if (seed, history, rate) not in known:
            row = loaded(seed, history, rate)
            append_row(table, row)
            watch(f"{history} at {rate:g}, seed {seed}: {row['cpu_seconds']} s", flush=True)


def summaries(rows: Sequence[Row], path: Sequence[Row]) -> list[Row]:
    """Of each law and rate: slips, the share of the way with vibration, and drift and vibration at its end.

    Parameters
    ----------
    rows : sequence of dict
        Those of `loaded`.
    path : sequence of dict
        What is told of the equilibria of the same seeds at the end of the way (tables/layers.jsonl).
    """
    told = {row["seed"]: starts_of(row["rising"]) for row in path if row.get("rising")}
    found = []
    for law, rate in product(HISTORIES, LOADED_RATES):
        own = [row for row in rows if (row["law"], row["rate"]) == (law, rate)]
        stay = [row for row in own if not slips(row)]
        ends = [(row["seed"], *(_at_the_end(row[name]) for name in ("drift", "vibration"))) for row in stay]
        beside = [
            {name: value / told[seed][0][name] for name, value in (("drift", drift), ("vibration", vibration))}
            for seed, drift, vibration in ends
            if seed in told and law == "coulomb"
        ]
        found.append(
            {
                "law": law,
                "rate": rate,
                "layers": len(own),
                "slip": share(len(own) - len(stay), len(own)),
                "on_the_way": share(sum(max(_vibrates(row)) > 0 for row in own), len(own)),
                "part": _spread([float(np.mean(_vibrates(row))) for row in own]),
                "at_the_end": share(sum(_vibrates(row)[-1] >= MOSTLY for row in own), len(own)),
                "drift": _spread([drift for _, drift, _ in ends]),
                "vibration": _spread([vibration for _, _, vibration in ends]),
                "over_told": {name: _spread([each[name] for each in beside]) for name in ("drift", "vibration")},
            }
        )
    return found


def slips(row: Row) -> int:
    """In how many parts of the way a layer moves as in a slip."""
    increments = np.abs(np.diff([0.0, *row["moved"]]))
    return int(np.sum(increments > SLIP * np.median(increments)))


def _vibrates(row: Row) -> list[float]:
    """Share of the windows of each part of the way that vibrate."""
    return [shares[VIBRATIONS.index(VIBRATES)] for shares in row["vibrates"]]


def _at_the_end(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values[-LAST_PARTS:]))))


def _spread(values: Sequence[float]) -> list[float] | None:
    """Median, least and largest."""
    return [float(np.median(values)), min(values), max(values)] if values else None
