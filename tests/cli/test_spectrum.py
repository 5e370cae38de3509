"""The command spectrum: what it says of stored packings, stable or not, drawn by a spring or at Coulomb's bound."""

import json
from dataclasses import replace

import numpy as np
import pytest
from reference_layer import SMALL, toml

from faultgouge import load
from faultgouge.analysis import (
    Contacts,
    MindlinLaw,
    Packing,
    RunFile,
    eigenvalues,
    spectrum,
    stiffness_matrix,
)
from faultgouge.analysis.responses.transient import transient_gains


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
    monkeypatch.setattr("faultgouge.commands.packings.MOST_PAIRS", pairs - 1)
    monkeypatch.setattr("faultgouge.commands.packings.VERDICT_FIRST", 0)
    assert "coordinates: LAPACK needs" in faultgouge_here("spectrum", beyond / "ramp.h5", "--values").stderr
    said = faultgouge_here("spectrum", beyond / "ramp.h5").stdout
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
    monkeypatch.setattr("faultgouge.signal_guard.rank", lambda: 1)
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
