"""How large imaginary parts are and could be: the largest |Im lambda| beside the norm of the antisymmetric part.

python -m research.modes.bounds FOLDER   rows of bounds.jsonl: packings of seeds 1, 2, ..., all of them, at three loads
"""

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.analysis import NoEquilibriumError, Packing, eigenvalues
from faultgouge.pywrap import Engine, Scene, equilibrate, settle
from faultgouge.studies.modes import antisymmetric_norm
from faultgouge.studies.result_rows import append_row

PACKINGS = {50: 12, 100: 12, 200: 8, 400: 6, 1000: 3}
LOADS = (0.03, 0.1, 0.2)
FY, STEP = 3.0, 0.03


def at_loads(disks: int, seed: int, loads: Iterable[float]) -> Iterator[tuple[float, Packing]]:
    """A settled packing at each F_x/F_y that it bears."""
    packing = {"disks": disks, "width": 11.9 * (disks / 100) ** 0.5, "seed": seed}
    state = settle(Scene.from_mapping({"packing": packing, "law": {"kn": 2e5}, "load": {"fy": FY}}))
    with Engine(state.packing) as engine:
        for load in loads:
            fx = load * FY
            try:
                for each in np.linspace(state.fx, fx, round((fx - state.fx) / STEP) + 1)[1:]:
                    state = equilibrate(engine, state, fx=float(each))
            except NoEquilibriumError:
                return
            yield load, state.packing


def rows(disks: int, seed: int) -> Iterator[dict[str, Any]]:
    """The numbers of one packing at each load that it bears."""
    for load, packing in at_loads(disks, seed, LOADS):
        row = {"disks": disks, "seed": seed, "fx_over_fy": load}
        yield row | {"imaginary": float(eigenvalues(packing).imag.max()), "bound": antisymmetric_norm(packing)}


if __name__ == "__main__":
    table = Path(sys.argv[1]) / "bounds.jsonl"
    table.unlink(missing_ok=True)
    for disks, count in PACKINGS.items():
        for seed in range(1, count + 1):
            for row in rows(disks, seed):
                append_row(table, row)
