"""The page about LAMMPSes of one's own: its script runs, and finds what the page says."""

import re
from pathlib import Path
from textwrap import dedent

import pytest

from docs.run_page import files

PAGE = Path(__file__).parents[2] / "docs" / "howto_own_lammps.md"


@pytest.mark.long
@pytest.mark.slow
def test_script_of_the_page(of_script):
    text, blocks = PAGE.read_text(), files(PAGE)
    assert blocks.keys() == {"slope.in", "look.py", "heap.in", "heap.py", "strain.py"}
    first = re.search(r"^(?: {4}.*\n|\n)+", text[text.index("    import ") :])[0]  # the three lines at the top
    printed = of_script("look.py", **blocks | {"look.py": blocks["look.py"] + dedent(first)})
    for says in (
        "40 spheres",
        "LAMMPS moves as K and C say: True True",
        "<Spectrum: no motion grows",
        "stable: every motion decays, the slowest with D as exp(-0.0523",
        "without dissipation: 42 complex pairs, D as exp(0.318",
        "K alone has 42 complex pairs, D as exp(0.318",
    ):
        assert says in printed


@pytest.mark.long
def test_heap_of_the_page(of_script):
    printed = of_script("heap.py", **files(PAGE))
    first, rests, flows = (float(each) for each in re.findall(r"([\d.]+)(?= degrees|$)", printed, re.MULTILINE)[:3])
    assert 0.01 < first < 1.0  # other builds pour another heap
    assert 15.0 < rests < flows < 27.0
