"""Which pairs may meet, by perturbation theory: against dense LAPACK."""

import numpy as np
import pytest
from scipy.linalg import eig, eigvals
from scipy.sparse import csr_array

from faultgouge.analysis.onset import LIMITS, Modes, full_operator
from faultgouge.analysis.onset.basis import Basis
from faultgouge.analysis.onset.screening import may_meet

SLACK = LIMITS.slack


def test_clusters_have_the_eigenvalues_of_the_operator(path):
    """Projected on the modes of another load; what is left out is of third order in the coupling."""
    basis = Basis.of(full_operator(path(0.0)))
    owned = [cluster.modes.start + np.arange(cluster.core[0], cluster.core[1] + 1) for cluster in basis.clusters]
    np.testing.assert_array_equal(np.concatenate(owned), np.arange(285))
    for fx, accuracy in ((0.001, 1e-4), (0.01, 2e-2)):
        matrix = full_operator(path(fx))
        expected = np.sort(eigvals(matrix.toarray()).real)[15:]  # five rattlers
        levels = basis.levels(matrix)
        assert np.median(basis.mixing(levels)) < LIMITS.mixing
        for cluster in basis.clusters:
            block = levels.block(cluster)
            core = slice(cluster.core[0], cluster.core[1] + 1)
            values = np.sort(eigvals(block).real)[core]
            np.testing.assert_allclose(values, expected[cluster.modes][core], atol=accuracy * np.diff(expected).mean())


@pytest.mark.parametrize("base", [0.0, 0.015, 0.021])
def test_meetings_are_those_of_the_eigenvalues(path, base):
    """Every pair that LAPACK has complex, or coming within its couplings, is named; most others are not."""
    basis = Basis.of(full_operator(path(base)))
    for load, most in ((base, 8), (base + 1e-3, 8)):
        here, there = (full_operator(path(fx)) for fx in (load, load + 1e-3 if load < 0.0215 else load))
        named = {tuple(pair) for pair in may_meet(basis.levels(here), basis.levels(there), SLACK)}
        assert len(named) <= most
        for matrix in (here, there):
            modes = Modes.of(0.0, matrix)
            for pair in modes.complex_pairs:
                # the two modes of the basis that carry the plane
                weight = np.linalg.norm(basis.vectors.T @ modes.pair(pair).right[basis.active], axis=1)
                assert tuple(sorted(np.argsort(weight)[-2:])) in named


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("antisymmetric", [0.02, 0.1, 0.3])
def test_no_complex_pair_escapes_the_may_meet(seed, antisymmetric):
    """Random levels and couplings, of spacing 1: as many complex pairs as LAPACK finds are named, or more."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(2, 150, 150))
    diagonal = np.diag(np.sort(rng.uniform(0, 150, 150)))
    symmetric, turning = 0.02 * (noise[0] + noise[0].T), antisymmetric * (noise[1] - noise[1].T)
    basis = Basis.of(csr_array(diagonal))
    here, there = (basis.levels(csr_array(diagonal + share * (symmetric + turning))) for share in (0.9, 1.0))
    named = may_meet(here, there, SLACK)
    values, right = eig(diagonal + symmetric + turning)
    for k in np.flatnonzero(values.imag > 0):
        assert set(np.argsort(np.abs(right[:, k]))[-2:]) in [set(pair) for pair in named.tolist()]


def test_meetings_of_crossing_levels_between_two_loads():
    """Levels that exchange their order meet, coupled as weakly as may be; those that only come close do not."""
    basis = Basis.of(csr_array(np.diag([1.0, 2.0, 5.0])))
    here, crossed, close = (
        basis.levels(csr_array(np.diag(d))) for d in ([1.0, 2.0, 5.0], [2.0, 1.9, 5.0], [1.5, 2.0, 5.0])
    )
    assert may_meet(here, crossed, SLACK).tolist() == [[0, 1]]
    assert may_meet(here, close, SLACK).tolist() == []
