"""Geometry, balance and validation of packings."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
import quasistatic
from hypothesis import given, settings
from hypothesis import strategies as st
from table_rows import rows_of

from faultgouge.analysis import Contacts, MindlinLaw, Packing, solid_fraction, touching

LAW = MindlinLaw(2e5, 6e4, 1.0)


def test_contacts_have_one_order_also_with_other_slips():
    contacts = Contacts([3, 0, 2, 1, 4], [1, -1, 0, -1, 0], [0.1, 0.2, 0.3, 0.4, 0.5])
    other = contacts.slipped(np.arange(5), 1e-17 * np.arange(5))
    assert [*map(list, (contacts.i, contacts.j))] == [[0, 0, 1, 0, 1], [2, 4, 3, -1, -1]]
    assert list(contacts.slip) == [0.3, 0.5, 0.1, 0.2, 0.4]
    assert other == Contacts(other.i, other.j, np.arange(5), 1e-17 * np.arange(5))
    for slips in ([1.0], [1.0, 2.0, 3.0, 4.0, np.inf]):
        with pytest.raises(ValueError, match="slip"):
            contacts.slipped(slips)


def test_moved_packing_is_one_made_anew(cluster):
    position, angle = cluster.position + 1e-3, cluster.angle - 0.1
    contacts = cluster.contacts.slipped(np.zeros(12))
    _ = cluster.geometry, cluster.rattlers  # of the old place
    moved = cluster.moved(position, angle, contacts, 1e-18 * position, 0.3)
    anew = replace(cluster, position=position, angle=angle, contacts=contacts, position_low=1e-18 * position, fx=0.3)
    assert moved == anew
    np.testing.assert_array_equal(moved.geometry.overlap, anew.geometry.overlap)
    np.testing.assert_array_equal(moved.net_force, anew.net_force)
    assert cluster.moved(position, angle, contacts).fx == cluster.fx
    for wrong in ({"position": position[1:]}, {"angle": np.full(6, np.nan)}, {"contacts": Contacts([6], [-1], [0])}):
        with pytest.raises(ValueError, match=r"position|angle|beyond"):
            cluster.moved(**({"position": position, "angle": angle, "contacts": contacts} | wrong))


def test_a_packing_is_frozen(cluster):
    for name in ("position", "fx", "contacts"):
        with pytest.raises(FrozenInstanceError):
            setattr(cluster, name, getattr(cluster, name))
    given = np.array(cluster.position)
    moved = cluster.moved(given, cluster.angle, cluster.contacts)
    given[0] += 7
    assert moved == cluster
    for array in (cluster.angle, cluster.geometry.overlap, moved.position, cluster.contacts.slipped(np.zeros(12)).slip):
        assert not array.flags.writeable


@pytest.mark.parametrize(("i", "j", "slip", "says"), rows_of("analysis/refused_contacts.txt"))
def test_impossible_contacts(i, j, slip, says):
    with pytest.raises(ValueError, match=says):
        Contacts(i, j, slip)


@pytest.mark.parametrize(("change", "says"), rows_of("analysis/refused_packings.txt", Contacts=Contacts))
def test_impossible_packings(cluster, change, says):
    with pytest.raises(ValueError, match=says):
        _ = replace(cluster, **change).geometry


def test_net_force_is_that_of_the_loop(cluster):
    # The loop rounds distances, 2e-16 of a length, which the stiffness turns into force; a disk has up to six contacts.
    rounding = 6 * 2.3e-16 * cluster.law.normal_stiffness(cluster.geometry.overlap).max()
    np.testing.assert_allclose(cluster.net_force, quasistatic.forces(cluster), rtol=0, atol=rounding)


def test_residual_leaves_out_rattlers_of_the_upper_layer():
    position, contacts = [[0, 0.5], [5, 3]], Contacts([0], [-1], [0])
    packing = Packing(position=position, radius=[0.5] * 2, top=[True] * 2, fy=3.0, contacts=contacts, law=LAW)
    # An open contact is none: a disk that only touches at a point is a rattler too.
    assert (list(packing.rattlers), packing.residual) == ([0, 1], 0)
    pressed = replace(packing, position=[[0, 0.4], [5, 3]])
    assert list(pressed.rattlers) == [1]
    assert pressed.residual == pytest.approx(2e5 * 0.1**1.5 - 3, rel=1e-14)


def test_solid_fraction_is_the_share_of_points_below_the_layer_that_lie_in_disks():
    """Disks that do not touch, so that no point lies in two; one is cut by the height, one lies above it."""
    position, top = [[0.5, 0.5], [1.9, 0.7], [0.7, 1.6], [2.3, 1.8], [1.4, 3.0]], [False, False, True, True, False]
    radius, none = [0.5, 0.7, 0.5, 0.3, 0.4], Contacts([], [], [])
    packing = Packing(position=position, radius=radius, top=top, contacts=none, law=LAW, box_length=3.0)
    x, y = np.meshgrid(np.arange(0.001, 3.0, 2e-3), np.arange(0.001, 1.7, 2e-3))
    inside = sum((x - c) ** 2 + (y - d) ** 2 < r**2 for (c, d), r in zip(packing.position, packing.radius, strict=True))
    # a grid of 2e-3 misses a perimeter of 14 by a hundredth of its width
    assert solid_fraction(packing) == pytest.approx(inside.mean(), abs=1e-4)
    # without a period the width is that of the disks, 2.6 here
    assert solid_fraction(replace(packing, box_length=None)) == pytest.approx(inside.mean() * 3.0 / 2.6, abs=1e-4)


@given(seed=st.integers(0, 2**32 - 1), periodic=st.booleans())
@settings(max_examples=50)
def test_touching_finds_what_all_pairs_have(seed, periodic):
    rng = np.random.default_rng(seed)
    length, n = 6.0, 25
    position = rng.uniform([-2 * length, 0.2], [2 * length, 4], (n, 2))
    position[0, 0] = -1e-17  # wraps to the box length itself
    radius = rng.uniform(0.2, 0.7, n)
    box_length = length if periodic else None
    expected = [(i, -1) for i in range(n) if position[i, 1] < radius[i]]
    i, j = np.triu_indices(n, 1)
    touch = np.linalg.norm(quasistatic.branches(position, box_length, i, j), axis=1) < radius[i] + radius[j]
    expected += zip(i[touch], j[touch], strict=True)
    found = touching(position, radius, box_length)
    assert found == Contacts(*zip(*expected, strict=True), np.zeros(len(expected)))
