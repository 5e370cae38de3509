r"""Error against run time: the pieces that a study is made of, the report's contract, and the quick report.

`verlet` is a readable version in NumPy of the motion that the pair style integrates. A step moves the disks by
:math:`\mathbf v\,\Delta t` with the velocities of the half step, advances each slip by

.. math:: \Delta s = \boldsymbol\tau \cdot \Delta(\mathbf r_i - \mathbf r_j) - (\Delta u_i + \Delta u_j)

and clamps it. While a contact turns by :math:`\Delta\varphi` and is compressed by :math:`\Delta\delta`, the tangent at
the end of the step errs by :math:`\tfrac12 \Delta\varphi\, \Delta\delta` in each step, and so by the first order of
:math:`\Delta t` in a given time; the tangent at the middle by the second order.
"""

import json

import numpy as np
import pytest

from faultgouge.analysis import discrete_frequency, spectrum
from faultgouge.assessment.results import AssessmentError
from faultgouge.assessment.work_precision import run, time_steps
from faultgouge.assessment.work_precision.equilibria import relaxation
from faultgouge.assessment.work_precision.study import Settings
from faultgouge.pywrap import Engine, Scene, ramp


def verlet(packing, steps):
    """(x, y, u) of the disks after `TIME` from rest, shape (3, N), length; no contact may form or open."""
    i, j, pair, dt = packing.contacts.i, packing.contacts.j, ~packing.contacts.floor, time_steps.TIME / steps
    mass = packing.mass * np.array([[1.0], [1.0], [packing.inertia_factor]])
    velocity = np.zeros_like(mass)
    for _ in range(steps):
        velocity += 0.5 * dt / mass * packing.net_force.reshape(mass.shape)
        step = dt * velocity
        moved, turned = step[:2, i] - step[:2, j] * pair, step[2, i] + step[2, j] * pair
        position, angle = packing.position + step[:2].T, packing.angle + step[2] / packing.radius
        there = packing.moved(position, angle, packing.contacts)
        middle = packing.moved(position - 0.5 * step[:2].T, angle, packing.contacts)
        slip = packing.contacts.slip + np.sum(middle.geometry.tangent.T * moved, axis=0) - turned
        clamped = packing.law.clamped(there.geometry.overlap, slip)
        packing = packing.moved(position, angle, packing.contacts.slipped(clamped))
        velocity += 0.5 * dt / mass * packing.net_force.reshape(mass.shape)
    return np.array([*packing.position.T, packing.scaled_angle])


def test_lammps_integrates_the_equations_of_the_readable_version():
    """To some roundings of a coordinate after 200 and 400 steps in which all contacts slide and two stick again."""
    packing = time_steps.three_disks()
    for steps in (200, 400):
        with Engine(packing) as engine, engine.undamped(time_steps.TIME / steps) as dynamics:
            dynamics.advance(steps)
            end = engine.packing
        found, expected = np.array([*end.position.T, end.scaled_angle]), verlet(packing, steps)
        assert np.abs(found - expected).max() < 1e-14
    assert np.abs(found - verlet(packing, 100)).max() > 1e-5


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


@pytest.mark.long
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
    assert "the reason" in (tmp_path / "report.md").read_text()
    assert len(said) == 2


@pytest.mark.long
def test_quick_report(faultgouge, tmp_path):
    faultgouge("report", "--quick", "-o", "report")
    studies = {study["name"]: study for study in json.loads((tmp_path / "report/report.json").read_text())["studies"]}
    assert list(studies) == list(run.STUDIES)
    orders = [order for study in studies.values() for order in study["orders"]]
    assert len(orders) == 2
    assert all(order["order"] == pytest.approx(order["expected"], abs=0.05) for order in orders)
    best = {}
    for name, study in studies.items():
        assert study["reference_error"] > 0
        assert all(point["error"] >= 0 and point["seconds"] > 0 for point in study["points"])
        assert (tmp_path / "report" / f"{run.stem(name)}.png").stat().st_size > 10_000
        for point in study["points"]:
            key = name, point["method"]
            best[key] = min(point["error"], best.get(key, np.inf))
    assert "F_x^c = 0.02183305641" in studies["onset"]["question"]  # that of an independent code
    assert best["onset", "root of the discriminant"] < 1e-8 < best["onset", "scan, Newton"]
    assert best["relaxation", "Newton, compensated"] < 1e-18
    assert best["relaxation", "Newton"] < 1e-12
