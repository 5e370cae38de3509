"""run.h5: to the bit, through kills, with MDAnalysis, and nothing foreign."""

import json
import multiprocessing
import os
from dataclasses import replace

import h5py
import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, PackingFileError, RunFile
from faultgouge.analysis.files.configuration_file import read_configuration


@pytest.fixture
def states(cluster):
    """Packings of the same disks with different numbers of contacts, none included, and awkward numbers."""
    rng = np.random.default_rng(0)
    c, result = cluster.contacts, []
    for count in (3, 12, 0, 7):
        kept = np.sort(rng.choice(12, count, replace=False))
        slip = c.slip[kept] * np.pi
        slip[:1] = -0.0
        place, contacts = cluster.position + rng.normal(0, 1e-3, (6, 2)), Contacts(c.i[kept], c.j[kept], slip)
        changed = {"position": place, "angle": rng.normal(size=6), "contacts": contacts, "fx": 0.1 * (len(result) + 1)}
        result.append(replace(cluster, **changed))
    return result


def test_what_was_written_is_what_is_read(tmp_path, states):
    path = tmp_path / "run.h5"
    attributes = {"scene": json.dumps({"mu": 1.0}), "seed": 7, "ranks": 1}
    with RunFile.create(path, states[0], attributes) as run:
        for k, state in enumerate(states):
            run.append(state, floor=1e-11 / 3, evaluations=k)
            assert len(run) == k + 1
    with RunFile(path) as run:
        assert [run.packing(k) for k in (*range(4), *range(-4, 0))] == 2 * states
        expected = {"floor": 4 * [1e-11 / 3], "evaluations": range(4)}
        expected |= {name: [getattr(state, name) for state in states] for name in ("fx", "residual")}
        for name, values in expected.items():
            np.testing.assert_array_equal(run.observable(name), values)
        assert run.attributes == attributes | {"complete": False, "faultgouge_format": 1}
        with pytest.raises(PackingFileError, match="no frame 4"):
            run.packing(4)


LAWS = [({}, {}, {"box_length"}), ({"rescaled": True}, {}, {"box_length", "rescaled"}),
        ({"cn": 0.1, "ct": 0.2}, {"drag_time": 0.3}, {"box_length", "cn", "ct", "drag_time"}),
        ({"coulomb": True}, {}, {"box_length", "coulomb"}),
        ({"exponent": 1.0, "kt": 0.0}, {"box_length": None}, {"exponent"})]  # fmt: skip


@pytest.mark.parametrize(("law", "changes", "stored"), LAWS)
def test_what_is_not_there_is_not_in_the_file(tmp_path, cluster, law, changes, stored):
    state = replace(cluster, law=replace(cluster.law, **({"exponent": 1.5} | law)), **changes)
    with RunFile.create(tmp_path / "run.h5", state) as run:
        run.append(state)
    with RunFile(tmp_path / "run.h5", "a") as run:
        run.append(state)
        assert [run.packing(k) for k in (0, 1)] == [state, state]
    always = {"radius", "mass", "top", "kn", "kt", "mu", "inertia_factor"}
    with h5py.File(tmp_path / "run.h5") as file:
        assert set(file["parameters"]) == always | stored


def write_and_die(path, states):
    """Write three states and save two of them at least, then die without a chance to close."""
    run = RunFile.create(path, states[0])
    for state in states[:2]:
        run.append(state)
    run.append_series("msd", time=[0.0, 1.0], value=[[1e-20, 1.0], [2e-20, 2.0]])
    run.save()
    run.append(states[2])
    os._exit(9)


def test_a_killed_run_keeps_its_frames(tmp_path, states):
    path = tmp_path / "run.h5"
    writer = multiprocessing.get_context("fork").Process(target=write_and_die, args=(path, states))
    writer.start()
    writer.join(60)
    assert writer.exitcode == 9
    with RunFile(path, "a") as run:
        assert len(run) in (2, 3)  # the third was saved if the others took no time
        assert not run.complete
        for state in states[len(run) : 3]:
            run.append(state)
        run.append_series("msd", time=[2.0], value=[[3e-20, 3.0]])
        run.complete = True
    with RunFile(path) as run:
        assert run.complete
        assert [run.packing(k) for k in range(3)] == states[:3]
        np.testing.assert_array_equal(run.series("msd")["time"], [0, 1, 2])
        np.testing.assert_array_equal(run.series("msd")["value"], [[1e-20, 1], [2e-20, 2], [3e-20, 3]])


HERTZ = pytest.mark.parametrize("cluster", [1.5], indirect=True, ids=["Hertz"])
"""What a broken file says does not depend on the law."""


@pytest.fixture
def sound(tmp_path, states):
    path = tmp_path / "run.h5"
    with RunFile.create(path, states[0], {"scene": "{}"}) as run:
        for state in states:
            run.append(state, floor=2.0)
        run.append_series("undamped", time=np.arange(50.0), msd=np.linspace(0, 1, 50))
    return path


@HERTZ
def test_what_an_error_leaves_half_done_is_not_saved(sound, states):
    def cut_short():
        with RunFile(sound, "a") as run, run.change():
            run.append(states[1], floor=2.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cut_short()
    with RunFile(sound) as run:
        assert len(run) == 4
    assert [each.name for each in sound.parent.iterdir()] == ["run.h5"]


@HERTZ
def test_every_flipped_byte_is_noticed(sound):
    content = sound.read_bytes()
    rng = np.random.default_rng(1)
    places = [*range(0, 520, 13), *rng.integers(0, len(content), 120).tolist()]
    for place in places:
        sound.write_bytes(content[:place] + bytes([content[place] ^ (1 << rng.integers(8))]) + content[place + 1 :])
        for mode in ("r", "a"):
            with pytest.raises(PackingFileError, match=r"run\.h5"):
                RunFile(sound, mode)
    sound.write_bytes(content)
    with RunFile(sound) as run:
        assert len(run) == 4


def test_a_file_holds_one_set_of_disks_and_of_names(sound, states):
    with RunFile(sound, "a") as run:
        for change in ({"law": MindlinLaw(1, 1, 1)}, {"box_length": None}, {"mass": np.full(6, 3.0)}):
            with pytest.raises(ValueError, match="another"):
                run.append(replace(states[1], **change), floor=1.0)
        with pytest.raises(ValueError, match="observables"):
            run.append(states[1])
        for columns in ({"time": [1.0]}, {"time": [1.0], "msd": []}):
            with pytest.raises(ValueError, match="undamped"):
                run.append_series("undamped", **columns)
        with pytest.raises(PackingFileError, match="no series growth"):
            run.series("growth")
        assert len(run) == 4


@HERTZ
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (None, "does not exist"),
        (lambda content: b"", "no HDF5 file, and no run"),
        (lambda content: b"not HDF5", "no HDF5 file, and no run"),
        (lambda content: content[:3000], "is damaged"),
        (lambda content: content[512:], "is an HDF5 file, and no run of faultgouge"),
    ],
)
def test_broken_missing_and_foreign_files(sound, change, says):
    content = sound.read_bytes()
    sound.unlink()
    if change is not None:
        sound.write_bytes(change(content))
    for reads in (RunFile, lambda path: RunFile(path, "a"), read_configuration):
        with pytest.raises(PackingFileError, match=rf"run\.h5 .*{says}"):
            reads(sound)


NAME = "faultgouge/more/msd"


@HERTZ
@pytest.mark.parametrize(
    "add",
    [
        lambda file: file.update({"other": h5py.ExternalLink("other.h5", "/data")}),
        lambda file: file.create_dataset(NAME, (4,), "f8", external=[("raw", 0, 32)]),
        lambda file: file.create_virtual_dataset(NAME, h5py.VirtualLayout((4,), "f8")),
    ],
)
def test_what_is_not_in_the_file_is_refused(sound, add):
    with RunFile(sound, "a") as run, run.change():
        add(run._file)
    with pytest.raises(PackingFileError, match="has its numbers in another file"):
        RunFile(sound)
