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
}


@pytest.mark.slow
def test_onset_states_no_digits_of_zero(faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(toml(UNSTABLE | {"law": {"kn": 2e5, "mu": 0.5}}))
    said = faultgouge_here("onset", "scene.toml", "-o", "onset.json").stdout
    found = json.loads((tmp_path / "onset.json").read_text())
    pairs = found["unstable_at_start"]["pairs"]
    assert f"mu = 0.5: unstable at F_x = 0, before any shear is added: {pairs} complex pairs; in the fastest " in said
    assert len(said.splitlines()) == 2  # the last one names the law
    assert (found["fx_c"], found["error"]) == (0.0, 0.0)


@pytest.mark.long
def test_all_windows_of_each_friction_coefficient_are_where_its_ramp_has_complex_pairs(faultgouge_here, tmp_path):
    """As many windows hold a load as LAPACK finds pairs in the equilibrium there; those of the start begin at zero."""
    (tmp_path / "scene.toml").write_text(toml(UNSTABLE))
    found = json.loads(faultgouge_here("onset", "scene.toml", "--all", "--json").stdout)["each_mu"]
    assert [each["mu"] for each in found] == UNSTABLE["law"]["mu"]
    for each in found:
        windows, scene = each["windows"], Scene.from_mapping(UNSTABLE | {"law": {"kn": 2e5, "mu": each["mu"]}})
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
    scene = Scene.from_mapping(UNSTABLE)
    found = triggering.row(scene, lambda mu: settle(scene, mu))
    assert [(each["ends"], each["reach"]) for each in found["ramps"]] == [("onset", 0.0)] * 2
    assert found["lowered"] is None
    assert "both packings are unstable" in "\n".join(in_words(summary_of_rows([{"result": found, "says": None}])))
