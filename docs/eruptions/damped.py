"""Eruptions with and without weak dashpots, on several paths to the same loads: docs/eruptions/damped.jsonl.

The paths differ in the increment of the ramp. What is there already is not computed again: a path takes some two
minutes.

python docs/eruptions/damped.py
"""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

from faultgouge.pywrap import Scene
from faultgouge.studies.eruptions import eruptions

HERE = Path(__file__).parent
ROWS = HERE / "damped.jsonl"
STEPS = (1e-3, 2e-3, 1.5e-3, 1.2e-3, 8e-4, 7e-4)
KEYS = ("fx", "damped", "rate", "msd", "lost", "sliding", "ends")

SCENE = Scene.from_toml(HERE.parents[1] / "scenes" / "eruptions.toml")
LOADS = (0.1, 0.3, 0.6, 1.0)
DAMPING = {"cn": 1.0, "ct": 0.3}


def path(step: float) -> list[dict[str, object]]:
    """The runs of a ramp with this increment."""
    given = SCENE.resolved() | {"damping": DAMPING}
    given["ramp"]["step"] = step
    given["eruptions"]["load"] = list(LOADS)
    with TemporaryDirectory() as folder:
        runs = eruptions(Scene.from_mapping(given), Path(folder), say=lambda _: None)["runs"]
    return [{"step": step} | {key: run[key] for key in KEYS} for run in runs]


if __name__ == "__main__":
    done = {json.loads(line)["step"] for line in ROWS.read_text().splitlines()} if ROWS.exists() else set()
    for step in STEPS:
        if step not in done:
            with ROWS.open("a") as file:
                file.writelines(json.dumps(row) + "\n" for row in path(step))
