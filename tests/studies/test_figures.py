"""What a figure contains: every disk and contact, the curves that it was given, and names on its axes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PatchCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.quiver import Quiver

from faultgouge.analysis import Contacts, MindlinLaw, Packing, touching
from faultgouge.studies import figures
from faultgouge.studies.figures import (
    PairCurve,
    coalescence_figure,
    growth_figure,
    onset_curve_figure,
    packing_figure,
    save,
)

REFERENCE = Path(__file__).parents[1] / "reference" / "packing7.json"


@pytest.fixture(scope="module")
def packing() -> Packing:
    """The reference packing, with slips at a thousandth of their limit."""
    stored = json.loads(REFERENCE.read_text())
    radius = np.array(stored["radius"])
    top = np.isin(np.arange(len(radius)), stored["top"])
    position = np.column_stack([stored["x"], stored["y"]])
    contacts = touching(position, radius, stored["box_length"])
    law = MindlinLaw(stored["kn"], stored["kt"], 1.0)
    frictionless = Packing(
        position=position,
        radius=radius,
        contacts=contacts,
        law=law,
        box_length=stored["box_length"],
        top=top,
        fx=0.01,
        fy=3.0,
    )
    slip = 1e-3 * law.slip_limit(frictionless.geometry.overlap)
    return replace(frictionless, contacts=Contacts(contacts.i, contacts.j, slip))


@pytest.fixture
def curves() -> list[PairCurve]:
    """The normal form: eigenvalues 1 -+ sqrt(fx_c - fx)."""
    made = []
    for mu, fx_c in ((1.0, 0.02), (0.8, 0.015)):
        fx = np.linspace(0, 0.03, 61)
        root = np.sqrt(fx_c - fx + 0j)
        made.append(PairCurve(mu, fx, np.column_stack([1 - root, 1 + root]), fx_c))
    return made


def labelled(axes, kind, label):
    (found,) = [artist for artist in axes.findobj(kind) if artist.get_label() == label]
    return found


def test_every_disk_is_drawn_and_again_where_the_box_cuts_it(packing):
    disks = labelled(packing_figure(packing).axes[0], PatchCollection, "disks")
    x = packing.position[:, 0] % packing.box_length
    cut = np.count_nonzero((x < packing.radius) | (x > packing.box_length - packing.radius))
    assert cut > 0
    assert len(disks.get_paths()) == len(packing) + cut


def test_without_a_period_nothing_is_drawn_twice(packing):
    contacts = touching(packing.position, packing.radius)
    disks = labelled(
        packing_figure(replace(packing, box_length=None, contacts=contacts)).axes[0], PatchCollection, "disks"
    )
    assert len(disks.get_paths()) == len(packing)


def test_upper_layer_is_yellow_and_rattlers_are_hollow(packing):
    axes = packing_figure(packing).axes[0]
    faces = labelled(axes, PatchCollection, "disks").get_facecolor().tolist()
    # A disk that the box cuts is there twice.
    x = packing.position[:, 0] % packing.box_length
    copies = 1 + ((x < packing.radius) | (x > packing.box_length - packing.radius))
    assert faces.count(list(to_rgba("white"))) == copies[packing.rattlers].sum()
    loaded = packing.top.copy()
    loaded[packing.rattlers] = False
    assert faces.count(list(to_rgba(figures.UPPER))) == copies[loaded].sum()


def test_bars_are_as_wide_as_their_force(packing):
    chains = labelled(packing_figure(packing).axes[0], LineCollection, "contacts")
    widths = np.array(chains.get_linewidths())
    ends = np.array(chains.get_segments())
    assert len(widths) >= len(packing.contacts)
    # The widest bar, the one of the largest force, joins two centres at that contact's distance.
    strongest = np.argmax(packing.normal_force)
    length = np.linalg.norm(ends[np.argmax(widths), 1] - ends[np.argmax(widths), 0])
    assert length == pytest.approx(packing.geometry.distance[strongest], rel=1e-12)  # rounding of the ends
    forces = packing.normal_force / packing.normal_force.max()
    assert widths.min() / widths.max() == pytest.approx(forces.min(), rel=1e-12)


def test_colour_is_the_share_of_the_slip_limit(packing):
    figure = packing_figure(packing)
    chains = labelled(figure.axes[0], LineCollection, "contacts")
    assert np.asarray(chains.get_array()) == pytest.approx(1e-3, rel=1e-12)  # two roundings of the fixture
    assert [axes.get_ylabel() for axes in figure.axes] == ["", "$|s|/t^*$"]


@pytest.mark.parametrize("change", [{"law": MindlinLaw(2e5, 0.0, 0.0)}, {"contacts": None}])
def test_without_slips_there_is_no_scale_of_colours(packing, change):
    if "contacts" in change:
        change = {"contacts": touching(packing.position, packing.radius, packing.box_length)}
    figure = packing_figure(replace(packing, **change))
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
    axes = packing_figure(lonely).axes[0]
    assert len(labelled(axes, PatchCollection, "disks").get_paths()) == 2
    assert labelled(axes, PolyCollection, "floor") is not None
    assert not axes.findobj(Quiver)


def test_arrows_show_the_load_on_the_upper_layer(packing):
    axes = packing_figure(packing).axes[0]
    down, along = axes.findobj(Quiver)
    assert len(down.U) == packing.top.sum()
    assert len(along.U) == 1
    assert np.all(down.V < 0)
    assert np.all(along.U > 0)
    assert {"$F_x$", "$F_y$"} <= {text.get_text() for text in axes.texts}
    unsheared = packing_figure(replace(packing, fx=0.0)).axes[0]
    assert len(unsheared.findobj(Quiver)) == 1


def test_disks_are_round(packing):
    assert packing_figure(packing).axes[0].get_aspect() == 1.0


def test_coalescence_shows_both_members_of_every_pair(curves):
    real, imaginary = coalescence_figure(curves).axes[:2]
    assert (real.get_ylabel(), imaginary.get_ylabel()) == (
        r"$\mathrm{Re}\,\lambda$",
        r"$\mathrm{Im}\,\lambda$",
    )
    assert imaginary.get_xlabel() == "$F_x$"
    drawn = [line for line in real.lines if len(line.get_xdata()) == len(curves[0].fx)]
    assert len(drawn) == 4
    assert np.array_equal(drawn[0].get_ydata(), np.sort(curves[0].eigenvalues.real, axis=1)[:, 0])
    assert drawn[0].get_color() == drawn[1].get_color() != drawn[2].get_color()
    assert {r"$\mu = 1$", r"$\mu = 0.8$"} <= {text.get_text() for text in real.texts}


def test_the_inset_magnifies_the_first_onset(curves):
    (inset,) = coalescence_figure(curves).axes[1].child_axes
    left, right = inset.get_xlim()
    assert left < 0.02 < right
    assert right - left < 0.2 * 0.03
    assert [label.get_text() for label in inset.get_xticklabels()] == ["$F_x^c = 0.02$"]


def test_without_an_onset_there_is_no_inset(curves):
    stable = replace(curves[0], fx_c=None)
    assert coalescence_figure([stable]).axes[1].child_axes == []


def test_growth_draws_the_predicted_slope_beside_the_data():
    time = np.linspace(0, 100, 501)
    msd = 1e-25 * (1 + np.exp(0.4 * time))
    msd[0] = 0.0
    axes = growth_figure(time, msd, window=(20.0, 90.0), predicted_rate=0.4, measured_rate=0.402).axes[0]
    data, predicted = axes.lines
    assert (axes.get_yscale(), axes.get_xlabel(), axes.get_ylabel()) == ("log", "$t$", "$D(t)$")
    assert len(data.get_xdata()) == 500
    (t0, t1), (d0, d1) = predicted.get_data()
    assert (t0, t1) == (20.0, 90.0)
    assert np.log(d1 / d0) / (t1 - t0) == pytest.approx(0.4, rel=1e-12)  # rounding of exp and log
    # A decade and a half above; where the floor still adds 3e-4 of D to the first point of the window.
    assert d0 / msd[100] == pytest.approx(10**1.5, rel=1e-3)
    texts = " ".join(text.get_text() for text in axes.texts)
    assert "= 0.4$" in texts
    assert "= 0.402$" in texts
    assert "+0.5" in texts


def test_onset_curve_is_drawn_in_order_of_mu():
    axes = onset_curve_figure([1.0, 0.5, 0.8], [0.02, 0.01, 0.015], [1e-3, 2e-3, 1e-3]).axes[0]
    assert axes.lines[0].get_xydata().tolist() == [[0.5, 0.01], [0.8, 0.015], [1.0, 0.02]]
    (bars,) = axes.findobj(LineCollection)
    heights = [segment[1, 1] - segment[0, 1] for segment in bars.get_segments()]
    assert heights == pytest.approx([4e-3, 2e-3, 2e-3], rel=1e-12)  # differences of sums, one rounding each
    assert (axes.get_xlabel(), axes.get_ylabel()) == (r"$\mu$", "$F_x^c$")


def test_saved_twice_gives_the_same_bytes(tmp_path, packing):
    first = save(packing_figure(packing), tmp_path / "packing.mu1.0")
    second = save(packing_figure(packing), tmp_path / "again")
    assert [path.name for path in first] == ["packing.mu1.0.png", "packing.mu1.0.svg"]
    assert first[0].read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in first[1].read_bytes()
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_no_settings_leak_out(packing):
    import matplotlib

    before = dict(matplotlib.rcParams)
    packing_figure(packing)
    assert dict(matplotlib.rcParams) == before
