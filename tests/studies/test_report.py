"""Error against run time: the pieces that a study is made of, the report's contract, and the quick report."""

import json

import numpy as np
import pytest

from faultgouge.analysis import discrete_frequency, spectrum
from faultgouge.assessment.results import AssessmentError
from faultgouge.assessment.work_precision import run, time_steps
from faultgouge.assessment.work_precision.equilibria import relaxation
from faultgouge.assessment.work_precision.study import Settings
from faultgouge.pywrap import Scene, ramp


@pytest.fixture(scope="module")
def settings():
    scene = Scene.from_toml(run.SCENE)
    return Settings(scene, tuple(ramp(scene)), quick=True, repeats=1)


def test_runs_show_velocity_verlets_growth_rate(settings):
    """As the dispersion of a frozen K foretells at each time step; taken out, the rate is that of K."""
    points = time_steps.growth(settings)["points"]
    values = spectrum(settings.at(0.024).packing).eigenvalues
    value = values[np.argmax(np.abs(np.sqrt(values).imag))]
    for point in points:
        exact, seen = (2 * abs(omega.imag) for omega in (np.sqrt(value), discrete_frequency(value, point["parameter"])))
        expected = abs(seen / exact - 1)
        if point["method"] == time_steps.RUN:
            assert point["error"] == pytest.approx(expected, rel=2e-2)
        else:
            assert point["error"] < min(1e-6, 0.01 * expected)


@pytest.mark.slow
def test_a_study_that_fails_does_not_take_along_the_others_whose_ways_lead_to_one_equilibrium(tmp_path):
    def broken(_):
        raise ValueError("the reason")

    said, studies = [], {"broken": broken, "relaxation": relaxation}
    with pytest.raises(AssessmentError, match=r"1 of 2 studies failed \(broken\)"):
        run.report(tmp_path, True, said.append, studies=studies)
    result = json.loads((tmp_path / "report.json").read_text())
    assert result["failed"] == [{"name": "broken", "says": "ValueError: the reason"}]
    (study,) = result["studies"]
    assert all(set(point) == {"method", "parameter", "error", "seconds", "evaluations"} for point in study["points"])
    for method, least in (("Newton", 1e-12), ("Verlet with drag", 1e-12), ("overdamped", 1e-9)):
        errors = [point["error"] for point in study["points"] if point["method"] == method]
        assert errors[-1] < least < errors[0]
        assert errors == sorted(errors, reverse=True)
    assert {"cpu", "cores", "load", "versions"} <= set(result["machine"])
    assert "the reason" in (tmp_path / "report.md").read_text()
    assert len(said) == 2


@pytest.mark.long
def test_quick_report(faultgouge, tmp_path):
    faultgouge("report", "--quick", "-o", "report")
    folder = tmp_path / "report"
    studies = {study["name"]: study for study in json.loads((folder / "report.json").read_text())["studies"]}
    assert list(studies) == list(run.STUDIES)
    orders = [order for study in studies.values() for order in study["orders"]]
    assert len(orders) == 3
    for order in orders:
        assert order["order"] == pytest.approx(order["expected"], abs=0.05)
    best = {}
    for name, study in studies.items():
        assert study["reference_error"] > 0
        assert all(point["error"] >= 0 and point["seconds"] > 0 for point in study["points"])
        for point in study["points"]:
            key = name, point["method"]
            best[key] = min(point["error"], best.get(key, np.inf))
    for name in map(run.stem, studies):
        assert (folder / f"{name}.png").stat().st_size > 10_000
    assert "F_x^c = 0.02183305641" in studies["onset"]["question"]  # that of an independent code
    assert best["onset", "root of the discriminant"] < 1e-8 < best["onset", "scan, Newton"]
    assert best["relaxation", "Newton, compensated"] < 1e-18
    assert best["relaxation", "Newton"] < 1e-12
