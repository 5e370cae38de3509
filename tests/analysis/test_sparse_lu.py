"""Factors of sparse symmetric matrices: solutions and inertia."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import block_diag, csc_array, diags_array, eye_array, kron
from scipy.sparse.linalg import SuperLU, splu

from faultgouge.analysis.factors import sparse_lu
from faultgouge.analysis.factors.sparse_lu import (
    CompiledFactors,
    SingularMatrixError,
    elimination_places,
    general_lu,
    symmetric_lu,
)


def lattice(side):
    """Three coordinates on every point of a square lattice, coupled at random to those of the next points."""
    line = diags_array([np.ones(side - 1), np.ones(side), np.ones(side - 1)], offsets=[-1, 0, 1])
    pattern = csc_array(kron(kron(line, line), np.ones((3, 3))))
    pattern.data = np.random.default_rng(side).uniform(-1, 1, pattern.nnz)
    return csc_array(pattern + pattern.T)


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("shift", [-20.0, -3.0, 0.1, 4.0, 20.0])
def test_pivots_tell_how_many_eigenvalues_are_negative(shift, ordered):
    matrix = lattice(10)
    factors = symmetric_lu(csc_array(matrix - shift * eye_array(300)), ordered=ordered, symmetric=True)
    assert factors.negative == np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < shift)


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("pivoting", [0.0, 0.01])
@pytest.mark.parametrize("unit", [0.0, 1.0, 1j])
def test_solutions_of_a_matrix_and_its_transpose(unit, pivoting, ordered):
    matrix = csc_array(lattice(12) + diags_array(20 + unit * np.arange(432.0)) + diags_array(np.ones(431), offsets=1))
    right = np.random.default_rng(1).standard_normal((432, 3))
    factors = symmetric_lu(matrix, ordered=ordered, pivoting=pivoting)
    for trans, turned in (("N", matrix), ("T", matrix.T)):
        # of condition 30 or so
        np.testing.assert_allclose(turned @ factors.solve(right + 0 * unit, trans), right, rtol=0, atol=1e-11)


def test_order_of_particles_is_that_of_their_coordinates():
    """Rows of one pattern follow each other, and the factors are as sparse as in an order of all coordinates."""
    matrix = csc_array(lattice(20) + 40 * eye_array(1200))
    mixed = np.random.default_rng(0).permutation(1200)
    shuffled = csc_array(matrix[mixed][:, mixed])
    order = np.argsort(elimination_places(shuffled))
    point = mixed[order] // 3
    assert np.array_equal(point, np.repeat(point[::3], 3))
    how = {"diag_pivot_thresh": 0.0, "relax": 1, "options": {"SymmetricMode": True}}
    ordered = splu(csc_array(shuffled[order][:, order]), permc_spec="NATURAL", **how).nnz
    assert ordered < 1.05 * splu(shuffled, permc_spec="MMD_AT_PLUS_A", **how).nnz  # of larger matrices fewer are left


@pytest.mark.parametrize("seed", range(4))
def test_order_of_a_matrix_whose_pattern_is_not_symmetric(seed):
    """METIS loops for ever on such a graph."""
    matrix = csc_array(lattice(30) + 40 * eye_array(2700))
    matrix.data[np.random.default_rng(seed).random(matrix.nnz) < 0.1] = 0.0
    matrix.eliminate_zeros()
    assert np.array_equal(np.sort(elimination_places(matrix)), np.arange(2700))


def test_general_factors_of_a_matrix_with_a_small_pivot():
    """Without other pivots nine digits would be lost."""
    matrix = csc_array(block_diag([[[1e-9, 1.0], [1.0, 1.0]]] * 20))
    right = np.random.default_rng(3).standard_normal(40)
    assert np.linalg.norm(matrix @ general_lu(matrix).solve(right) - right) < 1e-13 * np.linalg.norm(right)


@pytest.mark.parametrize("ordered", [False, True])
def test_singular_matrix_is_said_to_be_one(ordered):
    matrix = lattice(12).tolil()
    matrix[7, :] = matrix[:, 7] = 0
    with pytest.raises(SingularMatrixError, match="432 rows"):
        symmetric_lu(csc_array(matrix), ordered=ordered, symmetric=True)


def dense(factors):
    """L, D and U of compiled factors."""
    assert isinstance(factors.made, CompiledFactors)
    made, size = factors.made, len(factors.made.pivot)
    lower, upper = (
        csc_array((values, made.row, made.start), shape=(size, size)).toarray() + np.eye(size)
        for values in (made.lower, made.upper)
    )
    return lower, np.diag(made.pivot), upper.T


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("shape", [(432,), (432, 1), (432, 3), (432, 4), (432, 15)])
def test_compiled_factors_solve(shape, symmetric):
    """An indefinite matrix, and numbers of right sides below, at and above the four that are solved for at a time."""
    order = np.argsort(elimination_places(lattice(12)))
    matrix = csc_array(lattice(12) - 3 * eye_array(432))[order][:, order]
    if not symmetric:
        matrix.data *= np.random.default_rng(5).uniform(0.9, 1.1, matrix.nnz)
    right = np.random.default_rng(2).standard_normal(shape)
    factors = symmetric_lu(matrix, ordered=True, symmetric=symmetric)
    # |A x - b| <= 5 n u |L| |D| |U| |x| (Higham, Accuracy and Stability of Numerical Algorithms, 2002, theorems 9.3
    # and 9.4, which count 3 n for L U)
    product = np.linalg.multi_dot([np.abs(each) for each in dense(factors)])
    for trans, turned, size in (("N", matrix, product), ("T", matrix.T, product.T)):
        found = factors.solve(right, trans)
        bound = 5 * 432 * np.finfo(float).eps * size @ np.abs(np.reshape(found, (432, -1)))
        assert np.all(np.abs(turned @ found - right).reshape(432, -1) <= bound)


@given(size=st.integers(1, 90), entries=st.floats(0, 1), seed=st.integers(0, 1000), symmetric=st.booleans())
def test_compiled_factors_are_those_of_the_matrix(size, entries, seed, symmetric):
    """Any pattern: full and empty, of one tree of elimination and of many, from one column to two panels of a front."""
    rng = np.random.default_rng(seed)
    some = np.where(rng.random((size, size)) < entries, rng.uniform(-1, 1, (size, size)), 0.0)
    # diagonally dominant, of either sign
    matrix = some + some.T + np.diag(rng.choice([-1, 1], size) * (2 * size + 1.0))
    if not symmetric:
        matrix *= rng.integers(0, 3, (size, size)) + 2 * size * np.eye(size)
    factors = symmetric_lu(csc_array(matrix), ordered=True, symmetric=symmetric)
    lower, diagonal, upper = dense(factors)
    # |L D U - A| <= n u |L| |D| |U| (Higham, theorem 9.3)
    bound = (size + 2) * np.finfo(float).eps * np.abs(lower) @ np.abs(diagonal) @ np.abs(upper)
    assert np.all(np.abs(lower @ diagonal @ upper - matrix) <= 2 * bound)  # the product here is off by as much
    if symmetric:
        assert factors.negative == np.count_nonzero(np.diag(matrix) < 0)


@pytest.mark.parametrize("diagonal", [20.0, 0.0])
def test_factors_of_rows_in_any_order(diagonal):
    """Of a matrix whose pattern is not symmetric, and of one without a diagonal, which needs other pivots."""
    matrix = lattice(12).tolil()
    matrix.setdiag(diagonal)
    matrix = csc_array(matrix + diags_array(np.ones(430), offsets=2))
    moved = np.random.default_rng(4).permutation(432)
    matrix = csc_array(matrix[moved][:, moved])
    right = np.random.default_rng(5).standard_normal((432, 3))
    factors = general_lu(matrix)
    assert isinstance(factors.made, CompiledFactors if diagonal else SuperLU)
    for trans, turned in (("N", matrix), ("T", matrix.T)):
        found = factors.solve(right, trans)
        # other right sides than that for which the factors were looked at: ten times as far off at the most
        size = np.abs(matrix.data).max() * np.linalg.norm(found, axis=0)
        assert np.all(np.linalg.norm(turned @ found - right, axis=0) <= 10 * sparse_lu.INACCURATE * size)
