"""Modes: what takes part in them, which two are about to meet, how they are drawn, and a pair over the load."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import EllipseCollection
from matplotlib.quiver import Quiver

from faultgouge.analysis import Contacts, MindlinLaw, Packing, closest_to_meeting, normal_modes, spectrum, touching
from faultgouge.analysis.spectrum.spectrum import participation_ratio, rotation_share
from faultgouge.figures import PairCurve, draw_pair
from faultgouge.figures.mode import Mode, draw_modes


@pytest.fixture(scope="module")
def pyramid() -> Packing:
    """Two disks on the floor and one on top, with slips, so that K is not symmetric."""
    position, radius = np.array([[3.49, 0.4992], [4.51, 0.4992], [4.0, 1.3586]]), np.full(3, 0.5)
    law = MindlinLaw(2e5, 2e5 * 2 / 7, 1.0)
    contacts = touching(position, radius)
    bare = Packing(
        position=position, radius=radius, contacts=contacts, law=law, fx=0.1, fy=1.0, top=[False, False, True]
    )
    slip = 0.5 * law.slip_limit(bare.geometry.overlap) * np.array([1, -1, 0.3, -0.2])
    return replace(bare, contacts=Contacts(contacts.i, contacts.j, slip))


def test_participation_and_rotation_of_plain_motions():
    alone, together, turning = np.zeros((3, 3, 4))
    alone[0, 2], together[1], turning[2] = 1.0, 0.5, 0.5
    columns = np.column_stack([each.ravel() for each in (alone, together, turning)])
    np.testing.assert_allclose(participation_ratio(columns), [0.25, 1, 1], rtol=1e-15)
    np.testing.assert_allclose(rotation_share(columns), [0, 0, 1], rtol=1e-15)


def test_normal_modes_are_those_of_the_spectrum_and_the_closest_have_the_largest_cosine(pyramid):
    modes = normal_modes(pyramid)
    np.testing.assert_array_equal(modes.values.real, spectrum(pyramid).eigenvalues.real)
    assert np.all((modes.participation >= 1 / 3) & (modes.participation <= 1 + 1e-12))
    first, second, cosine = closest_to_meeting(modes)
    right = modes.right.real
    others = [abs(right[:, a] @ right[:, b]) for a in range(len(right.T)) for b in range(a)]
    assert cosine == pytest.approx(max(others), rel=1e-12)
    assert abs(right[:, first] @ right[:, second]) == pytest.approx(cosine, rel=1e-12)
    assert modes.values[first].real < modes.values[second].real


def test_a_complex_mode_is_drawn_at_two_moments_with_arrows_and_the_colour_of_rotation(pyramid):
    moved = np.zeros((3, 3), dtype=complex)
    moved[0, 2], moved[1, 2], moved[2] = 1.0, 1j, [2.0, -1.0, 0.0]
    figure = draw_modes(pyramid, [Mode(4, 10 + 2j, moved, 0.3, 0.1)], "a pair")
    first, second = (axes.findobj(Quiver)[0] for axes in figure.axes[:2])
    at_top = np.argmax(np.abs(first.U))
    assert first.U[at_top] > 0
    assert first.V[at_top] == 0
    # a quarter of a period later exp(i pi/2) has turned x into -y
    assert second.U[at_top] == pytest.approx(0, abs=1e-15)
    assert second.V[at_top] == pytest.approx(-first.U[at_top], rel=1e-12)
    (disks,) = figure.axes[0].findobj(EllipseCollection)
    np.testing.assert_allclose(disks.get_array(), [1.0, -0.5, 0.0])


def test_the_pair_over_the_load_has_both_members_and_an_inset_about_its_onset():
    """The normal form: eigenvalues 1 -+ sqrt(fx_c - fx)."""
    fx, fx_c = np.linspace(0, 0.03, 61), 0.02
    root = np.sqrt(fx_c - fx + 0j)
    curve = PairCurve(1.0, fx, np.column_stack([1 + root, 1 - root]), fx_c)
    real, imaginary = draw_pair([curve]).axes[:2]
    drawn = {real: (1 - root.real, 1 + root.real), imaginary: (-root.imag, root.imag)}
    for axes, members in drawn.items():
        for line, member in zip(axes.lines[:2], members, strict=True):
            np.testing.assert_array_equal(line.get_xydata(), np.column_stack([fx, member]))
    upper = imaginary.child_axes[0].lines[1]
    beyond = upper.get_xdata() > 1e-9
    np.testing.assert_allclose(upper.get_ydata()[beyond], np.sqrt(1e-3 * upper.get_xdata()[beyond]), rtol=1e-9)
    assert draw_pair([replace(curve, fx_c=None)]).axes[1].child_axes == []
