"""Settle, ramp and tracked onset of packings of growing size: time, memory, and how they grow.

Square packings of disks of two radii, width 1.192 sqrt(N). The upper layers are such as come to rest: others may sink
into the bed for long, so that times of settling are those of favourable cases. Each size runs in a process of its own,
with one thread, so that its peak of memory is its own.

    settle     from the loose start to the rounding floor, at F_x = 0
    newton     one increment of F_x by 1e-3 from there, median of three
    K dq = F   one linear solve in it
    onset      the first window of complex eigenvalues, found without all eigenvalues, the ramp to it included

    python benchmarks/scale.py [--disks 1000 3000] [--no-onset] [--output scale.json]

The exponent is that of the cost between the smallest and the largest size. 10,000 disks take minutes, 100,000 hours.
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

import numpy as np

from faultgouge.analysis import OnsetError, find_onset
from faultgouge.pywrap import Engine, Equilibrium, NoEquilibriumError, Scene, equilibrate, settle
from faultgouge.pywrap.quasistatic import newton_step
from faultgouge.pywrap.stages import EquilibriumPath

STEP, UNTIL = 1e-3, 0.05
MEAN_DIAMETER = 1.2
LAYER = {1000: 41, 3000: 74, 10_000: 129}  # layers that settle with seed 1; others may sink for long


def scene(disks: int, seed: int) -> Scene:
    """A square packing of so many disks."""
    width = round(1.192 * math.sqrt(disks), 1)
    top = LAYER.get(disks, round(1.3 * width / MEAN_DIAMETER))
    packing = {"disks": disks, "width": width, "top": top, "seed": seed}
    return Scene.from_mapping(
        {"packing": packing, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": {"step": STEP, "until": UNTIL}}
    )


def measured(disks: int, seed: int, with_onset: bool) -> dict[str, float | int | None]:
    """All stages of one size; seconds, and memory in GB."""
    wanted = scene(disks, seed)
    begin = time.perf_counter()
    start = settle(wanted)
    row: dict[str, float | int | None] = {
        "disks": disks,
        "settle": time.perf_counter() - begin,
        "residual": start.residual,
        "floor": start.floor,
        "newton": None,
        "solve": None,
        "onset": None,
        "fx_c": None,
    }
    with Engine(start.packing) as engine:
        here, times = start, []
        for k in range(1, 4):
            begin = time.perf_counter()
            try:
                here = equilibrate(engine, here, k * STEP)
            except NoEquilibriumError:
                break
            times.append(time.perf_counter() - begin)
        row["newton"] = statistics.median(times) if times else None
        row["evaluations"] = here.evaluations
        begin = time.perf_counter()
        newton_step(here.packing, here.packing.net_force)
        row["solve"] = time.perf_counter() - begin
        if with_onset:
            row |= onset(engine, start, wanted)
    row["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return row


def onset(engine: Engine, start: Equilibrium, wanted: Scene) -> dict[str, float | None]:
    """Time to the first window, and where it opens; None if the packing flows, or is stable to the ramp's end."""
    begin = time.perf_counter()
    path = EquilibriumPath(engine, start, wanted)
    try:
        fx_c = find_onset(path, STEP * np.arange(round(UNTIL / STEP) + 1)).fx_c
    except (NoEquilibriumError, OnsetError):
        fx_c = None
    return {"onset": time.perf_counter() - begin, "fx_c": fx_c}


def text(value: float | int | None, format_: str) -> str:
    """A number in the table, or a dash."""
    width = int(format_.split(".")[0])
    return "-".rjust(width) if value is None else format(value, format_)


def main() -> None:
    """Print the table, and write it as JSON if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--disks", type=int, nargs="+", default=[1000, 3000])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--no-onset", action="store_true", help="settle and ramp alone")
    parser.add_argument("--output", type=Path, help="also write the numbers to this file")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(options.disks[0], options.seed, not options.no_onset)))
        return

    columns = {"settle": "9.1f", "newton": "9.2f", "solve": "9.2f", "onset": "9.1f", "memory": "9.2f"}
    print(f"{'disks':>8s}{'settle':>9s}{'newton':>9s}{'K dq = F':>9s}{'onset':>9s}{'memory':>9s}{'F_x^c':>16s}")
    print(f"{'':8s}{'s':>9s}{'s':>9s}{'s':>9s}{'s':>9s}{'GB':>9s}")
    rows = []
    for disks in options.disks:
        command = [sys.executable, __file__, "--one", "--disks", str(disks), "--seed", str(options.seed)]
        done = subprocess.run(command + ["--no-onset"] * options.no_onset, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{disks} disks: {done.stderr.strip().splitlines()[-1]}")
        row = json.loads(done.stdout.splitlines()[-1])
        rows.append(row)
        cells = "".join(text(row[name], format_) for name, format_ in columns.items())
        print(f"{disks:8d}{cells}{text(row['fx_c'], '16.10f')}", flush=True)
    small, large = rows[0], rows[-1]
    if large["disks"] > small["disks"]:
        span = math.log(large["disks"] / small["disks"])
        exponents = {
            name: math.log(large[name] / small[name]) / span for name in columns if small[name] and large[name]
        }
        print(f"{'exponent':8s}" + "".join(text(exponents.get(name), "9.2f") for name in columns))
    if options.output:
        options.output.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
