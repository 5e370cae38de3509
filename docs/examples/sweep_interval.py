"""Onsets of ten packings by a sweep, and the share of packings that have one, with its 95 % interval.

A sweep that was cut off continues when the script is run again.
"""

from pathlib import Path

from faultgouge.studies.statistics import share
from faultgouge.studies.sweep.run_sweep import run_sweep
from faultgouge.studies.sweep.sweep_plan import Sweep
from faultgouge.studies.sweep.tasks import TASKS

SWEEP = """
task = "onset"
[sweep]
"packing.seed" = "1:10"
[scene.packing]
disks = 40
width = 7.5
[scene.law]
kn = 2e5
[scene.load]
fy = 3.0
[scene.ramp]
step = 1e-2
until = 0.1
"""

if __name__ == "__main__":  # a sweep starts processes, which read this file again
    Path("onsets.toml").write_text(SWEEP)
    rows = run_sweep(Sweep.from_toml("onsets.toml", TASKS), Path("onsets"), say=lambda words: None)
    onsets = [row["result"]["fx_c"] for row in rows if row["result"] and row["result"]["ends"] == "onset"]
    found = share(len(onsets), len(rows))
    print("onsets:", *(f"{fx_c:.4f}" for fx_c in sorted(onsets)))
    print(f"{len(onsets)} of {len(rows)} packings: a share of {found['share']:.2f}", end=" ")
    print(f"({found['low']:.2f} to {found['high']:.2f})")
