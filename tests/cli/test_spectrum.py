"""The command spectrum: what it says of stored packings, stable or not, drawn by a spring or at Coulomb's bound."""

import json
from dataclasses import replace

import numpy as np
import pytest
from reference_layer import SMALL, store, toml

from faultgouge import load
from faultgouge.analysis import Contacts, MindlinLaw, Packing, eigenvalues, spectrum, stiffness_matrix
from faultgouge.analysis.responses.transient import transient_gains


@pytest.fixture
def spectrum_of(faultgouge_here, tmp_path):
    """What the command prints of a packing, or of a file, in words and as JSON."""

    def run(packing, *more, name="run.h5"):
        if isinstance(packing, Packing):
            store(tmp_path / name, packing)
        words = ("spectrum", name if isinstance(packing, Packing) else packing, *more)
        return faultgouge_here(*words).stdout, json.loads(faultgouge_here(*words, "--json").stdout)

    return run


@pytest.mark.slow
def test_spectrum_of_a_run_file_is_that_of_the_packing_and_says_how_far_it_moves(
    spectrum_of, faultgouge_here, tmp_path
):
    (tmp_path / "scene.toml").write_text(toml(SMALL | {"ramp": {"step": 1e-2, "until": 1e-2}}))
    faultgouge_here("ramp", "scene.toml")
    packing = load(tmp_path / "run.h5")
    (said, printed), (lines, fast) = (spectrum_of("run.h5", more) for more in ("--gain", "--values"))
    for found, values in ((printed, spectrum(packing).eigenvalues), (fast, eigenvalues(packing))):
        assert found["eigenvalues"] == [[value.real, value.imag] for value in values.tolist()]
        assert found["rattlers"] == packing.rattlers.tolist()
    assert [float(word) for word in lines.splitlines()[0].split()] == fast["eigenvalues"][0]
    gain, (displacement, energy) = printed["transient_gain"], transient_gains(packing)
    assert (gain["displacement"], gain["time"], gain["energy"]) == (displacement.gain, displacement.time, energy.gain)
    assert f"a displacement from rest grows by up to {displacement.gain:.6g} times in its square" in said
    assert said.startswith("stable: no motion grows\n")
    assert printed["stability"]["stable"] is printed["stable"] is True


@pytest.mark.slow
def test_spectrum_of_a_large_packing(spectrum_of, beyond, monkeypatch):
    pairs = spectrum_of(beyond / "ramp.h5")[1]["pair_count"]
    monkeypatch.setattr("faultgouge.commands.packings.MOST_PAIRS", pairs - 1)
    monkeypatch.setattr("faultgouge.commands.packings.VERDICT_FIRST", 0)
    said, _ = spectrum_of(beyond / "ramp.h5")
    assert said.count("D grows as") == pairs - 1
    assert f"and 1 more: --json has all {pairs}" in said


@pytest.mark.parametrize("spring", [20.0, "rigid"])
def test_a_driven_packing_has_its_spring_in_command_and_python_alike(spectrum_of, tmp_path, reference_packing, spring):
    packing = reference_packing(1.0)
    drive = {"spring": spring, "velocity": 1e-3, "until": 1.0}
    about = {"task": "drive", "scene": json.dumps({"drive": drive})}
    store(tmp_path / "drive.h5", packing, about=about, time=0.0)
    _, told = spectrum_of("drive.h5")
    drawn = load(tmp_path / "drive.h5")
    assert told["spring"] == drawn.spring == drawn.configuration.spring == (0.0 if spring == "rigid" else spring)
    found = spectrum(drawn)
    assert [complex(*each) for each in told["eigenvalues"]] == found.eigenvalues.tolist()
    assert np.array_equal(spectrum(packing).eigenvalues, found.eigenvalues) is (spring == "rigid")
    difference = stiffness_matrix(drawn) - stiffness_matrix(drawn.configuration)
    assert abs(difference).max() < 1e-9 * abs(stiffness_matrix(drawn)).max()


def test_one_rank_alone_prints_the_spectrum(spectrum_of, faultgouge_here, reference_packing, monkeypatch):
    spectrum_of(reference_packing(1.0))
    monkeypatch.setattr("faultgouge.signal_guard.rank", lambda: 1)
    for more in ((), ("--json",), ("--values",)):
        assert faultgouge_here("spectrum", "run.h5", *more).stdout == ""


@pytest.mark.parametrize("history", ["coulomb", "total"])
def test_spectrum_says_what_contacts_at_the_bound_do(spectrum_of, faultgouge_here, tmp_path, history):
    """With the standard law, whose contacts slide on or stick there; the smoothed law has one derivative."""
    law = {"kn": 2e5, "mu": 0.4, "history": history}
    (tmp_path / "scene.toml").write_text(toml(SMALL | {"law": law, "ramp": {"step": 5e-2, "until": 0.6}}))
    faultgouge_here("ramp", "scene.toml")
    packing = load(tmp_path / "run.h5")
    said, _ = spectrum_of("run.h5")
    bound, standard = int(packing.sliding.sum()), history == "coulomb"
    sentence = f"{bound} of {len(packing.contacts)} contacts are at Coulomb's bound: each slides on ahead"
    assert (sentence in said) is (standard and bound > 0)
    assert ("neither of two linear motions decides" in said) is standard
    assert (spectrum(packing).is_stable is None) is standard
    assert bound > 0 or not standard


LAW = MindlinLaw(2e5, 2e5 * 2 / 7, 1.0)
OVERLAP = (3.0 / 2e5) ** (2 / 3)
STANDS = Packing(
    position=[[2.0, 0.5 - OVERLAP], [2.0, 1.5 - 2 * OVERLAP]], radius=[0.5, 0.5], top=[False, True],
    contacts=Contacts([0, 0], [-1, 1], [0, 0]), law=LAW, box_length=4.0, fy=3.0,
)  # fmt: skip
"""Two disks on top of each other, in balance and pressed together too far."""
FLOOR = {"top": [True, True], "contacts": Contacts([0, 1], [-1, -1], [0, 0])}
BESIDE = replace(STANDS, position=[[1.0, 0.5 - OVERLAP], [3.0, 0.5 - OVERLAP]], **FLOOR)
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
    spectrum_of, faultgouge_here, packing, stable, first, says
):
    said, printed = spectrum_of(packing)
    assert printed["stable"] is stable
    assert said.split(":")[0] == first
    assert says in said
    if stable is False:
        assert printed["negative"][0] == pytest.approx(-1.5025124716, rel=1e-9)
        done = faultgouge_here("spectrum", "run.h5", "--gain", "--json")
        assert json.loads(done.stdout)["transient_gain"] is None
        assert "no gain: the packing is unstable" in done.stderr
