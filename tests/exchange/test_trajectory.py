"""A trajectory is H5MD: MDAnalysis steps through it, and its analyses agree with ours."""

from importlib.util import find_spec

import numpy as np
import pytest

from faultgouge.analysis import PackingFileError, RunFile, mean_square_displacement, nearest_image
from faultgouge.pywrap import Record, Scene, reach

pytestmark = pytest.mark.skipif(
    find_spec("MDAnalysis") is None, reason="needs the extra export: pip install 'faultgouge[export]'"
)


@pytest.fixture(scope="module", params=["double", "compensated"])
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
def test_its_mean_square_displacement_is_ours(run):
    from MDAnalysis.analysis.msd import EinsteinMSD

    path, packing = run
    found = (
        EinsteinMSD(opened(path, len(packing)), select="all", msd_type="xy", fft=False).run(0, 150).results.timeseries
    )
    with RunFile(path) as file:
        place = np.insert(file.series("trajectory")["position"], 0, packing.position, axis=0)[:150]
    lags = (1, 10, len(place) - 1)
    ours = [
        np.mean([mean_square_displacement(place[k + lag], place[k]) for k in range(len(place) - lag)]) for lag in lags
    ]
    # float32 is 5e-7 of a coordinate of 10; the displacements are 1e-2
    np.testing.assert_allclose(found[list(lags)], ours, rtol=1e-2, atol=1e-13)
    assert ours[-1] > 1e-9


@pytest.mark.slow
def test_its_radial_distribution_is_ours(run):
    from MDAnalysis.analysis.rdf import InterRDF

    path, packing = run
    universe = opened(path, len(packing))
    disks = universe.atoms
    found = InterRDF(disks, disks, nbins=40, range=(0.5, 4.5), norm="none").run(0, 50)
    with RunFile(path) as file:
        place = np.insert(file.series("trajectory")["position"], 0, packing.position, axis=0)[:50]
    counts = np.zeros(40)
    for each in place:
        apart = np.hypot(*np.moveaxis(nearest_image(each[:, None] - each, packing.box_length), -1, 0))
        counts += np.histogram(apart[~np.eye(len(packing), dtype=bool)], 40, (0.5, 4.5))[0]
    # a distance on the edge of a bin may fall on either side of it in float32
    np.testing.assert_allclose(np.asarray(found.results.count), counts, atol=4 * len(place))
    assert counts.sum() > 1e4


@pytest.mark.slow
def test_no_equilibrium_follows_a_trajectory(run):
    path, packing = run
    with RunFile(path, "a") as file, pytest.raises(ValueError, match="no equilibrium can follow"):
        file.append(packing, floor=0.0, evaluations=0)
    with RunFile(path) as file, pytest.raises(PackingFileError, match="there is no frame 1"):
        file.packing(1)
