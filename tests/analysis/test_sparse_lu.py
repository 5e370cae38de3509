"""Factors of sparse symmetric matrices: solutions and inertia."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array, kron

from faultgouge.analysis import sparse_lu
from faultgouge.analysis.ldlt import SymmetricFactors
from faultgouge.analysis.sparse_lu import SingularMatrixError, SuperLUFactors, minimum_degree, symmetric_lu


def lattice(side):
    """Three coordinates on every point of a square lattice, coupled at random to those of the next points."""
    line = diags_array([np.ones(side - 1), np.ones(side), np.ones(side - 1)], offsets=[-1, 0, 1])
    pattern = csc_array(kron(kron(line, line), np.ones((3, 3))))
    pattern.data = np.random.default_rng(side).uniform(-1, 1, pattern.nnz)
    return csc_array(pattern + pattern.T)


@pytest.fixture(params=["SuperLU", "MUMPS"])
def backend(request, monkeypatch):
    """Both back ends; SuperLU is the one up to many coordinates, and MUMPS one from none on."""
    if request.param == "MUMPS":
        pytest.importorskip("mumps")
        monkeypatch.setattr(sparse_lu, "MUMPS_FROM", 0)
    return request.param


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("pivoting", [0.0, 0.01])
def test_solutions(ordered, pivoting, backend):
    matrix = csc_array(lattice(12) + 20 * eye_array(432))
    force = np.arange(432.0)
    step = symmetric_lu(matrix, ordered=ordered, pivoting=pivoting).solve(force)
    # positive definite, of condition 5 or so
    np.testing.assert_allclose(matrix @ step, force, rtol=0, atol=1e-11)


@pytest.mark.parametrize("shift", [-20.0, -3.0, 0.1, 4.0, 20.0])
def test_pivots_tell_how_many_eigenvalues_are_negative(shift, backend):
    matrix = lattice(10)
    factors = symmetric_lu(csc_array(matrix - shift * eye_array(300)), symmetric=True)
    assert factors.negative == np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < shift)


@pytest.mark.parametrize("unit", [1.0, 1j])
def test_solutions_of_the_transpose(unit, backend):
    matrix = csc_array(lattice(12) + diags_array(20 + unit * np.arange(432.0)) + diags_array(np.ones(431), offsets=1))
    right = np.random.default_rng(1).standard_normal((432, 3))
    factors = symmetric_lu(matrix, pivoting=0.01)
    for trans, turned in (("N", matrix), ("T", matrix.T)):
        # of condition 30 or so
        np.testing.assert_allclose(turned @ factors.solve(right + 0 * unit, trans), right, rtol=0, atol=1e-11)


def test_singular_matrix_is_said_to_be_one(backend):
    matrix = lattice(12).tolil()
    matrix[7, :] = matrix[:, 7] = 0
    with pytest.raises(SingularMatrixError, match="432 rows"):
        symmetric_lu(csc_array(matrix), symmetric=True)


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("shape", [(432,), (432, 1), (432, 5), (432, 6), (432, 13)])
def test_compiled_solutions_are_those_of_superlu(shape, ordered, monkeypatch):
    """An indefinite matrix, and numbers of right sides below, at and above the six that are solved for at a time."""
    matrix = csc_array(lattice(12) - 3 * eye_array(432))
    right = np.random.default_rng(2).standard_normal(shape)
    compiled = symmetric_lu(matrix, ordered=ordered, symmetric=True)
    monkeypatch.setattr(sparse_lu, "library", lambda: None)
    superlu = symmetric_lu(matrix, ordered=ordered, symmetric=True)
    assert (type(compiled), type(superlu)) == (SymmetricFactors, SuperLUFactors)
    assert compiled.negative == superlu.negative
    expected, order = superlu.solve(right), np.argsort(superlu.lu.perm_c)
    found = compiled.solve(right)
    # the same L, but D L^T in place of U: both are off by u times the growth of the factors, 1e3 here, and the
    # condition, 6e3, at the most
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    # |A x - b| <= 3 n u |L| |D| |L^T| |x| (Higham, Accuracy and Stability of Numerical Algorithms, 2002, theorem 9.4)
    lower = abs(csc_array((compiled.value, compiled.row, compiled.start), shape=matrix.shape) + eye_array(432))
    size = lower @ (np.abs(compiled.pivot) * (lower.T @ np.abs(np.reshape(found, (432, -1)))[order]).T).T
    residual = np.abs(matrix @ found - right).reshape(432, -1)[order]
    assert np.all(residual <= 3 * 432 * np.finfo(float).eps * size)


def test_order_and_memory_of_right_sides_do_not_matter():
    matrix = csc_array(lattice(8) + 20 * eye_array(192))
    right = np.random.default_rng(3).standard_normal((192, 12))
    solve = symmetric_lu(matrix, symmetric=True).solve
    for other in (np.asfortranarray(right), np.repeat(right, 2, axis=1)[:, ::2]):
        assert np.array_equal(solve(other), solve(right))


def test_pivots_off_the_diagonal_are_left_to_superlu():
    matrix = csc_array(np.array([[0.0, 1.0], [1.0, 0.0]]))
    np.testing.assert_array_equal(symmetric_lu(matrix, symmetric=True).solve(np.array([2.0, 3.0])), [3.0, 2.0])


def test_mumps_is_left_alone_where_it_may_not_be_used(backend):
    matrix = csc_array(lattice(8) + 20 * eye_array(192))
    assert isinstance(symmetric_lu(matrix, mumps=False), sparse_lu.SuperLUFactors)
    assert isinstance(symmetric_lu(matrix), sparse_lu.SuperLUFactors) == (backend == "SuperLU")


def test_minimum_degree_is_a_permutation():
    assert np.array_equal(np.sort(minimum_degree(csc_array(lattice(8) + 40 * eye_array(192)))), np.arange(192))
