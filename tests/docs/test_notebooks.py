"""The notebooks run as they stand, and find what other ways find."""

import json
import re
import subprocess
from pathlib import Path

import pytest
from reference_layer import BIN

nbformat = pytest.importorskip("nbformat")

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOKS = DOCS / "notebooks"
PICTURES = {"exceptional_point": 6, "own_packing": 3}
"""A cell that ends with a figure shows it."""


def cells(name):
    return [each for each in nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4).cells if each.cell_type == "code"]


def test_no_output_is_stored():
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == set(PICTURES)
    assert [cell for name in PICTURES for cell in cells(name) if cell.outputs or cell.execution_count] == []


@pytest.fixture(scope="module")
def printed():
    """What a notebook prints, and how many pictures it shows."""
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    ran = {}

    def run(name):
        if name not in ran:
            notebook = nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4)
            nbclient.NotebookClient(notebook, timeout=300).execute()
            outputs = [each for cell in notebook.cells for each in cell.get("outputs", [])]
            text = "".join(each["text"] for each in outputs if each.output_type == "stream" and each.name == "stdout")
            ran[name] = text, sum("image/png" in each.get("data", {}) for each in outputs)
        return ran[name]

    return run


def number(text, before):
    return float(re.search(re.escape(before) + r" (\d[-+.\de]*)", text)[1])


@pytest.mark.long
@pytest.mark.parametrize("name", PICTURES)
def test_every_figure_is_shown(printed, name):
    assert printed(name)[1] == PICTURES[name]


@pytest.mark.long
def test_the_exceptional_point(printed, faultgouge_in, tmp_path):
    """The pair of three disks opens as a square root; the hundred disks have the onset of the command."""
    text, _ = printed("exceptional_point")
    # beside the root stands a term that is proportional to the distance: a hundredth of the load at the most
    assert number(text, "exponent") == pytest.approx(0.5, abs=0.01)
    (tmp_path / "scene.toml").write_text(
        "[packing]\nseed = 1\n[law]\nkn = 2e5\n[load]\nfy = 3.0\n[ramp]\nstep = 1e-3\nuntil = 0.02\n"
    )
    found = json.loads(faultgouge_in(tmp_path, "onset", "scene.toml", "--json").stdout)
    # the same search in the same arithmetic, printed with ten digits
    assert number(text, "a hundred disks: F_x^c =") == pytest.approx(found["fx_c"], abs=5e-12)


@pytest.mark.long
def test_a_packing_of_ones_own(printed, faultgouge_in, tmp_path):
    """The commands of the how-to find the same onset: their path has other increments, whose error they state."""
    page = (DOCS / "howto_own_packing.md").read_text()
    deck, scene = re.findall(r"```\n(.*?)```", page, re.DOTALL)
    (tmp_path / "pour.in").write_text(deck)
    (tmp_path / "own.toml").write_text(scene)
    subprocess.run([BIN / "lmp", "-in", "pour.in"], cwd=tmp_path, capture_output=True, check=True)
    [relaxing] = re.findall(r"^    faultgouge (import .*)$", page, re.MULTILINE)
    assert faultgouge_in(tmp_path, *relaxing.split()).returncode == 0
    found = json.loads(faultgouge_in(tmp_path, "onset", "own.toml", "--json").stdout)
    text, _ = printed("own_packing")
    assert number(text, "own packing: F_x^c =") == pytest.approx(found["fx_c"], abs=found["error"] + 5e-12)
