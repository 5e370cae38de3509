"""What is exported is read by the programs that it is for, and comes back to the bit: packings, and films of frames.

A trajectory in run.h5 is H5MD: MDAnalysis steps through it, and its analyses agree with ours.
"""

import re
from base64 import b64decode
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from packing_snapshot import snapshot_of
from reference_layer import LAYER, toml

from faultgouge import load
from faultgouge.analysis import Contacts, MindlinLaw, PackingFileError, RunFile, nearest_image, normal_modes
from faultgouge.analysis.files.configuration_file import write_configuration
from faultgouge.analysis.files.formats import (
    ModeVectors,
    choose_frames,
    frames_of,
    packing_of,
    read_disks,
    upper_layer,
    write_frames,
    write_packing,
)
from faultgouge.analysis.files.formats.tables import read_slips

FILMS = pytest.mark.parametrize("suffix", [".xyz", ".gsd"], indirect=True)
READERS = "needs a large library that is no dependency: make readers"

PUSHED = {"fx": 1e-3, "time": 0.1, "amplitude": 1.0, "omega": 5.0}
SCENE = LAYER + toml({"ramp": {"step": 1e-3, "until": 2e-3}, "perturb": PUSHED, "output": {"trajectory": True}})


@pytest.fixture
def configuration(sheared):
    return snapshot_of(sheared)


@pytest.fixture
def mdanalysis():
    """MDAnalysis, in which parser and reader of run.h5 are registered."""
    import_module("faultgouge.analysis.files.mdanalysis")
    return import_module("MDAnalysis")


def back(disks):
    """The packing as the file has it, with the law and the load of its numbers."""
    law = dict(disks.given)
    given = {name: law.pop(name) for name in ("fx", "fy", "inertia_factor")}
    drag_time = law.pop("tau", None)
    return packing_of(disks, MindlinLaw(**law), upper_layer(disks, None), **given, drag_time=drag_time)


@pytest.mark.parametrize("kind", range(7))
def test_an_export_comes_back_to_the_bit(tmp_path, sheared, suffix, kind):
    """As it is, with open sides, compensated, under laws of other histories, without contacts, in a far image."""
    packing, c = sheared, sheared.contacts
    inside = c.floor | (np.abs(packing.position[c.i, 0] - packing.position[c.j, 0]) < 5)
    changed = (
        {},
        {"box_length": None, "contacts": Contacts(c.i[inside], c.j[inside], c.slip[inside])},
        {"position_low": packing.position * 1e-17, "contacts": c.slipped(c.slip, 1e-18 * c.i)},
        {"law": replace(packing.law, rescaled=True)},
        {"law": replace(packing.law, coulomb=True)},
        {"contacts": Contacts([], [], [])},
        {"position": packing.position + np.array([3 * packing.box_length, 0.0])},
    )
    packing = replace(packing, **changed[kind])
    write_packing(tmp_path / f"packing{suffix}", packing)
    assert back(read_disks(tmp_path / f"packing{suffix}")) == packing


def film(path, suffix, says="all"):
    """Frames of a run.h5 as a file beside it."""
    target = path.with_name(f"frames{suffix}")
    with RunFile(path) as run:
        write_frames(target, frames_of(run, choose_frames(run, says)))
    return target


@FILMS
@pytest.mark.slow
def test_each_equilibrium_of_a_ramp_comes_back_to_the_bit(faultgouge_here, tmp_path, ramp, equilibria, suffix):
    done = faultgouge_here("export", ramp, "--frames", "all", "-o", f"film{suffix}")
    assert f"2 frames of equilibria; written to film{suffix}" in done.stdout
    assert [back(read_disks(tmp_path / f"film{suffix}", k)) for k in range(2)] == list(equilibria)
    faultgouge_here("import", f"film{suffix}", "-o", "back.h5")
    assert load(tmp_path / "back.h5") == equilibria[1]
    times = re.findall('timestep="(.*?)" .*?file="frames/(.*?)"', film(ramp, ".pvd").read_text())
    assert times == [("0.0", "00000.vtp"), (repr(equilibria[1].fx), "00001.vtp")]


@pytest.fixture
def motion(ramp, sheared):
    """The ramp with three samples of an undamped run behind it; and the places of the disks in its four frames."""
    rng = np.random.default_rng(2)
    moved = sheared.position + 1e-4 * rng.normal(size=(3, *sheared.position.shape))
    with RunFile(ramp, "a") as file:
        file.append_trajectory([0.5, 1.0, 1.5], moved)
    return ramp, np.insert(moved, 0, sheared.position, axis=0)


@FILMS
def test_an_undamped_run_has_positions_and_no_slips(motion, suffix):
    path, places = motion
    target = film(path, suffix)
    for number, place in enumerate(places):
        disks = read_disks(target, number)
        np.testing.assert_array_equal(disks.position, place)
        assert disks.slips is None
    some = read_disks(film(path, suffix, "1:4:2"), 1)
    np.testing.assert_array_equal(some.position, places[3])


def test_pyvista_reads_disks_contacts_and_modes_and_steps_through_a_pvd(tmp_path, sheared, motion):
    pyvista = pytest.importorskip("pyvista", reason=READERS)
    modes, n = normal_modes(sheared), len(sheared)
    vectors = modes.right[:, 3].reshape(3, -1) * (1 + 0.5j)
    write_packing(tmp_path / "packing.vtp", sheared, [ModeVectors("mode_3", complex(modes.values[3]), vectors)])
    mesh = pyvista.read(tmp_path / "packing.vtp")
    assert (mesh.n_verts, mesh.n_lines) == (n, len(sheared.contacts))
    np.testing.assert_array_equal(mesh.points[:n, :2], sheared.position)
    np.testing.assert_array_equal(mesh["contact_slip"][n:], sheared.contacts.slip)
    np.testing.assert_array_equal(mesh["mode_3"][:n, :2], vectors.real[:2].T)
    np.testing.assert_array_equal(mesh["mode_3_imag_rotation"][:n], vectors.imag[2])
    # forces of the contacts and the load make the net forces
    total = np.where(sheared.top[:, None], [sheared.fx, -sheared.fy], 0.0)
    force, pair = mesh["contact_force"][n:, :2], ~sheared.contacts.floor
    np.add.at(total, sheared.contacts.i, force)
    np.subtract.at(total, sheared.contacts.j[pair], force[pair])
    np.testing.assert_allclose(total, mesh["net_force"][:n, :2], rtol=0, atol=1e-12)
    path, places = motion
    reader = pyvista.get_reader(film(path, ".pvd"))
    assert list(reader.time_values) == [0.0, 0.5, 1.0, 1.5]
    for number, place in enumerate(places):
        reader.set_active_time_point(number)
        (mesh,) = reader.read()
        np.testing.assert_array_equal(mesh.points[:n, :2], place)
        np.testing.assert_array_equal(
            mesh["displacement"][:n, :2], nearest_image(place - places[0], sheared.box_length)
        )
        assert ("contact_normal_force" in mesh.array_names, "contact_slip" in mesh.array_names) == (True, False)


def assert_same_places(found, place, box_length, atol):
    """The same in the plane, whatever the image in the periodic box."""
    np.testing.assert_allclose(nearest_image(np.array(found)[:, :2] - place, box_length), 0, rtol=0, atol=atol)


@FILMS
def test_ovito_steps_through_it(ramp, equilibria, suffix):
    ovito = pytest.importorskip("ovito.io", reason=READERS)
    pipeline = ovito.import_file(str(film(ramp, suffix)))
    assert pipeline.source.num_frames == 2
    for number, packing in enumerate(equilibria):
        data = pipeline.compute(number)
        atol = 1e-6 if suffix == ".gsd" else 1e-14  # float32
        assert_same_places(data.particles["Position"], packing.position, packing.box_length, atol)
        np.testing.assert_allclose(data.particles["Radius"], packing.radius, rtol=1e-7)
        if suffix == ".xyz":
            # its reader of text is a last bit off
            force = packing.net_force.reshape(3, -1)[:2].T
            np.testing.assert_allclose(np.array(data.particles["Force"])[:, :2], force, rtol=1e-14)
            assert tuple(data.cell.pbc) == (True, False, False)


@FILMS
def test_mdanalysis_and_gsd_read_it(tmp_path, sheared, suffix, mdanalysis):
    path = str(tmp_path / f"packing{suffix}")
    write_packing(Path(path), sheared)
    assert_same_places(mdanalysis.Universe(path).atoms.positions, sheared.position, sheared.box_length, 2e-6)  # float32
    if suffix == ".gsd":
        with import_module("gsd.hoomd").open(path) as file:
            frame, particles = file[0], file[0].particles
        turned = 2 * np.arctan2(particles.orientation[:, 3], particles.orientation[:, 0])
        assert frame.configuration.dimensions == 2
        np.testing.assert_array_equal(particles.diameter, np.float32(2 * sheared.radius))
        np.testing.assert_allclose(np.sin(turned - sheared.angle), 0, rtol=0, atol=1e-6)  # float32
        np.testing.assert_array_equal(frame.log["particles/net_force"][:, :2], sheared.net_force.reshape(3, -1)[:2].T)


def test_lines_of_a_vtp_go_from_disk_to_disk_and_to_the_floor(tmp_path, sheared):
    write_packing(tmp_path / "a.vtp", sheared)
    text = ElementTree.parse(tmp_path / "a.vtp").find(".//Points/DataArray").text
    points = np.frombuffer(b64decode(text)[8:]).reshape(-1, 3)[:, :2]
    contacts, (first, second) = sheared.contacts, points[len(sheared) :].reshape(-1, 2, 2).swapaxes(0, 1)
    np.testing.assert_array_equal(points[: len(sheared)], sheared.position)
    np.testing.assert_array_equal(first, sheared.position[contacts.i])
    foot = first * (1.0, 0.0)
    expected = np.where(contacts.floor[:, None], foot, sheared.position[contacts.j])
    np.testing.assert_allclose(nearest_image(second - expected, sheared.box_length), 0, rtol=0, atol=1e-14)


@pytest.fixture(scope="module", params=["double", pytest.param("compensated", marks=pytest.mark.long)])
def run(tmp_path_factory, faultgouge_here_in, request):
    """perturb.h5 of a strong push, with displacements that float32 still tells; its start, and all places of disks."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "scene.toml").write_text(f'precision = "{request.param}"\n' + SCENE)
    faultgouge_here_in(folder, "perturb", "scene.toml")
    with RunFile(folder / "perturb.h5") as file:
        start, moved = file.packing(), file.series("trajectory")["position"]
    return folder / "perturb.h5", start, np.insert(moved, 0, start.position, axis=0)


@pytest.mark.slow
def test_mdanalysis_steps_through_it_as_h5md_and_as_a_universe_with_radii_masses_and_layer(run, mdanalysis):
    path, packing, place = run
    bare, universe = mdanalysis.Universe.empty(len(packing), trajectory=True), mdanalysis.Universe(str(path))
    bare.load_new(str(path), format="H5MD", convert_units=False)
    np.testing.assert_array_equal(universe.atoms.radii, packing.radius)
    np.testing.assert_array_equal(universe.atoms.masses, packing.mass)
    for kind, members in (("top", packing.top), ("bed", ~packing.top)):
        np.testing.assert_array_equal(universe.select_atoms(f"type {kind}").indices, np.flatnonzero(members))
    with RunFile(path) as file:
        series = file.series("trajectory")
        assert len(file) == 1
        assert series["time"].tolist() == file.series("undamped")["time"].tolist()
    time = [0.0, *series["time"]]
    assert len(bare.trajectory) == len(universe.trajectory) == len(time) > 100
    for k, (frame, exact) in enumerate(zip(bare.trajectory, universe.trajectory, strict=True)):
        assert (frame.time, frame.data["fx"]) == (time[k], packing.fx)
        assert frame.dimensions[0] == np.float32(packing.box_length)
        np.testing.assert_array_equal(frame.positions[:, :2], place[k].astype(np.float32))
        assert exact.data["position"].dtype == np.float64
        np.testing.assert_array_equal(exact.data["position"][:, :2], place[k])
        if packing.compensated and k:
            np.testing.assert_array_equal(exact.data["position_low"], series["position_low"][k - 1])


def test_ase_reads_extended_xyz(tmp_path, ramp, configuration):
    """Places, species, box, forces and masses; of several frames each."""
    from ase.io import read

    with RunFile(ramp) as run:
        packing = run.packing()
        write_frames(tmp_path / "film.xyz", frames_of(run, range(2)))
    write_packing(tmp_path / "one.xyz", packing)
    write_packing(tmp_path / "lammps.xyz", configuration)
    one, film, other = (read(tmp_path / f"{name}.xyz", ":") for name in ("one", "film", "lammps"))
    assert [len(one), len(film), len(other)] == [1, 2, 1]
    for atoms in (one[0], film[1]):
        assert np.array_equal(atoms.positions[:, :2], packing.position)
        assert atoms.pbc.tolist() == [True, False, False]
        assert atoms.cell[0, 0] == packing.box_length
        assert np.array_equal(np.array(atoms.get_chemical_symbols()) == "U", packing.top)
        assert np.array_equal(atoms.arrays["radius"], packing.radius)
        assert np.array_equal(atoms.get_forces()[:, :2], packing.net_force.reshape(3, -1)[:2].T)
    assert np.array_equal(other[0].positions[:, : configuration.dimension], configuration.position)


LATER = "format 2 of faultgouge's files, and this version knows 1: a later version wrote it, so update faultgouge"


@pytest.mark.parametrize(
    ("module", "name"),
    [("formats.xyz", "a.xyz"), ("formats.lammps_data", "a.data"), ("formats.gsd_file", "a.gsd"),
     ("atomic_write", "run.h5"), ("atomic_write", "configuration.h5")],
)  # fmt: skip
def test_a_file_of_a_later_format_is_refused(tmp_path, sheared, configuration, monkeypatch, module, name):
    with monkeypatch.context() as version:
        version.setattr(f"faultgouge.analysis.files.{module}.FORMAT", 2)
        if name == "configuration.h5":
            write_configuration(tmp_path / name, configuration)
        elif name == "run.h5":
            RunFile.create(tmp_path / name, sheared).close()
        else:
            write_packing(tmp_path / name, sheared)
    with pytest.raises(PackingFileError, match=LATER):
        load(tmp_path / name)


def test_pandas_reads_a_table_of_contacts(tmp_path, sheared, configuration):
    """All digits; the forces of the rows make the net forces; and the slips come back with `import --contacts`."""
    import pandas

    for packing in (configuration, sheared):
        write_packing(tmp_path / "contacts.csv", packing)
        table, held = pandas.read_csv(tmp_path / "contacts.csv"), packing.configuration
        pandas.testing.assert_frame_equal(table[list(held.to_pandas())], held.to_pandas(), check_exact=True)
        total = held.load[:, 0].copy()
        force = table[["n_x", "n_y", "n_z"]].mul(table.f_n, axis=0).to_numpy()
        force += table[["f_t_x", "f_t_y", "f_t_z"]].to_numpy()
        np.add.at(total, table.id1 - 1, force)
        pair = table.id2 > 0
        np.subtract.at(total, table.id2[pair] - 1, force[pair])
        np.testing.assert_allclose(total, held.net_force[:, 0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(table.f_t, held.mobilised * held.contacts.friction, rtol=1e-12)
    assert np.array_equal(read_slips(tmp_path / "contacts.csv").slip, sheared.contacts.slip)


@pytest.mark.parametrize("suffix", [".gsd"], indirect=True)
def test_gsd_of_what_lammps_left(tmp_path, configuration, suffix):
    write_packing(tmp_path / f"a{suffix}", configuration)
    with import_module("gsd.hoomd").open(tmp_path / "a.gsd") as file:
        frame = file[0]
    box, middle = configuration.box, configuration.origin + 0.5 * configuration.box.sum(axis=0)
    moved = frame.particles.position + middle - np.pad(configuration.position, ((0, 0), (0, 1)))
    moved[:, 0] -= box[0, 0] * np.rint(moved[:, 0] / box[0, 0])  # whatever the image
    assert moved == pytest.approx(0, abs=1e-6)  # float32
    assert np.array_equal(frame.log["particles/net_force"], configuration.net_force[:, 0])
