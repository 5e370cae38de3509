"""The stability operator: the derivative of the forces, and the symmetries that it has and has not."""

from dataclasses import replace

import numpy as np
import pytest
import quasistatic

from faultgouge.analysis import stiffness_matrix


def differences(packing, step, columns):
    """-dF/dq by central differences of the contact-by-contact forces, slips advanced by the midpoint rule."""
    result = []
    for column in columns:
        q = np.zeros(3 * len(packing))
        q[column] = step
        ahead = quasistatic.forces(quasistatic.moved(packing, q, packing.fx))
        behind = quasistatic.forces(quasistatic.moved(packing, -q, packing.fx))
        result.append((behind - ahead) / (2 * step))
    return np.array(result).T


def test_derivative_of_forces(cluster):
    """Sticking, near the bound, sliding, floor, across the box: all at once.

    Step 1e-6 with overlaps of 1e-2: truncation (step/overlap)^2/6 = 2e-9, rounding 1e-16/1e-6 of a length.
    """
    matrix = stiffness_matrix(cluster).toarray()
    expected = differences(cluster, 1e-6, range(18))
    assert np.abs(matrix - expected).max() < 1e-8 * np.abs(matrix).max()
    assert np.abs(stiffness_matrix(cluster, "paper").toarray() - expected).max() > 1e-4 * np.abs(matrix).max()


def test_paper_form_lacks_the_turning_of_the_tangent(cluster):
    n = len(cluster)
    missing = np.zeros((3 * n, 3 * n))
    geometry = zip(*cluster.geometry, cluster.contacts.i, cluster.contacts.j, cluster.tangential_force, strict=True)
    for normal, tangent, distance, _, i, j, ft in geometry:
        if j < 0:
            continue
        big_n, big_p = np.zeros(3 * n), np.zeros(3 * n)
        big_n[[i, i + n, j, j + n]] = *normal, *-normal
        big_p[[i, i + n, j, j + n]] = *tangent, *-tangent
        missing += ft / distance * np.outer(big_n, big_p)
    difference = stiffness_matrix(cluster).toarray() - stiffness_matrix(cluster, "paper").toarray()
    scale = np.abs(stiffness_matrix(cluster).toarray()).max()
    assert np.abs(missing).max() > 1e-4 * scale
    # Differences of entries of that scale, rounded.
    np.testing.assert_allclose(difference, missing, rtol=0, atol=4e-16 * scale)


@pytest.mark.parametrize(("kt", "mu"), [(0.0, 1.0), (6e4, 0.0)])
def test_no_friction_no_rotation(cluster, kt, mu):
    smooth = replace(cluster, law=replace(cluster.law, kt=kt, mu=mu))
    matrix = stiffness_matrix(smooth).toarray()
    assert not matrix[12:].any()
    assert not matrix[:, 12:].any()
    assert np.abs(matrix - matrix.T).max() < 4e-16 * np.abs(matrix).max()
    assert not smooth.net_force[12:].any()


def test_unknown_form(cluster):
    with pytest.raises(ValueError, match="consistent"):
        stiffness_matrix(cluster, "exact")
