"""The reference packing against the numbers of an independent code."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from faultgouge.analysis import Contacts, find_onset, spectrum, stiffness_matrix
from faultgouge.assessment.extremes.packings import at_rest
from faultgouge.pywrap import Engine, NoEquilibriumError, Scene, equilibrate
from faultgouge.pywrap.equilibria.newton_matrix import factor_stiffness
from faultgouge.pywrap.equilibria.quasistatic import rounding_floor
from faultgouge.pywrap.lammps.trial_state import Trial
from faultgouge.pywrap.runs.scene_path import next_equilibrium, scene_path

FX = 0.01


def scene(step, **method):
    ramp = {"step": step, "until": FX, **method}
    return Scene.from_mapping({"packing": {}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": ramp})


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize("increment", [1e-3, 2.5e-4])
def test_newton_ramp(reference, climbed, number, increment):
    case = reference["cases"][number]
    reached = climbed(FX, increment, case["mu"])
    packing = reached[-1].packing
    counts = len(packing.contacts), packing.contacts.floor.sum(), len(packing.rattlers)
    assert counts == (case["contacts"], case["floor_contacts"], case["rattlers"])
    matrix = stiffness_matrix(packing).toarray()
    eigenvalues = spectrum(packing).eigenvalues.real
    assert np.trace(matrix) == pytest.approx(case["trace_K"], rel=1e-9)
    assert np.linalg.norm(matrix) == pytest.approx(case["fro_K"], rel=1e-9)
    # The asymmetry is 0.2 % of K, all of it from slips, whose path is resolved to second order in the increment: ten
    # times the reference's increment squared and it is felt.
    known = 1e-9 if increment == case["increment"] else 5e-9
    assert np.linalg.norm(matrix - matrix.T) == pytest.approx(case["fro_asym"], rel=known)
    assert np.abs(packing.contacts.slip).sum() == pytest.approx(case["slip_sum_abs"], rel=1e-9)
    np.testing.assert_allclose(eigenvalues[::-1][:20], case["eigenvalues_largest_20"], rtol=1e-9)
    # the zero of a frictionless translation is no zero with friction: all eigenvalues are above 1
    np.testing.assert_allclose(eigenvalues[eigenvalues > 1][:10], case["smallest_positive_10"], rtol=1e-9)
    assert np.median([each.evaluations for each in reached]) <= 6
    assert max(each.residual for each in reached) < 1.5 * reached[-1].floor


@pytest.mark.long
@pytest.mark.slow
def test_newton_and_overdamped_dynamics_agree(reference_packing, climbed):
    """With contacts at the bound: on a monotonic ramp they slide one way, whatever the path in a step."""
    packing, relaxed = climbed(FX, 2e-3, 0.05)[-1].packing, at_rest(reference_packing(0.05))
    settings = scene(2e-3, method="overdamped", force_tolerance=1e-10)
    with Engine(relaxed.packing) as engine:
        for k in range(1, 6):
            relaxed = next_equilibrium(engine, relaxed, k * 2e-3, settings)
    overdamped = relaxed.packing
    # the limit is taken at the overlap as Python rounds it
    at_bound = np.abs(packing.contacts.slip) > (1 - 1e-9) * packing.law.slip_limit(packing.geometry.overlap)
    assert at_bound.any()
    # Late in a relaxation a step is shorter than the last place of a coordinate: positions stand and slips still creep.
    # Each increment adds about 1e-11 to the difference by that; the tolerance of 1e-10 over the softest mode as much.
    assert np.abs(packing.position - overdamped.position).max() < 1e-10
    np.testing.assert_allclose(packing.contacts.slip, overdamped.contacts.slip, rtol=0, atol=2e-10)


def test_newton_is_quadratic(reference_packing):
    """Residuals of the iteration over the largest increment, 1e-2: each is below the square of the one before."""
    packing = reference_packing(1.0)
    displacement, residuals = np.zeros(300), []
    with Engine(packing) as engine:
        engine.set_fx(1e-2)
        for _ in range(5):
            trial = engine.try_displacement(packing, displacement)
            residuals.append(trial.residual)
            assert trial.floor == pytest.approx(rounding_floor(trial.packing), rel=1e-12)
            displacement += factor_stiffness(trial, trial.floor).solver.solve(trial.force)
    assert residuals[0] == pytest.approx(replace(packing, fx=1e-2).residual, rel=1e-6)
    falling = [r for r in residuals if r > 1e-9]
    assert len(falling) == 3
    assert all(after < before**1.5 for before, after in pairwise(falling))
    assert residuals[-1] < 1.5 * rounding_floor(packing)


def test_packing_that_flows_says_where(reference_packing):
    state = at_rest(reference_packing(0.1))
    says = r"no equilibrium was found beyond F_x = 0\.\d+"
    with Engine(state.packing) as engine, pytest.raises(NoEquilibriumError, match=says):  # noqa: PT012, the climb's end
        for k in range(1, 40):
            state = equilibrate(engine, state, 0.05 * k)
    assert 0.05 < state.fx < 1.0


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.slow
def test_onset(reference, reference_packing, number):
    case, increment = reference["cases"][number], 1e-3
    packing = reference_packing(case["mu"])
    with Engine(packing) as engine:
        path = scene_path(engine, at_rest(packing), scene(increment))
        onset = find_onset(path, increment * np.arange(round(case["onset_fx"] / increment) + 3))
    assert onset.fx_c == pytest.approx(case["onset_fx"], rel=1e-9)
    assert abs(onset.fx_c - case["onset_fx"]) < 3 * onset.error
    assert onset.windows[0].kind == "coalescence"


def test_rattler_on_which_a_contact_slides_is_not_thrown(reference_packing):
    """Nothing holds it across the contact, along which friction drags it."""
    bed, near = reference_packing(1.0), 0
    rattler, place, c = bed.rattlers[0], bed.position.copy(), bed.contacts
    overlap = 5e-10  # of a contact that carries little more than the rounding of coordinates
    place[rattler] = place[near] + np.array([0.0, bed.radius[rattler] + bed.radius[near] - overlap])
    slip = np.append(np.zeros(len(c)), bed.law.slip_limit(overlap))
    packing = replace(bed, position=place, contacts=Contacts(np.append(c.i, near), np.append(c.j, rattler), slip))
    force = np.concatenate([1e-3 * packing.top, np.zeros(2 * len(packing))])
    step = factor_stiffness(Trial.of(packing), rounding_floor(packing)).solver.solve(force).reshape(3, -1)
    # what moves the rattler is its neighbour; with K alone it would go as far
    assert np.abs(step[:, rattler]).max() < 0.1 * np.abs(step[:, near]).max()
