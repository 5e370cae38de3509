"""What a figure contains: every disk and contact, the curves that it was given, and names on its axes."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import to_rgba
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


def labelled(axes, kind, label):
    (found,) = [artist for artist in axes.findobj(kind) if artist.get_label() == label]
    return found


def test_every_disk_is_drawn_and_again_where_the_box_cuts_it(packing):
    axes = draw_packing(packing).axes[0]
    assert axes.get_aspect() == 1.0  # disks are round
    disks = labelled(axes, EllipseCollection, "disks")
    x = packing.position[:, 0] % packing.box_length
    cut = np.count_nonzero((x < packing.radius) | (x > packing.box_length - packing.radius))
    assert cut > 0
    assert len(disks.get_offsets()) == len(packing) + cut


def test_without_a_period_nothing_is_drawn_twice(packing):
    contacts = touching(packing.position, packing.radius)
    disks = labelled(
        draw_packing(replace(packing, box_length=None, contacts=contacts)).axes[0], EllipseCollection, "disks"
    )
    assert len(disks.get_offsets()) == len(packing)


def test_upper_layer_is_yellow_and_rattlers_are_hollow(packing):
    figure = draw_packing(packing)
    faces = labelled(figure.axes[0], EllipseCollection, "disks").get_facecolor().tolist()
    # A disk that the box cuts is there twice.
    x = packing.position[:, 0] % packing.box_length
    copies = 1 + ((x < packing.radius) | (x > packing.box_length - packing.radius))
    assert faces.count(list(to_rgba("white"))) == copies[packing.rattlers].sum()
    loaded = packing.top.copy()
    loaded[packing.rattlers] = False
    assert faces.count(list(to_rgba(UPPER))) == copies[loaded].sum()
    names = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert names == ["upper layer", "rattler (no contact)"]


def test_bars_are_as_wide_as_their_force(packing):
    chains = labelled(draw_packing(packing).axes[0], LineCollection, "contacts")
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
            lambda packing: np.unique(np.abs(packing.tangential_force) / (packing.law.mu * packing.normal_force)),
        ),
        ("force", "normal force $f_n$", lambda packing: np.unique(packing.normal_force)),
    ],
)
def test_what_colour_shows(packing, color, label, values):
    figure = draw_packing(packing, color=color)
    chains = labelled(figure.axes[0], LineCollection, "contacts")
    np.testing.assert_allclose(np.unique(np.asarray(chains.get_array())), values(packing), rtol=1e-12)  # roundings
    assert [axes.get_ylabel() for axes in figure.axes] == ["", label]


def test_another_colour_is_refused(packing):
    with pytest.raises(ValueError, match="none of mobilised, slip, force, none"):
        draw_packing(packing, color="temperature")


def test_axes_that_are_given_are_drawn_into(packing):
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2)
    assert draw_packing(packing, right) is figure
    assert len(labelled(right, EllipseCollection, "disks").get_offsets()) >= len(packing)
    assert not left.collections
    plt.close(figure)


@pytest.mark.parametrize("change", [{"law": MindlinLaw(2e5, 0.0, 0.0)}, {"contacts": None}])
def test_without_slips_there_is_no_scale_of_colours(packing, change):
    if "contacts" in change:
        change = {"contacts": touching(packing.position, packing.radius, packing.box_length)}
    figure = draw_packing(replace(packing, **change))
    assert len(figure.axes) == 1
    assert labelled(figure.axes[0], LineCollection, "contacts").get_array() is None


def test_a_packing_without_contacts_is_drawn():
    none = np.array([], dtype=int)
    lonely = Packing(
        position=[[1.0, 2.0], [3.0, 2.0]],
        radius=[0.5, 0.5],
        contacts=Contacts(none, none, none),
        law=MindlinLaw(1.0, 0.3, 1.0),
    )
    axes = draw_packing(lonely).axes[0]
    assert len(labelled(axes, EllipseCollection, "disks").get_offsets()) == 2
    assert labelled(axes, PolyCollection, "floor") is not None
    assert not axes.findobj(Quiver)


def test_arrows_show_the_load_on_the_upper_layer(packing):
    axes = draw_packing(packing).axes[0]
    down, along = axes.findobj(Quiver)
    assert len(down.U) == packing.top.sum()
    assert len(along.U) == 1
    assert np.all(down.V < 0)
    assert np.all(along.U > 0)
    assert {"$F_x$", "$F_y$"} <= {text.get_text() for text in axes.texts}
    unsheared = draw_packing(replace(packing, fx=0.0)).axes[0]
    assert len(unsheared.findobj(Quiver)) == 1


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
