"""Eruptions with and without weak dashpots, on several paths to the same loads: damped.jsonl.

The paths differ in the increment of the ramp. What is there already is not computed again: a path takes half a minute
of processor time. Prints the table of README.md.

python -m research.eruptions.make
"""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.stats import t as student

from faultgouge.pywrap import Scene
from faultgouge.studies.eruptions import eruptions

HERE = Path(__file__).parent
ROWS = HERE / "damped.jsonl"
STEPS = (1e-3, 2e-3, 1.5e-3, 1.2e-3, 8e-4, 7e-4)
KEYS = ("fx", "damped", "rate", "msd", "lost", "sliding", "ends")

SCENE = Scene.from_toml(HERE.parents[1] / "scenes" / "eruptions.toml")
LOADS = (0.1, 0.3, 0.6, 1.0)
DAMPING = {"cn": 1.0, "ct": 0.3}


def path(step: float) -> list[dict[str, Any]]:
    """The runs of a ramp with this increment."""
    given = SCENE.resolved() | {"damping": DAMPING}
    given["ramp"]["step"] = step
    given["eruptions"]["load"] = list(LOADS)
    with TemporaryDirectory() as folder:
        runs = eruptions(Scene.from_mapping(given), Path(folder), say=lambda _: None)["runs"]
    return [{"step": step} | {key: run[key] for key in KEYS} for run in runs]


def table(rows: list[dict[str, Any]]) -> None:
    """Ranges over the paths, and the ratio of geometric means with its 95 % interval (Student, paths less 1)."""
    for fx in LOADS:
        free, damped = (
            [np.log(row["msd"]) for row in rows if row["fx"] == fx and row["damped"] is kind] for kind in (False, True)
        )
        count, ratio = len(free), np.mean(damped) - np.mean(free)
        error = student.ppf(0.975, count - 1) * np.sqrt((np.var(free, ddof=1) + np.var(damped, ddof=1)) / count)
        ranges = [f"{np.exp(min(each)):.2e} to {np.exp(max(each)):.2e}" for each in (free, damped)]
        low, high = np.exp(ratio - error), np.exp(ratio + error)
        print(f"| {fx:g} | {ranges[0]} | {ranges[1]} | {np.exp(ratio):.2f} [{low:.2f}, {high:.2f}] |")


if __name__ == "__main__":
    done = {json.loads(line)["step"] for line in ROWS.read_text().splitlines()} if ROWS.exists() else set()
    for step in STEPS:
        if step not in done:
            with ROWS.open("a") as file:
                file.writelines(json.dumps(row) + "\n" for row in path(step))
    table([json.loads(line) for line in ROWS.read_text().splitlines()])
