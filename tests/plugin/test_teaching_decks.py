"""The teaching decks, one page each, do the same to the bit as the decks that are put together from parts."""

from pathlib import Path

import numpy as np
import pytest

from faultgouge.pywrap.lammps.decks import DECKS

TOLERANCE = ("-var", "force_tolerance", "1e-9")
STAGES = {
    "settle": ("loose100.data", "settled", "settled", ()),
    "ramp": ("packing100.data", "ramp.2", "ramp.2", ("-var", "until", "2e-3")),
    "perturb": ("packing100.data", "perturb", "perturb.end", ("-var", "time", "5", "-var", "amplitude", "1e-9")),
}


def positions(dump: Path) -> np.ndarray:
    """ID, x and y of each disk, as they stand in a dump."""
    header, rows = dump.read_text().split("ITEM: ATOMS ")[1].split("\n", 1)
    columns = [header.split().index(name) for name in ("id", "x", "y")]
    return np.array([row.split() for row in rows.splitlines()])[:, columns]


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.slow
def test_teaching_deck_equals_the_deck_of_parts(lmp, tmp_path, stage):
    data, taught, composed, options = STAGES[stage]
    done = lmp(DECKS / "teaching" / f"{stage}.in", "-var", "data", str(DECKS / data))
    assert done.returncode == 0, done.stdout[-2000:]
    assert "WARNING" not in done.stdout
    done = lmp(DECKS / f"{stage}.in", "-var", "decks", str(DECKS), *TOLERANCE, *options)
    assert done.returncode == 0, done.stdout[-2000:]
    assert np.array_equal(positions(tmp_path / f"{taught}.dump"), positions(tmp_path / f"{composed}.disks"))
