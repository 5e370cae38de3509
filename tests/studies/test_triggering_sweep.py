"""The protocol on one packing, another that is triggered, and sweeps of many, of which nothing is dropped."""

import json

import numpy as np
import pytest
from reference_layer import SMALL, toml

from faultgouge.analysis import RunFile
from faultgouge.pywrap import NoEquilibriumError, Scene, settle
from faultgouge.pywrap.onset import onset_run
from faultgouge.studies import triggering
from faultgouge.studies.reproduce import reproduce
from faultgouge.studies.statistics import distribution, quartiles, share, sign_test
from faultgouge.studies.triggering import in_words, summary_of_rows

PERTURBED = {"perturb": {"time": 1.0, "amplitude": 5e-10, "omega": 0.01}, "friction": {"v_ss": "10 v0"}}
SCENE = SMALL | PERTURBED | {"packing": SMALL["packing"] | {"seed": 2}, "law": {"kn": 2e5, "mu": [1.0, 0.8]}}


def end(ends, reach, mu=1.0):
    return {"mu": mu, "ends": ends, "reach": reach, "error": None}


def row(strong, weak, lowered=None, rise=None):
    """A row of the sweep; runs with a rise over 1e-23, after a jump to 1e-14 that the control shows as well."""
    result = {"ramps": [end(*strong), end(*weak, mu=0.8)], "lowered": lowered, "eruption": None}
    if rise is not None:
        largest = {"unperturbed": 1e-25, "perturbed": 1e-23, "weakening": 1e-23 * 10**rise, "control": 1e-14}
        verdict = "grows" if rise > 10 else "jump alone"
        result["eruption"] = largest | {"rate": 1.0, "verdict": verdict, "perturbation_shows": rise > 0}
    return {"result": result, "says": None}


EARLY, LATE, BEYOND, FLOWS = ("onset", 0.01), ("onset", 0.02), ("until", 0.03), ("flows", 0.01)
ROWS = [row(LATE, EARLY, True, rise) for rise in (0, 6, 11, 12)]
ROWS += [
    row(EARLY, LATE, False),
    row(BEYOND, LATE, True),
    row(BEYOND, BEYOND),
    {"result": {}, "says": "did not settle"},
]


def test_wilson_interval():
    """Newcombe, Statistics in Medicine 17, 857 (1998), table I, method 3, which has four digits."""
    for count, of, low, high in ((81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611)):
        found = share(count, of)
        assert found["share"] == count / of
        assert (found["low"], found["high"]) == pytest.approx((low, high), abs=5e-5)
    assert share(0, 0) == {"count": 0, "of": 0, "share": None, "low": None, "high": None}


def test_what_is_known_of_censored_onsets():
    """Two packings that are unstable before any shear do not tell whether the onset is lower."""
    start = ("onset", 0.0)
    pairs = [(LATE, EARLY), (EARLY, LATE), (BEYOND, LATE), (FLOWS, LATE), (LATE, FLOWS)]
    pairs += [(start, start), (EARLY, start), (start, EARLY)]
    told = [sign_test(end(*strong), end(*weak)) for strong, weak in pairs]
    assert told == [True, False, True, None, None, None, True, False]


def of_ends(function, *ends):
    return function([reach for _, reach in ends], [kind == "onset" for kind, _ in ends])


def test_quartiles_count_packings_without_onset():
    found, lost = [("onset", fx) for fx in (0.04, 0.01, 0.03, 0.02)], [("until", 0.05)] * 3
    assert of_ends(quartiles, *found) == [0.01, 0.02, 0.03]
    assert of_ends(quartiles, *found, *lost) == [0.02, 0.04, None]
    assert of_ends(quartiles, *lost) == [None, None, None]
    # of two that are left when one flows at 0.015, the next onset takes half of the share that remains: 1/4 + 3/8
    early = of_ends(distribution, EARLY, ("flows", 0.015), LATE, ("until", 0.05))
    np.testing.assert_allclose(early, [[0.01, 0.02], [0.25, 0.625]])


def test_what_was_found_before_a_failure_is_kept_and_first_onsets_are_those_of_whole_ramps(monkeypatch):
    def fail(*_):
        raise NoEquilibriumError("no eruption today")

    scene = Scene.from_mapping(SCENE)
    monkeypatch.setattr(triggering, "eruption", fail)
    result = triggering.triggering.row(scene, lambda mu: settle(scene, mu))
    assert (result["lowered"], result["says"]) == (True, "no eruption today")
    for found in result["ramps"]:
        assert (found["ends"], found["reach"]) == ("onset", pytest.approx(onset_run(scene, found["mu"]).fx_c, rel=1e-9))
        assert found["error"] < 1e-9


def test_eruptions_are_counted():
    result = summary_of_rows(ROWS)
    counts = {
        name: (each["count"], each["of"]) for name, each in result.items() if isinstance(each, dict) and "of" in each
    }
    assert counts["lowered"] == (5, 6)
    assert (counts["grows"], counts["perturbation_shows"]) == ((2, 4), (3, 4))
    assert {name: (each["count"], each["of"]) for name, each in result["rises"].items()} == {"5": (3, 4), "10": (2, 4)}
    assert [each["count"] for each in result["control_rises"].values()] == [4, 0]
    assert result["lowered_unknown"] == 1
    assert result["rise_quartiles"] == pytest.approx([4.5, 8.5, 11.25])
    assert [(each["found"]["count"], each["none_until"]) for each in result["onsets"]] == [(5, 2), (6, 1)]
    words = "\n".join(in_words(result))
    assert "mu = 1: an onset in 5 of 7 (71 %, 95 % interval 36 to 92 %)" in words
    assert "weakening friction lowers the onset in 5 of 6" in words


@pytest.mark.long
def test_shards_merge_into_the_summary_of_the_whole(faultgouge_here, tmp_path):
    scene = SMALL | {"law": SCENE["law"], "ramp": {"step": 5e-3, "until": 1e-2}}
    text = 'task = "triggering"\n[sweep]\n"packing.seed" = "3:4"\n' + toml(scene, "scene.")
    (tmp_path / "sweep.toml").write_text(text)
    said = [faultgouge_here("sweep", "sweep.toml", "--workers", "1", "-o", "whole").stdout]
    for part in ("1", "2"):
        faultgouge_here("sweep", "sweep.toml", "--workers", "1", "--shard", f"{part}/2", "-o", part)
    said.append(faultgouge_here("merge", "1", "2", "-o", "merged").stdout)
    one, other = (json.loads((tmp_path / name / "summary.json").read_text()) for name in ("whole", "merged"))
    assert one == other
    assert [each["mu"] for each in one["onsets"]] == [1.0, 0.8]
    assert all(f"mu = 1: an onset in {one['onsets'][0]['found']['count']} of 2" in each for each in said)


@pytest.mark.long
def test_another_packing_may_be_the_one_that_is_triggered(tmp_path):
    """Its onsets, runs and scene are in files and in the summary of their own, and the report says so."""
    ramp = {"packing": {"disks": 30, "seed": 4}, "ramp": {"step": 4e-3, "until": 0.012}}
    perturb = PERTURBED["perturb"] | {"fx": 0.011}
    scene, triggered = (Scene.from_mapping(SMALL | ramp | more) for more in ({}, PERTURBED | {"perturb": perturb}))
    summary = reproduce(scene, tmp_path, say=lambda _: None, triggered=triggered)
    found = summary["triggering"]
    assert (found["scene"], found["fx"]) == (triggered.resolved(), 0.011)
    assert found["onsets"][0]["onset"] == summary["ramps"][0]["onset"]
    with RunFile(tmp_path / "triggered.h5") as file:
        assert file.series("erupting")["msd"].max() == found["largest_D"]["erupting"]
    assert "The packing that is triggered" in (tmp_path / "report.md").read_text()
