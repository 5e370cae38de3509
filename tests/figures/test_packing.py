"""A packing: every disk and contact where it is, the load, and what the colours of contacts show."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import to_rgba
from matplotlib.quiver import Quiver

from faultgouge.analysis import Contacts, MindlinLaw, Packing, touching
from faultgouge.figures import draw_packing, save


@pytest.fixture(scope="module")
def packing(reference_packing) -> Packing:
    """The reference packing, with slips at a thousandth of their limit."""
    bare = replace(reference_packing(1.0), fx=0.01)
    slip = 1e-3 * bare.law.slip_limit(bare.geometry.overlap)
    return replace(bare, contacts=Contacts(bare.contacts.i, bare.contacts.j, slip))


def labelled(figure, kind, label):
    (found,) = [artist for artist in figure.axes[0].findobj(kind) if artist.get_label() == label]
    return found


def test_disks_that_the_box_cuts_are_there_twice_and_rattlers_are_hollow(packing):
    disks = labelled(draw_packing(packing), EllipseCollection, "disks")
    x = packing.position[:, 0] % packing.box_length
    copies = 1 + ((x < packing.radius) | (x > packing.box_length - packing.radius))
    assert len(disks.get_offsets()) == copies.sum() > len(packing)
    assert disks.get_facecolor().tolist().count(list(to_rgba("white"))) == copies[packing.rattlers].sum()
    alone = replace(packing, box_length=None, contacts=touching(packing.position, packing.radius))
    drawn = labelled(draw_packing(alone), EllipseCollection, "disks")
    np.testing.assert_array_equal(drawn.get_offsets(), packing.position)


def test_bars_are_as_wide_as_their_force(packing):
    chains = labelled(draw_packing(packing), LineCollection, "contacts")
    widths = np.array(chains.get_linewidths())
    ends = np.array(chains.get_segments())
    assert len(widths) >= len(packing.contacts)
    # The widest bar, the one of the largest force, joins two centres at that contact's distance.
    strongest = np.argmax(packing.normal_force)
    length = np.linalg.norm(ends[np.argmax(widths), 1] - ends[np.argmax(widths), 0])
    assert length == pytest.approx(packing.geometry.distance[strongest], rel=1e-12)  # rounding of the ends
    forces = packing.normal_force / packing.normal_force.max()
    assert widths.min() / widths.max() == pytest.approx(forces.min(), rel=1e-12)


SHOWN = {
    "slip": lambda packing: 1e-3,
    "mobilised": lambda packing: np.abs(packing.tangential_force) / (packing.law.mu * packing.normal_force),
    "force": lambda packing: packing.normal_force,
}


@pytest.mark.parametrize("color", SHOWN)
def test_what_colour_shows(packing, color):
    chains = labelled(draw_packing(packing, color=color), LineCollection, "contacts")
    drawn = np.unique(np.asarray(chains.get_array()))
    np.testing.assert_allclose(drawn, np.unique(SHOWN[color](packing)), rtol=1e-12)  # roundings


def test_another_colour_is_refused(packing):
    with pytest.raises(ValueError, match="none of mobilised, slip, force, none"):
        draw_packing(packing, color="temperature")


@pytest.mark.parametrize("without", ["friction", "slips", "contacts"])
def test_without_slips_there_is_no_scale_of_colours(packing, without):
    change = {
        "friction": {"law": MindlinLaw(2e5, 0.0, 0.0)},
        "slips": {"contacts": touching(packing.position, packing.radius, packing.box_length)},
        "contacts": {"contacts": Contacts([], [], [])},
    }[without]
    figure = draw_packing(replace(packing, **change))
    assert len(figure.axes) == 1
    assert labelled(figure, LineCollection, "contacts").get_array() is None


def test_arrows_show_the_load_on_the_upper_layer(packing):
    down, along = draw_packing(packing).findobj(Quiver)
    assert len(down.U) == packing.top.sum()
    assert np.all(down.V < 0)
    (shear,) = along.U
    assert shear > 0
    assert not draw_packing(replace(packing, fx=0.0, fy=0.0)).findobj(Quiver)


@pytest.mark.slow
def test_saved_twice_gives_the_same_bytes_and_no_settings_leak_out(tmp_path, packing):
    before = dict(matplotlib.rcParams)
    first, second = (save(draw_packing(packing), tmp_path / name) for name in ("packing.mu1.0", "again"))
    assert [path.name for path in first] == ["packing.mu1.0.png", "packing.mu1.0.svg"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert dict(matplotlib.rcParams) == before
