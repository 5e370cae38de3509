"""The command onset: what it prints and writes of one friction coefficient or several, and what it refuses."""

import json

import pytest
from reference_layer import LAYER, SMALL, toml

LAYERED = LAYER + toml({"ramp": {"step": 5.5e-3, "until": 0.022}})
SECOND = SMALL | {"packing": SMALL["packing"] | {"seed": 2}, "ramp": {"step": 5e-3, "until": 0.015}}
ONSET = 0.0218330564080
"""Of the reference packing."""


@pytest.mark.slow
def test_results_go_to_standard_output_and_progress_to_standard_error(faultgouge, faultgouge_here, tmp_path):
    """As two pipes of a shell see those of `onset`; the onset of the reference packing is the first of its windows."""
    (tmp_path / "scene.toml").write_text(LAYERED)
    first = faultgouge("onset", "scene.toml")
    assert first.stdout.startswith("mu = 1: F_x^c = 0.02183305")
    assert "two eigenvalues merge there" in first.stdout
    assert first.stderr == ""
    head, *_, law = first.stdout.splitlines()
    assert law == 'law of friction: the paper\'s smoothed law (history = "total")'
    table = faultgouge_here("onset", "scene.toml", "--all", "-o", "onset.json").stdout.splitlines()
    windows = json.loads((tmp_path / "onset.json").read_text())["windows"]
    assert (table[0], table[1].split()[:2], table[-1]) == (head, ["from", "F_x"], law)
    assert len(table) == 2 + len(windows) + 1
    assert windows[0]["fx_onset"] == pytest.approx(ONSET, rel=1e-9)
    assert windows == sorted(windows, key=lambda window: window["fx_onset"])


@pytest.mark.parametrize("damping", [{}, {"damping": {"cn": 1.0}}])
def test_all_windows_are_refused_where_the_first_alone_would_come(refusal, tmp_path, damping):
    """Before any work: no file, and no packing that settles."""
    (tmp_path / "scene.toml").write_text(toml(SMALL | {"packing": {"disks": 301, "width": 8.0}} | damping))
    said = refusal("onset", "scene.toml", "--all", "-o", "onset.json")
    assert "--all finds all windows of up to 300 disks, and the packing has 301: leave --all out" in said
    assert not (tmp_path / "onset.json").exists()


@pytest.mark.slow
def test_onset_names_the_friction_coefficients_without_one(faultgouge_here, tmp_path):
    """Those that follow are searched, too; a scene of which none has an onset ends with the exit code 1."""
    for name, mus in (("scene", [1.0, 0.3, 0.8]), ("none", [1.0, 0.8])):
        (tmp_path / f"{name}.toml").write_text(toml(SECOND | {"law": {"kn": 2e5, "mu": mus}}))
    said = faultgouge_here("onset", "scene.toml", "-o", "onset.json").stdout.splitlines()
    none = "no onset: No pair of eigenvalues is complex up to F_x = 0.015: raise ramp.until."
    assert said[0] == f"mu = 1: {none}"
    assert said[1].startswith("mu = 0.3: F_x^c = 0.01394557")
    assert said[-2] == f"mu = 0.8: {none}"
    assert said[-1].startswith("law of friction: ")
    found = json.loads((tmp_path / "onset.json").read_text())
    assert found["fx_c"] == pytest.approx(0.01394557065, abs=1e-10)
    assert [each["fx_c"] for each in found["each_mu"]] == [None, found["fx_c"], None]
    done = faultgouge_here("onset", "none.toml", code=1)
    assert "None of the 2 friction coefficients has an onset on this ramp." in done.stderr
    assert [line.split(":")[0] for line in done.stdout.splitlines()] == ["mu = 1", "mu = 0.8"]


def test_the_undamped_onset_of_a_ramp_on_which_the_dissipation_stops_all_growth(faultgouge_here, tmp_path):
    damped = {"ramp": {"step": 7e-3, "until": 0.014}, "law": {"kn": 2e5, "mu": 0.3}, "damping": {"cn": 500.0}}
    (tmp_path / "scene.toml").write_text(toml(SECOND | damped))
    done = faultgouge_here("onset", "scene.toml", "--json", code=1)
    result = json.loads(done.stdout)
    assert (result["fx_c"], result["windows"]) == (None, [])
    assert result["undamped"]["fx_c"] == pytest.approx(0.01394557, abs=1e-7)
    assert result["undamped"]["error"] > 0
    assert "Error: No motion grows up to F_x = 0.014: raise ramp.until." in done.stderr


@pytest.mark.slow
def test_onset_with_dissipation_as_json(faultgouge_here, tmp_path):
    """All modes at four loads; no contact changes on the way, and the onset hangs on the increment by 2e-11."""
    (tmp_path / "scene.toml").write_text(LAYERED + toml({"damping": {"cn": 1}}))
    result = json.loads(faultgouge_here("onset", "scene.toml", "-o", "onset.json", "--json").stdout)
    assert json.loads((tmp_path / "onset.json").read_text()) == result
    assert result["fx_c"] == pytest.approx(0.0218328368, abs=1e-10)
    assert result["undamped"]["fx_c"] == pytest.approx(ONSET, rel=1e-9)
    window = result["windows"][0]
    assert window.keys() == {"fx_onset", "fx_end", "frequency", "error", "error_of_path", "kind"}
    assert 0 < window["error_of_path"] <= window["error"]
    assert (window["kind"], window["fx_end"]) == ("hopf", None)
    assert window["frequency"] == pytest.approx(45.367, abs=1e-3)
