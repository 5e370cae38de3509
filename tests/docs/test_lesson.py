"""The lesson about three disks: its cells run, and its text is right about what they compute."""

import json
import re
from pathlib import Path

import pytest
from printed_numbers import number

from faultgouge.pywrap import Scene

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "lesson.md"
SCENE = ROOT / "scenes" / "three_disks.toml"


def cells():
    return re.findall(r"^```\{code-cell\} ipython3\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.long
def test_cells_compute_what_the_answers_say(faultgouge_here, of_script):
    facts = """
import json
x, y, turn = faultgouge.analysis.normal_modes(rest).right[:, 0].real.reshape(3, 3)
merging = np.argsort(abs(before[0] - window.eigenvalue))[:2]
merging = sorted(np.argsort(np.argsort(before[0].real))[merging].tolist())
first = float(loads[(spectra.imag != 0).any(axis=1)][0])
last = float(np.log10(msd[-1] / msd[len(msd) * 9 // 10]))
sideways = abs(x).min() / abs(y).max()
print(json.dumps([len(rest.contacts), abs(rest.contacts.slip).max(), merging, sideways, first, last]))
"""
    printed = of_script("lesson.py", **{"lesson.py": "\n".join(["import faultgouge.analysis", *cells()]) + facts})
    contacts, slip, merging, sideways, first, last_decade = json.loads(printed.splitlines()[-1])
    values = [float(each) for each in re.search(r"at F_x = 0: (.*)", printed)[1].split()]
    assert len(values) == 9
    assert min(values) > 0
    assert "K^T over the largest of K: 0e+00" in printed
    # questions 1, 2, 4 and 6: contacts, no slip, the slowest motion is sideways, the second and the third merge
    assert (contacts, slip, merging) == (5, 0.0, [1, 2])
    assert sideways > 5
    assert first == pytest.approx(1.95)  # question 8: the scan in steps of 0.025 has two digits
    # the onset of the command, in the same scene; its error is that of the rounding and of the increments
    fx_c = number(printed, "F_x^c =")
    command = json.loads(faultgouge_here("onset", SCENE, "--json").stdout)
    assert fx_c == pytest.approx(command["fx_c"], abs=command["error"] + 5e-10)  # printed with ten digits
    assert fx_c == pytest.approx(1.935965487, abs=1e-8)  # another processor settles the disks within 1e-10
    assert float(re.search(r"\^(0\.\d+)", printed)[1]) == pytest.approx(0.5, abs=0.005)
    predicted, measured = map(float, re.findall(r"exp\(([\d.]+) t\)", printed))
    assert measured == pytest.approx(predicted, rel=0.01)  # one beat in ten growth times is left in the fit
    assert last_decade < 1  # question 10: the growth ends


def test_the_scene_is_that_of_the_page():
    [block] = re.findall(r"sections = (\{.*?^\})", cells()[0], re.MULTILINE | re.DOTALL)
    mine, shipped = Scene.from_mapping(eval(block)), Scene.from_toml(SCENE)
    assert mine == shipped
