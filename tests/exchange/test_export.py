"""What is exported is read by the programs that it is for, and comes back to the bit."""

import json
from dataclasses import replace

import numpy as np
import pytest
from suffixes import GSD

from faultgouge.analysis import Contacts, RunFile, normal_modes
from faultgouge.pywrap.exchange import ModeVectors, packing_of, read_disks, upper_layer, write_packing

FORMATS = (".xyz", ".data", GSD)


def back(path, packing):
    """The packing as the file has it, the law excepted, which the command makes of the file's numbers."""
    disks = read_disks(path)
    return disks, packing_of(
        disks,
        packing.law,
        upper_layer(disks, None),
        fx=disks.given["fx"],
        fy=disks.given["fy"],
        inertia_factor=disks.given["inertia_factor"],
        drag_time=disks.given.get("tau"),
    )


@pytest.mark.parametrize("kind", ["as it is", "open sides", "compensated", "rescaled", "no contacts", "far image"])
@pytest.mark.parametrize("suffix", FORMATS)
def test_an_export_comes_back_to_the_bit(tmp_path, sheared, suffix, kind):
    packing, c = sheared, sheared.contacts
    if kind == "open sides":
        inside = np.abs(np.diff(packing.position[np.column_stack([c.i, c.j])][..., 0])[:, 0]) < 5
        kept = inside | c.floor
        packing = replace(packing, box_length=None, contacts=Contacts(c.i[kept], c.j[kept], c.slip[kept]))
    elif kind == "compensated":
        low = 1e-18 * np.arange(len(c))
        packing = replace(packing, position_low=packing.position * 1e-17, contacts=c.slipped(c.slip, low))
    elif kind == "rescaled":
        packing = replace(packing, law=replace(packing.law, rescaled=True))
    elif kind == "no contacts":
        packing = replace(packing, contacts=Contacts([], [], []))
    elif kind == "far image":
        packing = replace(packing, position=packing.position + np.array([3 * packing.box_length, 0.0]))
    path = tmp_path / f"packing{suffix}"
    write_packing(path, packing)
    disks, found = back(path, packing)
    assert found == packing
    assert {name: disks.given[name] for name in ("kn", "kt", "mu")} == {
        name: getattr(packing.law, name) for name in ("kn", "kt", "mu")
    }
    assert disks.given.get("rescaled", 0.0) == packing.law.rescaled


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.slow
def test_the_commands_there_and_back(faultgouge_here, tmp_path, stored, sheared, suffix):
    faultgouge_here("export", stored, "-o", f"packing{suffix}")
    faultgouge_here("import", f"packing{suffix}", "-o", "back.h5")
    with RunFile(tmp_path / "back.h5") as file:
        assert file.complete
        assert file.packing() == sheared


def test_lammps_reads_its_data(lmp, tmp_path, sheared):
    write_packing(tmp_path / "packing.data", sheared)
    done = lmp(
        "units lj\ndimension 2\nboundary p f p\natom_style sphere\nread_data packing.data\n"
        "pair_style zero 1.5\npair_coeff * *\nrun 0\n"
        "write_dump all custom back.dump id type x y radius mass modify sort id format float %.17g\n"
    )
    assert done.returncode == 0, done.stdout
    rows = np.loadtxt((tmp_path / "back.dump").read_text().splitlines()[9:])
    np.testing.assert_array_equal(rows[:, 1], 1 + sheared.top)
    x = rows[:, 2] - sheared.position[:, 0]
    np.testing.assert_allclose(x - sheared.box_length * np.round(x / sheared.box_length), 0, atol=1e-14)  # wrapped
    np.testing.assert_array_equal(rows[:, 3], sheared.position[:, 1])
    np.testing.assert_array_equal(rows[:, 4], sheared.radius)
    np.testing.assert_allclose(rows[:, 5], sheared.mass, rtol=2.3e-16)  # a last bit: density times volume is rounded


def test_pyvista_reads_disks_contacts_and_modes(tmp_path, sheared):
    pyvista = pytest.importorskip("pyvista", reason="reading .vtp needs pyvista, which is no dependency")
    modes = normal_modes(sheared)
    vectors = modes.right[:, 3].reshape(3, -1) * (1 + 0.5j)
    write_packing(tmp_path / "packing.vtp", sheared, [ModeVectors("mode_3", complex(modes.values[3]), vectors)])
    mesh, n = pyvista.read(tmp_path / "packing.vtp"), len(sheared)
    assert (mesh.n_verts, mesh.n_lines) == (n, len(sheared.contacts))
    np.testing.assert_array_equal(mesh.points[:n, :2], sheared.position)
    np.testing.assert_array_equal(mesh["radius"], np.append(sheared.radius, np.zeros(2 * len(sheared.contacts))))
    np.testing.assert_array_equal(mesh["net_force"][:n, :2], sheared.net_force.reshape(3, -1)[:2].T)
    np.testing.assert_array_equal(mesh["contact_slip"][n:], sheared.contacts.slip)
    np.testing.assert_array_equal(mesh["contact_normal_force"][n:], sheared.normal_force)
    np.testing.assert_array_equal(mesh["mode_3"][:n, :2], vectors.real[:2].T)
    np.testing.assert_array_equal(mesh["mode_3_imag_rotation"][:n], vectors.imag[2])
    # forces of the contacts and the load make the net forces
    total = np.where(sheared.top[:, None], [sheared.fx, -sheared.fy], 0.0)
    force, pair = mesh["contact_force"][n:, :2], ~sheared.contacts.floor
    np.add.at(total, sheared.contacts.i, force)
    np.subtract.at(total, sheared.contacts.j[pair], force[pair])
    np.testing.assert_allclose(total, sheared.net_force.reshape(3, -1)[:2].T, atol=1e-12)
    # lines are as long as the branches, also across the periodic boundary
    ends = mesh.points[n:].reshape(-1, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), sheared.geometry.distance, atol=1e-14)
    assert np.isnan(mesh["contact_slip"][:n]).all()


@pytest.mark.parametrize("suffix", FORMATS)
def test_ovito_reads_it(tmp_path, sheared, suffix):
    ovito = pytest.importorskip("ovito.io", reason="needs ovito, a large library that is no dependency")
    write_packing(tmp_path / f"packing{suffix}", sheared)
    data = ovito.import_file(str(tmp_path / f"packing{suffix}")).compute()
    place = np.array(data.particles["Position"])[:, :2] - sheared.position
    place[:, 0] -= sheared.box_length * np.round(place[:, 0] / sheared.box_length)
    np.testing.assert_allclose(place, 0, atol=1e-6 if suffix == ".gsd" else 1e-14)
    np.testing.assert_allclose(data.particles["Radius"], sheared.radius, rtol=1e-7)
    if suffix == ".xyz":
        # its reader of text is a last bit off
        force = sheared.net_force.reshape(3, -1)[:2].T
        np.testing.assert_allclose(np.array(data.particles["Force"])[:, :2], force, rtol=1e-14)
        assert tuple(data.cell.pbc) == (True, False, False)


def test_mdanalysis_and_gsd_read_it(tmp_path, sheared):
    pytest.importorskip("gsd.hoomd", reason="needs the extra export: pip install 'faultgouge[export]'")
    library = pytest.importorskip("MDAnalysis", reason="needs the extra export: pip install 'faultgouge[export]'")
    import gsd.hoomd

    write_packing(tmp_path / "packing.gsd", sheared)
    write_packing(tmp_path / "packing.xyz", sheared)
    with gsd.hoomd.open(str(tmp_path / "packing.gsd")) as file:
        frame = file[0]
    assert frame.configuration.dimensions == 2
    np.testing.assert_array_equal(frame.particles.diameter, np.float32(2 * sheared.radius))
    np.testing.assert_array_equal(frame.log["particles/net_force"][:, :2], sheared.net_force.reshape(3, -1)[:2].T)
    for suffix in (".gsd", ".xyz"):
        atoms = library.Universe(str(tmp_path / f"packing{suffix}")).atoms
        apart = atoms.positions[:, 0] - sheared.position[:, 0]
        apart -= sheared.box_length * np.round(apart / sheared.box_length)
        np.testing.assert_allclose(apart, 0, atol=2e-6)  # float32


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("-o", "packing.pdb"), "exports are .vtp, .xyz, .data, .gsd"),
        (("-o", "packing.data", "--mode", "pair"), "has no room for modes"),
        (("--frame", "3"), "there is no frame 3"),
        (("-o", "nowhere/packing.vtp"), "cannot be written"),
    ],
)
def test_what_an_export_is_refused_for(refusal, stored, words, says):
    assert says in refusal("export", stored, *words, code=1 if "written" in says else 2)


def test_a_packing_json_goes_the_same_way(tmp_path, reference, sheared):
    (tmp_path / "packing.json").write_text(json.dumps(reference))
    disks = read_disks(tmp_path / "packing.json")
    np.testing.assert_array_equal(upper_layer(disks, None), sheared.top)
