"""The stability operator: the derivative of the forces, and the symmetries that it has and has not."""

from dataclasses import replace

import numpy as np
import pytest
import quasistatic
from blocks import contact_blocks

from faultgouge.analysis import Contacts, MindlinLaw, Packing, stiffness_matrix


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


@pytest.mark.parametrize("form", ["consistent", "paper"])
@pytest.mark.parametrize("mu", [0.7, 0.0])
def test_sum_of_the_products_of_each_contact(cluster, form, mu):
    """K is assembled from nine numbers a contact; here from the 6 x 6 products of the formula."""
    n, packing = len(cluster), replace(cluster, law=replace(cluster.law, mu=mu))
    expected = np.zeros((3 * n, 3 * n))
    for i, j, block in zip(packing.contacts.i, packing.contacts.j, contact_blocks(packing, form), strict=True):
        ends = 2 if j >= 0 else 1
        where = np.concatenate([disk + n * np.arange(3) for disk in (i, j)[:ends]])
        expected[np.ix_(where, where)] += block[: 3 * ends, : 3 * ends]
    matrix = stiffness_matrix(packing, form).toarray()
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=1e-15 * np.abs(expected).max())


def test_cluster_has_every_state(cluster):
    x = cluster.contacts.slip / cluster.law.slip_limit(cluster.geometry.overlap)
    assert len(cluster.contacts) == 12
    assert cluster.contacts.floor.sum() == 4
    assert (x > 1).any()
    assert (x < -1).any()
    assert (np.abs(x) < 0.5).any()
    assert ((np.abs(x) > 0.95) & (np.abs(x) < 1)).any()
    pairs = ~cluster.contacts.floor
    bare = cluster.position[cluster.contacts.i[pairs], 0] - cluster.position[cluster.contacts.j[pairs], 0]
    assert (np.abs(bare) > 2).any()


@pytest.mark.slow
def test_derivative_of_forces_in_a_loaded_packing(ramp):
    """Overlaps of 6e-4 and a step of 1e-8.

    Rounding of a coordinate, 1e-15, over the step is 1e-7 of a contact's stiffness at worst; truncation is
    1e-10. No contact is at its bound at this load, where the second derivative jumps.
    """
    packing = ramp(1.0, 1e-3, 22)(0.02)
    limit = packing.law.slip_limit(packing.geometry.overlap)
    assert (np.abs(packing.contacts.slip) < limit).all()
    columns = np.random.default_rng(0).choice(300, 40, replace=False)
    matrix = stiffness_matrix(packing).toarray()
    expected = differences(packing, 1e-8, columns)
    assert np.abs(matrix[:, columns] - expected).max() < 1e-7 * np.abs(matrix).max()


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


def test_order_of_disks_does_not_matter(cluster):
    order = np.array([3, 5, 0, 4, 1, 2])
    place = np.argsort(order)
    c = cluster.contacts
    shuffled = Packing(
        position=cluster.position[order],
        radius=cluster.radius[order],
        contacts=Contacts(place[c.i], np.where(c.floor, -1, place[c.j]), c.slip),
        law=cluster.law,
        box_length=cluster.box_length,
    )
    rows = np.concatenate([order, order + 6, order + 12])
    expected = stiffness_matrix(cluster).toarray()
    # The same products; where i and j have changed places, sums in another order.
    actual = stiffness_matrix(shuffled).toarray()
    np.testing.assert_allclose(actual, expected[np.ix_(rows, rows)], rtol=0, atol=1e-15 * np.abs(expected).max())


def test_mirror(cluster):
    """x -> -x, theta -> -theta: tau is an axial vector's companion, so slips change sign."""
    c = cluster.contacts
    mirrored = replace(
        cluster,
        position=cluster.position * [-1, 1],
        angle=-cluster.angle,
        contacts=Contacts(c.i, c.j, -c.slip),
        fx=-cluster.fx,
    )
    sign = np.repeat([-1, 1, -1], len(cluster))
    np.testing.assert_array_equal(mirrored.net_force, sign * cluster.net_force)
    np.testing.assert_array_equal(
        stiffness_matrix(mirrored).toarray(), sign[:, None] * stiffness_matrix(cluster).toarray() * sign
    )


@pytest.mark.parametrize(("kt", "mu"), [(0.0, 1.0), (6e4, 0.0)])
def test_no_friction_no_rotation(cluster, kt, mu):
    smooth = replace(cluster, law=replace(cluster.law, kt=kt, mu=mu))
    matrix = stiffness_matrix(smooth).toarray()
    assert not matrix[12:].any()
    assert not matrix[:, 12:].any()
    assert np.abs(matrix - matrix.T).max() < 4e-16 * np.abs(matrix).max()
    assert not smooth.net_force[12:].any()


def test_nothing_touches():
    alone = Packing(position=[[0, 5]], radius=[1], contacts=Contacts([], [], []), law=MindlinLaw(1, 1, 1))
    matrix = stiffness_matrix(alone)
    assert matrix.shape == (3, 3)
    assert matrix.nnz == 0


def test_unknown_form(cluster):
    with pytest.raises(ValueError, match="consistent"):
        stiffness_matrix(cluster, "exact")
