"""Newton's matrix of large packings: the order of elimination, its fill, and solutions with factors from nearby."""

import numpy as np
import pytest
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


def test_fill_is_no_more_than_that_of_minimum_degree_on_the_matrix(packing, matrix, pairs):
    order = elimination_order(*pairs, len(packing), np.arange(3 * len(packing)))
    options = {"diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}}
    ours = splu(csc_array(matrix[order][:, order]), permc_spec="NATURAL", **options)
    # on a crystal, where entries vanish by symmetry, it is little more than half
    assert ours.nnz < 0.7 * splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A", **options).nnz


def scaled(matrix, scale):
    other = csr_array((matrix * scale).T * scale)
    other.eliminate_zeros()
    return other


def far_from_symmetric(matrix):
    upper = triu(matrix, k=1)
    return csr_array(matrix + 3 * (upper - upper.T))


def some_disks_changed(matrix):
    """Other stiffnesses of some disks, and none of another one."""
    scale = np.ones((3, matrix.shape[0] // 3))
    scale[:, [17, 2100]] = 3.0
    scale[:, 1234] = 0.0
    return scaled(matrix, scale.ravel())


def half_of_the_disks_softer_by_far(matrix):
    return scaled(matrix, np.tile(10.0 ** np.random.default_rng(4).uniform(-3, 0, matrix.shape[0] // 3), 3))


@pytest.mark.parametrize(
    ("other", "own", "accurate"),
    [
        (far_from_symmetric, True, 1e-8),
        (some_disks_changed, False, ACCURATE),
        pytest.param(half_of_the_disks_softer_by_far, True, ACCURATE, marks=pytest.mark.slow),
    ],
)
def test_factors_of_a_matrix_nearby_solve_as_long_as_they_serve(matrix, pairs, other, own, accurate):
    """Factors of its own are those of the symmetric part, and, where these do not serve either, of the matrix."""
    force = np.random.default_rng(3).standard_normal(matrix.shape[0])
    first = SparseSolver(matrix, *pairs)
    # friction makes K of sheared packings nonsymmetric; this one is at rest, and GMRES has nothing to do
    assert np.abs(matrix @ first.solve(force) - force).max() < 1e-10  # a condition number of some 1e4
    changed = other(matrix)
    solver = SparseSolver(changed, *pairs, first)
    step = solver.solve(force)
    assert (first.own, solver.own) == (True, own)
    held = changed.diagonal() != 0
    assert not step[~held].any()
    assert np.linalg.norm((changed @ step - force)[held]) <= accurate * np.linalg.norm(force)


def test_singular_matrix_has_no_solution():
    floating = coo_array(([1.0, -1.0, -1.0, 1.0], ([0, 0, 1, 1], [0, 1, 0, 1])), shape=(6, 6)).tocsr()
    assert SparseSolver(floating, np.array([0]), np.array([1])).solve(np.ones(6)) is None
