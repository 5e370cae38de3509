"""A trajectory is H5MD: MDAnalysis steps through it, and its analyses agree with ours."""

import sys
from importlib import import_module
from importlib.metadata import version

import h5py
import numpy as np
import pytest
from reference_layer import LAYER, toml

from faultgouge.analysis import PackingFileError, RunFile
from faultgouge.pywrap import Scene, SceneError

PUSHED = {"fx": 1e-3, "time": 0.3, "amplitude": 1.0, "omega": 5.0}
SCENE = LAYER + toml({"ramp": {"step": 1e-3, "until": 2e-3}, "perturb": PUSHED, "output": {"trajectory": True}})


@pytest.fixture
def mdanalysis():
    return pytest.importorskip("MDAnalysis", reason="needs the extra export: pip install 'faultgouge[export]'")


@pytest.fixture
def ours(mdanalysis):
    """The module that registers parser and reader of run.h5."""
    return import_module("faultgouge.pywrap.exchange.mdanalysis")


@pytest.fixture(scope="module", params=["double", pytest.param("compensated", marks=pytest.mark.long)])
def run(tmp_path_factory, faultgouge_in, request):
    """perturb.h5 of a strong push, with displacements that float32 still tells; its start, and all places of disks."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "scene.toml").write_text(f'precision = "{request.param}"\n' + SCENE)
    faultgouge_in(folder, "perturb", "scene.toml")
    with RunFile(folder / "perturb.h5") as file:
        start, moved = file.packing(), file.series("trajectory")["position"]
    return folder / "perturb.h5", start, np.insert(moved, 0, start.position, axis=0)


@pytest.mark.slow
def test_mdanalysis_steps_through_it(run, mdanalysis):
    path, packing, place = run
    universe = mdanalysis.Universe.empty(len(packing), trajectory=True)
    universe.load_new(str(path), format="H5MD", convert_units=False)
    with RunFile(path) as file:
        assert len(file) == 1
        time = np.insert(file.series("trajectory")["time"], 0, 0.0)
        np.testing.assert_array_equal(time[1:], file.series("undamped")["time"])
        assert file.observable("fx").shape == (1,)
    assert len(universe.trajectory) == len(time) > 100
    for k, frame in enumerate(universe.trajectory):
        assert frame.time == time[k]
        assert frame.dimensions[0] == np.float32(packing.box_length)
        assert frame.data["fx"] == packing.fx
        np.testing.assert_array_equal(frame.positions[:, :2], place[k].astype(np.float32))


@pytest.mark.slow
def test_a_universe_of_the_file_has_radii_masses_and_layer(run, mdanalysis, ours):
    path, packing, place = run
    universe = mdanalysis.Universe(str(path))
    np.testing.assert_array_equal(universe.atoms.radii, packing.radius)
    np.testing.assert_array_equal(universe.atoms.masses, packing.mass)
    np.testing.assert_array_equal(universe.select_atoms("type top").indices, np.flatnonzero(packing.top))
    np.testing.assert_array_equal(universe.select_atoms("type bed").indices, np.flatnonzero(~packing.top))
    with RunFile(path) as file:
        low = file.series("trajectory").get("position_low")
    for k, frame in enumerate(universe.trajectory[:20]):
        assert frame.data["position"].dtype == np.float64
        np.testing.assert_array_equal(frame.data["position"][:, :2], place[k])
        if packing.compensated and k:
            np.testing.assert_array_equal(frame.data["position_low"], low[k - 1])


@pytest.mark.long
def test_d_of_t_in_mdanalysis_is_that_of_the_run(run, mdanalysis, ours):
    path, packing, _ = run
    universe = mdanalysis.Universe(str(path))
    everything = ours.MeanSquareDisplacement(universe.atoms).run()
    with RunFile(path) as file:
        sampled = file.series("undamped")
    np.testing.assert_array_equal(everything.times[1:], sampled["time"])
    # sums over the disks are rounded; LAMMPS's positions are those of the file to the bit
    np.testing.assert_allclose(everything.results.msd[1:], sampled["msd"], rtol=1e-13)
    layer = ours.MeanSquareDisplacement(universe.select_atoms("type top")).run()
    bed = ours.MeanSquareDisplacement(universe.select_atoms("type bed")).run()
    share = packing.top.mean()
    weighted = share * layer.results.msd + (1 - share) * bed.results.msd
    np.testing.assert_allclose(weighted, everything.results.msd, rtol=1e-13)


@pytest.mark.slow
def test_no_equilibrium_follows_a_trajectory(run):
    path, packing, _ = run
    with RunFile(path, "a") as file, pytest.raises(ValueError, match="no equilibrium can follow"):
        file.append(packing, floor=0.0, evaluations=0)
    with RunFile(path) as file, pytest.raises(PackingFileError, match="there is no frame 1"):
        file.packing(1)


def test_h5md_as_others_read_it(tmp_path, reference_packing):
    packing = reference_packing(1.0)
    with RunFile.create(tmp_path / "run.h5", packing) as file:
        file.append(packing)
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["observables/position"] == file["particles/disks/position"]  # one object, two names
        np.testing.assert_array_equal(file["particles/disks/mass"], packing.mass)
        assert file["h5md/creator"].attrs["version"] == version("faultgouge")


def test_a_file_without_the_link_is_read_and_continued(tmp_path, reference_packing):
    packing = reference_packing(1.0)
    with RunFile.create(tmp_path / "run.h5", packing) as file:
        del file._file["observables/position"]
        file.append(packing)
    with RunFile(tmp_path / "run.h5", "a") as file:
        file.append(packing)
    with RunFile(tmp_path / "run.h5") as file:
        assert len(file) == 2
        np.testing.assert_array_equal(file.packing(1).position, packing.position)


def test_without_mdanalysis_the_import_says_the_one_command(monkeypatch):
    monkeypatch.delitem(sys.modules, "faultgouge.pywrap.exchange.mdanalysis", raising=False)
    monkeypatch.setitem(sys.modules, "MDAnalysis.analysis.base", None)
    with pytest.raises(ImportError, match=r"pip install 'faultgouge\[export\]'"):
        import_module("faultgouge.pywrap.exchange.mdanalysis")


def test_a_file_that_only_claims_to_be_a_run_is_refused_when_the_parser_is_there(tmp_path, ours):
    (tmp_path / "run.h5").write_bytes(b"no HDF5")
    with pytest.raises(SceneError, match="is of no format that is read: give"):
        Scene.from_mapping({"packing": {"file": str(tmp_path / "run.h5")}})
