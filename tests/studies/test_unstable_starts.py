"""Packings that settled with friction and are unstable before any shear: every command says so, and infers no more."""

import json

import pytest
from reference_layer import toml

from faultgouge.analysis import spectrum
from faultgouge.pywrap import Scene, ramp, settle
from faultgouge.studies.triggering import in_words, summary_of_rows, triggering

UNSTABLE = {
    "packing": {"disks": 20, "top": 4, "width": 4.9, "seed": 1, "settle_friction": True},
    "law": {"kn": 2e5, "mu": [0.5, 0.4]},
    "load": {"fy": 3.0},
    "ramp": {"step": 0.01, "until": 0.03},
    "perturb": {"fx": 0.0, "time": 1.0, "amplitude": 1e-9, "omega": 0.01},
    "friction": {"v0": 1e-7, "v_ss": "10 v0"},
    "trigger": {"distance": [0.1], "omega": [14.0], "time": 1.0, "runs": 1},
}
BEFORE = "unstable at F_x = 0, before any shear is added"


def pairs_at_rest():
    """Complex pairs at F_x = 0 of either friction coefficient."""
    scene = Scene.from_mapping(UNSTABLE)
    return [len(spectrum(settle(scene, mu).packing).pairs) for mu in scene.law.mus]


@pytest.mark.slow
def test_onset_counts_the_pairs_and_states_no_digits_of_zero(faultgouge_here, tmp_path):
    pairs = pairs_at_rest()
    (tmp_path / "scene.toml").write_text(toml(UNSTABLE | {"law": {"kn": 2e5, "mu": 0.5}}))
    said = faultgouge_here("onset", "scene.toml", "-o", "onset.json").stdout
    assert f"mu = 0.5: {BEFORE}: {pairs[0]} complex pairs; in the fastest motion D grows as exp(" in said
    assert len(said.splitlines()) == 2  # the last one names the law
    found = json.loads((tmp_path / "onset.json").read_text())
    assert (found["fx_c"], found["error"], found["unstable_at_start"]["pairs"]) == (0.0, 0.0, pairs[0])


@pytest.mark.long
def test_all_windows_of_each_friction_coefficient_are_where_its_ramp_has_complex_pairs(faultgouge_here, tmp_path):
    """As many windows hold a load as LAPACK finds pairs in the equilibrium there; those of the start begin at zero."""
    pairs = pairs_at_rest()
    (tmp_path / "scene.toml").write_text(toml(UNSTABLE))
    done = faultgouge_here("onset", "scene.toml", "--all", "--json")
    found = json.loads(done.stdout)["each_mu"]
    assert [each["mu"] for each in found] == UNSTABLE["law"]["mu"]
    for each, count in zip(found, pairs, strict=True):
        windows = each["windows"]
        assert f"mu = {each['mu']}: {BEFORE}: {count} complex pairs" in done.stderr
        assert done.stderr.count("   start") == sum(pairs)
        assert [w["fx_onset"] for w in windows if w["kind"] == "start"] == [0.0] * count
        assert (each["fx_c"], each["unstable_at_start"]["pairs"], each["complete"]) == (0.0, count, True)
        scene = Scene.from_mapping(UNSTABLE | {"law": {"kn": 2e5, "mu": each["mu"]}})
        for state in ramp(scene):
            held = [w for w in windows if w["fx_onset"] <= state.fx and (w["fx_end"] is None or state.fx < w["fx_end"])]
            assert len(held) == len(spectrum(state.packing).pairs)
        assert any(w["kind"] != "start" for w in windows)


@pytest.mark.long
def test_a_sweep_infers_nothing_of_weakening():
    """With mu = 0.4 the sweep finds no equilibrium at the next load, which is no sign of a flow."""
    scene = Scene.from_mapping({name: UNSTABLE[name] for name in ("packing", "law", "load", "ramp")})
    found = triggering.row(scene, lambda mu: settle(scene, mu))
    assert [(each["ends"], each["reach"]) for each in found["ramps"]] == [("onset", 0.0)] * 2
    assert found["lowered"] is None
    assert "both packings are unstable" in "\n".join(in_words(summary_of_rows([{"result": found, "says": None}])))
