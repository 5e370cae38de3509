"""Onsets of ten packings by a sweep, and the share of packings that have one, with its 95 % interval.

A sweep that was cut off continues when the script is run again.
"""

from faultgouge import sweep
from faultgouge.studies.statistics import share

SWEEP = {
    "task": "onset",
    "sweep": {"packing.seed": "1:10"},
    "scene": {
        "packing": {"disks": 40, "width": 7.5},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "ramp": {"step": 1e-2, "until": 0.1},
    },
}

if __name__ == "__main__":  # a sweep starts processes, which read this file again
    rows = sweep(SWEEP, "onsets", say=lambda words: None)
    onsets = [row["result"]["fx_c"] for row in rows if row["result"] and row["result"]["ends"] == "onset"]
    found = share(len(onsets), len(rows))
    print("onsets:", *(f"{fx_c:.4f}" for fx_c in sorted(onsets)))
    print(f"{len(onsets)} of {len(rows)} packings: a share of {found['share']:.2f}", end=" ")
    print(f"({found['low']:.2f} to {found['high']:.2f})")
