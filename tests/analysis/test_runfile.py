"""run.h5: to the bit, through kills, with MDAnalysis, and nothing foreign."""

import json
import pickle
import subprocess
import sys
from dataclasses import fields, replace

import h5py
import MDAnalysis
import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, Packing, PackingFileError, RunFile


def assert_identical(a: Packing, b: Packing) -> None:
    """Every field the same, arrays to the last bit."""
    for field in fields(Packing):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if isinstance(x, np.ndarray):
            assert x.dtype == y.dtype
            assert x.tobytes() == y.tobytes(), field.name
        elif isinstance(x, Contacts):
            for part in fields(Contacts):
                p, q = getattr(x, part.name), getattr(y, part.name)
                assert p is q is None or p.tobytes() == q.tobytes(), part.name
        else:
            assert x == y, field.name


@pytest.fixture
def states(cluster):
    """Packings of the same disks with different numbers of contacts, none included, and awkward numbers."""
    rng = np.random.default_rng(0)
    c, result = cluster.contacts, []
    for count in (3, 12, 0, 7):
        kept = np.sort(rng.choice(12, count, replace=False))
        slip = c.slip[kept] * np.pi
        slip[:1] = -0.0
        result.append(
            replace(
                cluster,
                position=cluster.position + rng.normal(0, 1e-3, (6, 2)),
                angle=rng.normal(size=6),
                contacts=Contacts(c.i[kept], c.j[kept], slip),
                fx=0.1 * (len(result) + 1),
            )
        )
    return result


def test_what_was_written_is_what_is_read(tmp_path, states):
    path = tmp_path / "run.h5"
    attributes = {"scene": json.dumps({"mu": 1.0}), "seed": 7, "ranks": 1}
    with RunFile.create(path, states[0], attributes) as run:
        for k, state in enumerate(states):
            run.append(state, floor=1e-11 / 3, evaluations=k)
            assert len(run) == k + 1
    with RunFile(path) as run:
        assert len(run) == 4
        for k, state in enumerate(states):
            assert_identical(run.packing(k), state)
            assert_identical(run.packing(k - 4), state)
        np.testing.assert_array_equal(run.fx, [state.fx for state in states])
        np.testing.assert_array_equal(run.observable("floor"), 4 * [1e-11 / 3])
        np.testing.assert_array_equal(run.observable("evaluations"), range(4))
        np.testing.assert_array_equal(run.observable("residual"), [state.residual for state in states])
        assert run.attributes == attributes
        with pytest.raises(PackingFileError, match="no frame 4"):
            run.packing(4)


def test_open_box_and_frictionless_law(tmp_path, cluster):
    state = replace(cluster, box_length=None, law=MindlinLaw(1.0, 0.0, 0.0))
    with RunFile.create(tmp_path / "run.h5", state) as run:
        run.append(state)
        assert_identical(run.packing(), state)


def test_appending_goes_on_later(tmp_path, states):
    path = tmp_path / "run.h5"
    with RunFile.create(path, states[0]) as run:
        run.append(states[0])
    with RunFile(path, "a") as run:
        run.append(states[1])
    with RunFile(path) as run:
        for k in (0, 1):
            assert_identical(run.packing(k), states[k])


def test_a_killed_run_keeps_its_frames(tmp_path, states):
    """The writer dies without a chance to close; then a frame that was cut short is written over."""
    path = tmp_path / "run.h5"
    script = (
        "import os, sys, pickle\n"
        "from faultgouge.analysis import RunFile\n"
        "states = pickle.loads(bytes.fromhex(sys.stdin.read()))\n"
        "run = RunFile.create(sys.argv[1], states[0])\n"
        "for state in states[:2]: run.append(state)\n"
        "run.append_series('msd', time=[0.0, 1.0], value=[1e-20, 2e-20])\n"
        "os._exit(9)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(path)], input=pickle.dumps(states).hex(), text=True, check=False
    )
    assert done.returncode == 9
    with h5py.File(path, "r+") as file:  # as if the third frame had been cut short
        value = file["observables/fx/value"]
        value.resize(3, axis=0)
        value[2] = 666.0
        file["faultgouge/msd/time"].resize(3, axis=0)
    with RunFile(path, "a") as run:
        assert len(run) == 2
        assert len(run.fx) == 2
        np.testing.assert_array_equal(run.series("msd")["time"], [0, 1])
        run.append(states[2])
        run.append_series("msd", time=[2.0], value=[3e-20])
    with RunFile(path) as run:
        for k in range(3):
            assert_identical(run.packing(k), states[k])
        np.testing.assert_array_equal(run.series("msd")["value"], [1e-20, 2e-20, 3e-20])


def test_series(tmp_path, states):
    with RunFile.create(tmp_path / "run.h5", states[0]) as run:
        run.append_series("growth", time=[0.0, 0.1], velocity=[[1.0, 2.0], [3.0, 4.0]])
        run.append_series("growth", time=[0.2], velocity=[[5.0, 6.0]])
        series = run.series("growth")
        np.testing.assert_array_equal(series["time"], [0, 0.1, 0.2])
        np.testing.assert_array_equal(series["velocity"], [[1, 2], [3, 4], [5, 6]])
        for columns in ({"time": [1.0]}, {"time": [1.0], "velocity": []}, {"time": 1.0, "velocity": 1.0}):
            with pytest.raises(ValueError, match="growth"):
                run.append_series("growth", **columns)
        with pytest.raises(PackingFileError, match="no series msd"):
            run.series("msd")


def test_a_file_holds_one_set_of_disks(tmp_path, states):
    with RunFile.create(tmp_path / "run.h5", states[0]) as run:
        run.append(states[0], floor=1.0)
        for change in ({"law": MindlinLaw(1, 1, 1)}, {"box_length": None}, {"mass": np.full(6, 3.0)}):
            with pytest.raises(ValueError, match="another"):
                run.append(replace(states[1], **change), floor=1.0)
        with pytest.raises(ValueError, match="observables"):
            run.append(states[1])
        with pytest.raises(ValueError, match="residual is taken"):
            run.append(states[1], residual=0.0)
        assert len(run) == 1


def test_frames_with_more_and_more_contacts_stay_compact(tmp_path):
    """A contact more makes the table of contacts wider, which must not store it twice; zeros and indices are packed."""
    n, frames = 2000, 10
    slip = np.random.default_rng(0).normal(0, 1e-6, n)
    row = Packing(
        position=np.column_stack([np.arange(n), np.full(n, 0.4999)]),
        radius=np.full(n, 0.5),
        contacts=Contacts([], [], []),
        law=MindlinLaw(2e5, 2e5, 1.0),
    )
    path = tmp_path / "run.h5"
    with RunFile.create(path, row) as file:
        for frame in range(frames):
            some = np.arange(n - frames + frame)
            file.append(replace(row, contacts=Contacts(some, np.full(len(some), -1), slip[some])))
    plain = 8 * (3 + 1 + 3) * n * frames  # positions, angles, contacts
    assert path.stat().st_size < 0.6 * plain


def test_datasets_depend_on_the_frames_alone(tmp_path, states):
    for name in ("a.h5", "b.h5"):
        with RunFile.create(tmp_path / name, states[0], {"host": name}) as run:
            for state in states:
                run.append(state, floor=2.0)

    def datasets(name):
        found = {}
        with h5py.File(tmp_path / name) as file:
            file.visititems(lambda key, item: found.update({key: item[()]}) if isinstance(item, h5py.Dataset) else None)
        return found

    first, second = datasets("a.h5"), datasets("b.h5")
    assert first.keys() == second.keys()
    for key, value in first.items():
        np.testing.assert_array_equal(value, second[key])


@pytest.mark.parametrize("periodic", [True, False])
def test_mdanalysis_opens_it(tmp_path, states, periodic):
    path = str(tmp_path / "run.h5")
    states = states if periodic else [replace(state, box_length=None) for state in states]
    with RunFile.create(path, states[0]) as run:
        for state in states:
            run.append(state)
    universe = MDAnalysis.Universe.empty(6, trajectory=True)
    universe.load_new(path, format="H5MD", convert_units=False)
    assert len(universe.trajectory) == 4
    for snapshot, state in zip(universe.trajectory, states, strict=True):
        # MDAnalysis keeps positions in single precision, observables in double.
        np.testing.assert_allclose(snapshot.positions[:, :2], state.position, rtol=1e-6)
        np.testing.assert_array_equal(snapshot.data["angle"], state.angle)
        if periodic:
            assert snapshot.dimensions[0] == np.float32(state.box_length)


@pytest.mark.parametrize("content", [None, b"", b"not HDF5", "truncated", "foreign", "other h5md"])
def test_broken_missing_and_foreign_files(tmp_path, states, content):
    path = tmp_path / "run.h5"
    if content == "truncated":
        with RunFile.create(path, states[0]) as run:
            run.append(states[0])
        path.write_bytes(path.read_bytes()[:3000])
    elif content in ("foreign", "other h5md"):
        with h5py.File(path, "w") as file:
            file["x"] = 1
            if content == "other h5md":
                file.create_group("h5md/creator").attrs["name"] = "somebody"
    elif content is not None:
        path.write_bytes(content)
    for mode in ("r", "a"):
        with pytest.raises(PackingFileError, match=r"run\.h5"):
            RunFile(path, mode)


def test_a_file_that_cannot_be_written(tmp_path, states):
    with pytest.raises(PackingFileError, match="nowhere"):
        RunFile.create(tmp_path / "nowhere" / "run.h5", states[0])
