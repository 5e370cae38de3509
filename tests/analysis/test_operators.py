"""Stability operator and damping matrix, assembled: sums of outer products of what each contact does.

Differences of forces are in test_stiffness_digits.py for one contact, and in tests/plugin for LAMMPS's.
"""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import damping_matrix, stiffness_matrix


def each_contact(packing):
    """Number, distance (infinite for the floor, whose normal does not turn), and three rows over all coordinates: the
    relative motion along the normal, along the tangent, and the slip."""
    n, contacts, geometry = len(packing), packing.contacts, packing.geometry
    for k, (i, j) in enumerate(zip(contacts.i, contacts.j, strict=True)):
        along, across, turning = np.zeros((3, 3 * n))
        along[[i, i + n]], across[[i, i + n]], turning[i + 2 * n] = geometry.normal[k], geometry.tangent[k], -1
        if j >= 0:
            along[[j, j + n]], across[[j, j + n]], turning[j + 2 * n] = -geometry.normal[k], -geometry.tangent[k], -1
        yield k, geometry.distance[k] if j >= 0 else np.inf, along, across, across + turning


@pytest.mark.parametrize("form", ["consistent", "paper"])
def test_stiffness_matrix(cluster, form):
    """Sticking, near the bound, sliding, floor, across the box; the paper's form lacks the turning of the tangent."""
    law = cluster.law.derivatives(cluster.geometry.overlap, cluster.contacts.slip)
    expected = np.zeros((18, 18))
    for k, distance, along, across, slip in each_contact(cluster):
        expected += law.normal_stiffness[k] * np.outer(along, along)
        expected += np.outer(slip, law.overlap_derivative[k] * along - law.slip_derivative[k] * slip)
        expected -= law.normal_force[k] / distance * np.outer(across, across)
        if form == "consistent":
            expected += law.tangential_force[k] / distance * np.outer(along, across)
    matrix = stiffness_matrix(cluster, form).toarray()
    # a handful of rounded products and sums
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=4e-16 * np.abs(expected).max())
    with pytest.raises(ValueError, match="consistent"):
        stiffness_matrix(cluster, "exact")


@pytest.mark.parametrize(
    ("law", "drag_time"),
    [
        ({"cn": 3.0}, None),
        ({"cn": 3.0, "ct": 5.0}, 7.0),
        ({"cn": 3.0, "ct": 5.0, "mu": 0.0}, None),
        ({}, 7.0),
        ({}, None),
    ],
)
def test_damping_matrix(cluster, law, drag_time):
    packing = replace(cluster, law=replace(cluster.law, **law), drag_time=drag_time)
    law, limit = packing.law, packing.law.slip_limit(packing.geometry.overlap)
    mass = np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass])
    expected = np.diag(mass / drag_time) if drag_time else np.zeros((18, 18))
    for k, _, along, _, slip in each_contact(packing):
        grown = packing.geometry.overlap[k] ** (law.exponent - 1)
        expected += law.cn * grown * np.outer(along, along)
        if abs(packing.contacts.slip[k]) < limit[k]:
            expected += law.ct * grown * np.outer(slip, slip)
    matrix = damping_matrix(packing)
    np.testing.assert_allclose(matrix.toarray(), expected, rtol=0, atol=2e-15 * np.abs(expected).max())
    assert matrix.nnz > 0 or not (law.damped or drag_time)
