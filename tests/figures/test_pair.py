"""The curve of a pair of eigenvalues between stored loads."""

import numpy as np

from faultgouge.figures import PairCurve, draw_pair
from faultgouge.figures.pair import curve_through


def test_the_pair_over_the_load_has_both_members_which_meet_at_the_onset():
    """The normal form: eigenvalues 1 -+ sqrt(fx_c - fx). Its discriminant is linear, so that curves between a few loads
    are exact, and both branches meet at the onset."""
    fx, fx_c = np.linspace(0, 0.03, 8), 0.02
    root = np.sqrt(fx_c - fx + 0j)
    curve = PairCurve(1.0, fx, np.column_stack([1 + root, 1 - root]), fx_c)
    real, imaginary = draw_pair([curve]).axes[:2]
    for axes, part in ((real, np.real), (imaginary, np.imag)):
        for sign, line, dots in zip((-1, 1), axes.lines[:2], axes.lines[2:4], strict=True):
            for drawn in (line, dots):
                at, value = drawn.get_xydata()[np.isfinite(drawn.get_ydata())].T
                wanted = np.sort([part(1 + s * np.sqrt(fx_c - at + 0j)) for s in (-1, 1)], axis=0)[(sign + 1) // 2]
                np.testing.assert_allclose(value, wanted, rtol=0, atol=1e-8)  # the root of what rounding leaves of D
            np.testing.assert_array_equal(dots.get_xdata(), fx)
            assert np.abs(line.get_xdata() - fx_c).min() < 1e-12


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
    np.testing.assert_allclose(np.diff(fine.eigenvalues[np.isfinite(fine.fx)], axis=1), 1.0, rtol=0, atol=1e-12)
    assert len(curve_through(fx, np.full((5, 2), np.nan + 0j))[0]) == 0
    root = np.sqrt(1.7 - fx + 0.05 * fx**2 + 0j)
    pair = np.column_stack([2 - root, 2 + root])
    up, down = curve_through(fx, pair), curve_through(fx[::-1], pair[::-1])
    for one, other in zip(up, down, strict=True):
        np.testing.assert_array_equal(one, other[::-1])
