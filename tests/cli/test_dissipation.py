"""Commands on scenes with [damping], and what spectrum says of transient growth."""

import json

import pytest
from reference_layer import LAYER, REFERENCE

from faultgouge.analysis import RunFile
from faultgouge.analysis.motion.transient import transient_gain

SCENE = f"""{LAYER}
[ramp]
step = 1e-3
until = 4e-3
"""


@pytest.fixture(autouse=True)
def _scene(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)


@pytest.mark.slow
@pytest.mark.long
def test_spectrum_says_how_far_a_stable_packing_moves(faultgouge, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace(f'file = "{REFERENCE}"', "disks = 30\nseed = 4"))
    faultgouge("ramp", "scene.toml")
    printed = json.loads(faultgouge("spectrum", "run.h5", "--json").stdout)["transient_gain"]
    with RunFile(tmp_path / "run.h5") as file:
        packing = file.packing()
    displacement, energy = transient_gain(packing), transient_gain(packing, "energy")
    assert printed["displacement"] == displacement.gain > 1
    assert printed["time"] == displacement.time
    assert printed["energy"] == energy.gain > 1
    said = faultgouge("spectrum", "run.h5").stdout
    assert f"a start at rest grows by up to {displacement.gain:.6g} times in |q|^2" in said
    assert f"{energy.gain:.6g} in energy" in said


@pytest.mark.slow
def test_onset_with_dissipation_as_json(faultgouge, tmp_path):
    """All modes at four loads; no contact changes on the way, and the onset hangs on the increment by 2e-11."""
    scene = SCENE.replace("until = 4e-3", "until = 0.022").replace("step = 1e-3", "step = 5.5e-3")
    scene += "[damping]\ncn = 1.0\n"
    (tmp_path / "scene.toml").write_text(scene)
    done = faultgouge("onset", "scene.toml", "-o", "onset.json", "--json")
    result = json.loads(done.stdout)
    assert json.loads((tmp_path / "onset.json").read_text()) == result
    assert "searched_to" not in result
    assert result["fx_c"] == pytest.approx(0.0218328368, abs=1e-10)
    assert result["undamped"]["fx_c"] == pytest.approx(0.0218330564080, rel=1e-9)
    window = result["windows"][0]
    assert window.keys() == {"fx_onset", "fx_end", "frequency", "error", "error_of_path", "kind"}
    assert 0 < window["error_of_path"] <= window["error"]
    assert (window["kind"], window["fx_end"]) == ("hopf", None)
    assert window["frequency"] == pytest.approx(45.367, abs=1e-3)


@pytest.mark.parametrize(
    ("more", "arguments", "code", "says"),
    [
        ("", (), 1, "No pair of eigenvalues is complex up to F_x = 0.004"),
        ("[damping]\ncn = 1.0", (), 1, "No motion grows up to F_x = 0.004"),
        ("[damping]", (), 2, "damping"),
        ("[damping]\nct = 1.0", ("--modes", "0:10"), 2, "--modes goes without [damping]"),
    ],
)
@pytest.mark.slow
def test_what_there_is_no_onset_of(faultgouge_here, tmp_path, more, arguments, code, says):
    (tmp_path / "scene.toml").write_text(SCENE + more)
    done = faultgouge_here("onset", "scene.toml", *arguments, code=code)
    assert says in done.stderr
    assert done.stdout == ""
