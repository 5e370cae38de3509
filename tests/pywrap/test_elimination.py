"""The order of elimination: a permutation, and one with little fill."""

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from faultgouge.analysis import stiffness_matrix
from faultgouge.pywrap.elimination import elimination_order
from faultgouge.pywrap.newton_matrix import sparse_solution
from faultgouge.studies.stability_cases.packings import crystal


@pytest.fixture(scope="module")
def packing():
    return crystal(60, 60)


def fill(matrix, order):
    options = {"permc_spec": order, "diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}}
    return splu(csc_array(matrix), **options).nnz


def test_order_is_a_permutation_that_keeps_disks_together(packing):
    coordinates = np.flatnonzero(np.arange(3 * len(packing)) % 7)  # some are no unknowns
    order = elimination_order(packing, coordinates)
    assert np.array_equal(np.sort(order), np.arange(len(coordinates)))
    disks = coordinates[order] % len(packing)
    assert np.count_nonzero(np.diff(disks)) == len(packing) - 1


def test_fill_is_no_more_than_that_of_minimum_degree_on_the_matrix(packing):
    matrix = stiffness_matrix(packing)
    order = elimination_order(packing, np.arange(3 * len(packing)))
    # on a crystal, where entries vanish by symmetry, it is little more than half
    assert fill(matrix[order][:, order], "NATURAL") < 0.7 * fill(matrix, "MMD_AT_PLUS_A")


def test_newton_step_solves(packing):
    force = np.random.default_rng(2).standard_normal(3 * len(packing))
    step = sparse_solution(packing)(force)
    # 1e-13 of the diagonal is added to K, which has a condition number of some 1e4
    np.testing.assert_allclose(stiffness_matrix(packing) @ step, force, atol=1e-9)
