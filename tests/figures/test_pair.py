"""The curve of a pair of eigenvalues between stored loads."""

import numpy as np
import pytest
from reference_layer import SMALL

from faultgouge.figures import PairCurve, draw_pair
from faultgouge.figures.followed_pairs import follow_eigenvalues
from faultgouge.figures.pair import curve_through
from faultgouge.pywrap import Scene
from faultgouge.pywrap.onset import onset_run


@pytest.fixture(scope="module")
def run():
    """The first window on a ramp of 17 loads, the loads, and the eigenvalues of its pair."""
    changed = {"packing": SMALL["packing"] | {"seed": 3}, "ramp": {"step": 0.01, "until": 0.16}}
    found = onset_run(Scene.from_mapping(SMALL | changed), mu=1.0)
    first, packings = found.windows[0], [each.packing for each in found.equilibria]
    pairs = follow_eigenvalues(packings).pairs
    pair = min(pairs, key=lambda each: np.nanmin(np.abs(each.eigenvalues.real - first.eigenvalue)))
    return first, np.array([each.fx for each in packings]), pair.eigenvalues


@pytest.mark.slow
def test_the_drawn_branches_meet_at_the_onset(run):
    """To a pixel of a picture; the onset itself is the root of the discriminant, solved for with equilibria close to
    it."""
    first, fx, eigenvalues = run
    curve = PairCurve(1.0, fx, eigenvalues, first.fx_onset)
    real, imaginary = draw_pair([curve]).axes[:2]
    for axes in (real, imaginary):
        figure = axes.figure
        figure.draw_without_rendering()
        lower, upper = (line.get_xydata() for line in axes.lines[:2])
        apart = np.abs(lower - upper)[:, 1]
        real_pair = curve.smooth().eigenvalues[:, 0].imag == 0
        # the last real load and the first complex one are one point, where both branches are
        meeting = np.flatnonzero(real_pair)[-1]
        assert apart[meeting] <= (1e-12 if axes is real else 0.0) * np.abs(lower).max()
        drawn = axes.transData.transform(lower[meeting])
        there = axes.transData.transform((first.fx_onset, lower[meeting, 1]))
        assert abs(drawn - there).max() < 1.0


def test_nothing_is_drawn_between_two_loads_of_which_one_is_unknown_and_a_falling_load_has_the_same_curve():
    """A complex nan has the imaginary part 0 in NumPy, which would be drawn as a stable pair."""
    fx = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    pair = np.column_stack([fx, fx + 1]).astype(complex)
    pair[2] = complex(np.nan, np.nan)
    curve = PairCurve(1.0, fx, pair, None)
    fine = curve.smooth()
    assert np.isnan(curve.imaginary[2]).all()
    assert not np.any((fine.fx > 1) & (fine.fx < 3))
    assert np.isnan(fine.fx).sum() == 1
    np.testing.assert_array_equal(np.isnan(fine.real), np.isnan(fine.imaginary))
    np.testing.assert_allclose(np.diff(fine.eigenvalues[np.isfinite(fine.fx)], axis=1), 1.0, atol=1e-12)
    assert len(curve_through(fx, np.full((5, 2), np.nan + 0j))[0]) == 0
    root = np.sqrt(1.7 - fx + 0.05 * fx**2 + 0j)
    pair = np.column_stack([2 - root, 2 + root])
    up, down = curve_through(fx, pair), curve_through(fx[::-1], pair[::-1])
    for one, other in zip(up, down, strict=True):
        np.testing.assert_array_equal(one, other[::-1])
