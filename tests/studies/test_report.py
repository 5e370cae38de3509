"""Error against run time: the pieces that a study is made of, the report's contract, and the quick report."""

import json

import mpmath
import numpy as np
import pytest

from faultgouge.analysis import discrete_frequency, spectrum
from faultgouge.assessment import work_precision as page
from faultgouge.assessment.work_precision.methods import dumps, relaxation
from faultgouge.assessment.work_precision.methods.extended import refine_eigenvalue
from faultgouge.assessment.work_precision.methods.growth import FastestMode, correct_dispersion, rate_of
from faultgouge.assessment.work_precision.methods.work_precision_study import Settings, compensate
from faultgouge.pywrap import Engine, Scene, ramp


@pytest.fixture(scope="module")
def settings():
    scene = Scene.from_toml(page.SCENE)
    return Settings(scene, tuple(ramp(scene)), quick=True, repeats=1)


def test_refined_eigenvalue_has_the_digits_it_says():
    matrix = np.random.default_rng(3).standard_normal((8, 8))
    values, vectors = np.linalg.eig(matrix)
    with mpmath.workdps(40):
        exact = mpmath.eig(mpmath.matrix(matrix.tolist()))[0]
        for value, vector in zip(values, vectors.T, strict=True):
            found = refine_eigenvalue(matrix, complex(value), vector.astype(complex), condition=3.0)
            # a long double is the sum of two doubles
            high = complex(found.value)
            number = mpmath.mpc(high) + mpmath.mpc(complex(found.value - np.clongdouble(high)))
            assert min(abs(number - each) for each in exact) < found.error
            assert found.error < 1e3 * np.finfo(np.longdouble).eps


@pytest.mark.slow
def test_all_ways_lead_to_one_equilibrium_and_a_relaxations_time_step_is_its_own(settings):
    start, end = settings.at(relaxation.FROM), settings.at(relaxation.TO).packing
    step = 0.9 * 2 / spectrum(end).omega_max
    with Engine(start.packing) as engine:
        increment = relaxation.Increment(engine, start, end)
        for way, least in (
            (lambda: increment.verlet(step, 10.0, 1000), 1e-12),
            (lambda: increment.newton(None), 1e-12),
            (lambda: increment.relax_overdamped(None, 1e-8), 1e-9),
        ):
            packing, evaluations = way()
            assert increment.distance(packing) < least < increment.distance(start.packing)
            assert evaluations > 0
        steps = [increment.relax_overdamped(time_step, 1e-4)[1] for time_step in (None, 4e-5, None)]
    assert steps[0] == steps[2] > steps[1]


def test_runs_show_velocity_verlets_growth_rate(settings):
    mode, least = FastestMode.of(compensate(settings.at(0.024)).packing), 1e-6
    dt = 0.4 * mode.limit
    with Engine(mode.packing) as engine:
        found = mode.measure_frequency(engine, dt, 3.0)
    predicted = rate_of(complex(discrete_frequency(mode.eigenvalue, dt)))
    assert rate_of(found) == pytest.approx(predicted, rel=least)
    assert abs(rate_of(found) / mode.exact - 1) > 10 * least
    assert rate_of(correct_dispersion(found, dt)) == pytest.approx(mode.exact, rel=least)


@pytest.mark.slow
def test_a_study_that_fails_does_not_take_the_others_along(tmp_path):
    def broken(_):
        raise ValueError("the reason")

    said = []
    with pytest.raises(page.ReportError, match=r"1 of 2 studies failed \(broken\)"):
        page.report(tmp_path, True, said.append, studies={"broken": broken, "files": dumps.dumps})
    result = json.loads((tmp_path / "report.json").read_text())
    assert result["failed"] == [{"name": "broken", "says": "ValueError: the reason"}]
    (study,) = result["studies"]
    assert all(set(point) == {"method", "parameter", "error", "seconds", "evaluations"} for point in study["points"])
    errors = {(point["method"], point["parameter"]): point["error"] for point in study["points"]}
    assert errors[dumps.HDF5, None] == errors[dumps.TEXT, 17] == 0
    assert 1e-6 < errors[dumps.SINGLE, None] < 1e-2
    assert errors[dumps.NO_SLIPS, None] > 1e-5
    assert {"cpu", "cores", "load", "versions"} <= set(result["machine"])
    assert "the reason" in (tmp_path / "report.md").read_text()
    assert len(said) == 2


@pytest.mark.long
def test_quick_report(faultgouge, tmp_path):
    faultgouge("report", "--quick", "-o", "report")
    folder = tmp_path / "report"
    studies = {study["name"]: study for study in json.loads((folder / "report.json").read_text())["studies"]}
    assert list(studies) == list(page.STUDIES)
    orders = [order for study in studies.values() for order in study["orders"]]
    assert len(orders) == 4
    for order in orders:
        assert order["order"] == pytest.approx(order["expected"], abs=0.05)
    best = {}
    for name, study in studies.items():
        assert study["reference_error"] > 0
        assert all(point["error"] >= 0 and point["seconds"] > 0 for point in study["points"])
        for point in study["points"]:
            key = name, point["method"]
            best[key] = min(point["error"], best.get(key, np.inf))
    for name in map(page.stem, studies):
        assert (folder / f"{name}.png").stat().st_size > 10_000
    onset = studies["onset"]
    assert all(case["true"] <= case["stated"] for case in onset["covered"])
    assert "covers the true one in 4 of 4 cases" in (folder / "report.md").read_text()
    assert "F_x^c = 0.02183305641" in onset["question"]  # that of an independent code
    assert best["onset", "root of the discriminant"] < 1e-8 < best["onset", "scan, Newton"]
    assert best["relaxation", "Newton, compensated"] < 1e-18
    assert best["relaxation", "Newton"] < 1e-12
    # the rounding of the smallest overlap, and the smallest of truncation and rounding
    assert best["Jacobian", "analytic"] < 5e-12 < best["Jacobian", "central differences in LAMMPS"] < 1e-5
    assert best["Jacobian", "complex step"] < 5e-12
    assert best["Jacobian", "analytic, paper's form"] > 1e-7
