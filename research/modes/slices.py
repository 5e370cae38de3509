"""Pairs counted in slices of the spectrum, beside those of all eigenvalues.

python -m research.modes.slices FOLDER [DISKS [SEED ...]]     rows of slices.jsonl: packings of 1,000 disks, or of DISKS

Of more than 1,000 disks the slices stand alone.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from faultgouge.analysis import dynamical_matrix, eigenvalues
from faultgouge.studies.modes import PairCounts
from faultgouge.studies.result_rows import append_row
from research.modes.bounds import at_loads
from research.modes.count_in_slices import count_in_slices

DENSE_DISKS = 1000
"""Disks up to which all eigenvalues are counted as well."""

PACKINGS = {1000: 5, 3000: 5, 10_000: 1}
LOADS = {1000: (0.03, 0.1), 3000: (0.01, 0.03, 0.1), 10_000: (0.01, 0.03)}


def rows(disks: int, seed: int) -> Iterator[dict[str, Any]]:
    """The counts of one packing at each load that it bears."""
    for load, packing in at_loads(disks, seed, LOADS[disks]):
        row = {"disks": disks, "seed": seed, "fx_over_fy": load}
        if disks <= DENSE_DISKS:
            every = PairCounts.of(eigenvalues(packing))
            row |= {"pairs": len(every.omega)} | {key: every.as_dict()[key] for key in ("growth_rate", "least_q")}
        values, error = count_in_slices(packing)
        found = PairCounts.of(values).as_dict()
        row |= {"modes": dynamical_matrix(packing)[0].shape[0], "sliced": found["pairs"], "error": error}
        yield row | {f"{key}_sliced": found[key] for key in ("growth_rate", "least_q")}


if __name__ == "__main__":
    disks = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    seeds = [int(each) for each in sys.argv[3:]] or range(1, PACKINGS[disks] + 1)
    for seed in seeds:
        for row in rows(disks, seed):
            append_row(Path(sys.argv[1]) / "slices.jsonl", row)
