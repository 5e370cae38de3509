"""The teaching decks, one page each, do the same to the bit as the decks that are put together from parts."""

import numpy as np
import pytest

from faultgouge.pywrap.lammps.decks import DECKS

STAGES = {
    "settle": ("loose100.data", "settled", "settled", {}),
    "ramp": ("packing100.data", "ramp.2", "ramp.2", {"until": 2e-3}),
    "perturb": ("packing100.data", "perturb", "perturb.end", {"time": 5, "amplitude": 1e-9}),
}


def positions(dump):
    """ID, x and y of each disk, as they stand in a dump."""
    header, rows = dump.read_text().split("ITEM: ATOMS ")[1].split("\n", 1)
    columns = [header.split().index(name) for name in ("id", "x", "y")]
    return np.array([row.split() for row in rows.splitlines()])[:, columns]


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.slow
def test_teaching_deck_equals_the_deck_of_parts(lmp, tmp_path, stage):
    data, taught, composed, variables = STAGES[stage]
    done = lmp(DECKS / "teaching" / f"{stage}.in", data=DECKS / data)
    assert "WARNING" not in done.stdout
    lmp(DECKS / f"{stage}.in", decks=DECKS, force_tolerance=1e-9, **variables)
    assert np.array_equal(positions(tmp_path / f"{taught}.dump"), positions(tmp_path / f"{composed}.disks"))
