"""The damping matrix is the sum of the outer products of each contact and the drag."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import damping_matrix


def outer_products(packing):
    """C from its definition, contact by contact."""
    n, law = len(packing), packing.law
    mass = np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass])
    expected = np.diag(mass / packing.drag_time) if packing.drag_time else np.zeros((3 * n, 3 * n))
    contacts = zip(*packing.geometry, packing.contacts.i, packing.contacts.j, packing.contacts.slip, strict=True)
    for normal, tangent, _, overlap, i, j, slip in contacts:
        along, across = np.zeros(3 * n), np.zeros(3 * n)
        along[[i, i + n]], across[[i, i + n, i + 2 * n]] = normal, (*tangent, -1)
        if j >= 0:
            along[[j, j + n]], across[[j, j + n, j + 2 * n]] = -normal, (*-tangent, -1)
        grown = overlap ** (law.exponent - 1)
        expected += law.cn * grown * np.outer(along, along)
        if abs(slip) < law.mu * law.kn / law.kt * overlap:
            expected += law.ct * grown * np.outer(across, across)
    return expected


@pytest.mark.parametrize(
    ("law", "drag_time"),
    [
        ({"cn": 3.0, "ct": 5.0}, 7.0),
        ({"cn": 3.0}, None),
        ({"ct": 5.0}, None),
        ({"cn": 3.0, "ct": 5.0, "mu": 0.0}, None),
        ({}, 7.0),
        ({}, None),
    ],
    ids=["all", "normal", "tangential", "without friction", "drag", "nothing"],
)
def test_sum_of_outer_products(cluster, law, drag_time):
    damped = replace(cluster, law=replace(cluster.law, **law), drag_time=drag_time)
    matrix, expected = damping_matrix(damped), outer_products(damped)
    # a handful of rounded products and sums
    np.testing.assert_allclose(matrix.toarray(), expected, rtol=0, atol=2e-15 * np.abs(expected).max())
    assert matrix.nnz > 0 or not (law or drag_time)
