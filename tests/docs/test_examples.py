"""Each script of docs/examples runs in an empty folder, and its numbers are right."""

import re
import subprocess
import sys
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from printed_numbers import number
from reference_layer import on_ranks

FOLDER = Path(__file__).parents[2] / "docs" / "examples"
PAGE = FOLDER.parent / "examples.md"

pytestmark = pytest.mark.slow


@pytest.fixture
def printed(of_script):
    """What a script prints."""
    return lambda name: of_script(f"{name}.py", **{f"{name}.py": (FOLDER / f"{name}.py").read_text()})


def test_three_disks(printed):
    # other increments of the ramp, and other processors, move the onset by 1e-10
    assert number(printed("three_disks"), "merge at F_x =") == pytest.approx(1.935965487, abs=2e-8)


def test_own_law(printed):
    """The vertical modes of a column of two equal springs and masses are known."""
    found = np.array([float(each) for each in re.search(r"\[(.*)\]", printed("own_law"))[1].split(",")])
    stiffness = 1e4 + 2.0 / 0.01  # k exp(overlap/a) = k + f_n/a
    for sign in (-1, 1):
        assert abs(found - stiffness * (3 + sign * sqrt(5)) / 2).min() < 0.01  # printed with two decimals
    assert found.min() < 0  # the column falls over


@pytest.mark.long
def test_sweep_with_interval(printed):
    text = printed("sweep_interval")
    onsets = [float(each) for each in re.search(r"onsets:(.*)", text)[1].split()]
    assert 0.0342 in onsets  # seed 4, as docs/api.md has it
    share, low, high = map(float, re.search(r"of ([\d.]+) \(([\d.]+) to ([\d.]+)\)", text).groups())
    assert share == len(onsets) / 10
    assert low < share < high
    assert high - low == pytest.approx(2 * 1.96 * sqrt(share * (1 - share) / 10), rel=0.2)  # Wilson's is narrower


@pytest.mark.long
def test_deck(printed):
    text = printed("dem_deck")
    assert number(text, "<Configuration:") == 40
    assert "stable: every motion decays" in text
    assert number(text, "K has") == 6 * 40
    largest, step = number(text, "eigenvalues up to"), number(text, "largest stable time step")
    assert 0.5 < step / (2 / sqrt(largest)) <= 1  # dashpots shorten the step of the undamped packing
    assert number(text, "differs from that of K and C by") < 2e-3  # in proportion to the time step, with dashpots


@pytest.mark.long
def test_spheres(printed):
    """Nothing grows, and the packing follows a load that rises: without contacts at the bound it does not vibrate."""
    text = printed("spheres")
    assert number(text, "<Configuration:") == 30
    assert "stable: every vibration decays" in text
    assert "vibration 0; from a rise of" in text
    assert "until the load has risen by" in text
    assert number(text, "drift") > 0


@pytest.mark.long
def test_table_of_another_code(printed):
    text = printed("other_code")
    assert number(text, "the largest force on a disk was") > 100
    assert number(text, "residual") < 1e-9
    assert 0 < number(text, "lowest eigenvalue") < 2000


@pytest.mark.long
def test_wave(printed):
    """The response to a small pulse is in proportion to the pulse; the tolerance leaves room for the nonlinear part."""
    assert number(printed("wave"), "moves the layer") == pytest.approx(10, abs=0.01)


@pytest.mark.long
def test_slip(printed):
    """The spring loses what the layer slips, less what its far end moves on: on another machine, too."""
    text = printed("slip")
    numbers = r"t = ([\d.]+) to ([\d.]+): the layer slips by ([\d.]+), and the force falls from ([\d.]+) to ([\d.]+)"
    begins, ends, slip, before, after = np.array(re.findall(numbers, text), dtype=float).T
    # F = k (V t - X) with k = 10 and V = 2e-3; numbers are printed with one, four and three decimals
    np.testing.assert_allclose(before - after, 10 * (slip - 2e-3 * (ends - begins)), rtol=0, atol=0.005)
    assert before.max() <= number(text, "largest force of the spring") + 1e-3
    assert number(text, "before the first slip:") > number(text, "complex pairs at rest:") == 0


@pytest.mark.long
@pytest.mark.ranks
def test_two_ranks(printed, tmp_path):
    """The same bits on one rank and on two."""
    command = [*map(str, on_ranks(2)), sys.executable, "on_two_ranks.py"]
    one = printed("on_two_ranks")
    two = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=True).stdout
    assert (number(one, ""), number(two, "")) == (1, 2)
    assert one.split(":")[1] == two.split(":")[1]
    assert number(one, "growth rate") > 0


@pytest.mark.long
def test_mdanalysis(printed):
    text = printed("in_mdanalysis")
    assert "6 equilibria" in text
    first, *others = map(float, re.search(r"of the layer:(.*)", text)[1].split())
    assert first == 0
    assert others == sorted(others)
    assert others[-1] / others[0] == pytest.approx(5, rel=0.05)  # the layer gives way in proportion to the load


def test_the_page_shows_every_script():
    lengths = {path.name: path.read_text().count("\n") for path in FOLDER.glob("*.py")}
    assert sorted(re.findall(r"examples/(\w+\.py)$", PAGE.read_text(), re.MULTILINE)) == sorted(lengths)
    assert {name: length for name, length in lengths.items() if not 20 <= length <= 60} == {}
