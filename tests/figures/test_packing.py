"""Packings: every disk and contact where it is, the load, colours of contacts. Modes."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from faultgouge.analysis import Contacts, MindlinLaw, Packing, closest_to_meeting, normal_modes, spectrum, touching
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.figures import draw_packing, save
from faultgouge.figures.disk_view import View
from faultgouge.figures.mode import ModeShape, draw_modes


@pytest.fixture(scope="module")
def packing(reference_packing) -> Packing:
    """The reference packing, with slips at a thousandth of their limit."""
    bare = replace(reference_packing(1.0), fx=0.01)
    slip = 1e-3 * bare.law.slip_limit(bare.geometry.overlap)
    return replace(bare, contacts=Contacts(bare.contacts.i, bare.contacts.j, slip))


def find_labelled(figure, kind, label):
    (found,) = [artist for artist in figure.axes[0].findobj(kind) if artist.get_label() == label]
    return found


def test_disks_that_the_box_cuts_are_there_twice_and_rattlers_are_hollow(packing):
    disks = find_labelled(draw_packing(packing), EllipseCollection, "disks")
    x = packing.position[:, 0] % packing.box_length
    copies = 1 + ((x < packing.radius) | (x > packing.box_length - packing.radius))
    assert len(disks.get_offsets()) == copies.sum() > len(packing)
    assert disks.get_facecolor().tolist().count(list(to_rgba("white"))) == copies[packing.rattlers].sum()
    alone = replace(packing, box_length=None, contacts=touching(packing.position, packing.radius))
    given, other = Figure().subplots(1, 2)
    drawn = find_labelled(draw_packing(alone, given), EllipseCollection, "disks")
    assert not other.collections
    np.testing.assert_array_equal(drawn.get_offsets(), packing.position)


def test_bars_are_as_wide_as_their_force(packing):
    chains = find_labelled(draw_packing(packing), LineCollection, "contacts")
    widths = np.array(chains.get_linewidths())
    ends = np.array(chains.get_segments())
    # The widest bar, the one of the largest force, joins two centres at that contact's distance.
    strongest = np.argmax(packing.normal_force)
    length = np.linalg.norm(ends[np.argmax(widths), 1] - ends[np.argmax(widths), 0])
    assert length == pytest.approx(packing.geometry.distance[strongest], rel=1e-12)  # rounding of the ends
    forces = packing.normal_force / packing.normal_force.max()
    assert widths.min() / widths.max() == pytest.approx(forces.min(), rel=1e-12)


def test_a_sheared_box_is_full_of_images(packing):
    """Of disks in a box that is periodic along both edges, every place of the picture repeats along the edges."""
    snapshot = packing.configuration
    low, high = packing.position.min(axis=0), packing.position.max(axis=0)
    box = np.array([[packing.box_length, 0, 0], [3.0, high[1] - low[1] + 1, 0], [0, 0, 1]])
    none, periodic = snapshot.contacts.chosen(np.zeros(0, int)), np.array([True, True, False])
    sheared = derive_frozen(snapshot, box=box, periodic=periodic, contacts=none)
    view = View.of(sheared)
    corners = np.array([[0, 0], box[0, :2], box[1, :2], box[0, :2] + box[1, :2]])
    np.testing.assert_array_equal([view.low, view.high], [corners.min(axis=0), corners.max(axis=0)])
    within = (view.place > view.low).all(axis=1) & (view.place < view.high).all(axis=1)
    for edge in box[:2, :2]:
        shifted = view.place[within] + edge
        inside = (shifted > view.low).all(axis=1) & (shifted < view.high).all(axis=1)
        distance = np.linalg.norm(shifted[inside][:, None] - view.place[None], axis=2).min(axis=1, initial=np.inf)
        assert distance == pytest.approx(0, abs=1e-12)
    assert len(view.edges) == 4


def test_what_colour_shows(packing):
    mobilised = np.abs(packing.tangential_force) / (packing.law.mu * packing.normal_force)
    for color, shown in (("slip", 1e-3), ("mobilised", mobilised), ("force", packing.normal_force)):
        chains = find_labelled(draw_packing(packing, color=color), LineCollection, "contacts")
        np.testing.assert_allclose(np.unique(chains.get_array()), np.unique(shown), rtol=1e-12)  # roundings
    with pytest.raises(ValueError, match="none of mobilised, slip, force, none"):
        draw_packing(packing, color="temperature")
    near = touching(packing.position, packing.radius, packing.box_length)  # no slips, no scale
    for change in ({"law": MindlinLaw(2e5, 0.0, 0.0)}, {"contacts": near}, {"contacts": Contacts([], [], [])}):
        figure = draw_packing(replace(packing, **change))
        assert len(figure.axes) == 1
        assert find_labelled(figure, LineCollection, "contacts").get_array() is None


@pytest.mark.parametrize("fx", [0.01, -0.01])
def test_no_arrow_of_the_weight_runs_through_the_shear_force_and_its_name(packing, fx):
    """Whatever the place of the highest disk of the layer."""
    assert not draw_packing(replace(packing, fx=0.0, fy=0.0)).findobj(Quiver)
    for place in (0.3, 0.5, 0.7):
        position = packing.position.copy()
        position[np.flatnonzero(packing.top)[-1]] = place * packing.box_length, position[:, 1].max() + 1
        figure = draw_packing(replace(packing, position=position, fx=fx))
        down, along = figure.findobj(Quiver)
        assert len(down.V) == packing.top.sum()
        assert np.all(down.V < 0)
        texts = {text.get_text(): text.get_position() for text in figure.axes[0].texts}
        assert along.Y[0] == texts["$F_x$"][1] > down.Y.max()
        assert np.sign(along.U[0]) == np.sign(along.X[0] - texts["$F_x$"][0]) == np.sign(fx)
        name, reach = texts["$F_y$"], sorted([along.X[0] - np.sign(fx) * 0.8, along.X[0] + along.U[0]])
        assert not reach[0] < name[0] < reach[1]


def test_saved_twice_gives_the_same_bytes_and_no_settings_leak_out(tmp_path, pyramid):
    before = dict(matplotlib.rcParams)
    first, second = (save(draw_packing(pyramid), tmp_path / name) for name in ("packing.mu1.0", "again"))
    assert [path.name for path in first] == ["packing.mu1.0.png", "packing.mu1.0.svg"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert dict(matplotlib.rcParams) == before


@pytest.fixture(scope="module")
def pyramid() -> Packing:
    """Two disks on the floor and one on top, with slips, so that K is not symmetric."""
    position, radius = np.array([[3.49, 0.4992], [4.51, 0.4992], [4.0, 1.3586]]), np.full(3, 0.5)
    law = MindlinLaw(2e5, 2e5 * 2 / 7, 1.0)
    contacts, load = touching(position, radius), {"fx": 0.1, "fy": 1.0, "top": [False, False, True]}
    bare = Packing(position=position, radius=radius, contacts=contacts, law=law, **load)
    slip = 0.5 * law.slip_limit(bare.geometry.overlap) * np.array([1, -1, 0.3, -0.2])
    return replace(bare, contacts=Contacts(contacts.i, contacts.j, slip))


def test_normal_modes_are_those_of_the_spectrum_and_the_closest_have_the_largest_cosine(pyramid):
    modes = normal_modes(pyramid)
    np.testing.assert_array_equal(modes.values.real, spectrum(pyramid).eigenvalues.real)
    first, second, cosine = closest_to_meeting(modes)
    cosines = np.abs(np.triu(modes.right.real.T @ modes.right.real, 1))
    assert cosine == pytest.approx(cosines.max(), rel=1e-12) == cosines[first, second]


@pytest.mark.parametrize("along_y", [1.0, 4e-4])
def test_a_complex_mode_is_drawn_at_two_moments_with_arrows_and_the_colour_of_rotation(pyramid, along_y):
    """Next to an onset a mode is nearly real: what hardly moves a quarter of a period later is magnified."""
    moved = np.zeros((3, 3), dtype=complex)
    moved[0, 2], moved[1, 2], moved[2] = 1.0, 1j * along_y, [2.0, -1.0, 0.0]
    figure = draw_modes(pyramid, [ModeShape(4, 10 + 2j, moved, 0.3, 0.1)], "a pair")
    first, second = (axes.findobj(Quiver)[0] for axes in figure.axes[:2])
    at_top = np.argmax(np.abs(first.U))
    assert first.U[at_top] > 0 == first.V[at_top]
    # a quarter of a period later exp(i pi/2) has turned x into -y
    assert second.U[at_top] == pytest.approx(0, abs=1e-15 / along_y)  # rounding is magnified, too
    assert second.V[at_top] == pytest.approx(-(1.0 if along_y == 1 else 0.8) * first.U[at_top], rel=1e-12)
    (disks,) = figure.axes[0].findobj(EllipseCollection)
    np.testing.assert_allclose(disks.get_array(), [1.0, -0.5, 0.0])
    says = "on the scale of the left picture" if along_y == 1 else "arrows and colours times 2000"
    assert says in figure.axes[1].get_title()


def test_most_arrows_of_a_mode_are_as_long_as_a_radius(pyramid):
    """Whatever the farthest disk does, up to a bound."""
    for far in (1.0, 0.1):
        moved = np.zeros((3, 3), dtype=complex)
        moved[0] = [far, far, 1.0]
        (arrows,) = draw_modes(pyramid, [ModeShape(4, 10.0, moved, 0.3, 0.1)], "a mode").axes[0].findobj(Quiver)
        lengths = np.hypot(arrows.U, arrows.V) / pyramid.radius.mean()
        assert lengths.max() <= 4.0 + 1e-12
        assert np.quantile(lengths, 0.75) > 1.0
