"""A picture that cannot be drawn is told in one sentence, and costs no number and no page."""

import json
import shutil
from pathlib import Path

import pytest
from jinja2 import UndefinedError
from matplotlib.figure import Figure
from reference_layer import SMALL, parted
from scipy.linalg import LinAlgError

from faultgouge.analysis import RunFile
from faultgouge.assessment.stability.cases.case import Case, Outcome
from faultgouge.assessment.stability.compute import stability
from faultgouge.figures.style import spared
from faultgouge.pywrap import Scene
from faultgouge.studies.frame import Study
from faultgouge.studies.genericity.page import write_page
from faultgouge.studies.sweep.draw import draw_sweep


@pytest.fixture
def no_pictures(monkeypatch):
    def fails(*_, **__):
        raise RuntimeError("no font at all\nand more of it")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fails)


@pytest.fixture
def said():
    return []


@pytest.fixture
def stored(tmp_path, reference_packing):
    with RunFile.create(tmp_path / "run.h5", reference_packing(1.0)) as run:
        run.append(reference_packing(1.0), floor=1e-11, evaluations=1)


def test_an_interrupt_is_no_failed_picture(said):
    with pytest.raises(KeyboardInterrupt), spared("x.png", said.append):
        raise KeyboardInterrupt
    assert said == []


def test_genericity_keeps_its_numbers_and_its_page_which_are_those_of_the_docs(tmp_path, no_pictures, said):
    docs = Path(__file__).parents[2] / "docs" / "genericity"
    for table in (*docs.glob("*/results.csv"), docs / "made.json"):
        (tmp_path / table.relative_to(docs)).parent.mkdir(exist_ok=True)
        shutil.copy(table, tmp_path / table.relative_to(docs))
    write_page(tmp_path, said.append)
    assert (tmp_path / "genericity.md").read_text() == (docs / "genericity.md").read_text()
    (words, numbers), (stored, expected) = (parted(each / "genericity.json") for each in (tmp_path, docs))
    assert words == stored
    assert numbers == pytest.approx(expected, rel=1e-12)
    assert len(said) == 4
    assert all("was not drawn (RuntimeError: no font at all)" in sentence for sentence in said)


def test_a_spectrum_keeps_its_eigenvalues(stored, faultgouge_here, monkeypatch):
    def fails(*_):
        raise LinAlgError("no convergence")

    monkeypatch.setattr("faultgouge.analysis.motion.transient.transient_gains", fails)
    done = faultgouge_here("spectrum", "run.h5", "--json")
    result = json.loads(done.stdout)
    assert len(result["eigenvalues"]) > 200
    assert result["transient_gain"] is None
    assert "the transient gain was not found (LinAlgError: no convergence); the eigenvalues are complete" in done.stderr


def test_draw_says_its_words_before_the_picture(stored, faultgouge_here, no_pictures):
    done = faultgouge_here("draw", "run.h5", code=1)
    assert "100 disks" in done.stderr


def test_stability_keeps_its_cases(tmp_path, no_pictures, said):
    case = Case("one", "group", lambda: Outcome("holds", 0.5, 1.0, "half of the bound"))
    stability(tmp_path, say=said.append, cases=[case])
    assert json.loads((tmp_path / "stability.json").read_text())["cases"][0]["figure"] == 0.5
    assert (tmp_path / "stability.md").exists()
    assert len(said) == 1
    assert "stability.png was not drawn (RuntimeError: no font at all)" in said[0]


def test_a_sweep_keeps_its_rows(tmp_path, no_pictures, said):
    row = {"values": {"packing.seed": 1}, "result": {"ramps": [{"mu": 1.0, "reach": 0.01, "ends": "onset"}]}}
    assert draw_sweep([row], tmp_path, said.append) == ""
    assert "results.png was not drawn (RuntimeError" in said[0]


def test_a_study_keeps_its_numbers_and_its_page(tmp_path, no_pictures, said):
    check, compute, figures = (lambda _: None), (lambda *_: {"fx_c": 7}), (lambda *_: {"sizes": Figure})
    study = Study("faultgouge.studies.eruptions", "eruptions", "eruptions", check, compute, figures, page=lambda _: {})
    with pytest.raises(UndefinedError):  # by the template, which comes after the pictures
        study(Scene.from_mapping(SMALL), tmp_path, said.append)
    assert json.loads((tmp_path / "eruptions.json").read_text())["fx_c"] == 7
    assert said == ["sizes.png was not drawn (RuntimeError: no font at all); all numbers are there"]
