"""Newton's matrix: a band, which solves as K does, with and without what carries nothing.

Of large packings: the order of elimination, its fill, and solutions.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import coo_array, csc_array, csr_array, triu
from scipy.sparse.linalg import splu

from faultgouge.analysis import MindlinLaw, stiffness_matrix
from faultgouge.analysis.factors.linear_solver import SparseSolver, elimination_order
from faultgouge.assessment.extremes.packings import crystal
from faultgouge.pywrap import Engine
from faultgouge.pywrap.equilibria.newton_matrix import FLOATING_SHARE, factor_stiffness
from faultgouge.pywrap.lammps.contact_graph import ContactGraph
from faultgouge.pywrap.lammps.trial_state import Trial


@pytest.fixture(params=["friction", "smooth", "compensated", "open"])
def packing(reference_packing, request):
    """With slips of which some are beyond the bound."""
    packing, rng = reference_packing(1.0), np.random.default_rng(3)
    limit = packing.law.slip_limit(packing.geometry.overlap)
    contacts, low = (
        packing.contacts.slipped(1.2 * limit * rng.uniform(-1, 1, len(limit))),
        rng.standard_normal((100, 2)),
    )
    changes = {"smooth": {"law": MindlinLaw(2e5, 0.0, 0.0)}, "compensated": {"position_low": 1e-18 * low}}
    changes |= {"friction": {}, "open": {"box_length": None}}
    # with open sides without those that met across the box
    return replace(packing, contacts=contacts, **changes[request.param]).loaded(0.0)


def test_solution(packing):
    force = np.random.default_rng(4).standard_normal(3 * len(packing))
    trial = Trial.of(packing)
    step, matrix = factor_stiffness(trial, 0.0).solver.solve(force), stiffness_matrix(packing).toarray()
    active = np.diag(matrix) != 0
    assert trial.graph.band(active).width < np.count_nonzero(active) / 4
    matrix[np.diag_indices(len(matrix))] *= 1 + FLOATING_SHARE
    assert not step[~active].any()
    left = (matrix @ step - force)[active]
    assert np.abs(left).max() < 1e-10 * np.abs(matrix).max() * np.abs(step).max()


def test_contacts_below_the_floor_are_left_out(reference_packing):
    packing = reference_packing(1.0)
    least, force = float(np.sort(packing.normal_force)[2]), np.random.default_rng(5).standard_normal(300)
    fewer = packing.loaded(least)
    found, expected = factor_stiffness(Trial.of(packing), least), factor_stiffness(Trial.of(fewer), 0.0)
    step = found.solver.solve(force)
    assert_allclose(step, expected.solver.solve(force), rtol=1e-6, atol=1e-9 * np.abs(step).max())
    count = ContactGraph(fewer.contacts, fewer.radius).per_disk(np.ones(len(fewer.contacts)))
    assert np.array_equal(found.expelled, (count == 1) & ~packing.top)


def test_contact_that_closes_on_the_way_has_no_slip(reference_packing):
    """A change of forces from changed displacements, and back: with what K knows of new contacts, and without."""
    base, rng = reference_packing(1.0), np.random.default_rng(3)
    displacement, change = 1e-4 * rng.standard_normal(300), np.zeros((3, 100))
    with Engine(base) as engine:
        trial = engine.try_displacement(base, displacement)
        since = engine.trial_of(base).graph
        change[:, trial.graph.i[~trial.graph.old(since)][0]] = 1e-7 * rng.standard_normal(3)
        change = change.ravel()
        forces = [engine.try_displacement(base, displacement + sign * change).force for sign in (1, -1)]
    softening = (forces[1] - forces[0]) / 2
    errors = [
        1e7 * np.abs(factor_stiffness(trial, trial.floor, start).solver.solve(softening) - change).max()
        for start in (since, None)
    ]
    # a hundredth of the stiffness is left
    assert errors[0] < 0.03 < 0.3 < errors[1]


@pytest.fixture(scope="module")
def large():
    """A packing, its K, and its pairs of disks."""
    packing = crystal(60, 60)
    c = packing.contacts
    return packing, stiffness_matrix(packing), (c.i[~c.floor], c.j[~c.floor])


def test_fill_is_no_more_than_that_of_minimum_degree_on_the_matrix(large):
    packing, matrix, pairs = large
    order = elimination_order(*pairs, len(packing), np.arange(3 * len(packing)))
    options = {"diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}}
    ours = splu(csc_array(matrix[order][:, order]), permc_spec="NATURAL", **options)
    # on a crystal, where entries vanish by symmetry, it is little more than half
    assert ours.nnz < 0.7 * splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", **options).nnz


@pytest.mark.parametrize(("asymmetry", "some", "another"), [(0.0, 1.0, 1.0), (3.0, 1.0, 1.0), (0.0, 3.0, 0.0)])
def test_a_large_matrix_is_solved_on_the_coordinates_that_have_a_stiffness(large, asymmetry, some, another):
    """As it is, far from symmetric, or with other stiffnesses of some disks and none of another one."""
    _, matrix, pairs = large
    upper, scale = triu(matrix, k=1), np.ones((3, matrix.shape[0] // 3))
    scale[:, [17, 2100]], scale[:, 1234] = some, another
    changed = csr_array(((matrix + asymmetry * (upper - upper.T)) * scale.ravel()).T * scale.ravel()).T.tocsr()
    changed.eliminate_zeros()
    force = np.random.default_rng(3).standard_normal(matrix.shape[0])
    step, held = SparseSolver(changed, *pairs).solve(force), changed.diagonal() != 0
    assert not step[~held].any()
    # a condition number of some 1e4
    assert np.linalg.norm((changed @ step - force)[held]) <= 1e-10 * np.linalg.norm(force)


def test_singular_matrix_has_no_solution():
    floating = coo_array(([1.0, -1.0, -1.0, 1.0], ([0, 0, 1, 1], [0, 1, 0, 1])), shape=(6, 6)).tocsr()
    assert SparseSolver(floating, np.array([0]), np.array([1])).solve(np.ones(6)) is None
