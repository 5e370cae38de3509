"""The fastest growing motions by products alone, against LAPACK and spectra that are known."""

import numpy as np
import pytest
from known_spectra import complex_block, turned
from scipy.sparse import csr_array, diags_array

from faultgouge.analysis.errors import BadInputError
from faultgouge.analysis.motion.fastest_growing import fastest_growing


def operator(seed, growing):
    """150 real eigenvalues and some that grow, sparse."""
    rng = np.random.default_rng(seed)
    blocks = [np.array([[value]]) for value in rng.uniform(0.5, 100, 150)]
    return turned([*blocks, *growing], rng)


def test_pairs_and_negative_eigenvalues():
    growing = [complex_block(30.0, 1.0), complex_block(70.0, 1.5), complex_block(2.0, 0.05), np.array([[-0.02]])]
    found = fastest_growing(operator(1, growing), count=4)
    expected = np.array([30 + 1j, 70 + 1.5j, 2 + 0.05j, -0.02])
    rates = 2 * np.abs(np.sqrt(expected).imag)
    order = np.argsort(-rates)
    np.testing.assert_allclose(found.rates, rates[order], rtol=1e-8)
    np.testing.assert_allclose(found.values, expected[order], rtol=1e-8)
    # the residual is what counts as converged
    assert found.residuals.max() < 1e-5
    matrix = operator(1, growing)
    image = matrix @ found.vectors
    np.testing.assert_allclose(np.linalg.norm(image - found.vectors * found.values, axis=0), 0, atol=1e-5 * 70)


@pytest.mark.parametrize("seed", [2, 3])
def test_with_dissipation(seed):
    """Dashpots stop one of the motions, and slow others down; LAPACK's eigenvalues of the first-order system."""
    growing = [complex_block(30.0, 3.0), complex_block(70.0, 2.5), complex_block(2.0, 0.05)]
    matrix = operator(seed, growing)
    loss = 4e-4 * (matrix + matrix.T) + diags_array(np.random.default_rng(seed).uniform(0, 0.06, matrix.shape[0]))
    size = matrix.shape[0]
    z = np.block([[np.zeros((size, size)), np.eye(size)], [-matrix.toarray(), -loss.toarray()]])
    values = np.linalg.eigvals(z)
    values = values[(values.real > 0) & (values.imag >= 0)]
    values = values[np.argsort(-values.real)]
    assert len(values) == 2
    found = fastest_growing(matrix, csr_array(loss), count=2)
    np.testing.assert_allclose(found.values, values, rtol=1e-8)
    np.testing.assert_allclose(found.rates, 2 * values.real, rtol=1e-6)
    assert found.vectors.shape == (size, 2)


@pytest.mark.parametrize("strong", [0.5, 40.0])
def test_strong_dissipation(strong):
    """A loss of many times the largest frequency: the sum does not lose its digits, and a negative eigenvalue grows."""
    matrix = operator(4, [np.array([[-25.0]])])
    found = fastest_growing(matrix, csr_array(strong * diags_array(np.ones(matrix.shape[0]))), count=1, periods=(3, 10))
    # s^2 + c s - 25 = 0
    assert found.rates == pytest.approx(-strong + np.sqrt(strong**2 + 100), rel=1e-6)


@pytest.mark.parametrize("damped", [False, True])
def test_nothing_grows(damped):
    """Then a rate of about 3 over the longest time is the limit."""
    matrix = operator(5, [])
    damping = csr_array(0.01 * diags_array(np.ones(matrix.shape[0]))) if damped else None
    found = fastest_growing(matrix, damping, periods=(10.0, 30.0))
    assert len(found.rates) == 0
    assert found.time == pytest.approx(30 * 2 * np.pi / 10, rel=0.05)
    assert 1 / found.time < found.limit < 4 / found.time


def test_many_that_grow_alike_are_seen_to_grow():
    """Their space does not converge; still the growth of one is certain, to the residual that is told."""
    growing = [complex_block(30.0 + 0.003 * k, 5.0) for k in range(80)]
    found = fastest_growing(operator(7, growing), count=1, periods=(10.0, 10.0))
    assert len(found.rates) == 1
    rate = 2 * abs(np.sqrt(30.0 + 5j).imag)
    assert found.rates[0] == pytest.approx(rate, rel=0.01)
    assert found.residuals[0] < 0.1 * rate / abs(np.sqrt(found.values[0]))
    assert not found.converged
    # followed for four times; the fastest of the eighty, which are not orthogonal, grows at 1.001 times this rate
    assert 0.95 * rate < found.least < 1.001 * rate


def test_what_is_slower_than_the_limit_is_not_claimed():
    matrix = operator(6, [complex_block(40.0, 1.5), complex_block(50.0, 1e-4)])
    found = fastest_growing(matrix, count=2, periods=(10.0, 30.0))
    assert len(found.rates) == 1
    assert found.limit > 2 * abs(np.sqrt(50 + 1e-4j).imag)


@pytest.mark.parametrize(
    ("named", "says"),
    [({"count": 0}, "0 motions"), ({"periods": (100.0, 10.0)}, "100 to 10 periods")],
)
def test_refusals(named, says):
    with pytest.raises(BadInputError, match=says):
        fastest_growing(operator(1, []), **named)
    with pytest.raises(BadInputError, match="4 coordinates"):
        fastest_growing(csr_array(np.eye(4)))
