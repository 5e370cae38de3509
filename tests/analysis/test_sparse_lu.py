"""Factors of sparse symmetric matrices: solutions and inertia."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array, kron

from faultgouge.analysis import sparse_lu
from faultgouge.analysis.sparse_lu import SingularMatrixError, minimum_degree, symmetric_lu


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


def test_mumps_is_left_alone_where_it_may_not_be_used(backend):
    matrix = csc_array(lattice(8) + 20 * eye_array(192))
    assert isinstance(symmetric_lu(matrix, mumps=False), sparse_lu.SuperLUFactors)
    assert isinstance(symmetric_lu(matrix), sparse_lu.SuperLUFactors) == (backend == "SuperLU")


def test_minimum_degree_is_a_permutation():
    assert np.array_equal(np.sort(minimum_degree(csc_array(lattice(8) + 40 * eye_array(192)))), np.arange(192))
