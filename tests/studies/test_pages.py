"""What studies leave: pages that fit a screen and say what tables say; a picture that cannot be drawn costs no page."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from scipy.linalg import LinAlgError

from faultgouge.analysis import RunFile
from faultgouge.figures.pages import WIDTH, filled
from faultgouge.figures.style import spared
from faultgouge.studies.packings import distance
from faultgouge.studies.sweep.draw import draw_sweep
from faultgouge.studies.yielding.compute import CONTROLLED
from faultgouge.studies.yielding.page import numbers, rows_of, text, worst_ends, write_lasting

DOCS = Path(__file__).parents[2] / "docs"
ROWS, FAILED = rows_of(DOCS / "yield" / "tables" / "quartz_100.jsonl")


@pytest.fixture
def no_pictures(monkeypatch):
    def fails(*_, **__):
        raise RuntimeError("no font at all\nand more of it")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fails)


@pytest.fixture
def said():
    return []


PROSE = "The exponent is 0.5 - 0.001 + 0.002 > 0, as in 1. and in # 2, over all of the many loads that are there. " * 3


def test_prose_and_items_are_folded_where_no_line_begins_a_list():
    lines = filled(PROSE).split("\n")
    assert max(map(len, lines)) <= WIDTH
    assert not [line for line in lines if re.match(r"([-+>#]|\d+\.) ", line)]
    assert " ".join(lines).split() == PROSE.split()
    first, *more = filled("- " + PROSE).split("\n")
    assert first.startswith("- ")
    assert all(re.match(r"  \S", line) for line in more)


def test_tables_pictures_code_and_formulas_stay():
    page = "\n".join(["| " + PROSE, "![" + PROSE + "](a.png)", "```", PROSE, "```", "$$", PROSE, "$$", "    " + PROSE])
    assert filled(page) == page


def test_an_interrupt_is_no_failed_picture(said):
    with pytest.raises(KeyboardInterrupt), spared("x.png", said.append):
        raise KeyboardInterrupt
    assert said == []


def test_a_spectrum_keeps_its_eigenvalues_and_draw_its_words(
    tmp_path, reference_packing, faultgouge_here, no_pictures, monkeypatch
):
    def fails(*_):
        raise LinAlgError("no convergence")

    with RunFile.create(tmp_path / "run.h5", reference_packing(1.0)) as run:
        run.append(reference_packing(1.0), floor=1e-11, evaluations=1)
    monkeypatch.setattr("faultgouge.analysis.motion.transient.transient_gains", fails)
    done = faultgouge_here("spectrum", "run.h5", "--json")
    result = json.loads(done.stdout)
    assert len(result["eigenvalues"]) > 200
    assert result["transient_gain"] is None
    assert "the transient gain was not found (LinAlgError: no convergence); the eigenvalues are complete" in done.stderr
    assert "100 disks" in faultgouge_here("draw", "run.h5", code=1).stderr


def test_a_sweep_keeps_its_rows(tmp_path, no_pictures, said):
    row = {"values": {"packing.seed": 1}, "result": {"ramps": [{"mu": 1.0, "reach": 0.01, "ends": "onset"}]}}
    assert draw_sweep([row], tmp_path, said.append) == ""
    assert "results.png was not drawn (RuntimeError" in said[0]


def test_the_page_of_yield_is_that_of_its_table():
    assert (DOCS / "yield" / "yield.md").read_text() == text(numbers(ROWS), len(ROWS), FAILED)


def test_flow_is_told_from_a_layer_that_finds_no_rest_under_drag():
    worst = worst_ends(ROWS, 1.0)
    runs = [[run for run in row["dynamic"] if run["restitution"] == 1.0] for row in ROWS]
    flowing = sum(any(run["ends"] == "flows" for run in each) for each in runs)
    assert worst["counts"]["flows"]["count"] == flowing == 9
    assert sum(each["count"] for each in worst["counts"].values()) == numbers(ROWS)["yields"][0]["unrest"]


def test_layers_without_loss_do_not_rest_below_their_static_yield_and_lossy_ones_do():
    assert all(row["static"] >= row["newton"] for row in ROWS)
    undamped, *lossy = numbers(ROWS)["yields"]
    assert undamped["unrest"] > len(ROWS) / 2
    assert undamped["share"][2] < 1
    assert all(each["unrest"] == 0 and each["share"] == [1, 1, 1] for each in lossy)
    # with more loss the same layers flow as the load rises, and all of them beyond the end of Newton's branch
    flowing = {0.9: [], 0.5: [], 0.1: []}
    for k, row in enumerate(ROWS):
        for run in row["loading"]:
            assert run["flows"] is None or row["newton"] < run["flows"] < row["static"]
            if run["rate"] == CONTROLLED and run["flows"] is not None and run["restitution"] in flowing:
                flowing[run["restitution"]].append(k)
    assert flowing[0.9] == flowing[0.5] == flowing[0.1] != []


def test_disks_that_carry_nothing_have_no_part_in_d(reference_packing):
    packing = reference_packing(1.0)
    position = packing.position + 1e-3
    position[packing.rattlers] += 1.0
    assert distance(packing, replace(packing, position=position)) == pytest.approx(2e-6, rel=1e-9)


def test_the_page_of_layers_left_to_themselves_is_that_of_its_tables_and_other_pages_say_the_same(tmp_path):
    shutil.copytree(DOCS / "yield" / "tables", tmp_path / "tables")
    written = write_lasting(tmp_path).read_text()
    assert (DOCS / "yield" / "further.md").read_text() == written
    referee = " ".join((DOCS / "modes" / "referee.md").read_text().split())
    assert "one draw of noise for each layer, 5 of 20 (11 to 47 %) layers vibrate" in " ".join(written.split())
    assert "5 of 20 with one draw of noise each, vibrate" in referee
    assert "5 of 20 vibrate on with the noise that they were given" in referee
