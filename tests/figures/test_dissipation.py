"""The figure of dissipation: what is predicted and what is measured can be told apart, and gaps stay gaps."""

import numpy as np
import pytest

from faultgouge.figures.dissipation import (
    GainCurve,
    OnsetCurve,
    dissipation_figure,
    draw_dashpot_onset,
    draw_drag_shift,
    draw_gain,
)

STRENGTH = np.geomspace(1e-4, 1e2, 7)
DASHPOTS = OnsetCurve(STRENGTH, 0.0148 + 1e-5 * STRENGTH, np.full(7, 0.0148), 0.015)
DRAG = OnsetCurve(STRENGTH, 0.015 + 1e-3 * STRENGTH**2, 0.015 + 1e-3 * STRENGTH**2, 0.015)
DISTANCE = np.geomspace(1e-6, 1e-1, 6)
GAINS = [
    GainCurve("none", DISTANCE, 2 / DISTANCE),
    GainCurve("dashpots", DISTANCE, np.where(DISTANCE < 1e-3, np.nan, 1 / DISTANCE)),
]


def test_dashpots_show_onsets_limit_and_undamped_onset():
    axes = draw_dashpot_onset(DASHPOTS).axes[0]
    undamped, limit, measured = axes.lines
    assert set(undamped.get_ydata()) == {0.015}
    assert np.array_equal(limit.get_ydata(), DASHPOTS.predicted)
    assert np.array_equal(measured.get_ydata(), DASHPOTS.onset)
    assert axes.get_xscale() == "log"


def test_drag_is_shown_as_a_shift():
    predicted, measured = draw_drag_shift(DRAG).axes[0].lines
    assert measured.get_ydata() == pytest.approx(1e-3 * STRENGTH**2, rel=1e-6)
    assert predicted.get_ydata() == pytest.approx(measured.get_ydata())


def test_no_gain_is_drawn_where_a_motion_grows_for_ever():
    plain, damped = draw_gain(GAINS).axes[0].lines
    assert np.isfinite(plain.get_ydata()).all()
    assert np.isnan(damped.get_ydata()).sum() == 3


def test_three_panels_in_order():
    titles = [axes.get_title(loc="left") for axes in dissipation_figure(DASHPOTS, DRAG, GAINS).axes]
    assert [title[:3] for title in titles] == ["(a)", "(b)", "(c)"]
