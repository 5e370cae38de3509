"""A layer that a spring draws: the command, the deck and an interrupted run are one run, to the bit."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from reference_layer import REFERENCE, store, toml
from table_rows import rows_of

from faultgouge.analysis import RunFile, Slip, read_dump
from faultgouge.pywrap import EngineError, Equilibrium, Record, Scene, SceneError, drive
from faultgouge.pywrap.lammps.data_file import data_file
from faultgouge.pywrap.lammps.decks import DECKS
from faultgouge.pywrap.runs.drive import CONFIDENCE, NOISES, advance_error, advance_of, check_drive, settle_for_drive

BASE = {"packing": {"file": str(REFERENCE)}, "law": {"kn": 2e5, "mu": 1.0}, "load": {"fy": 3.0}}
BASE |= {"damping": {"cn": 60.0, "ct": 17.0}}
THROWN = {"spring": 300.0, "velocity": 40.0, "until": 0.2, "states": 0.02}
"""A layer that is thrown across the period in a moment."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A scene of the reference packing, of its disks alone, with a drive."""
    numbers = json.loads(REFERENCE.read_text())
    path = tmp_path_factory.mktemp("packing") / "packing.json"
    path.write_text(json.dumps({key: numbers[key] for key in ("x", "y", "radius", "top", "box_length")}))
    base = BASE | {"packing": {"file": str(path)}}
    return lambda precision="double", **drive: Scene.from_mapping(base | {"precision": precision, "drive": drive})


@pytest.fixture(scope="module")
def settled(scene):
    """The packing from which all runs start."""
    return settle_for_drive(scene(**DRAWN))


def run_to_end(scene, path, parts=None, others=None):
    """Run a drive, or so many rows of it."""
    with Record(path, scene, task="drive") as record:
        if record.last is None:
            record.append(Equilibrium.of(settle_for_drive(scene)))
        for count, step in enumerate(record.drive(others)):
            if parts is not None and count == parts:
                return step
        record.finish()
        return step


def datasets(path):
    """All datasets of a file by name."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[...]} if isinstance(item, h5py.Dataset) else {}))
    return found


def assert_same(path, other):
    np.testing.assert_equal(datasets(path), datasets(other))  # names and values, those that are no number included


@pytest.mark.long
@pytest.mark.parametrize("precision", ["double", pytest.param("compensated", marks=pytest.mark.slow)])
def test_interrupted_run_goes_on_to_the_bit(scene, tmp_path, precision):
    """Cut off twice, once after disks have gone round the period."""
    wanted, whole, cut = scene(precision, **THROWN), tmp_path / "whole.h5", tmp_path / "cut.h5"
    last = run_to_end(wanted, whole)
    assert last.sample.displacement > 1.5
    for rows in (30, 25):
        run_to_end(wanted, cut, rows)
        with RunFile(cut) as file:
            assert not file.complete
            assert file.checkpoint
    with Record(cut, wanted, task="drive") as record:
        assert list(record.drive())
    with Record(cut, wanted, task="drive") as record:  # it was killed before it could finish the file
        assert record.complete
    assert_same(whole, cut)
    with pytest.raises(SceneError, match=r"drive.velocity is 40.0 there and 41.0 here"):
        run_to_end(scene(precision, **THROWN | {"velocity": 41.0}), cut)
    with pytest.raises(SceneError, match="is a file of the command drive"):
        Record(cut, wanted, task="ramp")


@pytest.mark.ranks
@pytest.mark.slow
@pytest.mark.parametrize(
    ("ranks", "precision", "diameter"), [(1, "double", None), (2, "double", 1.0), (1, "compensated", None)]
)
def test_deck_alone_is_the_same_to_the_bit(scene, lmp, tmp_path, ranks, precision, diameter):
    """Of the decks' own packing, too, whose disk 1 is not the smallest, if the deck has the smallest diameter."""
    wanted, given = scene(precision, **THROWN), {"spring": 300.0, "velocity": 40.0, "time": 0.2, "states": 0.02}
    if diameter is not None:
        shipped = wanted.packing.model_copy(update={"file": DECKS / "packing100.data", "top": "type:2"})
        wanted, given["diameter"] = wanted.model_copy(update={"packing": shipped}), diameter
    run_to_end(wanted, tmp_path / "drive.h5")
    with RunFile(tmp_path / "drive.h5") as file:
        (tmp_path / "start.data").write_text(data_file(file.packing(0)))
        stored, last = file.packing(-1), file.series("drive")
    data = tmp_path / "start.data"
    lmp(DECKS / "drive.in", ranks=ranks, decks=DECKS, data=data, precision=precision, every=1, **given)
    dumped, row = read_dump(tmp_path / "drive.end.disks"), np.loadtxt(tmp_path / "drive.series")[-1]
    assert dumped.fx == stored.fx
    for name in ("position", "position_low", "angle"):
        np.testing.assert_array_equal(getattr(dumped, name), getattr(stored, name))
    np.testing.assert_array_equal(dumped.contacts.slip, stored.contacts.slip)
    assert row[2:4].tolist() == [last["force"][-1], last["displacement"][-1]]
    # sums in another order, and without low parts
    few = 1e-13 if precision == "double" else 1e-8
    assert row[4:] == pytest.approx([last["thickness"][-1], last["kinetic_energy"][-1]], rel=few)


def test_stored_packing_keeps_its_slips(scene, tmp_path):
    """Friction bears a packing that has settled with friction; without its slips it would rearrange."""
    wanted = scene(**THROWN)
    whole = settle_for_drive(wanted)
    slips = 1e-7 * np.random.default_rng(0).standard_normal(len(whole.contacts))
    path = store(tmp_path / "held.h5", replace(whole, contacts=whole.contacts.slipped(slips)))
    stored = wanted.packing.model_copy(update={"file": path})
    start = settle_for_drive(wanted.model_copy(update={"packing": stored}))
    np.testing.assert_array_equal(start.contacts.slip, slips)
    np.testing.assert_array_equal(start.position, whole.position)


@pytest.mark.parametrize("spring", [10.0, "rigid"])
def test_run_does_not_depend_on_where_it_ends(scene, tmp_path, spring):
    """Rows and states of a shorter run are those of the longer one, but for the last row."""
    for until in (6.0, 9.0):
        run_to_end(scene(spring=spring, velocity=2e-3, until=until), tmp_path / f"{until}.h5")
    short, long = (datasets(tmp_path / f"{until}.h5") for until in (6.0, 9.0))
    for name in (each for each in short if each.startswith(("faultgouge", "observables/time"))):
        count = len(short[name]) - 1
        assert count > 1
        np.testing.assert_array_equal(short[name][:-1], long[name][:count], err_msg=name)


def test_states_are_the_even_ones_and_both_ends_of_each_slip_wherever_the_run_is_cut():
    drive_to_slip = {"spring": 10.0, "velocity": 2e-3, "slips": 1}
    wanted = Scene.from_mapping(BASE | {"packing": {"disks": 30, "seed": 4}, "drive": drive_to_slip})
    start, kept, rows = settle_for_drive(wanted), [], []

    def run(*resumed, keep=None):
        steps = []
        for step in drive(wanted, start, *resumed, keep=keep):
            steps.append(step)
            rows.append(step.sample)
        return steps, [(state.time, state.packing.fx) for step in steps for state in step.states]

    steps, states = run(keep=lambda reached: kept.append((len(rows), reached)))
    slips = [step.slip for step in steps if step.slip]
    ends = {time for slip in slips for time in (slip.begins, slip.ends)}
    even = {rows[count - 1].time for count, _ in kept}
    assert len(slips) == 1
    assert [time for time, _ in states] == sorted(even | ends | {rows[-1].time})
    samples = {row.time: row for row in rows}
    for time, packing in ((state.time, state.packing) for step in steps for state in step.states):
        row = samples[time]
        # a packing under the force of the spring, 10 of a displacement; what accelerates the layer is small
        assert packing.fx == row.force == pytest.approx(10.0 * (2e-3 * row.time - row.displacement), abs=1e-12)
        assert row.at_bound == packing.sliding.sum()
        assert row.thickness == packing.position[packing.top, 1].mean()
    for slip in slips:  # cut off within a slip, which has pending states
        count, reached = next(each for each in kept if rows[each[0] - 1].time > slip.begins)
        assert reached.pending
        assert run(rows[:count], reached)[1] == [each for each in states if each[0] >= reached.pending[0].time]


PULSE = {"signal": "pulse", "omega": 1.0}
DRAWN = {"spring": 10.0, "velocity": 1e-3, "until": 1.0}


@pytest.mark.parametrize(("change", "says"), rows_of("pywrap/refused_drives.txt", DRAWN=DRAWN, PULSE=PULSE))
def test_what_cannot_be_driven_is_refused_before_it_begins(settled, change, says):
    """Scenes that make no sense, and drives that are not slow, or that time steps do not follow."""
    sections = {key: each for key, each in {**BASE, "drive": DRAWN, **change}.items() if each}
    with pytest.raises(SceneError, match=says):  # noqa: PT012, the scene alone or with its packing
        wanted = Scene.from_mapping(sections, command="drive")
        check_drive(wanted, settle_for_drive(wanted) if "damping" in change else settled)


@pytest.mark.long
@pytest.mark.ranks
def test_command_on_two_ranks_is_the_same_to_the_bit(scene, faultgouge, faultgouge_here, tmp_path):
    drive = {"spring": 10.0, "velocity": 5e-3, "until": 0.3, "states": 0.1}
    wanted = BASE | {"packing": {"file": str(scene(**THROWN).packing.file)}, "damping": {"cn": 60.0}, "drive": drive}
    (tmp_path / "scene.toml").write_text(toml(wanted))
    one = faultgouge_here("drive", "scene.toml", "-o", "1.h5", "--json")
    two = faultgouge("drive", "scene.toml", "-o", "2.h5", "--json", ranks=2)
    assert json.loads(one.stdout) == json.loads(two.stdout)
    assert json.loads(one.stdout)["slips"] == []
    assert all("slow driving takes 100" in done.stderr for done in (one, two))
    assert_same(tmp_path / "1.h5", tmp_path / "2.h5")
    assert (tmp_path / "1.csv").read_text().startswith("begins,ends,")


@pytest.mark.long
def test_runs_that_differ_in_the_signal_share_what_is_before_it(scene, tmp_path):
    """Each goes on from a file of the run with the signal, and ends as one that has run from the beginning. Up to the
    signal all are equal to the bit."""
    wanted = scene(**THROWN, signal="pulse", at=0.06, omega=200.0, scale=5.0)
    drives = {"without": wanted.drive.without_signal(), "noise": wanted.drive.with_noise()}
    scenes = {tmp_path / f"{name}.h5": wanted.model_copy(update={"drive": each}) for name, each in drives.items()}
    run_to_end(wanted, tmp_path / "with.h5", others=scenes)
    series = [datasets(tmp_path / "with.h5")]
    for path, each in scenes.items():
        with RunFile(path) as file:
            assert not file.complete
            assert 0.04 < file.series("drive")["time"][-1] <= 0.06
        alone = path.with_suffix(".alone.h5")
        run_to_end(each, path)
        run_to_end(each, alone)
        with RunFile(path) as file, RunFile(alone) as other:
            assert file.attributes["scene"] == other.attributes["scene"]
        assert_same(path, alone)
        series.append(datasets(path))
    with_signal, without, noise = (each["faultgouge/drive/displacement"] for each in series)
    for each in (with_signal, noise):
        same = each == without
        assert same[series[0]["faultgouge/drive/time"] < 0.06].all()
        assert not same.all()
    assert np.abs(with_signal - without).max() > 1e-4


def test_clock_advance_is_the_time_between_comparable_slips():
    """A small slip with the signal does not count."""

    def slip(begins, drop):
        return Slip(begins, begins + 3.0, 0.6, 0.6 - drop, 0.1 * drop, 0.0)

    with_signal = [slip(30.0, 0.5), slip(66.0, 0.45), slip(100.0, 0.6)]
    without = [slip(30.0, 0.5), slip(120.0, 1.0)]
    assert advance_of(with_signal, without, 60.0) == 20.0
    assert advance_of(with_signal, without[:1], 60.0) is None


@pytest.mark.parametrize("scale", [0.0, 1e-11])
@pytest.mark.long
def test_signal_that_does_nothing_has_no_clock_advance_beyond_its_error(faultgouge_here, tmp_path, scale):
    """A small layer with the standard law, shortly before its first slip; without a force runs are the same."""
    drive = {"spring": 10.0, "velocity": 4e-3, "until": 26.0}
    drive |= {"signal": "pulse", "at": 9.0, "omega": 2.0, "scale": scale}
    wanted = BASE | {"packing": {"disks": 20, "seed": 2}, "law": {"kn": 2e5, "history": "coulomb"}, "drive": drive}
    (tmp_path / "scene.toml").write_text(toml(wanted))
    told = json.loads(faultgouge_here("drive", "scene.toml", "-o", "d.h5", "--json").stdout)
    assert told["slips"]
    assert len(told["clock_advances_of_noise"]) == NOISES
    assert abs(told["clock_advance"]) <= (told["clock_advance_error"] if scale else 0)
    with RunFile(tmp_path / "d.h5") as file:
        assert told["clock_advance_error"] >= np.diff(file.series("drive")["time"]).min()


def test_error_of_a_clock_advance_is_that_of_one_more_draw():
    """Of many draws of three and one more, as many are covered as is said; a row of the series is the least error."""
    draws = 2.0 * np.random.default_rng(0).standard_normal((4000, NOISES + 1))
    covered = [abs(last) <= advance_error(noise, 1e-9) for *noise, last in draws.tolist()]
    assert np.mean(covered) == pytest.approx(CONFIDENCE, abs=0.015)  # four standard errors
    assert advance_error([0.0, 0.0, 0.0], 0.1) == 0.1
    assert advance_error([0.0, None, 0.0], 0.1) is None


def test_disks_that_move_through_one_another_end_the_run_with_what_to_change(scene):
    wanted = scene(spring="rigid", velocity=300.0, until=1.0)
    with pytest.raises(EngineError, match=r"ended before t = 0\.\d+: take a slower drive, .* as LAMMPS stopped: "):
        list(drive(wanted, settle_for_drive(wanted)))
