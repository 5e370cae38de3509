"""Newton's matrix of large packings: the order of elimination, its fill, and solutions with factors from nearby."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import coo_array, csc_array, csr_array, triu
from scipy.sparse.linalg import splu

from faultgouge.analysis import stiffness_matrix
from faultgouge.analysis.factors.linear import ACCURATE, SparseSolver, elimination_order
from faultgouge.assessment.stability.cases.packings import crystal


@pytest.fixture(scope="module")
def packing():
    return crystal(60, 60)


@pytest.fixture(scope="module")
def matrix(packing):
    return stiffness_matrix(packing)


@pytest.fixture(scope="module")
def pairs(packing):
    c = packing.contacts
    return c.i[~c.floor], c.j[~c.floor]


@pytest.fixture(scope="module")
def solver(matrix, pairs):
    """With factors of its own: they are made at the first solution."""
    solver = SparseSolver(matrix, *pairs)
    solver.solve(np.ones(matrix.shape[0]))
    return solver


def test_fill_is_no_more_than_that_of_minimum_degree_on_the_matrix(packing, matrix, pairs):
    order = elimination_order(*pairs, len(packing), np.arange(3 * len(packing)))
    options = {"diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}}
    ours = splu(csc_array(matrix[order][:, order]), permc_spec="NATURAL", **options)
    # on a crystal, where entries vanish by symmetry, it is little more than half
    assert ours.nnz < 0.7 * splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", **options).nnz


def test_own_factors_are_those_of_the_symmetric_part(matrix, solver):
    force = np.random.default_rng(2).standard_normal(matrix.shape[0])
    assert solver.own
    # friction makes K of sheared packings nonsymmetric; this one is at rest, and GMRES has nothing to do
    assert_allclose(matrix @ solver.solve(force), force, atol=1e-10)  # a condition number of some 1e4


def test_far_from_symmetric_matrix_is_factored_itself(matrix, pairs):
    upper = triu(matrix, k=1)
    other = csr_array(matrix + 3 * (upper - upper.T))
    force = np.random.default_rng(5).standard_normal(matrix.shape[0])
    step = SparseSolver(other, *pairs).solve(force)
    assert np.linalg.norm(other @ step - force) < 1e-8 * np.linalg.norm(force)


def changed(matrix, disks):
    """K with other stiffnesses of some disks, and without that of the first one."""
    scale = np.ones(matrix.shape[0])
    coordinates = np.add.outer([0, matrix.shape[0] // 3, 2 * matrix.shape[0] // 3], disks)
    scale[coordinates[:, 1:]] = 3.0
    scale[coordinates[:, 0]] = 0.0
    other = (matrix * scale).T.tocsr() * scale
    other.eliminate_zeros()
    return other.tocsr(), coordinates[:, 0]


def test_factors_of_a_matrix_nearby_solve(matrix, pairs, solver):
    other, gone = changed(matrix, [1234, 17, 2100])
    nearby = SparseSolver(other, *pairs, solver)
    force = np.random.default_rng(3).standard_normal(matrix.shape[0])
    step = nearby.solve(force)
    assert not nearby.own
    force[gone] = 0.0
    assert not step[gone].any()
    assert np.linalg.norm(other @ step - force) <= ACCURATE * np.linalg.norm(force)


@pytest.mark.slow
def test_factors_that_do_not_serve_are_replaced(matrix, pairs, solver):
    # half of the disks softer by far: GMRES is not done in time
    rng = np.random.default_rng(4)
    scale = np.tile(10.0 ** rng.uniform(-3, 0, matrix.shape[0] // 3), 3)
    other = ((matrix * scale).T.tocsr() * scale).T.tocsr()
    force = rng.standard_normal(matrix.shape[0])
    step = SparseSolver(other, *pairs, solver).solve(force)
    assert np.linalg.norm(other @ step - force) <= ACCURATE * np.linalg.norm(force)


def test_singular_matrix_has_no_solution():
    floating = coo_array(([1.0, -1.0, -1.0, 1.0], ([0, 0, 1, 1], [0, 1, 0, 1])), shape=(6, 6)).tocsr()
    assert SparseSolver(floating, np.array([0]), np.array([1])).solve(np.ones(6)) is None
