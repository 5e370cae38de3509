"""Pairs against dense LAPACK: which may meet, by perturbation theory; how one is continued without the others."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigvals
from scipy.sparse import csr_array

from faultgouge.analysis.windows import LIMITS, Limits, System, SystemModes, full_operator
from faultgouge.analysis.windows.screens.pairs import PairScreen, may_meet
from faultgouge.analysis.windows.slices.eigenbasis import Basis

SLACK = LIMITS.slack


def at(path, fx):
    return System(fx, full_operator(path(fx)))


def dense_pair(system, reference):
    """The pair of the two modes that lie closest to the planes of another one, from all eigenvectors."""
    modes = SystemModes.of(system)
    return modes.space(modes.nearest(reference))


def complex_pair(system):
    (pair,) = (modes := SystemModes.of(system)).complex_pairs
    return modes.space(pair)


@pytest.mark.parametrize("factors", ["dense", "sparse", "of a neighbour"])
@pytest.mark.parametrize("fx", [0.0218, 0.0218330564, 0.021833056408868, 0.0219, 0.022])
def test_continued_pair_is_that_of_lapack(path, fx, factors):
    """From real through double to complex, from a load at which the pair is complex."""
    system = at(path, fx)
    start = complex_pair(at(path, 0.022))
    limits = Limits() if factors == "dense" else Limits(dense_factors=0)
    if factors == "of a neighbour":
        start = start.at(at(path, 0.0221), limits)
    found, expected = start.at(system, limits), dense_pair(system, start)
    assert (found.inverse is not None) == (factors != "dense")
    if factors == "of a neighbour":
        assert found.inverse is start.inverse
    # D is in error by its coefficients, the entries of B - mean, times some ten of the operator's rounding.
    assert found.mean == pytest.approx(expected.mean, abs=50 * system.rounding)
    assert found.discriminant == pytest.approx(expected.discriminant, abs=200 * system.rounding * expected.spread)
    if abs(expected.discriminant) > 1e-8:
        # the overlap goes as the root of D
        error = 100 * system.rounding * expected.spread / abs(expected.discriminant)
        assert found.overlap == pytest.approx(expected.overlap, rel=1e-4 + error)
    assert found.like(expected)


def test_continuation_is_refused_rather_than_wrong(path):
    """Planes of two unrelated modes belong to no pair that inverse iteration can reach."""
    system = at(path, 0.022)
    apart = SystemModes.of(system).space((30, 200))
    wrong = replace(apart, right=np.eye(300)[:, [7, 107]], left=np.eye(300)[:, [7, 107]])
    assert wrong.at(system) is None


def test_overlap_of_a_block_is_that_of_the_eigenvectors(path):
    modes = SystemModes.of(at(path, 0.022))
    (pair,) = modes.complex_pairs
    expected = abs(np.vdot(modes.left[:, pair[0]], modes.right[:, pair[0]]))
    assert modes.space(pair).overlap == pytest.approx(expected, rel=1e-8)


def test_factors_of_a_distant_neighbour_are_given_up(path):
    """Those of another spectrum, nowhere near the pair: its own are made."""
    limits = Limits(dense_factors=0)
    system = at(path, 0.022)
    start = complex_pair(at(path, 0.0219))
    far = system.inverse(10 * start.mean, limits)
    found = replace(start, inverse=far).at(system, limits)
    assert found.inverse is not far
    assert found.discriminant == pytest.approx(start.at(system, limits).discriminant, rel=1e-9)


@pytest.mark.parametrize("fx", [0.0215, 0.0218330564, 0.022])
def test_slope_of_the_growth(path, fx):
    """Against the difference of two blocks, from real through double to complex."""
    step = 1e-6
    below, middle, above = (at(path, fx + offset * step) for offset in (-1, 0, 1))
    pair = dense_pair(middle, complex_pair(at(path, 0.022)))
    slope = (pair.at(above).growth - pair.at(below).growth) / 2
    assert 0.5 * (pair.slope(above) - pair.slope(below)) == pytest.approx(slope, rel=1e-5)


@pytest.fixture(scope="module")
def damped_reference(ramp):
    """The reference packing with dissipation at a load, and its modes where some grow."""
    path = ramp(1.0, 1e-3, 26)

    def damped(load):
        return System.of(path(load).with_dissipation(cn=1.0), dissipation=True)

    return damped, SystemModes.of(damped(0.023))


@pytest.mark.parametrize("fx", [0.02, 0.022, 0.024])
def test_a_single_mode_is_that_of_lapack(damped_reference, fx):
    """With dissipation, from another load: growing and decaying ones, and its slope against a difference."""
    damped, here = damped_reference
    there, modes = damped(fx), SystemModes.of(damped(fx))
    for k in (3, 100, 200, *here.grows.tolist()):
        found = here.space((k,)).follow(there)
        expected = min(modes.values, key=lambda s: abs(s - found.mean))
        # SAFETY of LAPACK's own uncertainty
        assert abs(found.mean - expected) * found.overlap < 50 * there.rounding
        near = [found.at(damped(fx + offset)) for offset in (-1e-7, 1e-7)]
        slope = 0.5 * (found.slope(near[1].system) - found.slope(near[0].system))
        assert slope == pytest.approx(0.5 * (near[1].growth - near[0].growth), rel=1e-3, abs=1e-12)


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
    fresh = Basis.of(matrix)  # of the last load, whose antisymmetric part no other basis makes smaller
    assert np.median(fresh.mixing(fresh.levels(matrix))) < 1e-8 < 1e-3 < np.median(basis.mixing(levels))


@pytest.mark.parametrize("base", [0.0, 0.015, 0.021])
def test_meetings_are_those_of_the_eigenvalues(path, base):
    """Every pair that LAPACK has complex, or coming within its couplings, is named; most others are not."""
    basis = Basis.of(full_operator(path(base)))
    for load, most in ((base, 8), (base + 1e-3, 8)):
        here, there = (full_operator(path(fx)) for fx in (load, load + 1e-3 if load < 0.0215 else load))
        named = {tuple(pair) for pair in may_meet(basis.levels(here), basis.levels(there), SLACK)}
        assert len(named) <= most
        for matrix in (here, there):
            modes = SystemModes.of_operator(0.0, matrix)
            for pair in modes.complex_pairs:
                # the two modes of the basis that carry the plane
                weight = np.linalg.norm(basis.vectors.T @ modes.space(pair).right[basis.active], axis=1)
                assert tuple(sorted(np.argsort(weight)[-2:])) in named


def test_no_complex_pair_escapes_the_may_meet():
    """Of four to seven levels of spacing 1, coupled strongly; without the third order 85 of 1072 escape."""
    rng = np.random.default_rng(1)
    escaped = 0
    for _ in range(1500):
        size = int(rng.integers(4, 8))
        diagonal = np.diag(np.sort(rng.uniform(0, size, size)))
        symmetric, turning = rng.normal(size=(2, size, size))
        matrix = diagonal + 0.2 * (symmetric + symmetric.T + turning - turning.T)
        levels = Basis.of(csr_array(diagonal)).levels(csr_array(matrix))
        escaped += np.iscomplexobj(np.linalg.eigvals(matrix)) and len(may_meet(levels, levels, SLACK)) == 0
    assert escaped == 0


def test_meetings_of_crossing_levels_between_two_loads():
    """Levels that exchange their order meet, coupled as weakly as may be; those that only come close do not."""
    basis = Basis.of(csr_array(np.diag([1.0, 2.0, 5.0])))
    here, crossed, close = (
        basis.levels(csr_array(np.diag(d))) for d in ([1.0, 2.0, 5.0], [2.0, 1.9, 5.0], [1.5, 2.0, 5.0])
    )
    assert may_meet(here, crossed, SLACK).tolist() == [[0, 1]]
    assert may_meet(here, close, SLACK).tolist() == []


def test_modes_of_clusters_are_those_of_lapack(path):
    """With complex and with real ones; modes beside the clusters are real."""
    systems = at(path, 0.0219), at(path, 0.022)
    for system, modes in zip(systems, PairScreen()(*systems, [], 1), strict=True):
        everything = SystemModes.of(system)
        assert 2 <= len(modes) <= LIMITS.few_modes
        assert len(modes.complex_pairs) == len(everything.complex_pairs) == 1
        nearest = np.abs(modes.values[:, None] - everything.values).argmin(axis=1)
        error = np.abs(modes.values - everything.values[nearest])
        assert np.all(error * modes.overlap < 50 * system.rounding)
        for side in ("right", "left"):
            both = getattr(modes, side), getattr(everything, side)[:, nearest]
            np.testing.assert_allclose(np.abs(np.sum(both[0].conj() * both[1], axis=0)), 1, atol=1e-6)
