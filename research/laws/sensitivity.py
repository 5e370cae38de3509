"""How the response grows just below the first onset, with either law: the rows of sensitivity.jsonl.

The pair that is about to coalesce is started across its common eigenvector, with the K of the law: the largest
displacement grows as a power of the distance 1 - F_x/F_x^c, with the exponent -1/2 at an exceptional point.

python -m research.laws.sensitivity FOLDER [SEED ...]    minutes; from the folder of the repository
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.analysis import NoEquilibriumError, OnsetError
from faultgouge.pywrap import Scene, onset_run
from faultgouge.studies.result_rows import append_row
from faultgouge.studies.triggering import sensitivity
from research.laws.sets import ONSETS, sets

NEAR = -np.geomspace(1e-3, 1e-6, 10)
"""Distances of the equilibria from the onset, in units of F_y."""


def rows(seed: int) -> Iterator[dict[str, Any]]:
    """A packing with either law: its onset, and exponent and largest amplitude of the response below it."""
    for history in ("total", "coulomb"):
        scene = Scene.from_mapping(with_seed(history, seed))
        known: dict[str, Any] = {"seed": seed, "history": history}
        try:
            run = onset_run(scene, scene.law.mus[0], near_onset=NEAR * scene.load.fy, first=True)
        except (OnsetError, NoEquilibriumError):
            continue  # no window up to the end of the ramp
        known |= {"fx_c": run.fx_c, "fx_c_error": run.windows[0].error}
        try:
            found = sensitivity(run)
        except ValueError:  # the onset is not known well enough for three distances
            yield known | {"exponent": None}
            continue
        amplitudes = [pair.amplitude() for pair in found.pairs]
        yield known | {
            "exponent": found.fit.exponent,
            "error": found.fit.error,
            "distances": [float(found.distance.min()), float(found.distance.max())],
            "amplitudes": [float(min(amplitudes)), float(max(amplitudes))],
        }


def with_seed(history: str, seed: int) -> dict[str, Any]:
    """The scene of the sweep "onset" of a law, as one mapping."""
    scene = sets()[f"onset {history}"].scene
    return scene | {"packing": scene["packing"] | {"seed": seed}}


if __name__ == "__main__":
    folder, *seeds = sys.argv[1:]
    for each in map(int, seeds or range(1, ONSETS + 1)):
        for row in rows(each):
            append_row(Path(folder) / "sensitivity.jsonl", row)
