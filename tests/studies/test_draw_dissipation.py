"""The figure of dissipation: what is predicted and what is measured can be told apart, and gaps stay gaps."""

import numpy as np
import pytest

from faultgouge.studies.dissipation.draw import dissipation_figure

STRENGTH = np.geomspace(1e-4, 1e2, 7)
LIMIT, SHIFT = 0.0148, 1e-3 * STRENGTH**2
DASHPOTS = [{"strength": x, "onset": LIMIT + 1e-5 * x, "predicted": LIMIT, "undamped": 0.015} for x in STRENGTH]
DRAG = [
    {"strength": x, "onset": 0.015 + shift, "predicted": 0.015 + shift, "undamped": 0.015}
    for x, shift in zip(STRENGTH, SHIFT, strict=True)
]
DISTANCE = np.geomspace(1e-6, 1e-1, 6)
GAINS = {
    "none": [{"distance": x, "gain": 2 / x} for x in DISTANCE],
    "dashpots": [{"distance": x, "gain": None if x < 1e-3 else 1 / x} for x in DISTANCE],
}


def test_three_panels_show_predictions_and_onsets_and_where_there_is_no_gain():
    dashpots, drag, gain = dissipation_figure(DASHPOTS, DRAG, GAINS).axes
    assert [axes.get_title(loc="left")[:3] for axes in (dashpots, drag, gain)] == ["(a)", "(b)", "(c)"]
    undamped, limit, measured = dashpots.lines
    assert set(undamped.get_ydata()) == {0.015}
    assert set(limit.get_ydata()) == {LIMIT}
    assert np.array_equal(measured.get_ydata(), LIMIT + 1e-5 * STRENGTH)
    assert dashpots.get_xscale() == "log"
    predicted, measured = drag.lines
    assert measured.get_ydata() == pytest.approx(1e-3 * STRENGTH**2, rel=1e-6)
    assert predicted.get_ydata() == pytest.approx(measured.get_ydata())
    plain, damped = gain.lines
    assert np.isfinite(plain.get_ydata()).all()
    assert np.isnan(damped.get_ydata()).sum() == 3
