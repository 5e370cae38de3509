"""The page about a shear cell: its script runs, and what stability says is what LAMMPS does."""

import re
from pathlib import Path

import numpy as np
import pytest

from docs.run_page import files

PAGE = Path(__file__).parents[2] / "docs" / "howto_shear_cell.md"


@pytest.mark.long
def test_script_of_the_page(of_script):
    """Other builds pour another bed: what agrees in one agrees in another."""
    printed = of_script("cycle.py", **files(PAGE))
    shown = re.findall(r"^```text\n(?!# )(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)[0]
    for text in (printed, shown):
        first, *_, last = (float(each) for each in re.findall(r"^path: .* force (\S+)$", text, re.MULTILINE))
        assert 0 < last - first < 5.0 * 0.04  # the lid gives way a little
        ours, theirs = (float(each) for each in re.findall(r"^drift (\S+); of LAMMPS (\S+)$", text, re.MULTILINE)[0])
        assert ours == pytest.approx(theirs, rel=0.02)  # from rest: the first period is not yet steady
        known = re.findall(r"^LAMMPS: far end.*\n +(stable|unstable)", text, re.MULTILINE)
        assert len(known) >= 3
        moved = np.array(re.findall(r"D of LAMMPS (\S+), of one-sided motion (\S+)", text), dtype=float)
        ratio = (moved[:, 0] / moved[:, 1]).reshape(4, 2)
        agrees = np.all(abs(ratio - 1) < 0.1, axis=1)
        assert agrees.sum() >= 3  # weak contacts close to the bound may come to it in one
        assert np.all((ratio > 0.3) & (ratio < 3))
