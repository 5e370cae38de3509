"""The commands spectrum and stability: what they say of packings, stable or not, drawn by a spring or at Coulomb's
bound, and where a packing that grows ends in LAMMPS; command and Python alike."""

import json
from dataclasses import replace

import numpy as np
import pytest
from reference_layer import SMALL, store, toml

from faultgouge import load, stability
from faultgouge.analysis import Contacts, MindlinLaw, Packing, eigenvalues, spectrum, stiffness_matrix
from faultgouge.analysis.responses.transient import transient_gains


@pytest.fixture
def told(faultgouge_here):
    """What a command prints, in words and as JSON."""

    def run(*words):
        return faultgouge_here(*words).stdout, json.loads(faultgouge_here(*words, "--json").stdout)

    return run


@pytest.mark.slow
def test_spectrum_of_a_run_file_is_that_of_the_packing_and_says_how_far_it_moves(told, faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(toml(SMALL | {"ramp": {"step": 1e-2, "until": 1e-2}}))
    faultgouge_here("ramp", "scene.toml")
    packing = load(tmp_path / "run.h5")
    (said, printed), (lines, fast) = (told("spectrum", "run.h5", more) for more in ("--gain", "--values"))
    for found, values in ((printed, spectrum(packing).eigenvalues), (fast, eigenvalues(packing))):
        assert [complex(*each) for each in found["eigenvalues"]] == values.tolist()
        assert found["rattlers"] == packing.rattlers.tolist()
    assert [float(word) for word in lines.splitlines()[0].split()] == fast["eigenvalues"][0]
    gain, (displacement, energy) = printed["transient_gain"], transient_gains(packing)
    assert (gain["displacement"], gain["time"], gain["energy"]) == (displacement.gain, displacement.time, energy.gain)
    assert f"a displacement from rest grows by up to {displacement.gain:.6g} times in its square" in said
    assert said.startswith("stable: no motion grows\n")
    assert printed["stability"]["stable"] is printed["stable"] is True


@pytest.mark.slow
def test_spectrum_of_a_large_packing(told, beyond, monkeypatch):
    pairs = told("spectrum", beyond / "ramp.h5")[1]["pair_count"]
    monkeypatch.setattr("faultgouge.commands.packings.MOST_PAIRS", pairs - 1)
    monkeypatch.setattr("faultgouge.commands.packings.VERDICT_FIRST", 0)
    said, _ = told("spectrum", beyond / "ramp.h5")
    assert said.count("D grows as") == pairs - 1
    assert f"and 1 more: --json has all {pairs}" in said


@pytest.mark.parametrize("spring", [20.0, "rigid"])
def test_a_driven_packing_has_its_spring_in_command_and_python_alike(told, tmp_path, reference_packing, spring):
    packing = reference_packing(1.0)
    about = {"task": "drive", "scene": json.dumps({"drive": {"spring": spring, "velocity": 1e-3, "until": 1.0}})}
    drawn = load(store(tmp_path / "drive.h5", packing, about=about, time=0.0))
    _, printed = told("spectrum", "drive.h5")
    assert printed["spring"] == drawn.spring == drawn.configuration.spring == (0.0 if spring == "rigid" else spring)
    found = spectrum(drawn)
    assert [complex(*each) for each in printed["eigenvalues"]] == found.eigenvalues.tolist()
    assert np.array_equal(spectrum(packing).eigenvalues, found.eigenvalues) is (spring == "rigid")
    difference = stiffness_matrix(drawn) - stiffness_matrix(drawn.configuration)
    assert abs(difference).max() < 1e-9 * abs(stiffness_matrix(drawn)).max()


def test_one_rank_alone_prints_the_spectrum(faultgouge_here, tmp_path, reference_packing, monkeypatch):
    store(tmp_path / "run.h5", reference_packing(1.0))
    monkeypatch.setattr("faultgouge.signal_guard.rank", lambda: 1)
    for more in ((), ("--json",), ("--values",)):
        assert faultgouge_here("spectrum", "run.h5", *more).stdout == ""


@pytest.mark.parametrize("history", ["coulomb", "total"])
def test_spectrum_says_what_contacts_at_the_bound_do(told, faultgouge_here, tmp_path, history):
    """With the standard law, whose contacts slide on or stick there; the smoothed law has one derivative."""
    law = {"kn": 2e5, "mu": 0.4, "history": history}
    (tmp_path / "scene.toml").write_text(toml(SMALL | {"law": law, "ramp": {"step": 5e-2, "until": 0.6}}))
    faultgouge_here("ramp", "scene.toml")
    packing, said = load(tmp_path / "run.h5"), faultgouge_here("spectrum", "run.h5").stdout
    bound, standard = int(packing.sliding.sum()), history == "coulomb"
    sentence = f"{bound} of {len(packing.contacts)} contacts are at Coulomb's bound: each slides on ahead"
    assert (sentence in said) is (standard and bound > 0)
    assert ("neither of two linear motions decides" in said) is standard
    assert (spectrum(packing).is_stable is None) is standard
    assert bound > 0 or not standard


def column(law, fy):
    """Two disks on top of each other, in balance and pressed together too far."""
    overlap = (fy / law.kn) ** (2 / 3)
    return Packing(
        position=[[2.0, 0.5 - overlap], [2.0, 1.5 - 2 * overlap]], radius=[0.5, 0.5], top=[False, True],
        contacts=Contacts([0, 0], [-1, 1], [0, 0]), law=law, box_length=4.0, fy=fy,
    )  # fmt: skip


STANDS = column(MindlinLaw(2e5, 2e5 * 2 / 7, 1.0), 3.0)
FLOOR = {"top": [True, True], "contacts": Contacts([0, 1], [-1, -1], [0, 0])}
BESIDE = replace(STANDS, position=[[1.0, STANDS.position[0, 1]], [3.0, STANDS.position[0, 1]]], **FLOOR)
MOVES = replace(BESIDE, position=[[1.0, 0.49], [3.0, 0.49]])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("packing", "stable", "first", "says"),
    [
        (STANDS, False, "unstable", "negative eigenvalue -1.50251247"),
        (MOVES, None, "not known whether the packing is stable", "the packing moves: the residual force on a"),
        (BESIDE, True, "stable", "volume fraction"),
    ],
    ids=["buckles", "moves", "side by side"],
)
def test_spectrum_calls_no_packing_stable_that_buckles_or_moves(
    told, faultgouge_here, tmp_path, packing, stable, first, says
):
    store(tmp_path / "run.h5", packing)
    said, printed = told("spectrum", "run.h5")
    assert printed["stable"] is stable
    assert said.split(":")[0] == first
    assert says in said
    if stable is False:
        assert printed["negative"][0] == pytest.approx(-1.5025124716, rel=1e-9)
        done = faultgouge_here("spectrum", "run.h5", "--gain", "--json")
        assert json.loads(done.stdout)["transient_gain"] is None
        assert "no gain: the packing is unstable" in done.stderr


def test_a_column_falls_in_lammps_and_the_verdict_says_so(told, faultgouge_here, tmp_path):
    falls = column(MindlinLaw(2e3, 6e2, 0.5, cn=0.5, ct=0.1, coulomb=True), 2.0)
    stored = store(tmp_path / "run.h5", falls, about={"task": "ramp", "scene": "{}"})
    verdict = stability(stored)
    assert verdict.stable is False
    said, printed = told("stability", stored)
    assert said == f"{verdict}\n"
    assert told("spectrum", stored)[1]["stability"].items() <= printed.items()
    follow = stability(load(stored), follow=True)
    assert (follow.follow["ends"], follow.follow["displacement"] > 0.1, follow.first_change > 0) == (
        "flows",
        True,
        True,
    )
    for command in ("stability", "spectrum"):
        said = faultgouge_here(command, stored, "--follow").stdout
        assert "LAMMPS goes on from there, and flows, at a displacement of" in said
    alone = stability(load(stored).configuration, follow=True)
    assert alone.follow is None
    assert "this packing has no LAMMPS behind it" in alone.remarks[-1]


@pytest.mark.long
def test_without_a_file_stability_is_the_old_name_of_extremes(faultgouge_here, tmp_path):
    done = faultgouge_here("stability", "-o", "cases", "--quick")
    assert "is called faultgouge extremes now" in done.stderr
    assert json.loads((tmp_path / "cases" / "extremes.json").read_text())["cases"]
