"""The notebooks run as they stand, and find what other ways find."""

import json
import re
import subprocess
from pathlib import Path

import pytest
from reference_layer import BIN, toml

nbformat = pytest.importorskip("nbformat")

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOKS = DOCS / "notebooks"
NAMES = ("exceptional_point", "own_packing")


def test_no_output_is_stored():
    assert sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb")) == sorted(NAMES)
    cells = [cell for name in NAMES for cell in nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4).cells]
    assert [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")] == []


def printed_and_shown(name):
    """What a notebook prints, and how many pictures it shows: a cell that ends with a figure shows it."""
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4)
    nbclient.NotebookClient(notebook, timeout=300).execute()
    outputs = [each for cell in notebook.cells for each in cell.get("outputs", [])]
    text = "".join(each["text"] for each in outputs if each.output_type == "stream" and each.name == "stdout")
    return text, sum("image/png" in each.get("data", {}) for each in outputs)


def number(text, before):
    return float(re.search(re.escape(before) + r" (\d[-+.\de]*)", text)[1])


@pytest.mark.long
def test_the_exceptional_point(faultgouge, tmp_path):
    """The pair of three disks opens as a square root; the hundred disks have the onset of the command."""
    text, pictures = printed_and_shown("exceptional_point")
    assert pictures == 6
    # beside the root stands a term that is proportional to the distance: a hundredth of the load at the most
    assert number(text, "exponent") == pytest.approx(0.5, abs=0.01)
    sections = {"packing": {"seed": 1}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": {"step": 1e-3, "until": 0.02}}
    (tmp_path / "scene.toml").write_text(toml(sections))
    found = json.loads(faultgouge("onset", "scene.toml", "--json").stdout)
    # the same search in the same arithmetic, printed with ten digits
    assert number(text, "a hundred disks: F_x^c =") == pytest.approx(found["fx_c"], abs=5e-12)


@pytest.mark.long
def test_a_packing_of_ones_own(faultgouge, tmp_path):
    """The commands of the how-to find the same onset: their path has other increments, whose error they state."""
    page = (DOCS / "howto_own_packing.md").read_text()
    deck, scene = re.findall(r"```\n(.*?)```", page, re.DOTALL)
    (tmp_path / "pour.in").write_text(deck)
    (tmp_path / "own.toml").write_text(scene)
    subprocess.run([BIN / "lmp", "-in", "pour.in"], cwd=tmp_path, capture_output=True, check=True)
    [relaxing] = re.findall(r"^    faultgouge (import .*)$", page, re.MULTILINE)
    faultgouge(*relaxing.split())
    found = json.loads(faultgouge("onset", "own.toml", "--json").stdout)
    text, pictures = printed_and_shown("own_packing")
    assert pictures == 3
    assert number(text, "own packing: F_x^c =") == pytest.approx(found["fx_c"], abs=found["error"] + 5e-12)
