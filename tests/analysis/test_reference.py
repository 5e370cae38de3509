"""The numbers of an independent code, for a packing of 100 disks: conventions and digits."""

import numpy as np
import pytest

from faultgouge.analysis import find_onset, spectrum, stiffness_matrix

ONSET = 0.0218330564080


@pytest.mark.slow
def test_loaded_packing(reference, ramp):
    """Newton stops at 3e-11 of force; over stiffnesses of 1e3 and slips of 1e-6 these digits are left."""
    expected = reference["cases"][0]
    loaded = ramp(expected["mu"], expected["increment"], 88)(expected["fx"])
    assert len(loaded.contacts) == expected["contacts"]
    assert loaded.contacts.floor.sum() == expected["floor_contacts"]
    assert len(loaded.rattlers) == expected["rattlers"]
    assert loaded.residual < 1e-10
    matrix = stiffness_matrix(loaded).toarray()
    assert np.trace(matrix) == pytest.approx(expected["trace_K"], rel=1e-12)
    assert np.linalg.norm(matrix) == pytest.approx(expected["fro_K"], rel=1e-12)
    assert np.linalg.norm(matrix - matrix.T) == pytest.approx(expected["fro_asym"], rel=1e-9)
    assert np.abs(loaded.contacts.slip).sum() == pytest.approx(expected["slip_sum_abs"], rel=1e-9)
    result = spectrum(loaded)
    assert not result.pairs
    assert len(result.eigenvalues) == 3 * (100 - expected["rattlers"])
    values = result.eigenvalues.real
    np.testing.assert_allclose(values[::-1][:20], expected["eigenvalues_largest_20"], rtol=1e-11)
    np.testing.assert_allclose(values[values > 0][:10], expected["smallest_positive_10"], rtol=1e-11)


@pytest.mark.long
@pytest.mark.parametrize(("increment", "count", "first"), [(1e-3, 22, 0), (2.5e-4, 88, 76)])
@pytest.mark.slow
def test_onset(ramp, increment, count, first):
    """The increment does not matter: nine digits from either, and the stated error covers what is left."""
    path = ramp(1.0, increment, count)
    onset = find_onset(path, path.grid[first : count + 1])
    assert onset.fx_c == pytest.approx(ONSET, rel=1e-9)
    assert abs(onset.fx_c - ONSET) < onset.error < 1e-9 * onset.fx_c
    (window,) = onset.windows
    assert window.kind == "coalescence"
    assert window.fx_end is None
    # |y^H x| goes as the root of the distance: 1e-6 of a window of 1e-3 away it is 1e-3 at most.
