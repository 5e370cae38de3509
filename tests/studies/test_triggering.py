"""Runs with weakening friction, the packing that is triggered, and sweeps of many, of which nothing is dropped."""

import json

import numpy as np
import pytest
from reference_layer import SMALL, toml

from faultgouge.analysis import RunFile, spectrum
from faultgouge.pywrap import NoEquilibriumError, Scene, ramp, settle
from faultgouge.pywrap.onset import onset_run
from faultgouge.studies import triggering
from faultgouge.studies.reproduce import reproduce
from faultgouge.studies.statistics import distribution, quartiles, share, sign_test
from faultgouge.studies.triggering import Forecast, in_words, judge, summary_of_rows

V0, LENGTH = 1e-11, 400.0
TIME = np.linspace(0.1, LENGTH, 4000)
NOISE = 1e-24 * (TIME / LENGTH) ** 2
"""Of doubles, whose D grows as a power of the time: 1e-26 at first, 1e-24 in the end."""


def msd_with_jump(height, at, then=0.0):
    """D that jumps at a time, and grows on from a thousandth of its jump at a rate."""
    later = np.maximum(TIME - at, 0.0)
    return NOISE + (at <= TIME) * height * (np.sin(later) ** 2 + 1e-3 * np.exp(then * later))


STABLE, UNSTABLE = Forecast(1.55e-12, 0.0, 1.2, 0.0), Forecast(1e-16, 9.0, 5.0, 0.1)
QUIET = Forecast(1e-16, 0.0, 5.0, 0.0)


@pytest.mark.parametrize(
    ("msd", "crossing", "foreseen", "verdict"),
    [
        # the whole jump, after the first twentieth of the run: no growth over 13.6 decades
        (msd_with_jump(1.5e-12, 265.0), 265.0, STABLE, "jump alone"),
        # nothing but rounding: the first twentieth has a smaller D than the rest
        (NOISE, np.inf, STABLE, "does not weaken"),
        (msd_with_jump(1e-12, 390.0), 390.0, STABLE, "too short"),
        (msd_with_jump(1e-16, 50.0, 0.1), 50.0, UNSTABLE, "grows"),
        (msd_with_jump(1e-16, 50.0, 0.16), 50.0, UNSTABLE, "unexplained"),
        (msd_with_jump(1e-16, 50.0, 0.1), 50.0, QUIET, "unexplained"),
        # beyond the jump of its first moments, but not beyond the one that is foreseen
        (msd_with_jump(1e-16, 50.0, 0.02), 50.0, Forecast(1e-15, 0.1, 1.2, 0.1), "jump alone"),
    ],
    ids=["late jump", "noise", "at the end", "grows", "faster", "nothing grows", "foreseen"],
)
def test_only_growth_at_the_rate_of_the_spectrum_and_beyond_the_jump_is_an_instability(
    msd, crossing, foreseen, verdict
):
    """The layer of the run is fast enough from a time on, or never."""
    run = {"time": TIME, "msd": msd, "layer_velocity": np.where(crossing <= TIME, 2 * V0, 0.5 * V0)}
    assert judge(run, V0, foreseen)["verdict"] == verdict


def test_wilson_interval():
    """Newcombe, Statistics in Medicine 17, 857 (1998), table I, method 3, which has four digits."""
    for count, of, low, high in ((81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611)):
        found = share(count, of)
        assert found["share"] == count / of
        assert (found["low"], found["high"]) == pytest.approx((low, high), abs=5e-5)
    assert share(0, 0) == {"count": 0, "of": 0, "share": None, "low": None, "high": None}


def end(ends, reach, mu=1.0):
    return {"mu": mu, "ends": ends, "reach": reach, "error": None}


EARLY, LATE, BEYOND, FLOWS = ("onset", 0.01), ("onset", 0.02), ("until", 0.03), ("flows", 0.01)


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


def row(strong, weak, lowered=None, rise=None):
    """A row of the sweep; runs with a rise over 1e-23, after a jump to 1e-14 that the control shows as well."""
    result = {"ramps": [end(*strong), end(*weak, mu=0.8)], "lowered": lowered, "eruption": None}
    if rise is not None:
        largest = {"unperturbed": 1e-25, "perturbed": 1e-23, "weakening": 1e-23 * 10**rise, "control": 1e-14}
        verdict = "grows" if rise > 10 else "jump alone"
        result["eruption"] = largest | {"rate": 1.0, "verdict": verdict, "perturbation_shows": rise > 0}
    return {"result": result, "says": None}


def test_eruptions_are_counted():
    rows = [row(LATE, EARLY, True, rise) for rise in (0, 6, 11, 12)]
    rows += [row(EARLY, LATE, False), row(BEYOND, LATE, True), row(BEYOND, BEYOND)]
    result = summary_of_rows([*rows, {"result": {}, "says": "did not settle"}])
    counts = {name: (result[name]["count"], result[name]["of"]) for name in ("lowered", "grows", "perturbation_shows")}
    assert counts == {"lowered": (5, 6), "grows": (2, 4), "perturbation_shows": (3, 4)}
    assert {name: (each["count"], each["of"]) for name, each in result["rises"].items()} == {"5": (3, 4), "10": (2, 4)}
    assert [each["count"] for each in result["control_rises"].values()] == [4, 0]
    assert result["lowered_unknown"] == 1
    assert result["rise_quartiles"] == pytest.approx([4.5, 8.5, 11.25])
    assert [(each["found"]["count"], each["none_until"]) for each in result["onsets"]] == [(5, 2), (6, 1)]
    words = "\n".join(in_words(result))
    assert "mu = 1: an onset in 5 of 7 (71 %, 95 % interval 36 to 92 %)" in words
    assert "weakening friction lowers the onset in 5 of 6" in words


PERTURBED = {"perturb": {"time": 1.0, "amplitude": 5e-10, "omega": 0.01}, "friction": {"v_ss": "10 v0"}}
LAW = {"law": {"kn": 2e5, "mu": [1.0, 0.8]}}


@pytest.mark.long
def test_what_was_found_before_a_failure_is_kept_and_first_onsets_are_those_of_whole_ramps(monkeypatch):
    def fail(*_):
        raise NoEquilibriumError("no eruption today")

    scene = Scene.from_mapping(SMALL | PERTURBED | LAW | {"packing": SMALL["packing"] | {"seed": 2}})
    monkeypatch.setattr(triggering, "eruption", fail)
    result = triggering.triggering.row(scene, lambda mu: settle(scene, mu))
    assert (result["lowered"], result["says"]) == (True, "no eruption today")
    for found in result["ramps"]:
        assert (found["ends"], found["reach"]) == ("onset", pytest.approx(onset_run(scene, found["mu"]).fx_c, rel=1e-9))
        assert found["error"] < 1e-9


@pytest.mark.long
def test_shards_merge_into_the_summary_of_the_whole(faultgouge_here, tmp_path):
    scene = SMALL | LAW | {"ramp": {"step": 5e-3, "until": 1e-2}}
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


UNSTABLE_START = {
    "packing": {"disks": 20, "top": 4, "width": 4.9, "seed": 1, "settle_friction": True},
    "law": {"kn": 2e5, "mu": [0.5, 0.4]},
    "load": {"fy": 3.0},
    "ramp": {"step": 0.01, "until": 0.03},
}
"""It has settled with friction and is unstable before any shear: every command says so, and infers no more."""


@pytest.mark.slow
def test_onset_states_no_digits_of_zero(faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(toml(UNSTABLE_START | {"law": {"kn": 2e5, "mu": 0.5}}))
    said = faultgouge_here("onset", "scene.toml", "-o", "onset.json").stdout
    found = json.loads((tmp_path / "onset.json").read_text())
    pairs = found["unstable_at_start"]["pairs"]
    assert f"mu = 0.5: unstable at F_x = 0, before any shear is added: {pairs} complex pairs; in the fastest " in said
    assert len(said.splitlines()) == 2  # the last one names the law
    assert (found["fx_c"], found["error"]) == (0.0, 0.0)


@pytest.mark.long
def test_all_windows_of_each_friction_coefficient_are_where_its_ramp_has_complex_pairs(faultgouge_here, tmp_path):
    """As many windows hold a load as LAPACK finds pairs in the equilibrium there; those of the start begin at zero."""
    (tmp_path / "scene.toml").write_text(toml(UNSTABLE_START))
    found = json.loads(faultgouge_here("onset", "scene.toml", "--all", "--json").stdout)["each_mu"]
    assert [each["mu"] for each in found] == UNSTABLE_START["law"]["mu"]
    for each in found:
        windows, scene = each["windows"], Scene.from_mapping(UNSTABLE_START | {"law": {"kn": 2e5, "mu": each["mu"]}})
        counts = []
        for state in ramp(scene):
            held = [w for w in windows if w["fx_onset"] <= state.fx and (w["fx_end"] is None or state.fx < w["fx_end"])]
            counts.append(len(spectrum(state.packing).pairs))
            assert len(held) == counts[-1]
        assert [w["fx_onset"] for w in windows if w["kind"] == "start"] == [0.0] * counts[0]
        assert (each["fx_c"], each["unstable_at_start"]["pairs"], each["complete"]) == (0.0, counts[0], True)
        assert any(w["kind"] != "start" for w in windows)


@pytest.mark.long
def test_a_sweep_infers_nothing_of_weakening():
    """With mu = 0.4 the sweep finds no equilibrium at the next load, which is no sign of a flow."""
    scene = Scene.from_mapping(UNSTABLE_START)
    found = triggering.triggering.row(scene, lambda mu: settle(scene, mu))
    assert [(each["ends"], each["reach"]) for each in found["ramps"]] == [("onset", 0.0)] * 2
    assert found["lowered"] is None
    assert "both packings are unstable" in "\n".join(in_words(summary_of_rows([{"result": found, "says": None}])))
