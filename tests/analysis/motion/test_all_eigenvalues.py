"""All eigenvalues in slices, with vectors, against spectra that are known and against LAPACK; what is missing is told.

Matrices have small slices here, so that some ten of them are enough for a test.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_spectra import complex_block, turned
from scipy.linalg import eig
from scipy.optimize import linear_sum_assignment
from scipy.sparse import block_diag, csr_array

from faultgouge.analysis import Configuration, LinearisedContacts, spectrum
from faultgouge.analysis.contacts import BOOLEAN, PER_CONTACT
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
    real = [np.array([[value]]) for value in rng.uniform(0, 100, 120)]
    cluster = [np.array([[value]]) for value in 40 + 1e-7 * np.arange(3)]
    negative = [np.array([[value]]) for value in (-3.0, -0.01)]
    pairs = [complex_block(rng.uniform(5, 95), 10.0 ** rng.uniform(-6, 0.5)) for _ in range(15)]
    # eigenvalues a +- 1e-3 and a +- 1e-3 i, of condition 500
    oblique = [np.array([[a, 1.0], [e, a]]) for a in rng.uniform(5, 95, 3) for e in (1e-6, -1e-6)]
    blocks = [*real, *cluster, *negative, *pairs, *oblique]
    expected = np.concatenate([np.linalg.eigvals(each) for each in blocks])
    values, marked = all_eigenvalues(turned(blocks, rng), **SMALL)
    assert len(values) == len(expected)
    # 1e-6 of a mean distance, 0.6, at the edge of a disc; what is next to the shift has all digits
    assert nearest(values, expected).max() < 1e-6
    assert np.count_nonzero(marked.values.imag > 0) == 15 + 3
    # rounding of a norm of 800, times 500
    assert nearest(marked.values, expected).max() < 1e-10
    assert np.sort(marked.values[(marked.values.imag == 0) & (marked.values.real < 0)].real) == pytest.approx(
        np.array([-3.0, -0.01]), abs=1e-11
    )


@pytest.mark.slow
def test_vectors_are_those_of_lapack():
    rng = np.random.default_rng(1)
    blocks = [complex_block(a, 0.1 + b) for a, b in rng.uniform(1, 60, (60, 2)) / [1, 30]]
    blocks += [np.array([[a, 1.0], [-1e-4, a + 1e-3]]) for a in rng.uniform(1, 60, 4)]
    matrix = turned(blocks, rng)
    values, left, right = eig(matrix.toarray(), left=True)
    _, marked = all_eigenvalues(matrix, **SMALL)
    assert len(marked.values) == 64
    for k, value in enumerate(marked.values):
        same = np.argmin(np.abs(values - value))
        # of condition 50; the planes have converged to 1e-6 on the left, and vectors within them exactly
        assert abs(right[:, same].conj() @ marked.right[:, k]) == pytest.approx(1, abs=1e-6)
        assert abs(left[:, same].conj() @ marked.left[:, k]) == pytest.approx(1, abs=1e-6)
        assert marked.overlap[k] == pytest.approx(abs(left[:, same].conj() @ right[:, same]), rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("copies", "others", "sizes"),
    [(5, 300, SMALL), pytest.param(20, 300, SMALL, marks=pytest.mark.long), (20, 150, {})],
)
def test_more_equal_eigenvalues_than_a_block_has_vectors(copies, others, sizes):
    """As of spheres that spin without a force. A slice that lacks some is found again with larger blocks."""
    rng = np.random.default_rng(copies)
    real = np.concatenate([np.zeros(copies), np.full(copies, 7.0), rng.uniform(1, 50, others)])
    found, _ = all_eigenvalues(turned([np.array([[value]]) for value in real], rng), **sizes)
    np.testing.assert_allclose(found.real, np.sort(real), rtol=0, atol=1e-6)


@pytest.mark.parametrize("copies", [3, 40])
def test_identical_cells_that_do_not_touch_have_each_their_eigenvalues(copies):
    """More equal ones than any block has vectors, with pairs and negative ones, beside a large island."""
    rng = np.random.default_rng(copies)
    cell = np.array([[2.0, 1.0, 0.0], [-1.0, 2.0, 0.3], [0.2, 0.1, -0.5]])
    large = turned([np.array([[value]]) for value in rng.uniform(1, 50, 150)], rng)
    whole = csr_array(block_diag([*[cell] * copies, large]))
    mixed = rng.permutation(whole.shape[0])
    whole = csr_array(whole[mixed][:, mixed])
    (found, marked), expected = all_eigenvalues(whole, **SMALL), np.linalg.eigvals(whole.toarray())
    assert nearest(found, expected).max() < 1e-6
    assert len(marked) == 2 * copies
    np.testing.assert_allclose(whole @ marked.right, marked.right * marked.values, atol=1e-9)
    np.testing.assert_allclose(whole.T @ marked.left.conj(), marked.left.conj() * marked.values, atol=1e-9)


def of_stiffness(matrix):
    """A configuration of unit masses with this K, whose contacts are not known."""
    count = matrix.shape[0] // 3
    each, none = np.ones(count), {name: bool if name in BOOLEAN else int for name in PER_CONTACT}
    return Configuration(
        dimension=2, position=np.zeros((count, 2)), radius=each, mass=each, inertia=each,
        contacts=LinearisedContacts(**{name: np.zeros((0, *PER_CONTACT[name]), kind) for name, kind in none.items()}),
        box=np.eye(3), origin=np.zeros(3), periodic=np.zeros(3, bool), load=np.zeros((count, 2, 3)),
        stiffness=matrix, damping=csr_array(matrix.shape),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("coupled", "sliced"),
    [(False, False), (True, False), (False, True), pytest.param(True, True, marks=pytest.mark.slow)],
)
def test_forty_equal_pairs_and_forty_equal_negative_ones_are_counted(coupled, sliced, monkeypatch):
    """As of forty copies of a packing side by side: rounding makes pairs of some of the negative ones, too."""
    rng = np.random.default_rng(1)
    cells = [block for _ in range(40) for block in (complex_block(7.0, 0.5), np.array([[-0.5]]))]
    others = [np.array([[value]]) for value in rng.uniform(1, 50, 120)]
    whole = turned([*cells, *others], rng) if coupled else csr_array(block_diag([*cells, turned(others, rng)]))
    if sliced:
        monkeypatch.setattr(spectrum_module, "SLICED", 0)
        monkeypatch.setattr(spectrum_module, "all_eigenvalues", lambda matrix: all_eigenvalues(matrix, **SMALL))
    found = spectrum(of_stiffness(whole))
    assert len(found.pairs) == 40
    assert [pair.eigenvalue for pair in found.pairs] == pytest.approx([7 + 0.5j] * 40, rel=1e-9)
    assert found.negative == pytest.approx([-0.5] * 40, rel=1e-9)


@pytest.fixture
def losing(monkeypatch):
    """Discs that lose a real eigenvalue, so many of them."""

    def lose(times):
        about, left = module.eigenvalues_about, [times]

        def about_without(*given):
            values, *rest = about(*given)
            low, high = given[2]
            own = np.flatnonzero((values.imag == 0) & (values.real > low) & (values.real < high))
            if left[0] == 0 or not len(own):
                return values, *rest
            left[0] -= 1
            return np.delete(values, own[0]), *rest

        monkeypatch.setattr(module, "eigenvalues_about", about_without)

    return lose


def test_a_missing_eigenvalue_is_found_again(losing):
    rng = np.random.default_rng(3)
    real = rng.uniform(1, 50, 150)
    losing(1)
    found, _ = all_eigenvalues(turned([np.array([[value]]) for value in real], rng), **SMALL)
    np.testing.assert_allclose(found.real, np.sort(real), rtol=0, atol=1e-6)


@pytest.mark.slow
def test_missing_eigenvalues_are_told(losing):
    rng = np.random.default_rng(3)
    losing(-1)
    with pytest.raises(SpectrumError, match=r"All eigenvalues of 150 coordinates: 14\d were found"):
        all_eigenvalues(turned([np.array([[value]]) for value in rng.uniform(1, 50, 150)], rng), **SMALL)


@pytest.mark.slow
def test_spectrum_of_a_packing(path, monkeypatch):
    """Beyond its onset the reference packing has complex pairs."""
    expected = spectrum(path(0.022))
    monkeypatch.setattr(spectrum_module, "SLICED", 0)
    monkeypatch.setattr(spectrum_module, "all_eigenvalues", lambda matrix: all_eigenvalues(matrix, **SMALL))
    found = spectrum(path(0.022))
    spacing = np.ptp(expected.eigenvalues.real) / len(expected.eigenvalues)
    assert nearest(found.eigenvalues, expected.eigenvalues).max() < 1e-6 * spacing
    assert found.noise_pairs == expected.noise_pairs
    assert len(found.pairs) == len(expected.pairs) > 0
    for one, other in zip(found.pairs, expected.pairs, strict=True):
        # the safety factor allows for the rounding of both
        assert abs(one.eigenvalue - other.eigenvalue) * other.overlap < 50 * expected.rounding
        assert abs(one.eigenvalue - other.eigenvalue) < 1e-12 * abs(other.eigenvalue) / other.overlap
        assert one.overlap == pytest.approx(other.overlap, rel=1e-4)
        assert one.participation == pytest.approx(other.participation, rel=1e-6)
        assert one.rotation == pytest.approx(other.rotation, rel=1e-6)
