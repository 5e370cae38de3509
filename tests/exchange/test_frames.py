"""All frames of a ramp and of an undamped run, as OVITO, ParaView and HOOMD's readers see them."""

from dataclasses import replace

import numpy as np
import pytest
from suffixes import GSD

from faultgouge.analysis import RunFile, nearest_image
from faultgouge.pywrap.exchange import chosen_frames, frames_of, packing_of, read_disks, upper_layer, write_frames

SUFFIXES = (".xyz", GSD)


@pytest.fixture
def ramp(tmp_path, sheared, reference_packing):
    """Two equilibria as a run.h5."""
    start = reference_packing(1.0)
    own = {"mass": sheared.mass, "inertia_factor": sheared.inertia_factor, "drag_time": sheared.drag_time}
    with RunFile.create(tmp_path / "run.h5", sheared) as file:
        file.append(replace(start, angle=sheared.angle, **own))
        file.append(sheared)
        file.complete = True
    return tmp_path / "run.h5"


@pytest.fixture
def motion(ramp, sheared):
    """The same, with three samples of an undamped run behind it."""
    rng = np.random.default_rng(2)
    moved = sheared.position + 1e-4 * rng.normal(size=(3, *sheared.position.shape))
    with RunFile(ramp, "a") as file:
        file.append_trajectory([0.5, 1.0, 1.5], moved)
    return ramp, np.insert(moved, 0, sheared.position, axis=0)


def written(path, suffix, says="all"):
    target = path.with_name(f"frames{suffix}")
    with RunFile(path) as run:
        write_frames(target, frames_of(run, chosen_frames(run, says)))
    return target


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_each_equilibrium_of_a_ramp_comes_back_to_the_bit(ramp, suffix):
    target = written(ramp, suffix)
    with RunFile(ramp) as run:
        for number in range(2):
            packing, disks = run.packing(number), read_disks(target, number)
            names = ("fx", "fy", "inertia_factor")
            given = {name: disks.given[name] for name in names} | {"drag_time": disks.given["tau"]}
            assert packing_of(disks, packing.law, upper_layer(disks, None), **given) == packing


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_undamped_run_has_positions_and_no_slips(motion, suffix, sheared):
    path, places = motion
    target = written(path, suffix)
    for number, place in enumerate(places):
        disks = read_disks(target, number)
        np.testing.assert_array_equal(disks.position, place)
        assert disks.slips is None
    some = read_disks(written(path, suffix, "1:4:2"), 1)
    np.testing.assert_array_equal(some.position, places[3])


def test_pyvista_steps_through_a_pvd(motion, sheared):
    pyvista = pytest.importorskip("pyvista", reason="reading .pvd needs pyvista: make readers")
    path, places = motion
    reader = pyvista.get_reader(written(path, ".pvd"))
    assert list(reader.time_values) == [0.0, 0.5, 1.0, 1.5]
    for number, place in enumerate(places):
        reader.set_active_time_point(number)
        (mesh,) = reader.read()
        n = len(sheared)
        np.testing.assert_array_equal(mesh.points[:n, :2], place)
        apart = nearest_image(place - places[0], sheared.box_length)
        np.testing.assert_array_equal(mesh["displacement"][:n, :2], apart)
        assert "contact_normal_force" in mesh.array_names
        assert "contact_slip" not in mesh.array_names


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_ovito_steps_through_it(motion, sheared, suffix):
    ovito = pytest.importorskip("ovito.io", reason="needs ovito, a large library: make readers")
    path, places = motion
    pipeline = ovito.import_file(str(written(path, suffix)))
    assert pipeline.source.num_frames == 4
    for number, place in enumerate(places):
        found = np.array(pipeline.compute(number).particles["Position"])[:, :2]
        apart = nearest_image(found - place, sheared.box_length)
        np.testing.assert_allclose(apart, 0, atol=2e-6 if suffix == ".gsd" else 1e-14)  # float32


@pytest.mark.slow
def test_the_command(faultgouge_here, refusal, tmp_path, ramp, sheared):
    done = faultgouge_here("export", ramp, "--frames", "all", "-o", "film.pvd")
    assert "2 frames of equilibria; written to film.pvd" in done.stderr
    assert sorted(path.name for path in (tmp_path / "film").iterdir()) == ["00000.vtp", "00001.vtp"]
    assert f'timestep="{sheared.fx!r}"' in (tmp_path / "film.pvd").read_text()
    for words, says in (
        (("--frames", "all", "-o", "film.vtp"), "several frames go into .xyz, .gsd, .pvd"),
        (("--frames", "3", "-o", "film.xyz"), "give all, START:STOP or START:STOP:STEP"),
        (("--frames", "5:9", "-o", "film.xyz"), "has 2 frames, and none of them is meant"),
        (("--frames", "all", "--mode", "pair", "-o", "film.xyz"), "without --frame and --mode"),
        (("-o", "film.pvd"), "add --frames all"),
    ):
        assert says in refusal("export", ramp, *words)
