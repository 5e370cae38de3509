"""What studies leave: pages and pictures that show what tables say; a picture that cannot be drawn costs no page."""

from dataclasses import replace

import numpy as np
import pytest
from reference_layer import SMALL

from faultgouge.analysis import Growth, RunFile
from faultgouge.figures.series import draw_growth
from faultgouge.pywrap import Scene
from faultgouge.studies.reproduce.protocol import growth_run, recorded_ramp, report, summary_of
from faultgouge.studies.reproduce.triggering_figures import eruption_figure
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


def test_eruption_draws_its_runs_their_control_and_the_crossing():
    time = np.geomspace(0.01, 100, 300)
    runs = [(time, level * (1 + np.sin(time) ** 2)) for level in (1e-25, 1e-22, 1e-10)]
    runs[0][1][:5] = 0.0
    for panel in eruption_figure(*runs, control=runs[1], crossing=2.5).axes:
        *drawn, threshold = panel.lines
        for line, (_, msd) in zip(drawn, (runs[2], runs[1], runs[1], runs[0]), strict=True):
            np.testing.assert_array_equal(line.get_ydata(), msd[msd > 0])
        assert set(threshold.get_xdata()) == {2.5}


def test_growth_draws_the_predicted_slope_beside_the_data():
    time = np.linspace(0, 100, 501)
    msd = 1e-25 * (1 + np.exp(0.4 * time))
    _, predicted = draw_growth(time, msd, 0.4, Growth(0.402, 1e-3, 12.0, 20.0, 90.0)).axes[0].lines
    (t0, t1), (d0, d1) = predicted.get_data()
    assert (t0, t1) == (20.0, 90.0)
    assert np.log(d1 / d0) / (t1 - t0) == pytest.approx(0.4, rel=1e-12)  # rounding of exp and log
    # A decade and a half above; where the floor still adds 3e-4 of D to the first point of the window.
    assert d0 / msd[100] == pytest.approx(10**1.5, rel=1e-3)
