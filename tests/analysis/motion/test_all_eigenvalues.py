"""All eigenvalues in slices, with vectors, against spectra that are known and against LAPACK; what is missing is told.

Matrices have small slices here, so that some ten of them are enough for a test.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_spectra import complex_block, of_stiffness, turned
from scipy.linalg import eig
from scipy.optimize import linear_sum_assignment
from scipy.sparse import block_diag, csr_array

from faultgouge.analysis import spectrum
from faultgouge.analysis.motion import all_eigenvalues as module
from faultgouge.analysis.motion import spectrum as spectrum_module
from faultgouge.analysis.motion.all_eigenvalues import SpectrumError, all_eigenvalues

SMALL = {"own": 24, "least": 30}


def nearest(one, other):
    """How far eigenvalues are from those of another list, each from one of its own."""
    distance = np.abs(one[:, None] - other)
    rows, columns = linear_sum_assignment(distance)
    return distance[rows, columns]


@pytest.mark.slow
@settings(max_examples=3, deadline=None)
@given(st.integers(0, 10_000))
def test_known_spectra(seed):
    """Real ones, clusters, negative ones, pairs next to the axis and away from it, and pairs about to coalesce."""
    rng = np.random.default_rng(seed)
    real = [*rng.uniform(0, 100, 80), *(40 + 1e-7 * np.arange(3)), -3.0, -0.01]
    pairs = [complex_block(rng.uniform(5, 95), 10.0 ** rng.uniform(-6, 0.5)) for _ in range(15)]
    # eigenvalues a +- 1e-3 and a +- 1e-3 i, of condition 500
    oblique = [np.array([[a, 1.0], [e, a]]) for a in rng.uniform(5, 95, 3) for e in (1e-6, -1e-6)]
    blocks = [*real, *pairs, *oblique]
    expected = np.concatenate([np.linalg.eigvals(np.atleast_2d(each)) for each in blocks])
    values, marked = all_eigenvalues(turned(blocks, rng), **SMALL)
    assert len(values) == len(expected)
    # 1e-6 of a mean distance, 0.6, at the edge of a disc; what is next to the shift has all digits
    assert nearest(values, expected).max() < 1e-6
    negative = (marked.values.imag == 0) & (marked.values.real < 0)
    assert np.count_nonzero(marked.values.imag > 0) == 15 + 3
    # rounding of a norm of 800, times 500
    assert nearest(marked.values, expected).max() < 1e-10
    assert np.sort(marked.values[negative].real) == pytest.approx(np.array([-3.0, -0.01]), abs=1e-11)


@pytest.mark.slow
def test_vectors_are_those_of_lapack():
    rng = np.random.default_rng(1)
    blocks = [complex_block(a, 0.1 + b) for a, b in rng.uniform(1, 60, (60, 2)) / [1, 30]]
    blocks += [np.array([[a, 1.0], [-1e-4, a + 1e-3]]) for a in rng.uniform(1, 60, 4)]
    matrix = turned(blocks, rng)
    values, left, right = eig(matrix.toarray(), left=True)
    _, marked = all_eigenvalues(matrix, **SMALL)
    assert len(marked.values) == 64
    same = np.abs(values[:, None] - marked.values).argmin(axis=0)
    # of condition 50; the planes have converged to 1e-6 on the left, and vectors within them exactly
    for known, found in ((right, marked.right), (left, marked.left)):
        np.testing.assert_allclose(np.abs(np.sum(known[:, same].conj() * found, axis=0)), 1, rtol=0, atol=1e-6)
    overlap = np.abs(np.sum(left[:, same].conj() * right[:, same], axis=0))
    np.testing.assert_allclose(marked.overlap, overlap, rtol=1e-5)


@pytest.mark.parametrize("copies", [3, 40])
def test_identical_cells_that_do_not_touch_have_each_their_eigenvalues(copies):
    """More equal ones than any block has vectors, with pairs and negative ones, beside a large island."""
    rng = np.random.default_rng(copies)
    cell = np.array([[2.0, 1.0, 0.0], [-1.0, 2.0, 0.3], [0.2, 0.1, -0.5]])
    large = turned(rng.uniform(1, 50, 150), rng)
    whole = csr_array(block_diag([*[cell] * copies, large]))
    mixed = rng.permutation(whole.shape[0])
    whole = csr_array(whole[mixed][:, mixed])
    (found, marked), expected = all_eigenvalues(whole, **SMALL), np.linalg.eigvals(whole.toarray())
    assert nearest(found, expected).max() < 1e-6
    assert len(marked) == 2 * copies
    np.testing.assert_allclose(whole @ marked.right, marked.right * marked.values, rtol=0, atol=1e-9)
    np.testing.assert_allclose(whole.T @ marked.left.conj(), marked.left.conj() * marked.values, rtol=0, atol=1e-9)


@pytest.fixture
def sliced(monkeypatch):
    """Spectra of all packings are taken in small slices."""
    monkeypatch.setattr(spectrum_module, "SLICED", 0)
    monkeypatch.setattr(spectrum_module, "all_eigenvalues", lambda matrix: all_eigenvalues(matrix, **SMALL))


@pytest.mark.long
@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("in_slices", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_forty_equal_pairs_and_forty_equal_negative_ones_are_counted(coupled, in_slices, request):
    """As of forty copies of a packing side by side: rounding makes pairs of some of the negative ones, too."""
    rng = np.random.default_rng(1)
    cells, others = 40 * [complex_block(7.0, 0.5), -0.5], rng.uniform(1, 50, 120)
    whole = turned([*cells, *others], rng) if coupled else csr_array(block_diag([*cells, turned(others, rng)]))
    if in_slices:
        request.getfixturevalue("sliced")
    found = spectrum(of_stiffness(whole))
    assert len(found.pairs) == 40
    assert [pair.eigenvalue for pair in found.pairs] == pytest.approx([7 + 0.5j] * 40, rel=1e-9)
    assert found.negative == pytest.approx([-0.5] * 40, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, -1])
def test_a_missing_eigenvalue_is_found_again_and_many_are_told(times, monkeypatch):
    """Discs that lose a real eigenvalue, once, or each time."""
    about, left = module.eigenvalues_about, [times]

    def losing(*given):
        values, *rest = about(*given)
        own = np.flatnonzero((values.imag == 0) & (values.real > given[2][0]) & (values.real < given[2][1]))
        lost = own[: left[0] != 0]
        left[0] -= len(lost)
        return np.delete(values, lost), *rest

    monkeypatch.setattr(module, "eigenvalues_about", losing)
    rng = np.random.default_rng(3)
    real = np.sort(rng.uniform(1, 50, 150))
    matrix = turned(real, rng)
    if times > 0:
        np.testing.assert_allclose(all_eigenvalues(matrix, **SMALL)[0].real, real, rtol=0, atol=1e-6)
        return
    with pytest.raises(SpectrumError, match=r"All eigenvalues of 150 coordinates: 14\d were found"):
        all_eigenvalues(matrix, **SMALL)


@pytest.mark.slow
def test_spectrum_of_a_packing(path, request):
    """Beyond its onset the reference packing has complex pairs."""
    expected = spectrum(path(0.022))
    request.getfixturevalue("sliced")
    found = spectrum(path(0.022))
    spacing = np.ptp(expected.eigenvalues.real) / len(expected.eigenvalues)
    assert nearest(found.eigenvalues, expected.eigenvalues).max() < 1e-6 * spacing
    assert found.noise_pairs == expected.noise_pairs
    assert len(found.pairs) == len(expected.pairs) > 0
    for one, other in zip(found.pairs, expected.pairs, strict=True):
        # the safety factor allows for the rounding of both
        allowed = min(50 * expected.rounding, 1e-12 * abs(other.eigenvalue)) / other.overlap
        assert abs(one.eigenvalue - other.eigenvalue) < allowed
        assert one.overlap == pytest.approx(other.overlap, rel=1e-4)
        assert (one.participation, one.rotation) == pytest.approx((other.participation, other.rotation), rel=1e-6)
