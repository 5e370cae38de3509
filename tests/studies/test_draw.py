"""What the figures of studies contain: laws, runs and fits."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import Growth
from faultgouge.analysis.responses.normal_form import NormalForm
from faultgouge.analysis.responses.power_law import PowerLaw
from faultgouge.figures.series import draw_growth
from faultgouge.pywrap.lammps.dynamics import Weakening
from faultgouge.studies.reproduce.triggering_figures import (
    DAMPING_TIMES,
    amplitude_figure,
    damping_figure,
    eruption_figure,
    friction_law_figure,
    measured_friction_figure,
    response_figure,
    share,
    weakening_figure,
)
from faultgouge.studies.triggering import Sensitivity
from research.dissipation.draw import dissipation_figure

PAPERS = Weakening(B=0.2, w=0.4, mu_ss=0.8, v0=0.0, v_ss=1.0)


@pytest.fixture
def runs():
    time = np.geomspace(0.01, 100, 300)
    return [(time, level * (1 + np.sin(time) ** 2)) for level in (1e-25, 1e-22, 1e-10)]


def test_laws_are_drawn_from_their_thresholds_on():
    """The paper's law, and those that it fitted to measurements."""
    reduced, mu = friction_law_figure(replace(PAPERS, v0=3.0, v_ss=7.0), 0.5).axes[0].lines[0].get_data()
    assert np.all(mu[reduced <= 0] == 0.5)
    np.testing.assert_allclose(mu[reduced > 0], 0.1 * np.exp(-0.4 * reduced[reduced > 0]) + 0.4, rtol=1e-12)
    for line, mu_ss in zip(measured_friction_figure().axes[0].lines, (0.78, 0.74), strict=True):
        v, mu = line.get_data()
        assert np.all(mu[v <= 0.05] == 1)
        np.testing.assert_allclose(mu[v > 0.05], 0.22 * np.exp(-4 * (v[v > 0.05] - 0.05)) + mu_ss, rtol=1e-12)


def test_eruption_draws_its_runs_their_control_and_the_crossing(runs):
    runs[0][1][:5] = 0.0
    axes, late = eruption_figure(*runs, control=runs[1], crossing=2.5).axes
    for panel in (axes, late):
        *drawn, threshold = panel.lines
        for line, (_, msd) in zip(drawn, (runs[2], runs[1], runs[1], runs[0]), strict=True):
            np.testing.assert_array_equal(line.get_ydata(), msd[msd > 0])
        assert set(threshold.get_xdata()) == {2.5}


def test_weakening_draws_the_run_over_its_law():
    law = replace(PAPERS, v0=1e-11, v_ss=1e-9)
    velocity = np.concatenate([np.geomspace(1e-13, 1e-6, 50), [-1e-9, 0.0]])
    smooth, run = weakening_figure(velocity, 0.5 * share(law, velocity), law, 0.5).axes[0].lines[:2]
    np.testing.assert_array_equal(run.get_ydata(), 0.5 * share(law, velocity[:50]))
    np.testing.assert_array_equal(smooth.get_ydata(), 0.5 * share(law, smooth.get_xdata()))


def normal_pairs(*epsilons):
    """Pairs of the normal form, whose unit of time is one."""
    return tuple(NormalForm(0.2, epsilon) for epsilon in epsilons)


def test_amplitudes_carry_their_exponent():
    distance = np.array([1e-7, 1e-2, 0.5])
    found = Sensitivity(distance, normal_pairs(*distance), PowerLaw(-0.49989, 3e-5, 1.4))
    _, fitted, points = amplitude_figure(found).axes[0].lines
    np.testing.assert_allclose(fitted.get_ydata(), 1.4 * np.array([1e-7, 0.5]) ** -0.49989)
    np.testing.assert_array_equal(points.get_ydata(), [pair.amplitude() for pair in found.pairs])
    # of a response of less than four times the start no damping takes half
    assert found.near == found.pairs[:2]


def test_damping_marks_its_crossover():
    pairs = normal_pairs(1e-3, 1e-5)
    lines = damping_figure(pairs).axes[0].lines
    for number, pair in enumerate(pairs):
        line, plateau, dot, ring = lines[4 * number : 4 * number + 4]
        np.testing.assert_array_equal(line.get_xdata(), pair.tau_d * DAMPING_TIMES)
        np.testing.assert_array_equal(line.get_ydata(), [pair.amplitude(tau) for tau in line.get_xdata()])
        assert set(plateau.get_ydata()) == {pair.amplitude()}
        # between two points the curve bends by a few per cent
        assert dot.get_xydata()[0] == pytest.approx((pair.tau_d, 0.4155 * pair.amplitude()), rel=0.05)
        assert tuple(ring.get_xydata()[0]) == (pair.half_gain_time(), 0.5 * pair.amplitude())


def test_response_lies_over_the_run(runs):
    _, msd = runs[0]
    upper, lower = response_figure(runs[0], msd * 1.001).axes
    broad, line = upper.lines
    np.testing.assert_array_equal(broad.get_ydata(), msd)
    np.testing.assert_array_equal(line.get_ydata(), msd * 1.001)
    assert lower.lines[0].get_ydata().max() == pytest.approx(1e-3, rel=1e-9)


def test_growth_draws_the_predicted_slope_beside_the_data():
    time = np.linspace(0, 100, 501)
    msd = 1e-25 * (1 + np.exp(0.4 * time))
    _, predicted = draw_growth(time, msd, 0.4, Growth(0.402, 1e-3, 12.0, 20.0, 90.0)).axes[0].lines
    (t0, t1), (d0, d1) = predicted.get_data()
    assert (t0, t1) == (20.0, 90.0)
    assert np.log(d1 / d0) / (t1 - t0) == pytest.approx(0.4, rel=1e-12)  # rounding of exp and log
    # A decade and a half above; where the floor still adds 3e-4 of D to the first point of the window.
    assert d0 / msd[100] == pytest.approx(10**1.5, rel=1e-3)


def test_growth_that_was_not_reached_has_its_slope_and_a_stable_start_none():
    time = np.linspace(0, 20, 201)
    msd = 1e-25 * (1 + 0.5 * np.sin(time) ** 2)
    _, predicted = draw_growth(time, msd, 0.036, None).axes[0].lines
    (t0, t1), (d0, d1) = predicted.get_data()
    assert (t0, t1) == (0, 20)
    assert np.log(d1 / d0) / 20 == pytest.approx(0.036, rel=1e-12)
    # a slope that leaves the picture ends where a decade and a half above D ends
    _, steep = draw_growth(time, msd, 10.0, None).axes[0].lines
    assert steep.get_xdata()[1] < 20
    assert len(draw_growth(time, msd, 0.0, None).axes[0].lines) == 1


def test_dissipation_shows_predictions_and_onsets_and_where_there_is_no_gain():
    strength, limit, undamped = np.geomspace(1e-4, 1e2, 7), 0.0148, 0.015
    crossover, distance = undamped + 1e-3 * strength**2, np.geomspace(1e-6, 1e-1, 6)
    lowered = [{"strength": x, "onset": limit + 1e-5 * x, "predicted": limit, "undamped": undamped} for x in strength]
    raised = [
        {"strength": x, "onset": fx, "predicted": fx, "undamped": undamped}
        for x, fx in zip(strength, crossover, strict=True)
    ]
    gains = {
        "none": [{"distance": x, "gain": 2 / x} for x in distance],
        "dashpots": [{"distance": x, "gain": None if x < 1e-3 else 1 / x} for x in distance],
    }
    dashpots, drag, gain = dissipation_figure(lowered, raised, gains).axes
    assert [set(line.get_ydata()) for line in dashpots.lines[:2]] == [{undamped}, {limit}]
    assert np.array_equal(dashpots.lines[2].get_ydata(), limit + 1e-5 * strength)
    for line in drag.lines:
        assert line.get_ydata() == pytest.approx(1e-3 * strength**2, rel=1e-6)
    assert [np.isnan(line.get_ydata()).sum() for line in gain.lines] == [0, 3]
