"""Ensembles: what is counted, what is kept, and that nothing is dropped."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from faultgouge.pywrap import Scene, SceneError
from faultgouge.studies import ensemble as study
from faultgouge.studies.ensemble import Eruption, Member, RampEnd
from faultgouge.studies.onsets import onset_run

BIN = Path(sys.executable).parent

SCENE = {
    "packing": {"disks": 30, "top": 5, "width": 6.0, "seed": 2},
    "law": {"kn": 2e5, "mu": [1.0, 0.8]},
    "load": {"fy": 3.0},
    "ramp": {"step": 5e-3, "until": 0.025},
    "perturb": {"fx": 0.0, "time": 0.5, "amplitude": 5e-10, "omega": 0.01},
    "friction": {"v_ss": "10 v0"},
}


@pytest.fixture
def scene():
    return Scene.from_mapping(SCENE)


def silent(_):
    pass


def ramps(strong, weak):
    return RampEnd(1.0, *strong), RampEnd(0.8, *weak)


def eruption(rise):
    """A rise over 1e-23, after a jump to 1e-14 that the control shows as well."""
    return Eruption(
        fx=0.015,
        fx_control=0.005,
        rate=1.0,
        unperturbed=1e-25,
        perturbed=1e-23,
        weakening=1e-23 * 10**rise,
        control=1e-14,
        jump=1e-14,
    )


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [
        # Newcombe, Statistics in Medicine 17, 857 (1998), table I, method 3
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_interval(count, of, low, high):
    found = study.share(count, of)
    assert found["share"] == count / of
    # four digits are printed there
    assert (found["low"], found["high"]) == pytest.approx((low, high), abs=5e-5)


def test_share_of_nothing_is_unknown():
    assert study.share(0, 0) == {"count": 0, "of": 0, "share": None, "low": None, "high": None}


@pytest.mark.parametrize(
    ("strong", "weak", "expected"),
    [
        (("onset", 0.02), ("onset", 0.01), True),
        (("onset", 0.01), ("onset", 0.02), False),
        (("until", 0.03), ("onset", 0.02), True),
        (("flows", 0.01), ("onset", 0.02), None),
        (("onset", 0.02), ("until", 0.03), False),
        (("onset", 0.02), ("flows", 0.01), None),
        (("until", 0.03), ("until", 0.03), None),
    ],
)
def test_what_is_known_of_censored_onsets(strong, weak, expected):
    assert study.lowers(*ramps(strong, weak)) is expected


def test_quartiles_count_packings_without_onset():
    found = [RampEnd(1.0, "onset", fx) for fx in (0.04, 0.01, 0.03, 0.02)]
    assert study.quartiles(found) == [0.01, 0.02, 0.03]
    lost = [RampEnd(1.0, "until", 0.05)] * 3
    assert study.quartiles(found + lost) == [0.02, 0.04, None]
    assert study.quartiles(lost) == [None, None, None]
    # of two that are left when one flows at 0.015, the next onset takes half of the share that remains: 1/4 + 3/8
    early = [RampEnd(1.0, *end) for end in (("onset", 0.01), ("flows", 0.015), ("onset", 0.02), ("until", 0.05))]
    np.testing.assert_allclose(study.distribution(early), [[0.01, 0.02], [0.25, 0.625]])


def test_first_onset_is_that_of_the_whole_ramp(scene):
    end, path = study.first_onset(scene, 1.0)
    whole = onset_run(scene, 1.0)
    assert (end.ends, end.fx_c) == ("onset", pytest.approx(whole.onset.fx_c, rel=1e-9))
    assert end.error < 1e-9
    assert path[-1].fx - scene.ramp.step <= end.reach <= path[-1].fx


def test_an_ensemble_goes_on_where_it_was_cut_off(scene, tmp_path, monkeypatch):
    first = study.ensemble(scene, 1, tmp_path, silent)
    lines = tmp_path / "ensemble.jsonl"
    whole = lines.read_text()
    lines.write_text(whole + whole[:50])  # a crash in the middle of a line

    examined = []

    def examine(scene, seed):
        examined.append(seed)
        return Member(seed, says="not examined")

    monkeypatch.setattr(study, "examine", examine)
    said = []
    second = study.ensemble(scene, 2, tmp_path, said.append)
    assert examined == [3]
    assert said[0].startswith("1 of 2 packings are in")
    assert lines.read_text().startswith(whole)
    assert [json.loads(line)["seed"] for line in lines.read_text().splitlines()] == [2, 3]
    assert (first["seeds"], second["seeds"]) == ([2], [2, 3])
    assert first["onsets"] == second["onsets"]  # what failed adds nothing to them
    assert json.loads((tmp_path / "ensemble.json").read_text()) == second

    study.ensemble(scene.model_copy(update={"load": scene.load.model_copy(update={"fy": 2.0})}), 1, tmp_path, silent)
    assert examined == [3, 2], "another scene's lines are none of this one"


def test_a_member_that_fails_is_counted(scene, tmp_path):
    full = scene.model_copy(update={"packing": scene.packing.model_copy(update={"width": 1.0})})
    said = []
    result = study.ensemble(full, 2, tmp_path, said.append)
    assert [each["seed"] for each in result["failed"]] == [2, 3]
    assert "width" in result["failed"][0]["says"]
    assert result["onsets"] == []
    assert "2 packings, of which 2 failed" in said
    assert any(line.startswith("seed 2: failed: ") for line in said)


def test_what_was_found_before_a_failure_is_kept(scene, monkeypatch):
    def fail(*_):
        raise RuntimeError("no eruption today")

    monkeypatch.setattr(study, "first_onset", lambda scene, mu: (RampEnd(mu, "onset", 0.01 * mu), ()))
    monkeypatch.setattr(study, "_eruption", fail)
    member = study.examine(scene, 3)
    assert member.ramps == ramps(("onset", 0.01), ("onset", 0.008))
    assert member.lowered is True
    assert member.says == "no eruption today"
    assert "failed: " in study.sentence(member)


def test_eruptions_are_counted(scene):
    eruptions = [eruption(rise) for rise in (0.0, 6.0, 11.0, 12.0)]
    ends = ramps(("onset", 0.02), ("onset", 0.01))
    members = [Member(seed, ends, True, each) for seed, each in enumerate(eruptions)]
    members += [Member(8, ramps(("onset", 0.01), ("onset", 0.02)), False), Member(9, says="did not settle")]
    result = study.summary(scene, members)
    assert {name: (each["count"], each["of"]) for name, each in result["rises"].items()} == {"5": (3, 4), "10": (2, 4)}
    assert [each["count"] for each in result["control_rises"].values()] == [4, 0]
    assert (result["grows"]["count"], result["grows"]["of"]) == (2, 4)
    assert (result["lowered"]["count"], result["lowered"]["of"]) == (4, 5)
    assert result["rise_quartiles"] == pytest.approx([4.5, 8.5, 11.25])
    assert [each["seed"] for each in result["failed"]] == [9]
    assert Member.from_dict(json.loads(json.dumps(study.asdict(members[0])))) == members[0]


def test_figure_shows_pairs_and_rises():
    members = [
        Member(1, ramps(("onset", 0.02), ("onset", 0.01)), True, eruption(11.0)),
        Member(2, ramps(("onset", 0.01), ("onset", 0.02)), False),
        Member(3, ramps(("until", 0.03), ("onset", 0.02)), True),
        Member(4, ramps(("until", 0.03), ("until", 0.03))),
    ]
    onsets, pairs, rises = study.ensemble_figure(members).axes
    assert [line.get_label() for line in onsets.lines[::2]] == [r"$\mu = 1$", r"$\mu = 0.8$"]
    drawn = [(*line.get_xydata()[0], line.get_marker()) for line in pairs.lines[:3]]
    assert drawn == [(0.02, 0.01, "o"), (0.01, 0.02, "o"), (0.03, 0.02, ">")]
    assert pairs.get_xlabel() == r"$F_x^c(\mu = 1)$"
    assert sum(bar.get_height() for bar in rises.patches) == 2  # the packing and its control
    assert [line.get_markerfacecolor() for line in pairs.lines[:3]] == ["C0", "none", "none"]
    assert len(study.ensemble_figure([]).axes) == 3


def test_stored_packings_make_no_ensemble(tmp_path):
    reference = Path(__file__).parents[1] / "reference" / "packing7.json"
    stored = Scene.from_mapping(SCENE | {"packing": {"file": str(reference)}})
    with pytest.raises(SceneError, match="stored one"):
        study.ensemble(stored, 2, tmp_path, silent)


def test_ranks_share_the_packings(tmp_path):
    toml = """
    [packing]
    disks = 30
    top = 5
    width = 6.0
    seed = 3
    [law]
    kn = 2e5
    mu = [1.0, 0.8]
    [load]
    fy = 3.0
    [ramp]
    step = 5e-3
    until = 1e-2
    """
    (tmp_path / "scene.toml").write_text(toml)
    command = [BIN / "faultgouge", "reproduce", "scene.toml", "--ensemble", "2", "-o"]
    for name, before in (("one", []), ("shared", [BIN / "mpiexec", "-n", "2"])):
        done = subprocess.run(
            [*before, *command, name], cwd=tmp_path, capture_output=True, text=True, timeout=120, env=os.environ
        )
        assert done.returncode == 0, done.stderr
    one, shared = (json.loads((tmp_path / name / "ensemble.json").read_text()) for name in ("one", "shared"))
    one.pop("seconds_per_packing"), shared.pop("seconds_per_packing")
    assert one == shared
    assert one["seeds"] == [3, 4]
    for ending in ("png", "svg"):
        assert (tmp_path / "shared" / f"ensemble.{ending}").stat().st_size > 0
