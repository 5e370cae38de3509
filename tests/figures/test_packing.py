"""What a figure contains: every disk and contact, the curves that it was given, and names on its axes."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from faultgouge.analysis import Contacts, MindlinLaw, Packing, touching
from faultgouge.figures import draw_packing, save
from faultgouge.figures.style import UPPER


@pytest.fixture(scope="module")
def packing(reference_packing) -> Packing:
    """The reference packing, with slips at a thousandth of their limit."""
    bare = replace(reference_packing(1.0), fx=0.01)
    slip = 1e-3 * bare.law.slip_limit(bare.geometry.overlap)
    return replace(bare, contacts=Contacts(bare.contacts.i, bare.contacts.j, slip))


def labelled(figure, kind, label):
    (found,) = [artist for artist in figure.axes[0].findobj(kind) if artist.get_label() == label]
    return found


def test_disks_that_the_box_cuts_are_there_twice_the_upper_layer_is_yellow_and_rattlers_are_hollow(packing):
    figure = draw_packing(packing)
    assert figure.axes[0].get_aspect() == 1.0  # disks are round
    disks = labelled(figure, EllipseCollection, "disks")
    x = packing.position[:, 0] % packing.box_length
    copies = 1 + ((x < packing.radius) | (x > packing.box_length - packing.radius))
    assert len(disks.get_offsets()) == copies.sum() > len(packing)
    faces = disks.get_facecolor().tolist()
    assert faces.count(list(to_rgba("white"))) == copies[packing.rattlers].sum()
    loaded = packing.top.copy()
    loaded[packing.rattlers] = False
    assert faces.count(list(to_rgba(UPPER))) == copies[loaded].sum()
    names = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert names == ["upper layer", "rattler (no contact)"]
    alone = replace(packing, box_length=None, contacts=touching(packing.position, packing.radius))
    assert len(labelled(draw_packing(alone), EllipseCollection, "disks").get_offsets()) == len(packing)


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


@pytest.mark.parametrize(
    ("color", "label", "values"),
    [
        ("slip", "slip / slip limit", lambda packing: 1e-3),
        (
            "mobilised",
            r"mobilised friction $|f_t|/(\mu f_n)$",
            lambda packing: np.abs(packing.tangential_force) / (packing.law.mu * packing.normal_force),
        ),
        ("force", "normal force $f_n$", lambda packing: packing.normal_force),
    ],
)
def test_what_colour_shows(packing, color, label, values):
    figure = draw_packing(packing, color=color)
    chains = labelled(figure, LineCollection, "contacts")
    drawn = np.unique(np.asarray(chains.get_array()))
    np.testing.assert_allclose(drawn, np.unique(values(packing)), rtol=1e-12)  # roundings
    assert [axes.get_ylabel() for axes in figure.axes] == ["", label]


def test_another_colour_is_refused(packing):
    with pytest.raises(ValueError, match="none of mobilised, slip, force, none"):
        draw_packing(packing, color="temperature")


def test_axes_that_are_given_are_drawn_into(packing):
    figure = Figure()
    given, other = figure.subplots(1, 2)
    assert draw_packing(packing, given) is figure
    assert len(labelled(figure, EllipseCollection, "disks").get_offsets()) >= len(packing)
    assert not other.collections


@pytest.mark.parametrize("without", ["friction", "slips"])
def test_without_slips_there_is_no_scale_of_colours(packing, without):
    law, contacts = MindlinLaw(2e5, 0.0, 0.0), touching(packing.position, packing.radius, packing.box_length)
    figure = draw_packing(replace(packing, **({"law": law} if without == "friction" else {"contacts": contacts})))
    assert len(figure.axes) == 1
    assert labelled(figure, LineCollection, "contacts").get_array() is None


def test_a_packing_without_contacts_is_drawn():
    none = np.array([], dtype=int)
    lonely = Packing(
        position=[[1.0, 2.0], [3.0, 2.0]],
        radius=[0.5, 0.5],
        contacts=Contacts(none, none, none),
        law=MindlinLaw(1.0, 0.3, 1.0),
    )
    figure = draw_packing(lonely)
    assert len(labelled(figure, EllipseCollection, "disks").get_offsets()) == 2
    assert labelled(figure, PolyCollection, "floor") is not None
    assert not figure.findobj(Quiver)


def test_arrows_show_the_load_on_the_upper_layer(packing):
    axes = draw_packing(packing).axes[0]
    down, along = axes.findobj(Quiver)
    assert len(down.U) == packing.top.sum()
    assert np.all(down.V < 0)
    (shear,) = along.U
    assert shear > 0
    assert {"$F_x$", "$F_y$"} <= {text.get_text() for text in axes.texts}
    assert len(draw_packing(replace(packing, fx=0.0)).findobj(Quiver)) == 1


@pytest.mark.slow
def test_saved_twice_gives_the_same_bytes_and_no_settings_leak_out(tmp_path, packing):
    before = dict(matplotlib.rcParams)
    first = save(draw_packing(packing), tmp_path / "packing.mu1.0")
    second = save(draw_packing(packing), tmp_path / "again")
    assert [path.name for path in first] == ["packing.mu1.0.png", "packing.mu1.0.svg"]
    assert first[0].read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in first[1].read_bytes()
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert dict(matplotlib.rcParams) == before
