"""The header of the law by itself: an exponent is one struct in one list, and creates no energy on closed paths.

The header is compiled with a power more, the square, as docs/howto_law.md adds one, and gives out the work of paths.
"""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import MindlinLaw

HEADERS = Path(__file__).parents[2] / "pair_mindlin_smooth"

INPUTS = Path(__file__).with_name("inputs")

CLOSED = [(1e-3, 1.6e-3), (2e-3, 0.0), (2e-3, -1.6e-3), (1e-3, 0.0)]
"""Slipped, pressed, slipped back, and parted: (overlap, increment) of each leg."""


@pytest.mark.slow
def test_another_exponent(tmp_path, monkeypatch):
    """The square, as the header has it: the slips and forces of the Python law, and no energy out of a closed path."""
    compiler = ["c++", "-std=c++17", "-O1", f"-I{HEADERS}", INPUTS / "law_path.cpp", "-o", "path"]
    done = subprocess.run(compiler, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    monkeypatch.setattr("faultgouge.analysis.packing.law.EXPONENTS", (2.0,))
    law = MindlinLaw(2e6, 6e5, 0.8, exponent=2.0, coulomb=True)
    for start in np.linspace(-1.6e-3, 1.6e-3, 9):
        path = [(1e-3, start), *CLOSED, (1e-3, -start)]
        words = "\n".join(f"{overlap} {increment}" for overlap, increment in path)
        printed = subprocess.run([tmp_path / "path"], input=words, capture_output=True, text=True).stdout
        rows, slip, before = np.loadtxt(printed.splitlines()), 0.0, 1e-3
        assert rows[-1, 2] >= 0
        for (overlap, increment), (there, force, _) in zip(path, rows, strict=True):
            slip = float(law.clamped(overlap, law.remembered(slip, before, overlap) + increment))
            before = overlap
            # the trapezoidal rule of each of 20,000 steps: (d overlap/overlap)^2/12 of each, 2e-10 in all
            assert there == pytest.approx(slip, rel=1e-8, abs=1e-15)
            assert force == pytest.approx(float(law.tangential_force(overlap, slip)), rel=1e-8, abs=1e-12)
