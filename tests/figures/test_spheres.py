"""Pictures of spheres: who hides whom, where the light is, widths of bars, floor, and the arrows of a mode."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.quiver import Quiver

from faultgouge.analysis import normal_modes
from faultgouge.figures import draw_mode, draw_packing
from faultgouge.figures.spheres import DOTS_ACROSS, INTO, LIGHT, flat, shade_spheres

RED, BLUE = [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]
FRAME = (-1.0, 1.0, -1.0, 1.0)


def test_the_nearer_sphere_hides_the_other_in_any_order():
    place = np.array([0.5 * INTO, -0.5 * INTO])  # the second is nearer
    for order in ([0, 1], [1, 0]):
        dots = shade_spheres(place[order], np.full(2, 0.4), np.array([RED, BLUE])[order], FRAME)
        red, _, blue, opaque = dots[len(dots) // 2, DOTS_ACROSS // 2]
        assert (blue > red, opaque) == (True, 1)
    assert dots[0, 0, 3] == 0  # beside the spheres there is nothing


def test_the_brightest_dot_faces_the_lamp():
    radius = 0.8
    dots = shade_spheres(np.zeros((1, 3)), np.array([radius]), np.array([[0.5, 0.5, 0.5]]), FRAME)
    row, column = np.unravel_index(np.argmax(dots[..., 0]), dots.shape[:2])
    size = 2 / DOTS_ACROSS
    seen = np.array([-1 + size * (column + 0.5), 1 - size * (row + 0.5)]) / radius
    np.testing.assert_allclose(seen, flat(LIGHT), rtol=0, atol=0.05)  # next to its top a cosine is flat


def test_bars_are_as_wide_as_their_forces_and_end_on_the_floor(column):
    axes = draw_packing(column, caption=True).axes[0]
    (floor,) = axes.findobj(PolyCollection)
    [bars] = [each for each in axes.findobj(LineCollection) if len(each.get_segments()) == 2]
    widths = np.sort(bars.get_linewidths())
    assert widths[1] == pytest.approx(2 * widths[0], rel=1e-12)
    at_floor = flat(np.array([0.5, 0.5, 0.0]))
    ends = np.concatenate([bar for bar in bars.get_segments()])
    assert np.hypot(*(ends - at_floor).T).min() < 1e-9
    assert floor.get_paths()[0].contains_point(at_floor)
    assert "2 spheres" in draw_packing(column, caption=True).get_suptitle()


def test_arrows_of_the_vertical_mode_point_up_or_down(column):
    """The stiffer of the two vertical modes of the column: the spheres move against each other."""
    upright = np.sum(np.abs(normal_modes(column).right[4:6]) ** 2, axis=0) > 0.99
    figure = draw_mode(column, int(np.flatnonzero(upright)[-1]))
    (arrows,) = figure.axes[0].findobj(Quiver)
    assert np.abs(arrows.U).max() < 1e-6 * np.abs(arrows.V).max()
    assert arrows.V[0] * arrows.V[1] < 0
