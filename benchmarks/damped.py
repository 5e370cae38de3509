"""The windows of growing motion by the few modes that may grow, beside those of all modes at every load.

The search for growing motion follows few modes, and asks for all of them where these leave doubt. This script searches
20 ramps of packings with four kinds of dissipation in both ways, and compares every window: the same number, and edges
that differ by no more than ten times the sum of both stated errors, which are those of rounding. It also takes the
search for complex pairs on the same ramp, as the measure of time. The table is `damped.csv` beside this file.

    nice python benchmarks/damped.py [--disks 60] [--packings 20] [--until 0.02] [--table damped.csv]

It ends with exit code 1 where windows differ. All of it takes two minutes of one processor for 60 disks, and ten
for 100.
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import csv
import sys
import time
from itertools import count
from pathlib import Path

import numpy as np

from faultgouge.analysis import NoEquilibriumError, OnsetError, find_onset
from faultgouge.analysis.damped_onset.edge import DampedWindow
from faultgouge.analysis.damped_onset.growing import Growing
from faultgouge.analysis.damped_onset.modes import Pencil
from faultgouge.analysis.damped_onset.windows import damped_windows, dissipating, walked
from faultgouge.analysis.onset.limits import LIMITS
from faultgouge.pywrap import Scene
from faultgouge.pywrap.onset.damped import Ramped, inside, ramped

KINDS = ({"cn": 1.0}, {"cn": 10.0, "ct": 5.0}, {"ct": 0.1}, {"cn": 0.1, "drag_time": 300.0})
"""Dissipation, in turn."""

COLUMNS = ("disks", "seed", "dissipation", "windows", "all_modes", "largest_difference", "stated", "seconds")
COLUMNS += ("seconds_all_modes", "seconds_undamped")

Row = dict[str, object]


def compared(ramp: Ramped, kind: dict[str, float]) -> tuple[Row, bool]:
    """Both searches on a ramp, and whether they agree."""
    times = [time.process_time()]
    try:
        complex_pairs = find_onset(dissipating(ramp.path), ramp.forces).windows
    except OnsetError:
        complex_pairs = ()
    look = inside(complex_pairs)
    times.append(time.process_time())
    path = dissipating(ramp.path, **kind)
    few = damped_windows(path, ramp.forces, look=look)
    times.append(time.process_time())
    loads = np.unique(np.concatenate([ramp.forces, [fx for fx in look if fx < ramp.forces[-1]]]))
    narrowest = LIMITS.narrowest * float(ramp.forces[-1])
    every = walked(Growing(lambda fx: Pencil.of(path(fx)), narrowest, None), loads)
    times.append(time.process_time())
    undamped, seconds, whole = np.diff(times)
    differences, stated = edges(few, every)
    row: Row = {"windows": len(few), "all_modes": len(every), "seconds": f"{seconds:.2f}"}
    row |= {"largest_difference": f"{max(differences, default=0.0):.1e}", "stated": f"{max(stated, default=0.0):.1e}"}
    row |= {"seconds_all_modes": f"{whole:.2f}", "seconds_undamped": f"{undamped:.2f}"}
    same = len(few) == len(every) and all(a <= 10 * b for a, b in zip(differences, stated, strict=True))
    return row, same


def edges(few: tuple[DampedWindow, ...], every: tuple[DampedWindow, ...]) -> tuple[list[float], list[float]]:
    """Differences of onsets and ends, with the errors stated of both; inf where one window ends and the other not."""
    differences, stated = [], []
    for one, other in zip(few, every, strict=False):
        ends = (one.fx_end, other.fx_end)
        open_ends = [end is None for end in ends]
        end = 0.0 if all(open_ends) else np.inf if any(open_ends) else abs(float(ends[0] or 0) - float(ends[1] or 0))
        differences.append(max(abs(one.fx_onset - other.fx_onset), end))
        stated.append(one.error + other.error)
    return differences, stated


def main() -> None:
    """Search, compare, and write the table as it grows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--disks", type=int, default=60, help="of a packing")
    parser.add_argument("--packings", type=int, default=20, help="how many")
    parser.add_argument("--until", type=float, default=0.02, help="largest F_x; 20 increments")
    parser.add_argument("--table", type=Path, default=Path(__file__).parent / "damped.csv", help="the table")
    options = parser.parse_args()
    wrong, done, totals = 0, 0, np.zeros(3)
    with options.table.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        seeds = count(1)
        while done < options.packings:
            seed = next(seeds)
            kind = KINDS[seed % len(KINDS)]
            packing = {"disks": options.disks, "width": round(1.192 * options.disks**0.5, 1), "seed": seed}
            steps = {"step": options.until / 20, "until": options.until}
            scene = {"packing": packing, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": steps}
            try:
                with ramped(Scene.from_mapping(scene)) as ramp:
                    row, same = compared(ramp, kind)
            except NoEquilibriumError as error:
                print(f"seed {seed} left out: {error}", flush=True)
                continue
            done += 1
            words = " ".join(f"{key}={value:g}" for key, value in kind.items())
            row |= {"disks": options.disks, "seed": seed, "dissipation": words}
            table.writerow(row)
            file.flush()
            wrong += not same
            totals += [float(str(row[key])) for key in ("seconds", "seconds_all_modes", "seconds_undamped")]
            print(*row.values(), "" if same else "NOT THE SAME", flush=True)
    few, every, undamped = totals
    print(f"{wrong} of {options.packings} differ; {few:.1f} s, all modes {every:.1f} s, undamped {undamped:.1f} s")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
