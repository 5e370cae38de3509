"""What studies leave: pages that fit a screen and say what tables say; a picture that cannot be drawn costs no page."""

from dataclasses import replace

import pytest
from reference_layer import SMALL

from faultgouge.analysis import RunFile
from faultgouge.pywrap import Scene
from faultgouge.studies.reproduce.protocol import growth_run, recorded_ramp, report, summary_of
from faultgouge.studies.sweep.draw import draw_sweep


@pytest.mark.long
def test_the_page_of_the_protocol_counts_no_windows_that_were_not_counted(tmp_path):
    """As of a packing of more than 300 disks, of which the first window alone is sought."""
    scene = Scene.from_mapping(SMALL | {"ramp": {"step": 5e-3, "until": 0.045}})
    run = recorded_ramp(scene, 1.0, tmp_path / "run.h5")
    growth = growth_run(scene, run, tmp_path / "run.h5")
    first = replace(run, windows=run.windows[:1], complete=False)
    for each, cell in ((run, f"| {len(run.windows)} |"), (first, "| not counted, as the search ended with the")):
        page = report(scene, [each], growth, "nothing", None)
        (row,) = (line for line in page.splitlines() if line.startswith("| 1 |"))
        assert cell in row
        assert summary_of(scene, [each], growth)["ramps"][0]["onset"]["complete"] is each.complete


def test_a_sweep_keeps_its_rows_and_draw_its_words(tmp_path, reference_packing, faultgouge_here, monkeypatch):
    """Where a picture cannot be drawn."""

    def fails(*_, **__):
        raise RuntimeError("no font at all\nand more of it")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fails)
    said, result = [], {"ramps": [{"mu": 1.0, "reach": 0.01, "ends": "onset"}]}
    assert draw_sweep([{"values": {"packing.seed": 1}, "result": result}], tmp_path, said.append) == ""
    assert "results.png was not drawn (RuntimeError" in said[0]
    with RunFile.create(tmp_path / "run.h5", reference_packing(1.0)) as run:
        run.append(reference_packing(1.0), floor=1e-11, evaluations=1)
    assert "100 disks" in faultgouge_here("draw", "run.h5", code=1).stdout
