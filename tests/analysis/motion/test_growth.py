"""Growth rates from D(t): of motions whose rate is known, between noise and ceiling."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import (
    Contacts,
    MindlinLaw,
    Packing,
    fit_growth,
    growth_of_run,
    growth_rate,
    mean_square_displacement,
    spectrum,
)


@pytest.mark.parametrize("eigenvalue", [2058.0 + 1.8j, 2058.0 + 0.3j, 40.0 + 0.5j])
@pytest.mark.parametrize("shape", ["standing", "turning", "mixed"])
def test_rate_of_a_complex_pair(eigenvalue, shape):
    """A standing wave, as beside an exceptional point, dips to zero twice a period; the means do not care."""
    one, other = np.random.default_rng(1).normal(size=(2, 30))
    vector = {"standing": one + 0j, "turning": np.array([1, 1j] * 15), "mixed": one + 0.1j * other}[shape]
    rate = growth_rate(eigenvalue)
    time = np.linspace(0, 34 / rate, 20001)
    motion = np.exp(1j * np.conj(np.sqrt(eigenvalue)) * time)[:, None] * vector  # the member that grows
    growth = fit_growth(time, 1e-22 * np.mean(motion.real**2, axis=1), lower=1e-21, upper=1e-10)
    assert growth.decades > 9
    # 600 samples of incoherent phase make a mean good to 3e-2, and 24 means a slope over 25 e-foldings
    # to 1e-3; three times that for phases that are not all incoherent.
    assert growth.rate == pytest.approx(rate, rel=3e-3)
    assert abs(growth.rate - rate) < 5 * growth.error + 1e-9 * rate


def test_rate_from_samples_at_uneven_times():
    """Those of an undamped run: equally spaced, and besides at times that grow geometrically."""
    every = 50 * np.arange(1, 2001)
    time = 1e-3 * np.union1d(every, np.geomspace(1, every[-1], 200).astype(int))
    msd = 1e-24 * np.exp(0.4 * time) * (1 + 0.5 * np.cos(9 * time))
    # the stretches begin and end at other samples, by a spacing at the most
    growth = fit_growth(time, msd, 1e-22, 1e-10)
    assert growth.rate == pytest.approx(0.4, rel=1e-3)
    used = msd[(time >= growth.start) & (time <= growth.end)]
    assert used[0] >= 1e-22 > msd[time < growth.start].max()
    assert used.max() < 1e-10 <= msd[time > growth.end][0]


def test_mean_square_displacement_of_wrapped_positions():
    reference = np.array([[0.1, 1.0], [9.9, 2.0]])
    moved = np.array([[9.9, 1.0], [0.2, 2.4]])  # by -0.2 and by +0.3, +0.4, across the box
    d = mean_square_displacement(np.array([reference, moved]), reference, box_length=10.0)
    np.testing.assert_allclose(d, [0, (0.04 + 0.25) / 2], rtol=1e-12, atol=0)
    assert mean_square_displacement(moved, reference) > 50


def run_of(rate, length, share=1e-4, noise=1e-26):
    """D of noise, of which one motion with a share of it grows."""
    time = np.linspace(0.1, length, 4000)
    return time, noise * (1 + np.sin(time) ** 2 + share * np.exp(rate * time))


def test_growth_of_a_run_stands_beside_its_prediction(path):
    packing = path(0.022)
    known = spectrum(packing)
    rate = known.growth_rate()
    full, cut, short = (growth_of_run(packing, *run_of(rate, folds / rate)) for folds in (40, 21, 6))
    assert (full.predicted, full.pairs, full.negative, full.enough) == (rate, len(known.pairs), 0, True)
    # the noise adds a thousandth at the lower bound
    assert full.measured.rate == pytest.approx(rate, rel=1e-3)
    assert full.as_dict()["growth"].keys() >= {"measured", "error", "predicted", "from", "to"}
    # a run that ends while D still grows is followed to its end
    assert cut.measured.end == pytest.approx(21 / rate, rel=1e-2)
    assert (short.measured, short.enough) == (None, False)
    # a tenth of the share of one of 300 modes, three decades above the noise, and one more
    assert short.needed * rate == pytest.approx(np.log(1e4 * 3000), rel=1e-12)
    assert "6.0 e-foldings" in short.says


def test_growth_of_a_stable_start_is_not_invented(path):
    """However D rises."""
    time, damped = np.linspace(0.1, 100, 2000), replace(path(0.022), drag_time=1.0)
    for packing, words in ((path(0.02), "linearly stable"), (damped, "dissipation damps all motion")):
        found = growth_of_run(packing, time, 1e-26 * np.exp(0.3 * time))
        assert (found.measured, found.predicted, found.needed, found.enough) == (None, 0, None, None)
        assert found.as_dict()["growth"] is None
        assert words in found.says


def test_growth_with_weakened_friction_counts_from_the_moment_it_weakens(path):
    """Stable with mu = 1, unstable with 0.8: D jumps at t = 100 and grows from there."""
    packing = path(0.0205)
    weak = spectrum(replace(packing, law=replace(packing.law, mu=0.8))).growth_rate()
    assert spectrum(packing).growth_rate() == 0 < weak
    time = np.linspace(0.1, 100 + 40 / weak, 8000)
    later = np.maximum(time - 100, 0)
    msd = 1e-26 * np.exp(0.1 * np.minimum(time, 100)) + (time >= 100) * 1e-18 * (1 + 1e-3 * np.exp(weak * later))
    found = growth_of_run(packing, time, msd, np.where(time < 100, 1.0, 0.8))
    assert (found.predicted, found.weakened) == (weak, 0.8)
    assert found.measured.start > 100
    # the jump is a tenth of D at the lower bound, and no part of it at the upper one
    assert found.measured.rate == pytest.approx(weak, rel=0.02)


def test_a_packing_that_buckles_says_so():
    law = MindlinLaw(2e5, 0.0, 0.0)
    contacts = Contacts([0, 0], [-1, 1], [0, 0])
    column = Packing(position=[[0, 0.49], [0, 1.47]], radius=[0.5, 0.5], contacts=contacts, law=law)
    found = growth_of_run(column, *run_of(0.1, 1.0))
    assert (found.pairs, found.negative) == (0, 1)
    assert "1 negative eigenvalue" in found.says
