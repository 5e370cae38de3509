"""What the figures of studies contain: laws, runs and fits."""

import numpy as np
import pytest

from faultgouge.analysis import Growth
from faultgouge.figures.series import draw_growth
from faultgouge.studies.reproduce.triggering_figures import eruption_figure


@pytest.fixture
def runs():
    time = np.geomspace(0.01, 100, 300)
    return [(time, level * (1 + np.sin(time) ** 2)) for level in (1e-25, 1e-22, 1e-10)]


def test_eruption_draws_its_runs_their_control_and_the_crossing(runs):
    runs[0][1][:5] = 0.0
    axes, late = eruption_figure(*runs, control=runs[1], crossing=2.5).axes
    for panel in (axes, late):
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
