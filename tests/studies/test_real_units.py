"""What commands say in SI: the numbers of the scene, times the units that tests/pywrap/test_units.py works out."""

import json

import pytest
from reference_layer import SMALL, UNITS, toml

from faultgouge.analysis import RunFile
from faultgouge.pywrap import Scene, SceneError
from faultgouge.pywrap.scenes.units import real_units
from faultgouge.studies.reproduce import reproduce

SECTIONS = SMALL | {
    "packing": {"disks": 30, "seed": 4},
    "ramp": {"step": 4e-3, "until": 0.012},
    "perturb": {"fx": 0.011, "time": 1.0, "amplitude": 5e-10, "omega": 0.01},
    "friction": {"v_ss": "10 v0"},
}
SCENE = toml(SECTIONS) + UNITS


@pytest.mark.parametrize("damping", ["", "[damping]\ncn = 1.0\n"])
@pytest.mark.slow
def test_onset_in_si(faultgouge_here, tmp_path, damping):
    (tmp_path / "scene.toml").write_text(SCENE + damping)
    done = faultgouge_here("onset", "scene.toml", "--json")
    found = json.loads(done.stdout)
    real = real_units(Scene.from_toml(tmp_path / "scene.toml"))
    window = found["windows"][0]
    omega = window["frequency"] if damping else window["lambda"] ** 0.5
    assert found["si"][0] == real.onset(found["fx_c"], omega)
    assert found["si"][0]["shear_stress_Pa"] == pytest.approx(found["fx_c"] / 3.0 * real.overburden, rel=1e-12)
    for number in found["si"][0].values():
        assert f"{number:.4g}" in done.stderr


@pytest.mark.long
def test_another_packing_may_be_the_one_that_is_triggered(tmp_path):
    """Its onsets, runs and scene are in files and in the summary of their own, and the report says so.

    Slow because of ten figures.
    """
    triggered = Scene.from_mapping(SECTIONS)
    scene = triggered.model_copy(update={"perturb": None, "friction": None})
    summary = reproduce(scene, tmp_path, say=lambda _: None, triggered=triggered)
    assert summary["triggering"]["scene"] == triggered.resolved()
    assert summary["triggering"]["fx"] == 0.011
    assert summary["triggering"]["onsets"][0]["onset"] == summary["ramps"][0]["onset"]
    with RunFile(tmp_path / "triggered.h5") as file:
        assert file.series("erupting")["msd"].max() == summary["triggering"]["largest_D"]["erupting"]
    assert "The packing that is triggered" in (tmp_path / "report.md").read_text()


@pytest.mark.slow
def test_a_ramp_that_steps_over_the_window_is_refused(tmp_path):
    """It is narrow: from 0.01159 to 0.01217."""
    scene = Scene.from_mapping(SECTIONS | {"ramp": {"step": 1e-2, "until": 0.02}})
    with pytest.raises(SceneError, match="no load of the ramp lies in a window"):
        reproduce(scene, tmp_path / "out", say=id)
