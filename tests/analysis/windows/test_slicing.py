"""All eigenvectors of a sparse symmetric matrix, slice by slice, against LAPACK."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import chain
from threading import Barrier

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array

from faultgouge.analysis.factors.lanczos import SlicedSpectrum, SliceError, factor_shifted
from faultgouge.analysis.windows import LIMITS, Limits, Ranks
from faultgouge.analysis.windows.slices import slices

FEW = Limits(slice_size=24, count_spacing=60, first_look=20, one_basis=50)


SLICED = replace(LIMITS, one_basis=50)
"""Slices of the sizes of packings, of far smaller matrices."""


def network(size, seed):
    """Springs of random stiffness between neighbours on a square lattice of so many points a side."""
    rng = np.random.default_rng(seed)
    line, every = np.diff(np.eye(size), axis=0), np.eye(size)
    stretches = csc_array(np.concatenate([np.kron(every, line), np.kron(line, every)]))
    stiffness = rng.uniform(0.5, 1.5, stretches.shape[0])
    return csc_array(stretches.T @ diags_array(stiffness) @ stretches)


@pytest.mark.slow
def test_slices_are_the_whole_spectrum():
    matrix = network(34, 1)
    expected, basis = np.linalg.eigh(matrix.toarray())
    values, count = [], 0
    for part in slices(matrix, 20, ranks=Ranks(workers=2)):
        own, vectors = part.values[part.own], part.vectors
        assert part.first + part.own.start == count
        count += len(own)
        values.append(own)
        assert part.own.start == min(20, part.first + part.own.start)
        # what blocks stray is taken away but for its square, 1e-11 at the most for one vector
        np.testing.assert_allclose(vectors.T @ vectors, np.eye(len(part.values)), rtol=0, atol=2e-11)
        # in mean distances of eigenvalues, 8 / 1156: the residual that is asked for, and its square
        residual = np.linalg.norm(matrix @ vectors - vectors * part.values, axis=0)[part.own]
        overlap = np.linalg.norm(basis[:, count - len(own) : count].T @ vectors[:, part.own], axis=0)
        assert residual.max() < 10 * LIMITS.vector_residual * np.ptp(own) / len(own)
        np.testing.assert_allclose(overlap, 1.0, rtol=0, atol=1e-3)
    # the residual squared over the distance of the next eigenvalues, which may be a hundredth of the mean one
    np.testing.assert_allclose(np.concatenate(values), expected, rtol=0, atol=1e-4 * 8 / 1156)


@pytest.mark.slow
def test_a_negative_eigenvalue_is_found_with_those_next_to_zero():
    """As of a symmetric part that is about to lose its stability; the bound of the spectrum is far away."""
    expected = np.concatenate([[-1.3], np.linspace(1, 2000, 600), np.geomspace(3e3, 1e5, 50)])
    values = np.concatenate([part.values[part.own] for part in slices(csc_array(np.diag(expected)), 20, SLICED)])
    np.testing.assert_allclose(values[:300], expected[:300], rtol=0, atol=1e-4 * 2000 / 600)


@pytest.mark.slow
def test_degenerate_eigenvalues_are_all_found():
    """A square lattice on a torus, stiffer along one side: most eigenvalues are fourfold."""
    one = np.eye(24)
    along = 2 * one - np.roll(one, 1, axis=0) - np.roll(one, -1, axis=0)
    matrix, values = csc_array(np.kron(along, one) + np.kron(one, 1.3 * along)), np.linalg.eigvalsh(along)
    found = np.concatenate([part.values[part.own] for part in slices(matrix, 20, SLICED)])
    np.testing.assert_allclose(found, np.sort(np.add.outer(values, 1.3 * values).ravel()), rtol=0, atol=1e-6)


def overlooking(matrix, shift):
    """An inertia that is one too high from some shift on, as if an eigenvalue had been overlooked."""
    solve, below = factor_shifted(matrix, shift)
    return solve, below + (shift > 4.0)


def inaccurate(matrix, shift):
    """Factors of a matrix that is off by 4e-4: half of a mean distance of eigenvalues at their upper end."""
    return factor_shifted(csc_array(matrix * (1 + 4e-4)), shift)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("factorise", "says"), [(overlooking, "one is missing in between"), (inaccurate, "the factors are inaccurate")]
)
def test_wrong_factors_are_noticed(factorise, says):
    with pytest.raises(SliceError, match=says):
        list(slices(network(24, 2), 20, SLICED, factorise=factorise))


@pytest.mark.parametrize("distance", [1e-6, -1e-8])
def test_shift_next_to_an_eigenvalue(distance):
    """Such an eigenvector grows back from rounding at once; blocks that stray with it are made anew."""
    values, own = np.linspace(1.0, 2.0, 301), (138, 162)
    part = SlicedSpectrum(csc_array(np.diag(values)), FEW, factor_shifted).slice_about(values[150] + distance, own, 10)
    # ten vectors that stray together, each by 3e-6 at the most
    assert np.abs(part.vectors.T @ part.vectors - np.eye(len(part.values))).max() < 1e-10
    np.testing.assert_allclose(part.values[part.own], values[slice(*own)], rtol=0, atol=1e-4 / 300)


def on_ranks(size, work):
    """What work gives on each of several ranks, which are threads here."""
    barrier, given = Barrier(size, timeout=60), [None] * size

    def rank(number):
        def gather(mine):
            given[number] = mine
            barrier.wait()
            everyone = list(given)
            barrier.wait()
            return everyone

        return work(Ranks(number, size, gather, workers=1))

    with ThreadPoolExecutor(size) as pool:
        return [pool.submit(rank, number) for number in range(size)]


@pytest.mark.parametrize("size", [2, 3])
def test_ranks_have_together_the_slices_of_one_to_the_bit(size):
    matrix = network(20, 5)
    alone = list(slices(matrix, 10, limits=FEW))
    shared = [each.result() for each in on_ranks(size, lambda ranks: list(slices(matrix, 10, limits=FEW, ranks=ranks)))]
    assert min(len(each) for each in shared) >= len(alone) // size > 1
    for one, other in zip(alone, chain(*shared), strict=True):
        assert (one.first, one.own) == (other.first, other.own)
        assert np.array_equal(one.values, other.values)
        assert np.array_equal(one.vectors, other.vectors)


@pytest.mark.parametrize(("fails", "says"), [(True, "of one rank"), (False, "is missing in between")])
def test_an_error_of_one_rank_is_that_of_all(fails, says):
    """The second of two ranks has an error, or inertias that are too high by one."""

    def of(ranks):
        def factorise(matrix, shift):
            if fails and shift > 6 and ranks.rank == 1:
                raise SliceError("of one rank")
            solve, below = factor_shifted(matrix, shift)
            return solve, below + ranks.rank * (not fails)

        return list(slices(network(20, 5), 10, limits=FEW, factorise=factorise, ranks=ranks))

    for each in on_ranks(2, of):
        with pytest.raises(SliceError, match=says):
            each.result()
