"""The page about LAMMPSes of one's own: its script runs, and finds what the page says."""

import re
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "howto_own_lammps.md"


@pytest.mark.slow
def test_script_of_the_page(tmp_path):
    text = PAGE.read_text()
    blocks = dict(re.findall(r"^```\w+\n# ([\w.]+)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    assert blocks.keys() == {"slope.in", "look.py", "heap.in", "heap.py", "strain.py"}
    for name, block in blocks.items():
        (tmp_path / name).write_text(block)
    first = re.search(r"^(?: {4}.*\n|\n)+", text[text.index("    import ") :])[0]
    with (tmp_path / "look.py").open("a") as script:  # the three lines at the top of the page
        script.write(dedent(first))
    done = subprocess.run([sys.executable, "look.py"], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert "40 spheres" in done.stdout
    assert "LAMMPS moves as K and C say: True True" in done.stdout
    assert "<Spectrum: no motion grows" in done.stdout
    assert "stable: every motion decays, the slowest with D as exp(-0.0523" in done.stdout
    assert "without dissipation: 42 complex pairs, D as exp(0.318" in done.stdout
    assert "K alone has 42 complex pairs, D as exp(0.318" in done.stdout


@pytest.mark.long
def test_heap_of_the_page(tmp_path):
    text = PAGE.read_text()
    blocks = dict(re.findall(r"^```\w+\n# (heap[.\w]+)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    for name, block in blocks.items():
        (tmp_path / name).write_text(block)
    done = subprocess.run([sys.executable, "heap.py"], cwd=tmp_path, capture_output=True, text=True, timeout=3600)
    assert done.returncode == 0, done.stderr
    first, rests, flows = (float(each) for each in re.findall(r"([\d.]+)(?= degrees|$)", done.stdout, re.MULTILINE)[:3])
    assert 0.01 < first < 1.0  # other builds pour another heap
    assert 15.0 < rests < flows < 27.0
