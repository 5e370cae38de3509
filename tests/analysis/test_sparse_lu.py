"""Factors of sparse symmetric matrices: solutions and inertia."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array, kron

from faultgouge.analysis.sparse_lu import symmetric_lu


def lattice(side):
    """Three coordinates on every point of a square lattice, coupled at random to those of the next points."""
    line = diags_array([np.ones(side - 1), np.ones(side), np.ones(side - 1)], offsets=[-1, 0, 1])
    pattern = csc_array(kron(kron(line, line), np.ones((3, 3))))
    pattern.data = np.random.default_rng(side).uniform(-1, 1, pattern.nnz)
    return csc_array(pattern + pattern.T)


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("pivoting", [0.0, 0.01])
def test_solutions(ordered, pivoting):
    matrix = csc_array(lattice(12) + 20 * eye_array(432))
    force = np.arange(432.0)
    step = symmetric_lu(matrix, ordered=ordered, pivoting=pivoting).solve(force)
    # positive definite, of condition 5 or so
    np.testing.assert_allclose(matrix @ step, force, rtol=0, atol=1e-11)


@pytest.mark.parametrize("shift", [-20.0, -3.0, 0.1, 4.0, 20.0])
def test_pivots_tell_how_many_eigenvalues_are_negative(shift):
    matrix = lattice(10)
    pivots = symmetric_lu(csc_array(matrix - shift * eye_array(300))).U.diagonal()
    assert np.count_nonzero(pivots < 0) == np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < shift)
