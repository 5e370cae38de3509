"""A trajectory is H5MD: MDAnalysis steps through it, and its analyses agree with ours."""

from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec

import numpy as np
import pytest

from faultgouge.analysis import PackingFileError, RunFile
from faultgouge.pywrap import Record, Scene, SceneError, reach

pytestmark = pytest.mark.skipif(
    find_spec("MDAnalysis") is None, reason="needs the extra export: pip install 'faultgouge[export]'"
)


@pytest.fixture(scope="module", params=["double", pytest.param("compensated", marks=pytest.mark.long)])
def run(tmp_path_factory, request):
    """perturb.h5 of a strong push: displacements that float32 still tells."""
    from tests.conftest import REFERENCE

    mapping = {
        "precision": request.param,
        "packing": {"file": str(REFERENCE)},
        "law": {"kn": 2e5},
        "load": {"fy": 3.0},
        "ramp": {"step": 1e-3, "until": 2e-3},
        "perturb": {"fx": 1e-3, "time": 0.3, "amplitude": 1.0, "omega": 5.0},
        "output": {"trajectory": True},
    }
    scene = Scene.from_mapping(mapping)
    path = tmp_path_factory.mktemp("run") / "perturb.h5"
    *_, start = reach(scene, 1e-3)
    with Record(path, scene, task="perturb") as record:
        record.append(start)
        for _ in record.undamped(scene, start):
            pass
        record.finish()
    return path, start.packing


def opened(path, count):
    import MDAnalysis

    universe = MDAnalysis.Universe.empty(count, trajectory=True)
    universe.load_new(str(path), format="H5MD", convert_units=False)
    universe.add_TopologyAttr("type", ["D"] * count)
    return universe


@pytest.mark.slow
def test_mdanalysis_steps_through_it(run):
    path, packing = run
    universe = opened(path, len(packing))
    with RunFile(path) as file:
        assert len(file) == 1
        series = file.series("trajectory")
        np.testing.assert_array_equal(series["time"], file.series("undamped")["time"])
        assert file.observable("fx").shape == (1,)
    place = np.insert(series["position"], 0, packing.position, axis=0)
    time = np.insert(series["time"], 0, 0.0)
    assert len(universe.trajectory) == len(time) > 100
    for k, frame in enumerate(universe.trajectory):
        assert frame.time == time[k]
        assert frame.dimensions[0] == np.float32(packing.box_length)
        assert frame.data["fx"] == packing.fx
        np.testing.assert_array_equal(frame.positions[:, :2], place[k].astype(np.float32))


@pytest.mark.slow
def test_a_universe_of_the_file_has_radii_masses_and_layer(run):
    import MDAnalysis

    import faultgouge.pywrap.exchange.mdanalysis  # noqa: F401  # it registers parser and reader

    path, packing = run
    universe = MDAnalysis.Universe(str(path))
    np.testing.assert_array_equal(universe.atoms.radii, packing.radius)
    np.testing.assert_array_equal(universe.atoms.masses, packing.mass)
    np.testing.assert_array_equal(universe.select_atoms("type top").indices, np.flatnonzero(packing.top))
    np.testing.assert_array_equal(universe.select_atoms("type bed").indices, np.flatnonzero(~packing.top))
    with RunFile(path) as file:
        series = file.series("trajectory")
    place = np.insert(series["position"], 0, packing.position, axis=0)
    for k, frame in enumerate(universe.trajectory[:20]):
        assert frame.data["position"].dtype == np.float64
        np.testing.assert_array_equal(frame.data["position"][:, :2], place[k])
        if packing.compensated and k:
            np.testing.assert_array_equal(frame.data["position_low"], series["position_low"][k - 1])


@pytest.mark.slow
@pytest.mark.long
def test_d_of_t_in_mdanalysis_is_that_of_the_run(run):
    import MDAnalysis

    from faultgouge.pywrap.exchange.mdanalysis import MeanSquareDisplacement

    path, packing = run
    universe = MDAnalysis.Universe(str(path))
    everything = MeanSquareDisplacement(universe.atoms).run()
    with RunFile(path) as file:
        sampled = file.series("undamped")
    np.testing.assert_array_equal(everything.times[1:], sampled["time"])
    # sums over the disks are rounded; LAMMPS's positions are those of the file to the bit
    np.testing.assert_allclose(everything.results.msd[1:], sampled["msd"], rtol=1e-13)
    layer = MeanSquareDisplacement(universe.select_atoms("type top")).run()
    bed = MeanSquareDisplacement(universe.select_atoms("type bed")).run()
    share = packing.top.mean()
    weighted = share * layer.results.msd + (1 - share) * bed.results.msd
    np.testing.assert_allclose(weighted, everything.results.msd, rtol=1e-13)


def test_h5md_as_others_read_it(tmp_path, reference_packing):
    import h5py

    packing = reference_packing(1.0)
    with RunFile.create(tmp_path / "run.h5", packing) as file:
        file.append(packing)
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["observables/position"] == file["particles/disks/position"]  # one object, two names
        np.testing.assert_array_equal(file["particles/disks/mass"], packing.mass)
        assert file["h5md/creator"].attrs["version"] == version("faultgouge")


def test_a_file_without_the_link_is_read_and_continued(tmp_path, reference_packing):
    from faultgouge.analysis.files.sealedfile import new_file, write

    packing = reference_packing(1.0)
    with RunFile.create(tmp_path / "run.h5", packing) as file:
        file.append(packing)
    copy = tmp_path / "before.h5"
    with RunFile(tmp_path / "run.h5") as source, new_file() as file:
        for name in ("h5md", "particles", "parameters", "observables"):
            source._file.copy(name, file)
        file.attrs.update(source._file.attrs)
        del file["observables/position"]
        write(copy, file)
    with RunFile(copy, "a") as file:
        file.append(packing)
    with RunFile(copy) as file:
        assert len(file) == 2
        np.testing.assert_array_equal(file.packing(1).position, packing.position)


def test_without_mdanalysis_the_import_says_the_one_command(monkeypatch):
    import sys

    monkeypatch.delitem(sys.modules, "faultgouge.pywrap.exchange.mdanalysis", raising=False)
    monkeypatch.setitem(sys.modules, "MDAnalysis.analysis.base", None)
    with pytest.raises(ImportError, match=r"pip install 'faultgouge\[export\]'"):
        import_module("faultgouge.pywrap.exchange.mdanalysis")


@pytest.mark.slow
def test_no_equilibrium_follows_a_trajectory(run):
    path, packing = run
    with RunFile(path, "a") as file, pytest.raises(ValueError, match="no equilibrium can follow"):
        file.append(packing, floor=0.0, evaluations=0)
    with RunFile(path) as file, pytest.raises(PackingFileError, match="there is no frame 1"):
        file.packing(1)


def test_a_file_that_only_claims_to_be_a_run_is_refused_when_the_parser_is_there(tmp_path):
    import_module("faultgouge.pywrap.exchange.mdanalysis")
    (tmp_path / "run.h5").write_bytes(b"no HDF5")
    with pytest.raises(SceneError, match="is of no format that is read: give"):
        Scene.from_mapping({"packing": {"file": str(tmp_path / "run.h5")}})
