"""All eigenvectors of a sparse symmetric matrix, slice by slice, against LAPACK."""

import numpy as np
import pytest
from scipy.sparse import csc_array

from faultgouge.analysis.onset import LIMITS, Limits
from faultgouge.analysis.onset.slicing import SliceError, factored, slices


def network(size, seed):
    """Springs of random stiffness between neighbours on a square lattice of so many points a side."""
    rng = np.random.default_rng(seed)
    number = np.arange(size * size).reshape(size, size)
    pairs = np.concatenate(
        [
            np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()]),
            np.column_stack([number[:-1].ravel(), number[1:].ravel()]),
        ]
    )
    stiffness = rng.uniform(0.5, 1.5, len(pairs))
    matrix = np.zeros((size * size, size * size))
    for (i, j), k in zip(pairs, stiffness, strict=True):
        matrix[[i, i, j, j], [i, j, i, j]] += np.array([k, -k, -k, k])
    return csc_array(matrix)


@pytest.mark.parametrize("workers", [1, 2])
def test_slices_are_the_whole_spectrum(workers):
    matrix = network(34, 1)
    expected, basis = np.linalg.eigh(matrix.toarray())
    values, count = [], 0
    for part in slices(matrix, 20, workers):
        own = part.values[part.own]
        assert part.first + part.own.start == count
        count += len(own)
        values.append(own)
        assert part.own.start == min(20, part.first + part.own.start)
        vectors = part.vectors
        # one pass of Gram and Schmidt leaves 1e-13, and more until a second one is found to be needed: 4e-13 here, and
        # 1.2e-11 at the worst of seven matrices of other sizes
        np.testing.assert_allclose(vectors.T @ vectors, np.eye(len(part.values)), rtol=0, atol=2e-11)
        # in mean distances of eigenvalues, 8 / 1156: the residual that is asked for, and its square
        spacing = np.ptp(own) / len(own)
        residual = np.linalg.norm(matrix @ vectors - vectors * part.values, axis=0)[part.own]
        overlap = np.linalg.norm(basis[:, count - len(own) : count].T @ vectors[:, part.own], axis=0)
        assert residual.max() < 10 * LIMITS.accurate * spacing
        np.testing.assert_allclose(overlap, 1.0, atol=1e-3)
    # the residual squared over the distance of the next eigenvalues, which may be a hundredth of the mean one
    np.testing.assert_allclose(np.concatenate(values), expected, atol=1e-4 * 8 / 1156)


@pytest.mark.parametrize("modes", [(0, 100), (500, 760), (1100, 1156), (700, 701)])
def test_part_of_the_spectrum(modes):
    """The eigenvalues of these numbers, with shifts about them alone."""
    shifts = []

    def watched(matrix, shift):
        shifts.append(shift)
        return factored(matrix, shift)

    kinds = {"limits": Limits(coarse=60), "factorise": watched}
    matrix = network(34, 4)
    expected = np.linalg.eigvalsh(matrix.toarray())
    parts = list(slices(matrix, 20, modes=modes, **kinds))
    assert parts[0].first + parts[0].own.start == modes[0]
    values = np.concatenate([part.values[part.own] for part in parts])
    np.testing.assert_allclose(values, expected[slice(*modes)], rtol=0, atol=1e-4 * 8 / 1156)
    few = len(shifts)
    list(slices(matrix, 20, **kinds))
    assert few < 0.5 * (len(shifts) - few)


def test_degenerate_eigenvalues_are_all_found():
    """A square lattice on a torus, stiffer along one side: most eigenvalues are fourfold."""
    along = 2 * np.eye(34) - np.roll(np.eye(34), 1, axis=0) - np.roll(np.eye(34), -1, axis=0)
    matrix = csc_array(np.kron(along, np.eye(34)) + np.kron(np.eye(34), 1.3 * along))
    one = np.linalg.eigvalsh(along)
    expected = np.sort(np.add.outer(one, 1.3 * one).ravel())
    values = np.concatenate([part.values[part.own] for part in slices(matrix, 20)])
    np.testing.assert_allclose(values, expected, rtol=0, atol=1e-6)


def test_missing_eigenvalue_is_noticed():
    """An inertia that is one too high from some shift on, as if an eigenvalue had been overlooked."""

    def wrong(matrix, shift):
        solve, below = factored(matrix, shift)
        return solve, below + (shift > 4.0)

    with pytest.raises(SliceError, match="one is missing in between"):
        list(slices(network(34, 2), 20, factorise=wrong))


def test_inaccurate_factors_are_noticed():
    """Factors of a matrix that is off by 2e-4: half of a mean distance of eigenvalues at their upper end."""

    def inaccurate(matrix, shift):
        return factored(csc_array(matrix * (1 + 2e-4)), shift)

    with pytest.raises(SliceError, match="the factors are inaccurate"):
        list(slices(network(34, 3), 20, factorise=inaccurate))
