r"""What becomes of packings at rest once contacts at Coulomb's bound slide on ahead and stick on the way back.

Each row is the verdict of :func:`faultgouge.analysis.stability` on one packing: its linear motion with all contacts at
the bound sticking and with all of them sliding on, its one-sided motion from random pushes, and its one-sided motion
under a load that rises.

**Which packings.** *Ramps*: layers of 100 disks (k_n = 2e5, F_y = 3, mu = 1) that settle without friction and are then
loaded in increments of 1e-3 F_y, either with the slider from the beginning (law "coulomb") or with the smoothed law
("total"), at 0.1, 0.2 and 0.3 F_y, with dashpots of the restitutions 0.9 and 0.97 (C_T = 2/7 C_N). *Poured*: layers of
50 spheres under LAMMPS's own laws on slopes of 0.2 and 0.3, with three stiffnesses and dashpots of one restitution.

**The rule.** Packings are those of the seeds 1, 2, 3, ... in this order, all of them, with all that is asked of one
seed before the next; the number of seeds is what the time allowed.

**Beside LAMMPS.** At 0.2 F_y and the restitution 0.9 the plugin integrates the layer of the slider under a load that
rises at the rates `RATES` per disk of the layer. A drag fades out before velocities are measured, as in
:mod:`faultgouge.analysis.motion.rising_load`.
"""

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mpi4py import MPI

from faultgouge.analysis import Configuration, Packing, Signal, Stability, stability
from faultgouge.analysis.motion.rising_load import DRAG, FADE
from faultgouge.pywrap import Engine, Scene, dashpot, settle, time_step
from research.lammps_laws.compute import GAMMA, KN, MU, pour, rest
from research.laws.both_laws import as_slider, at_loads
from research.modes.loss import impact_velocity, with_dashpots
from research.modes.sets import sets
from research.tables import read_rows

SEEDS = 20
LOADS = (0.1, 0.2, 0.3)
RESTITUTIONS = (0.9, 0.97)
HISTORIES = ("coulomb", "total")

COMPARED = (0.2, 0.9)
"""F_x/F_y and restitution of the packings that LAMMPS integrates."""

RATES = (3e-4, 3e-5, 3e-6)
"""Rates of the load in LAMMPS, force / time: over the 60 units of time of a run the load rises by 2e-2 at the most."""

WINDOWS, STAGES, LOOKS = 24, 40, 400
"""Windows of a run, stages in which the drag fades, and looks at velocities in each of the last two windows."""

POURED_LAWS = (
    "granular hertz, mindlin/force",
    "granular hertz, mindlin_rescale/force",
    "granular hooke, linear_history",
)
STIFFNESSES = (KN, KN / 10**1.5, KN / 10**2.25)
"""Overlaps of Hertz's laws go as k_n^(-2/3): some 6e-4, 6e-3 and 2e-2 of a diameter; dashpots go as k_n^(2/3), with one
restitution. Those of the linear law go as 1/k_n, and dashpots as its root."""

SLOPES, POURED_SEEDS = (0.2, 0.3), 5


def layers(seed: int) -> Iterator[dict[str, Any]]:
    """All rows of the layers of one seed."""
    base = sets()["force 100"].scene
    packing, fy = base.get("packing", {}) | {"seed": seed}, base["load"]["fy"]
    changes = {"packing": packing, "ramp": {"step": 1e-3 * fy, "until": max(LOADS) * fy}}
    scene = Scene.from_mapping(base | changes | {"modes": {"fx_over_fy": list(LOADS)}})
    start = settle(scene)
    for history in HISTORIES:
        law = scene.law.model_copy(update={"history": history})
        own = replace(start, packing=as_slider(start.packing)) if history == "coulomb" else start
        found = list[Packing]()

        def keep(packing: Packing, found: list[Packing] = found) -> dict[str, Any]:
            found.append(packing)
            return {}

        told = at_loads(scene.model_copy(update={"law": law}), own, keep)
        key = {"seed": seed, "law": history}
        for load, each in zip(told["loads"], found, strict=True):
            for restitution in RESTITUTIONS:
                begin = time.process_time()
                cn = dashpot(scene.law.kn, restitution, 1.0, impact_velocity(scene))
                lossy = with_dashpots(each, cn)
                # linear motion under a rising load follows, or grows as it does at rest
                row = verdict(stability(lossy, rise="fx" if history == "coulomb" else None), lossy.configuration)
                if history == "coulomb" and (load["fx_over_fy"], restitution) == COMPARED:
                    row["lammps"] = {str(rate): rise_in_lammps(lossy, rate) for rate in RATES}
                    stuck = replace(lossy, law=replace(lossy.law, mu=100.0))
                    row["control"] = rise_in_lammps(stuck, min(RATES))
                where = {"fx_over_fy": load["fx_over_fy"], "restitution": restitution}
                yield key | where | row | {"cpu_seconds": time.process_time() - begin}
        if len(found) < len(LOADS):
            yield key | {"ends": told["ends"], "reach": told["reach"]}


def verdict(found: Stability, configuration: Configuration) -> dict[str, Any]:
    """What is kept of a verdict."""
    told = found.as_dict()
    kept = {name: told[name] for name in ("stable", "growth_rate", "at_bound", "one_sided", "rising", "reasons")}
    overlap = configuration.contacts.overlap
    return kept | {
        "contacts": found.contacts,
        "overlap": float(overlap.mean()) if len(overlap) else None,
        "sticking": found.sticking.growth_rate,
        "sliding": found.sliding.growth_rate,
        "undamped": found.undamped.growth_rate,
        "pairs": found.undamped.pairs,
    }


def rise_in_lammps(packing: Packing, rate: float) -> dict[str, float]:
    """Drift and vibration over the rate of a load that rises, as the plugin integrates it: the last two windows."""
    drift, vibration = np.sqrt(np.mean(np.square(windows_in_lammps(packing, rate)[-2:]), axis=0)).tolist()
    return {"drift": drift, "vibration": vibration}


def windows_in_lammps(packing: Packing, rate: float, spins: bool = False, windows: int = WINDOWS) -> list[list[float]]:
    """Drift and vibration over the rate, as the plugin integrates it, in each window after the drag has faded out.

    LAMMPS's fix viscous does not act on rotations; with `spins` they are slowed down, too, between parts of the run.
    """
    dt = time_step(packing)
    chunk = 300 * dt / 0.05  # as of one-sided motion: `time_step` is 0.05 of the stable one
    look = max(1, round(chunk / LOOKS / dt))
    steps = look * LOOKS
    parts = 10 if spins else 1
    end = 2 * windows * chunk
    signal = Signal(np.array([0.0, end]), np.array([0.0, rate * end]))
    values = []
    with Engine(packing, MPI.COMM_SELF) as engine, engine.undamped(dt, signal=signal) as dynamics:
        lmp, part = engine.lammps, FADE * steps // STAGES // parts
        for stage in range(STAGES):
            drag = DRAG / (steps * dt) * (1 - (stage + 0.5) / STAGES) ** 2
            lmp.command(f"fix fade all viscous {drag!r}")
            for _ in range(parts):
                lmp.command(f"run {part} post no")
                if spins:
                    lmp.numpy.extract_atom("omega")[: len(packing)] *= np.exp(-drag * part * dt)
        lmp.command("unfix fade")
        lmp.command("run 0 post no")
        for _ in range(windows - FADE):
            start = dynamics.advance(1).position
            squares = np.zeros_like(start)
            for _ in range(LOOKS):
                motion = dynamics.advance(look)
                squares += motion.velocity**2 / LOOKS
            moved = motion.position - start
            if packing.box_length is not None:
                moved[:, 0] -= packing.box_length * np.round(moved[:, 0] / packing.box_length)
            mean = moved / (steps * dt)
            values.append([np.mean(mean**2), np.mean(np.maximum(squares - mean**2, 0.0))])
    return (np.sqrt(values) / rate).tolist()


def poured(law: str, kn: float, slope: float, seed: int) -> dict[str, Any]:
    """The row of one packing of spheres."""
    begin = time.process_time()
    key = {"law": law, "kn": kn, "slope": slope, "seed": seed}
    with TemporaryDirectory() as folder:
        gamma = GAMMA * (kn / KN) ** (1 / 2 if "hooke" in law else 2 / 3)
        lmp = pour(law, 3, 50, MU, seed, Path(folder) / "log", gamma, kn)
        lmp.command(f"variable slope equal {slope}")
        found = rest(lmp)
        lmp.close()
    row = {"rests": False} if found is None else {"rests": True} | verdict(stability(found), found)
    return key | row | {"cpu_seconds": time.process_time() - begin}


def compute_poured(table: Path, watch: Any = print) -> None:
    """Add the packings of spheres that a table lacks, seed by seed."""
    names = ("law", "kn", "slope", "seed")
    known = {tuple(row[name] for name in names) for row in read(table)}
    for seed in range(1, POURED_SEEDS + 1):
        for law, kn, slope in product(POURED_LAWS, STIFFNESSES, SLOPES):
            if (law, kn, slope, seed) not in known:
                append(table, [poured(law, kn, slope, seed)])
                watch(f"{law}, kn = {kn:g}, slope {slope}, seed {seed}", flush=True)


def append(table: Path, rows: list[dict[str, Any]]) -> None:
    """Add rows to a table."""
    with table.open("a") as file:
        file.writelines(json.dumps(row) + "\n" for row in rows)


def read(table: Path) -> list[dict[str, Any]]:
    """The rows of a table; none where there is no table."""
    return read_rows(table) if table.exists() else []
