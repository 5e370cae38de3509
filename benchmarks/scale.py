"""Settle, ramp, undamped run and tracked onset of packings of growing size: time, memory, and how they grow.

Square packings of disks of two radii, width 1.192 sqrt(N), with the upper layer of a scene that does not say `top`.
Each size runs in a process of its own, and with one thread, but for onsets, which take as many as there are cores.
Memory is the peak of all stages before the onsets, and of all.

    settle     from the loose start to the rounding floor, at F_x = 0
    newton     one increment of F_x by 2/N from there, median of three
    assembly   of K
    solve      of K dq = F, factorisation included
    largest    eigenvalue of K, for the time step of an undamped run
    undamped   1000 steps of such a run
    onset      the first window, the ramp to it included; not with --no-onset, and hours for 100,000 disks
    file       run.h5, for each equilibrium

Beside these, square crystals of disks, whose equilibria are known and need no settling.

    python benchmarks/scale.py [--disks 1000 3000 10000] [--crystals 10000 100000] [--no-onset]

The exponent is that of the cost between the smallest and the largest size. To settle 10,000 disks takes half a minute.
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import json
import math
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from faultgouge.analysis import OnsetError, Packing, RunFile, find_onset, stiffness_matrix
from faultgouge.assessment.extremes.packings import crystal
from faultgouge.pywrap import Engine, Equilibrium, NoEquilibriumError, Scene, equilibrate, settle
from faultgouge.pywrap.equilibria.newton_matrix import factor_stiffness
from faultgouge.pywrap.equilibria.quasistatic import rounding_floor
from faultgouge.pywrap.runs.scene_path import scene_path
from faultgouge.pywrap.runs.undamped import time_step

Row = dict[str, float | int | None]

INCREMENTS = 50
"""Number of increments, each of 2/N: the first onset falls somewhat faster than 2/N, and contacts change as often in an
increment."""


def scene(disks: int, seed: int) -> Scene:
    """A square packing of so many disks."""
    packing = {"disks": disks, "width": round(1.192 * math.sqrt(disks), 1), "seed": seed}
    return Scene.from_mapping(
        {
            "packing": packing,
            "law": {"kn": 2e5},
            "load": {"fy": 3.0},
            "ramp": {"step": 2 / disks, "until": 2 * INCREMENTS / disks},
        }
    )


def measured(disks: int, seed: int, with_onset: bool) -> Row:
    """All stages of one size; seconds, and memory in GB."""
    wanted = scene(disks, seed)
    begin = time.perf_counter()
    start = settle(wanted)
    row: Row = {"disks": disks, "settle": time.perf_counter() - begin}
    with Engine(start.packing) as engine:
        row |= increments(engine, start) | undamped(engine, start) | {"memory": peak()}
        if with_onset:
            row["onset"], row["fx_c"] = onset(engine, start, wanted)
    return row | {"in all": peak()}


def peak() -> float:
    """The most memory so far, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def measured_crystal(disks: int) -> Row:
    """Measure a square crystal, without settling and onset."""
    columns = round(math.sqrt(disks))
    packing = crystal(columns, columns)
    with Engine(packing) as engine:
        start = equilibrate(engine, Equilibrium(packing, packing.residual, rounding_floor(packing), 0), 0.0)
        row: Row = {"disks": len(packing)}
        return row | increments(engine, start) | undamped(engine, start) | {"memory": peak()}


def increments(engine: Engine, start: Equilibrium) -> Row:
    """Times of increments of F_x, of one linear solve and of one assembly of K; size of an equilibrium in a file."""
    here, times = start, []
    for k in range(1, 4):
        begin = time.perf_counter()
        try:
            here = equilibrate(engine, here, 2 * k / len(start.packing))
        except NoEquilibriumError:
            break
        times.append(time.perf_counter() - begin)
    packing = here.packing
    trial = engine.try_displacement(packing, np.zeros(3 * len(packing)))
    _ = packing.geometry, trial.packing.geometry, trial.branches  # computed once, and not part of what follows
    begin = time.perf_counter()
    stiffness_matrix(packing)
    assembled = time.perf_counter()
    factors = factor_stiffness(trial, trial.floor)
    if factors is not None:
        factors.solver.solve(trial.force)
    return {
        "residual": here.residual,
        "floor": here.floor,
        "evaluations": here.evaluations,
        "newton": statistics.median(times) if times else None,
        "assembly": assembled - begin,
        "solve": time.perf_counter() - assembled,
        "file": size_in_file(packing),
    }


def size_in_file(packing: Packing) -> float:
    """Size of one equilibrium in run.h5, MB."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        with RunFile.create(path, packing) as file:
            empty = path.stat().st_size
            file.append(packing)
        return (path.stat().st_size - empty) / 2**20


def undamped(engine: Engine, start: Equilibrium) -> dict[str, float]:
    """Times of the largest eigenvalue and of 1000 steps of an undamped run."""
    begin = time.perf_counter()
    step = time_step(start.packing)
    known = time.perf_counter()
    engine.restore(start.packing)
    with engine.undamped(step) as dynamics:
        dynamics.advance(100)
        ready = time.perf_counter()
        dynamics.advance(1000)
        return {"largest": known - begin, "undamped": time.perf_counter() - ready}


def onset(engine: Engine, start: Equilibrium, wanted: Scene) -> tuple[float, float | None]:
    """Time to the first window, and where it opens; None if the packing flows, or is stable to the ramp's end."""
    begin = time.perf_counter()
    path = scene_path(engine, start, wanted)
    try:
        fx_c = find_onset(path, 2 * np.arange(INCREMENTS + 1) / len(start.packing)).fx_c
    except (NoEquilibriumError, OnsetError):
        fx_c = None
    return time.perf_counter() - begin, fx_c


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--disks", type=int, nargs="+", default=[1000, 3000, 10_000])
    parser.add_argument("--crystals", type=int, nargs="*", default=[10_000, 100_000])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--no-onset", action="store_true", help="settle and ramp alone")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        disks = options.disks[0]
        row = measured_crystal(disks) if options.crystals else measured(disks, options.seed, not options.no_onset)
        print(json.dumps(row))
        return

    extra = ["--seed", str(options.seed), *["--no-onset"] * options.no_onset]
    table("settled packings", options.disks, ["--crystals", *extra])
    table("crystals", options.crystals, ["--crystals", "1"])


COLUMNS = ("disks", "settle", "newton", "assembly", "solve", "largest", "undamped", "file", "memory", "onset")
"""Columns of the table; beside them stand the memory in all and the onsets."""


def table(title: str, sizes: list[int], arguments: list[str]) -> None:
    """Measure packings of several sizes, each in a process of its own, and print them."""
    columns = (*COLUMNS, "in all", "fx_c")
    print(f"\n{title}; s, memory in GB, file in MB\n" + "".join(f"{name:>11s}" for name in columns))
    rows: list[Row] = []
    for disks in sizes:
        command = [sys.executable, __file__, "--one", "--disks", str(disks), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{disks} disks: {done.stderr.strip().splitlines()[-1]}")
        rows.append(json.loads(done.stdout.splitlines()[-1]))
        print(_line([rows[-1].get(name) for name in columns]), flush=True)
    if len(rows) > 1:
        small, large = rows[0], rows[-1]
        pairs = [(small.get(name), large.get(name)) for name in COLUMNS]
        span = math.log(large["disks"] / small["disks"])
        print("exponents\n" + _line([math.log(b / a) / span if a and b else None for a, b in pairs]))


def _line(values: list[float | int | None]) -> str:
    return "".join(f"{'-':>11s}" if value is None else f"{value:11.5g}" for value in values)


if __name__ == "__main__":
    main()
