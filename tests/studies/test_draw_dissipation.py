"""The figure of dissipation: what is predicted and what is measured can be told apart, and gaps stay gaps."""

import numpy as np
import pytest

from faultgouge.studies.dissipation.compute import Gain, Strength
from faultgouge.studies.dissipation.draw import dissipation_figure, draw_dashpot_onset, draw_drag_shift, draw_gain

STRENGTH = np.geomspace(1e-4, 1e2, 7)
LIMIT, SHIFT = 0.0148, 1e-3 * STRENGTH**2
DASHPOTS = [Strength("cn", x, LIMIT + 1e-5 * x, 1.0, LIMIT, 0.015) for x in STRENGTH]
DRAG = [Strength("drag", x, 0.015 + shift, 1.0, 0.015 + shift, 0.015) for x, shift in zip(STRENGTH, SHIFT, strict=True)]
DISTANCE = np.geomspace(1e-6, 1e-1, 6)
GAINS = {
    "none": [Gain(x, 0.0, 0.0, 2 / x, 1.0, None) for x in DISTANCE],
    "dashpots": [Gain(x, 1.0, 0.0, None if x < 1e-3 else 1 / x, 1.0, None) for x in DISTANCE],
}


def test_dashpots_show_onsets_limit_and_undamped_onset():
    axes = draw_dashpot_onset(DASHPOTS).axes[0]
    undamped, limit, measured = axes.lines
    assert set(undamped.get_ydata()) == {0.015}
    assert set(limit.get_ydata()) == {LIMIT}
    assert np.array_equal(measured.get_ydata(), LIMIT + 1e-5 * STRENGTH)
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
