"""The command line as a user types it: what it prints, what it leaves behind, and what it refuses in one sentence."""

import json
import re
import time
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from reference_layer import LAYER, SMALL, toml

from faultgouge import load
from faultgouge.analysis import (
    Contacts,
    MindlinLaw,
    NoEquilibriumError,
    Packing,
    RunFile,
    eigenvalues,
    mean_square_displacement,
    read_dump,
    spectrum,
    stiffness_matrix,
)
from faultgouge.analysis.motion.transient import transient_gains
from faultgouge.commands import terminal
from faultgouge.pywrap import Record, Scene, settle
from faultgouge.pywrap.lammps.instance import lammps_instance
from faultgouge.pywrap.settling.settle import settle_bed
from fuzz.kills import difference, results

SECTIONS = {
    "ramp": {"step": 1e-3, "until": 0.004},
    "perturb": {"fx": 1.5e-3, "time": 0.5},
    "output": {"trajectory": True},
}
SCENE = LAYER + toml(SECTIONS)


@pytest.fixture(autouse=True)
def _scene(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)


@pytest.fixture(scope="module")
def whole(tmp_path_factory, faultgouge_here_in):
    """A folder with run.h5, the whole ramp of the scene, and what the command printed."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "scene.toml").write_text(SCENE)
    return folder, json.loads(faultgouge_here_in(folder, "ramp", "scene.toml", "--json").stdout)


def test_ramp_to_a_load_that_the_file_went_beyond(faultgouge_here, tmp_path):
    """Nothing is computed, and the load is not the last one of the file."""
    scene = SMALL | {"ramp": {"step": 6e-3, "until": [0.012, 0.0]}}
    (tmp_path / "scene.toml").write_text(toml(scene))
    assert "F_x = 0 reached" in faultgouge_here("ramp", "scene.toml").stdout
    before = (tmp_path / "run.h5").read_bytes()
    (tmp_path / "scene.toml").write_text(toml(scene | {"ramp": {"step": 6e-3, "until": 6e-3}}))
    said = faultgouge_here("ramp", "scene.toml").stdout
    assert said == "run.h5 goes on from F_x = 0.006, where ramp.until ends, to F_x = 0: nothing is left to compute\n"
    assert (tmp_path / "run.h5").read_bytes() == before


@pytest.mark.slow
def test_ramp_as_json(whole):
    folder, printed = whole
    assert [row["fx"] for row in printed["equilibria"]] == [k * 1e-3 for k in range(5)]
    for row in printed["equilibria"]:
        assert row["residual"] < 1.5 * row["floor"] < 1.5e-10
        assert row["contacts"] == 191
    assert sorted(path.name for path in folder.iterdir()) == ["run.h5", "scene.toml"]
    with RunFile(folder / "run.h5") as file:
        assert len(file) == 5
        assert json.loads(file.attributes["scene"])["ramp"]["until"] == 4e-3


@pytest.mark.long
def test_a_ramp_says_which_way_it_took(faultgouge, tmp_path):
    """Of this packing, halved increments end before 0.0785; the same command again reads the way from the file."""
    scene = {"packing": {"disks": 100, "seed": 11}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
    (tmp_path / "scene.toml").write_text(
        'precision = "compensated"\n' + toml(scene | {"ramp": {"step": 5e-4, "until": 0.0785}})
    )
    way = "3 increments from F_x = 0.078"
    for says in (f"F_x = 0.0785 was reached by {way}, after", ""):
        done = faultgouge("ramp", "scene.toml", "--json")
        assert says in done.stderr
        *before, last = json.loads(done.stdout)["equilibria"]
        assert last["way"] == way
        assert all(row["way"] is None for row in before)


@pytest.mark.ranks
@pytest.mark.slow
def test_a_ramp_that_was_cut_off_goes_on_and_two_ranks_write_the_same(faultgouge, tmp_path, whole):
    for until in ("until = 0.002", "until = 0.004"):
        (tmp_path / "scene.toml").write_text(SCENE.replace("until = 0.004", until))
        faultgouge("ramp", "scene.toml", ranks=2)
    assert difference(results(whole[0]), results(tmp_path)) == ""


@pytest.mark.slow
@pytest.mark.parametrize("loads", [(0.0,), (0.0, 1e-3)], ids=["settled", "with a ramp"])
def test_settle_finishes_a_settling_and_no_ramp(faultgouge_here, tmp_path, loads):
    scene = Scene.from_toml(tmp_path / "scene.toml", command="settle")
    settled = settle(scene)
    with Record(tmp_path / "run.h5", scene) as record:  # as a kill between the packing and the end leaves it
        for fx in loads:
            record.append(replace(settled, packing=replace(settled.packing, fx=fx)))
    faultgouge_here("settle", "scene.toml")
    with RunFile(tmp_path / "run.h5") as file:
        assert len(file) == len(loads)
        assert file.complete == (loads == (0.0,))


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "says"), [(1, "11 of 40 disks lie above the upper layer"), (2, "")])
def test_settle_says_that_many_disks_lie_above_the_layer(faultgouge_here, tmp_path, seed, says):
    packing = {"disks": 40, "width": 7.5, "seed": seed}
    (tmp_path / "scene.toml").write_text(toml({"packing": packing, "law": {"kn": 2e5}, "load": {"fy": 3.0}}))
    said = faultgouge_here("settle", "scene.toml").stderr
    assert says in said
    assert ("above the upper layer" in said) is bool(says)


@pytest.mark.slow
def test_perturb_writes_the_series_and_the_trajectory_that_is_asked_for(faultgouge_here, tmp_path):
    done = faultgouge_here("perturb", "scene.toml", "--json")
    series = json.loads(done.stdout)
    assert done.stderr.endswith("written to perturb.h5\n")
    assert (series["growth"], series["predicted_rate"], series["time_needed"]) == (None, 0, None)
    assert "linearly stable" in series["says"]
    assert series["time"][-1] == pytest.approx(0.5, abs=1e-3)
    # a stable packing at rest: D stays at the rounding of coordinates, the residual over the softest mode squared
    assert 0 < max(series["msd"]) < 1e-22
    with RunFile(tmp_path / "perturb.h5") as file:
        assert file.fx.tolist() == [1.5e-3]
        path, start = file.series("trajectory"), file.packing()
        assert file.series("undamped")["msd"].tolist() == series["msd"]
    assert path["time"].tolist() == series["time"]
    moved = mean_square_displacement(path["position"], start.position, start.box_length)
    assert moved.tolist() == series["msd"]


@pytest.mark.slow
def test_dumps_that_are_asked_for_hold_the_equilibria(faultgouge_here, beyond):
    with RunFile(beyond / "ramp.h5") as file:
        for k in (1, 2):
            stored, dumped = file.packing(k), read_dump(beyond / f"ramp.{k}.disks")
            assert np.array_equal(dumped.position, stored.position)
            assert np.array_equal(dumped.contacts.slip, stored.contacts.slip)
            assert dumped.fx == stored.fx
    printed = json.loads(faultgouge_here("spectrum", beyond / "ramp.2.disks", "--json").stdout)
    assert printed["fx"] == 0.012
    assert printed["eigenvalues"] == [[v.real, v.imag] for v in spectrum(dumped).eigenvalues.tolist()]
    # the forces were balanced, so that what was read is what was written
    assert printed["residual"] < 1.2e-10


@pytest.mark.slow
def test_spectrum_of_a_run_file_is_that_of_the_packing_and_says_how_far_it_moves(faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(toml(SMALL | {"ramp": {"step": 5e-3, "until": 1e-2}}))
    faultgouge_here("ramp", "scene.toml")
    run = tmp_path / "run.h5"
    with RunFile(run) as file:
        packing = file.packing()
    printed, fast = (
        json.loads(faultgouge_here("spectrum", run, *more, "--json").stdout) for more in (["--gain"], ["--values"])
    )
    for found, values in ((printed, spectrum(packing).eigenvalues), (fast, eigenvalues(packing))):
        assert found["eigenvalues"] == [[value.real, value.imag] for value in values.tolist()]
        assert found["rattlers"] == packing.rattlers.tolist()
    first = faultgouge_here("spectrum", run, "--values").stdout.splitlines()[0]
    assert [float(word) for word in first.split()] == fast["eigenvalues"][0]
    gain, (displacement, energy) = printed["transient_gain"], transient_gains(packing)
    assert (gain["displacement"], gain["time"], gain["energy"]) == (displacement.gain, displacement.time, energy.gain)
    said = faultgouge_here("spectrum", run, "--gain").stdout
    assert f"a displacement from rest grows by up to {displacement.gain:.6g} times in its square" in said
    plain = faultgouge_here("spectrum", run)
    assert "grows by up to" not in plain.stdout
    assert plain.stdout.startswith("stable: no motion grows\n")
    assert printed["stability"]["stable"] is printed["stable"] is True


@pytest.mark.slow
def test_spectrum_of_a_large_packing(faultgouge_here, beyond, monkeypatch):
    pairs = json.loads(faultgouge_here("spectrum", beyond / "ramp.h5", "--json").stdout)["pair_count"]
    monkeypatch.setattr("faultgouge.commands.spectrum.MOST_PAIRS", pairs - 1)
    monkeypatch.setattr("faultgouge.commands.spectrum.SLOW_COORDINATES", 0)
    done = faultgouge_here("spectrum", beyond / "ramp.h5")
    assert "coordinates: their spectrum needs" in done.stderr
    said = done.stdout
    assert said.count("D grows as") == pairs - 1
    assert f"and 1 more: --json has all {pairs}" in said


def test_a_driven_packing_has_its_spring_in_command_and_python_alike(faultgouge_here, tmp_path, reference_packing):
    packing = reference_packing(1.0)
    for spring in (20.0, "rigid"):
        drive = {"spring": spring, "velocity": 1e-3, "until": 1.0}
        with RunFile.create(
            tmp_path / "drive.h5", packing, {"task": "drive", "scene": json.dumps({"drive": drive})}
        ) as file:
            file.append(packing, time=0.0)
            file.complete = True
        told = json.loads(faultgouge_here("spectrum", "drive.h5", "--json").stdout)
        drawn = load(tmp_path / "drive.h5")
        assert told["spring"] == drawn.spring == drawn.configuration.spring == (0.0 if spring == "rigid" else spring)
        found = spectrum(drawn)
        assert [complex(*each) for each in told["eigenvalues"]] == found.eigenvalues.tolist()
        assert np.array_equal(spectrum(packing).eigenvalues, found.eigenvalues) is (spring == "rigid")
        difference = stiffness_matrix(drawn) - stiffness_matrix(drawn.configuration)
        assert abs(difference).max() < 1e-9 * abs(stiffness_matrix(drawn)).max()


def test_one_rank_alone_prints_the_spectrum(faultgouge_here, tmp_path, reference_packing, monkeypatch):
    with RunFile.create(tmp_path / "run.h5", reference_packing(1.0)) as file:
        file.append(reference_packing(1.0))
        file.complete = True
    monkeypatch.setattr("faultgouge.mpi_rank.rank", lambda: 1)
    for more in ((), ("--json",), ("--values",)):
        assert faultgouge_here("spectrum", "run.h5", *more).stdout == ""


def test_spectrum_says_what_contacts_at_the_bound_do(faultgouge_here, tmp_path):
    """With the standard law, whose contacts slide on or stick there; the smoothed law has one derivative."""
    scene = SMALL | {"law": {"kn": 2e5, "mu": 0.4}, "ramp": {"step": 5e-2, "until": 0.6}}
    for history in ("coulomb", "total"):
        (tmp_path / f"{history}.toml").write_text(toml(scene | {"law": scene["law"] | {"history": history}}))
        faultgouge_here("ramp", f"{history}.toml", "-o", f"{history}.h5")
        with RunFile(tmp_path / f"{history}.h5") as file:
            packing = file.packing()
        done = faultgouge_here("spectrum", f"{history}.h5")
        bound = int(packing.sliding.sum())
        sentence = f"{bound} of {len(packing.contacts)} contacts are at Coulomb's bound: each slides on ahead"
        assert (sentence in done.stdout) is (history == "coulomb" and bound > 0)
        assert ("neither of two linear motions decides" in done.stdout) is (history == "coulomb")
        assert (spectrum(packing).is_stable is None) is (history == "coulomb")
        assert bound > 0 or history == "total"


@pytest.mark.slow
def test_spectrum_calls_no_packing_stable_that_buckles_or_moves(faultgouge_here, tmp_path):
    """Two disks on top of each other, in balance and pressed together too far; side by side they are stable."""
    law = MindlinLaw(2e5, 2e5 * 2 / 7, 1.0)
    overlap = (3.0 / 2e5) ** (2 / 3)
    stands = Packing(
        position=[[2.0, 0.5 - overlap], [2.0, 1.5 - 2 * overlap]],
        radius=[0.5, 0.5],
        top=[False, True],
        contacts=Contacts([0, 0], [-1, 1], [0, 0]),
        law=law,
        box_length=4.0,
        fy=3.0,
    )
    beside = replace(stands, position=[[1.0, 0.5 - overlap], [3.0, 0.5 - overlap]], top=[True, True])
    packings = {
        "buckles": stands,
        "moves": replace(beside, position=[[1.0, 0.49], [3.0, 0.49]], contacts=Contacts([0, 1], [-1, -1], [0, 0])),
        "stands": replace(beside, contacts=Contacts([0, 1], [-1, -1], [0, 0])),
    }
    said, printed = {}, {}
    for name, packing in packings.items():
        with RunFile.create(tmp_path / f"{name}.h5", packing) as file:
            file.append(packing)
            file.complete = True
        said[name] = faultgouge_here("spectrum", f"{name}.h5").stdout
        printed[name] = json.loads(faultgouge_here("spectrum", f"{name}.h5", "--json").stdout)
    assert [each["stable"] for each in printed.values()] == [False, None, True]
    first = [each.split(":")[0] for each in said.values()]
    assert first == ["unstable", "not known whether the packing is stable", "stable"]
    assert printed["buckles"]["negative"][0] == pytest.approx(-1.5025124716, rel=1e-9)
    assert "negative eigenvalue -1.50251247" in said["buckles"]
    assert "the packing moves: the residual force on a particle is" in said["moves"]
    assert "volume fraction" in said["stands"]
    done = faultgouge_here("spectrum", "buckles.h5", "--gain", "--json")
    assert json.loads(done.stdout)["transient_gain"] is None
    assert "no gain: the packing is unstable" in done.stderr


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("spectrum", "scene.toml"), "run `faultgouge ramp scene.toml -o run.h5`, and give run.h5"),
        (("draw", "scene.toml"), "scene.toml is a scene, and this command reads a stored packing"),
        (("view", "scene.toml"), "scene.toml is a scene, and this command reads a stored packing"),
        (("onset", "run.h5"), "run.h5 is a stored run, and onset reads a scene: give its .toml file"),
        (("stability", "run.h5"), "`faultgouge spectrum run.h5` says whether a packing is stable"),
    ],
)
def test_a_file_of_the_wrong_kind_is_refused_with_what_to_do(refusal, words, says):
    assert says in refusal(*words)


@pytest.mark.slow
def test_onset_as_json_and_among_some_modes(faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace("until = 0.004", "until = 0.022"))
    for more, modes in (((), None), (("--modes", "0:285"), [0, 285])):
        result = json.loads(faultgouge_here("onset", "scene.toml", *more, "--json").stdout)
        assert result.get("modes") == modes
        assert result["fx_c"] == pytest.approx(0.0218330564080, rel=1e-9)
        assert result["windows"][0].keys() >= {"fx_onset", "fx_end", "lambda", "error"}


@pytest.mark.slow
def test_results_go_to_standard_output_and_progress_to_standard_error(faultgouge, faultgouge_here, tmp_path):
    """As two pipes of a shell see those of `onset`; the onset of the reference packing is the first of its windows."""
    scene = LAYER + toml({"ramp": {"step": 5.5e-3, "until": 0.022}, "perturb": {"fx": 0.022, "time": 0.1}})
    (tmp_path / "scene.toml").write_text(scene)
    first = faultgouge("onset", "scene.toml")
    found, every = (
        json.loads(faultgouge_here("onset", "scene.toml", *more, "--json").stdout) for more in ((), ("--all",))
    )
    assert first.stdout.startswith("mu = 1: F_x^c = 0.02183305")
    assert "two eigenvalues merge there" in first.stdout
    law = 'law of friction: the paper\'s smoothed law (history = "total")'
    assert first.stdout.splitlines()[-1] == law
    assert first.stderr == ""
    table = faultgouge_here("onset", "scene.toml", "--all").stdout.splitlines()
    assert [line.split()[:2] for line in table[:2]] == [["mu", "="], ["from", "F_x"]]
    assert len(table) == 2 + len(every["windows"]) + 1
    assert table[-1] == law
    assert (len(found["windows"]), found["fx_c"]) == (1, every["fx_c"])
    assert every["windows"] == sorted(every["windows"], key=lambda window: window["fx_onset"])
    for command, result in (("settle", "100 disks"), ("ramp", "F_x = 0.022 reached"), ("perturb", "F_x = 0.022, mu")):
        done = faultgouge_here(command, "scene.toml", "-o", f"{command}.h5")
        assert done.stdout.startswith(result)
        assert result not in done.stderr


@pytest.mark.slow
def test_a_bed_is_settled_once_for_all_friction_coefficients(faultgouge_here, tmp_path, monkeypatch):
    """And the dumps of a ramp are written by the LAMMPS that has the packing, and by no other."""
    settled, opened = [], []
    for name, calls, what in (
        ("faultgouge.pywrap.settling.settle.settle_bed", settled, settle_bed),
        ("faultgouge.studies.reproduce.protocol.settle_bed", settled, settle_bed),
        ("faultgouge.pywrap.lammps.engine.lammps_instance", opened, lammps_instance),
    ):
        monkeypatch.setattr(
            name, partial(lambda calls, what, *given, **more: calls.append(1) or what(*given, **more), calls, what)
        )
    small = SMALL | {"packing": SMALL["packing"] | {"seed": 2}}
    (tmp_path / "scene.toml").write_text(toml(small | {"law": {"kn": 2e5, "mu": [1.0, 0.8, 0.5]}}))
    assert len(faultgouge_here("onset", "scene.toml").stdout.splitlines()) == 7  # the last one names the law
    assert len(settled) == 1
    settled.clear()
    monkeypatch.setattr("faultgouge.studies.reproduce.protocol.recorded_ramp", ramps_that_end(beds := []))
    faultgouge_here("reproduce", "scene.toml", "-o", "out", code=1)
    assert len(settled) == 1
    assert len(beds) == 3
    assert all(bed is beds[0] is not None for bed in beds)
    counts = []
    for dumps in (False, True):
        opened.clear()
        (tmp_path / "scene.toml").write_text(toml(small | {"output": {"dumps": dumps}}))
        faultgouge_here("ramp", "scene.toml", "-o", f"{dumps}.h5")
        counts.append(len(opened))
    assert counts[0] == counts[1]
    assert len(list(tmp_path.glob("True.*.disks"))) == 5


@pytest.mark.parametrize(
    ("disks", "more", "says", "damping"),
    [
        (301, (), "--all finds all windows of up to 300 disks, and the packing has 301: leave --all out", {}),
        (301, (), "--all finds all windows of up to 300 disks, and", {"damping": {"cn": 1.0}}),
        (30, ("--modes", "0:20"), "--all goes without --modes", {}),
    ],
)
def test_all_windows_are_refused_where_the_first_alone_would_come(
    faultgouge_here, tmp_path, disks, more, says, damping
):
    """Before any work: no file, and no packing that settles."""
    scene = SMALL | {"packing": {"disks": disks, "width": 8.0}} | damping
    (tmp_path / "scene.toml").write_text(toml(scene))
    done = faultgouge_here("onset", "scene.toml", "--all", *more, "-o", "onset.json", code=2)
    assert done.stderr.startswith(f"Error: {says}")  # not after what the work would take
    assert not (tmp_path / "onset.json").exists()


@pytest.mark.slow
def test_onset_names_the_friction_coefficients_without_one(faultgouge_here, tmp_path):
    """Those that follow are searched, too; a scene of which none has an onset ends with the exit code 1."""
    small = SMALL | {"packing": SMALL["packing"] | {"seed": 2}, "ramp": {"step": 5e-3, "until": 0.015}}
    (tmp_path / "scene.toml").write_text(toml(small | {"law": {"kn": 2e5, "mu": [1.0, 0.3, 0.8]}}))
    said = faultgouge_here("onset", "scene.toml").stdout.splitlines()
    none = "no onset: No pair of eigenvalues is complex up to F_x = 0.015: raise ramp.until."
    assert said[0] == f"mu = 1: {none}"
    assert said[1].startswith("mu = 0.3: F_x^c = 0.01394557")
    assert said[-2] == f"mu = 0.8: {none}"
    assert said[-1].startswith("law of friction: ")
    found = json.loads(faultgouge_here("onset", "scene.toml", "--json").stdout)
    assert found["fx_c"] == pytest.approx(0.01394557065, abs=1e-10)
    assert [each["fx_c"] for each in found["each_mu"]] == [None, found["fx_c"], None]
    (tmp_path / "scene.toml").write_text(toml(small | {"law": {"kn": 2e5, "mu": [1.0, 0.8]}}))
    done = faultgouge_here("onset", "scene.toml", code=1)
    assert "None of the 2 friction coefficients has an onset on this ramp." in done.stderr
    assert [line.split(":")[0] for line in done.stdout.splitlines()] == ["mu = 1", "mu = 0.8"]


def ramps_that_end(beds):
    """A ramp of which no more is asked than the bed that it is given; the third one ends the command."""

    def ramp(scene, mu, path, bed):
        beds.append(bed)
        if len(beds) == 3:
            raise NoEquilibriumError("enough")
        return SimpleNamespace(describe=lambda: "none")

    return ramp


def test_the_undamped_onset_of_a_ramp_on_which_the_dissipation_stops_all_growth(faultgouge_here, tmp_path):
    small = SMALL | {"packing": SMALL["packing"] | {"seed": 2}, "ramp": {"step": 7e-3, "until": 0.014}}
    (tmp_path / "scene.toml").write_text(toml(small | {"law": {"kn": 2e5, "mu": 0.3}, "damping": {"cn": 500.0}}))
    done = faultgouge_here("onset", "scene.toml", "-o", "onset.json", "--json", code=1)
    result = json.loads(done.stdout)
    assert json.loads((tmp_path / "onset.json").read_text()) == result
    assert (result["fx_c"], result["windows"]) == (None, [])
    assert result["undamped"]["fx_c"] == pytest.approx(0.01394557, abs=1e-7)
    assert result["undamped"]["error"] > 0
    assert "mu = 0.3: without dissipation F_x^c = 0.01394" in done.stderr
    assert "Error: No motion grows up to F_x = 0.014: raise ramp.until." in done.stderr


@pytest.mark.slow
def test_onset_with_dissipation_as_json(faultgouge_here, tmp_path):
    """All modes at four loads; no contact changes on the way, and the onset hangs on the increment by 2e-11."""
    (tmp_path / "scene.toml").write_text(LAYER + toml({"ramp": {"step": 5.5e-3, "until": 0.022}, "damping": {"cn": 1}}))
    done = faultgouge_here("onset", "scene.toml", "-o", "onset.json", "--json")
    result = json.loads(done.stdout)
    assert json.loads((tmp_path / "onset.json").read_text()) == result
    assert "searched_to" not in result
    assert result["fx_c"] == pytest.approx(0.0218328368, abs=1e-10)
    assert result["undamped"]["fx_c"] == pytest.approx(0.0218330564080, rel=1e-9)
    window = result["windows"][0]
    assert window.keys() == {"fx_onset", "fx_end", "frequency", "error", "error_of_path", "kind"}
    assert 0 < window["error_of_path"] <= window["error"]
    assert (window["kind"], window["fx_end"]) == ("hopf", None)
    assert window["frequency"] == pytest.approx(45.367, abs=1e-3)


@pytest.mark.slow
def test_a_lack_of_memory_is_no_fault_of_the_program(capsys):
    from faultgouge.exit_status import fail

    with pytest.raises(MemoryError) as lack:
        np.empty(1 << 55)
    with pytest.raises(SystemExit) as end:
        fail(lack.value)
    assert end.value.code == 1
    assert "Error: there is not enough memory (Unable to allocate 256. PiB for an array" in capsys.readouterr().err


def test_every_command_has_help_with_an_example(faultgouge, faultgouge_here):
    commands = ["settle", "ramp", "perturb", "onset", "spectrum", "explain", "report", "extremes", "reproduce"]
    commands += ["import", "export", "movie", "view", "sweep", "modes", "eruptions"]
    overview = faultgouge("--help").stdout
    for command in commands:
        assert command in overview
        done = faultgouge_here(command, "--help")
        assert "Example" in done.stdout
        assert "\\" not in done.stdout  # plain text escapes no brackets


def test_the_overview_has_the_whole_first_sentence_of_each_command(faultgouge_here, refusal):
    from faultgouge.commands import program

    _, table = faultgouge_here("--help").stdout.split("Commands:")
    text = " ".join(table.split())
    assert "ramp Raise F_x from equilibrium to equilibrium, and store each equilibrium. perturb Run" in text
    assert "merge Join the shards of a sweep; the table is that of an undivided sweep. modes" in text
    commands = program().commands
    hidden = {name for name in commands if commands[name].hidden}
    assert hidden == {"stability"}  # the name that `extremes` once had
    assert set(re.findall(r"^  (\w+)  ", table, re.MULTILINE)) == set(commands) - hidden
    assert "Did you mean 'onset'?" in refusal("onst")


@pytest.mark.slow
def test_off_a_terminal_progress_is_a_line_a_minute_until_it_is_left(monkeypatch, capsys):
    """Also within one long item."""
    monkeypatch.setattr(terminal, "SECONDS_BETWEEN_LINES", 0.02)
    for item in terminal.progress([1, 2, 3], "equilibria", 5, done=2):
        time.sleep(0.5)
        if item == 2:
            break
    lines = capsys.readouterr().err.splitlines()
    assert set(lines) - {"equilibria: 2 of 5"} == {"equilibria: 3 of 5", "equilibria: 4 of 5"}
    time.sleep(0.2)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("command", "change", "code", "says"),
    [
        ("perturb", ("kn = 2e5", "kn = -1.0"), 2, "law.kn = -1.0 is refused: give a number above 0"),
        ("perturb", ("fy = 3.0", "fy = 300.0"), 2, "the packing is not in balance, a disk feels"),
        ("perturb", ("time = 0.5", "time = 0.5\ntime_step = 0.1"), 2, "over the limit 2/omega_max"),
        ("perturb", ("time = 0.5", "time = 1e-9"), 2, "shorter than one step"),
        ("onset", ("", ""), 1, "No pair of eigenvalues is complex up to F_x = 0.004"),
        ("onset", ("[ramp]", "[damping]\ncn = 1.0\n[ramp]"), 1, "No motion grows up to F_x = 0.004"),
        ("onset", ("[ramp]", "[damping]\n[ramp]"), 2, "damping"),
        ("onset --modes 0:10", ("[ramp]", "[damping]\nct = 1.0\n[ramp]"), 2, "--modes goes without [damping]"),
    ],
)
@pytest.mark.slow
def test_a_scene_that_cannot_be_run(refusal, tmp_path, command, change, code, says):
    (tmp_path / "scene.toml").write_text(SCENE.replace(*change))
    assert says in refusal(*command.split(), "scene.toml", code=code)
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


@pytest.mark.parametrize(
    ("command", "code", "says"),
    [
        ("init", 2, "scene.toml exists"),
        ("ramp scene.toml -o ramp.h5", 2, "holds a run of another scene (load.fy is 3.0 there and 3.00001 here)"),
        ("rampp scene.toml", 2, "rampp"),
        ("spectrum no.h5", 2, "no.h5 does not exist"),
        ("spectrum scene.toml", 2, "scene.toml is a scene, and this command reads a stored packing"),
        ("spectrum no.disks", 2, "no.disks cannot be read"),
        ("spectrum ramp.h5 --values --gain", 2, "--values computes nothing but eigenvalues"),
        ("onset scene.toml --modes 600", 2, "as in --modes 0:600"),
        ("onset scene.toml --modes 900:910", 2, "are no part of"),
        ("draw ramp.h5 -o p.bmp", 2, "a .png, a .svg or a .pdf"),
        ("draw ramp.h5 --mode all", 2, "--mode all: give pair, or the number of a mode, from 0"),
        ("draw ramp.h5 --mode 9999", 2, "modes, counted from 0"),
        ("draw ramp.h5 --mode pair --frame 0", 2, "no two of them are about to meet"),
        ("movie ramp.h5 -o film.avi", 2, "a .gif or an .mp4"),
        ("movie perturb.h5 --span 5 6", 2, "its times go from 0 to"),
        ("export ramp.h5 -o packing.pdb", 2, "exports are .vtp, .xyz, .data, .gsd"),
        ("export ramp.h5 -o packing.data --mode pair", 2, "has no room for modes"),
        ("export ramp.h5 --frame 9", 2, "there is no frame 9"),
        ("export ramp.h5 -o nowhere/packing.vtp", 1, "cannot be written"),
        ("export ramp.h5 -o film.pvd", 2, "add --frames all"),
        ("export ramp.h5 -o film.vtp --frames all", 2, "several frames go into .xyz, .gsd, .pvd"),
        ("export ramp.h5 -o film.xyz --frames 3", 2, "give all, START:STOP or START:STOP:STEP"),
        ("export ramp.h5 -o film.xyz --frames 5:9", 2, "has 5 frames, and none of them is meant"),
        ("export ramp.h5 -o film.xyz --frames all --mode pair", 2, "without --frame and --mode"),
    ],
)
@pytest.mark.slow
def test_a_command_that_cannot_be_run(refusal, tmp_path, beyond, command, code, says):
    (tmp_path / "scene.toml").write_text((beyond / "scene.toml").read_text().replace("fy = 3.0", "fy = 3.00001"))
    for name in ("ramp.h5", "perturb.h5"):
        (tmp_path / name).symlink_to(beyond / name)
    assert says in refusal(*command.split(), code=code)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["perturb.h5", "ramp.h5", "scene.toml"]
