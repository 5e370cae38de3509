"""The load of an undamped run that the onset chooses: beyond one onset, or between two."""

import json
from types import SimpleNamespace

import pytest
from reference_layer import toml

from faultgouge.pywrap import Scene, SceneError
from faultgouge.pywrap.onset import load_at_onset

SECTIONS = {"packing": {"seed": 4, "disks": 40, "width": 7.5}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
SECTIONS |= {"ramp": {"step": 1e-2, "until": 0.05}, "perturb": {"time": 1.0}}
WEAKENING = {"friction": {"v0": 1e-6, "v_ss": 1e-5, "mu_ss": 0.8}}


def onset(fx_c, fx_end=None):
    return SimpleNamespace(fx_c=fx_c, windows=[SimpleNamespace(fx_onset=fx_c, fx_end=fx_end)])


@pytest.mark.parametrize(("fx_end", "fx"), [(None, 0.025), (0.04, 0.025), (0.018, 0.0165)])
def test_a_step_beyond_the_onset_and_within_the_window(fx_end, fx):
    assert load_at_onset(Scene.from_mapping(SECTIONS), {1.0: onset(0.015, fx_end)}) == pytest.approx(fx, rel=1e-12)


def test_between_the_onsets_of_the_weakened_and_of_the_static_friction():
    scene = Scene.from_mapping(SECTIONS | WEAKENING)
    assert load_at_onset(scene, {1.0: onset(0.03), 0.8: onset(0.02)}) == pytest.approx(0.025, rel=1e-12)
    with pytest.raises(SceneError, match=r"no load between two onsets.*Give perturb.fx"):
        load_at_onset(scene, {1.0: onset(0.03), 0.8: onset(0.03)})


@pytest.mark.slow
def test_a_run_without_a_load_starts_beyond_the_onset(faultgouge_here, tmp_path):
    (tmp_path / "scene.toml").write_text(toml(SECTIONS))
    done = faultgouge_here("perturb", "scene.toml", "--json")
    assert "the run starts at F_x = 0.0421" in done.stderr
    found = json.loads(done.stdout)
    # F_x^c of docs/api.md, halfway to the ramp's end, which is nearer than a step
    assert found["fx"] == pytest.approx(0.5 * (0.03423693541 + 0.05), abs=1e-8)
    assert found["predicted_rate"] > 0
    assert found["pairs"] > 0
