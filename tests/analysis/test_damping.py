"""The damping matrix: the sum of the outer products of each contact and the drag; differences are in tests/plugin."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import damping_matrix


@pytest.fixture
def damped(cluster):
    law = replace(cluster.law, cn=3.0, ct=5.0)
    return replace(cluster, law=law, drag_time=7.0)


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


def test_sum_of_outer_products(damped):
    matrix, expected = damping_matrix(damped).toarray(), outer_products(damped)
    # a handful of rounded products and sums
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=2e-15 * np.abs(expected).max())


def test_parts(damped):
    """Normal dashpots, tangential ones and drag add up; without any of them nothing is left."""
    law = damped.law
    none = replace(damped, law=replace(law, cn=0.0, ct=0.0), drag_time=None)
    parts = [
        replace(none, law=replace(law, ct=0.0)),
        replace(none, law=replace(law, cn=0.0)),
        replace(none, drag_time=damped.drag_time),
    ]
    together = sum(damping_matrix(part).toarray() for part in parts)
    np.testing.assert_allclose(together, damping_matrix(damped).toarray(), rtol=0, atol=1e-15 * np.abs(together).max())
    assert damping_matrix(none).nnz == 0
    frictionless = replace(damped, law=replace(law, mu=0.0), drag_time=None)
    assert not damping_matrix(frictionless).toarray()[2 * len(damped) :].any()
