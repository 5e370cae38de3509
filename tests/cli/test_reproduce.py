"""The main job, on the reference packing: what it leaves behind, and that its numbers are those of physics."""

import json

import pytest
from reference_layer import LAYER, UNITS, toml

from faultgouge.analysis import RunFile
from faultgouge.pywrap import Scene
from faultgouge.pywrap.scenes.units import real_units

SECTIONS = {
    "ramp": {"step": 1e-3, "until": 0.024},
    "perturb": {"fx": 0.0205, "time": 40.0, "amplitude": 1e-9, "omega": 0.01},
    "friction": {"v_ss": "10 v0"},
}
SCENE = LAYER.replace("kn = 2e5", "kn = 2e5\nmu = [1.0, 0.8]") + toml(SECTIONS) + UNITS

FIGURES = ("figure1", "figure2", "figure3", "figure4", "figure5a", "figure5b")


def is_complete(path):
    with RunFile(path) as file:
        return file.complete


@pytest.mark.long
def test_reproduce(faultgouge, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    faultgouge("reproduce", "scene.toml", "-o", "results")
    results = tmp_path / "results"
    for name in FIGURES:
        for suffix in (".png", ".svg"):
            assert (results / (name + suffix)).stat().st_size > 5_000
    assert {is_complete(path) for path in results.rglob("*.h5")} == {True}
    report = (results / "report.md").read_text()
    for assumption in ("side boundaries", "upper layer", "inertia", "time step", "f_min", "settling"):
        assert assumption in report

    summary = json.loads((results / "summary.json").read_text())
    first, second = summary["ramps"]
    assert first["onset"]["fx_c"] == pytest.approx(0.0218330564080, rel=1e-9)
    assert second["onset"]["fx_c"] == pytest.approx(0.0191432059561, rel=1e-9)
    # the rate over at least six decades, within 1 % of the spectrum's
    assert summary["growth"]["measured"]["decades"] > 6
    assert abs(summary["growth"]["deviation"]) < 0.01
    triggering = summary["triggering"]
    assert triggering["linear_response_deviation"] < 0.01
    assert triggering["amplitude_exponent"] == pytest.approx(-0.5, abs=0.02)
    assert triggering["distances"][1] / triggering["distances"][0] > 1e3
    # 40 time units are enough for friction to weaken and the equilibrium to jump; growth takes longer
    assert triggering["rise_in_decades"] > 7
    assert triggering["jump"] > 1e6 * triggering["largest_D"]["perturbed"]
    assert triggering["verdict"] != "grows"
    assert triggering["largest_D_of_the_control"] > 0
    assert triggering["smallest_mu"] == pytest.approx(0.8, abs=1e-6)
    perturbed = faultgouge("perturb", "scene.toml")
    assert f"v0 = {triggering['v0']:.3g} (" in perturbed.stdout + perturbed.stderr

    rows = {cells[1].strip(): cells[3].strip() for line in report.splitlines() if len(cells := line.split("|")) == 5}
    real = real_units(Scene.from_toml(tmp_path / "scene.toml"))
    assert rows["F_x^c for mu = 1, a shear stress"].startswith(f"{1e-6 * real.stress(first['onset']['fx_c']):.4g} MPa")
    assert rows["dashpot C_N of the restitution"] == "0.9 at 1 m/s"
    assert rows["amplitude of the wave, as ground velocity"] == f"{real.ground_velocity(1e-9, 0.01, 'layer'):.3g} m/s"
