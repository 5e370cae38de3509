"""The pair over F_x: both members, both branches in one colour, and an inset that can be read."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.figures import PairCurve, draw_pair


@pytest.fixture
def curves() -> list[PairCurve]:
    """The normal form: eigenvalues 1 -+ sqrt(fx_c - fx)."""
    made = []
    for mu, fx_c in ((1.0, 0.02), (0.8, 0.015)):
        fx = np.linspace(0, 0.03, 61)
        root = np.sqrt(fx_c - fx + 0j)
        made.append(PairCurve(mu, fx, np.column_stack([1 - root, 1 + root]), fx_c))
    return made


def test_coalescence_shows_both_members_of_every_pair(curves):
    real, imaginary = draw_pair(curves).axes[:2]
    assert [each.get_ylabel() for each in (real, imaginary)] == [r"$\mathrm{Re}\,\lambda$", r"$\mathrm{Im}\,\lambda$"]
    assert imaginary.get_xlabel() == "$F_x$"
    drawn = [line for line in real.lines if len(line.get_xdata()) == len(curves[0].fx)]
    assert len(drawn) == 4
    assert np.array_equal(drawn[0].get_ydata(), np.sort(curves[0].eigenvalues.real, axis=1)[:, 0])
    assert drawn[0].get_color() == drawn[1].get_color() != drawn[2].get_color()
    names = [text.get_text() for text in real.get_legend().get_texts()]
    assert names == [r"$\mu = 1$, $F_x^c = 0.02$", r"$\mu = 0.8$, $F_x^c = 0.015$"]


def test_conjugates_have_both_halves_in_one_colour(curves):
    imaginary = draw_pair(curves).axes[1]
    for number, curve in enumerate(curves):
        below, above = [line for line in imaginary.lines if len(line.get_xdata()) == 61][2 * number : 2 * number + 2]
        assert below.get_color() == above.get_color()
        assert np.array_equal(below.get_ydata(), -above.get_ydata())
        assert above.get_ydata()[-1] == pytest.approx(np.sqrt(0.03 - curve.fx_c), rel=1e-12)  # one root


def test_the_inset_counts_from_the_first_onset_if_there_is_one(curves):
    (inset,) = draw_pair(curves).axes[1].child_axes
    left, right = inset.get_xlim()
    assert left == -right
    assert inset.get_xlabel() == "$(F_x - F_x^c)\\,/\\,10^{-3}$"
    upper = inset.lines[1]
    beyond = upper.get_xdata() > 1e-9
    np.testing.assert_allclose(upper.get_ydata()[beyond], np.sqrt(1e-3 * upper.get_xdata()[beyond]), rtol=1e-9)
    stable = replace(curves[0], fx_c=None)
    assert draw_pair([stable]).axes[1].child_axes == []
