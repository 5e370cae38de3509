r"""Symmetries of one contact, of its forces and of its block of K, whatever the law, the overlap and the slip.

A rigid rotation about the origin moves disk i by :math:`\hat z \times \mathbf r_i` and rolls it by R_i. The contact
turns and its forces with it; but the law's lever arm is the full radius, so that the slip changes by

.. math:: T \cdot q = r - R_i - R_j = -\delta ,

and what remains of a contact's force is :math:`-K_c\, q = f_n P - f_t N - a\,\delta\, T`.
"""

from dataclasses import replace

import numpy as np
import pytest
from blocks import block
from hypothesis import given
from hypothesis import strategies as st

from faultgouge.analysis import Contacts, MindlinLaw, Packing

EXPONENT = st.floats(-10, -0.5)
SHARE = st.one_of(
    st.integers(-1500, 1500).map(lambda thousandths: thousandths / 1000), st.sampled_from([1 - 1e-12, -1 + 1e-9])
)
LAW = st.builds(
    MindlinLaw,
    kn=st.floats(0, 12).map(lambda e: 10**e),
    kt=st.one_of(st.just(0.0), st.floats(-2, 12).map(lambda e: 10**e)),
    mu=st.one_of(st.just(0.0), st.floats(-6, 1).map(lambda e: 10**e)),
    exponent=st.sampled_from([1.5, 1.0]),
)
FORM = st.sampled_from(["consistent", "paper"])


def reals(least, most):
    """Numbers of so many decimals that no product of them is below the normal doubles, where powers are not exact."""
    return st.floats(least, most).map(lambda x: round(x, 9))


@st.composite
def pairs(draw):
    """Two disks in contact, anywhere."""
    law = draw(LAW)
    radii = np.array([1.0, draw(st.floats(0.02, 1.0))])[draw(st.permutations([0, 1]))]
    angle, overlap = draw(reals(0, 6.28)), 10 ** draw(EXPONENT) * radii.min()
    other = np.array([draw(reals(-5, 5)), draw(reals(-5, 5))])
    position = np.array([other + (radii.sum() - overlap) * np.array([np.cos(angle), np.sin(angle)]), other])
    bare = Packing(position=position, radius=radii, law=law, contacts=Contacts([0], [1], [0.0]))
    slip = draw(SHARE) * law.slip_limit(bare.geometry.overlap)
    return replace(bare, contacts=Contacts([0], [1], slip))


def vectors(packing):
    """N, P and T."""
    (nx, ny), (tx, ty) = packing.geometry.normal[0], packing.geometry.tangent[0]
    return np.array([[nx, ny, 0, -nx, -ny, 0], [tx, ty, 0, -tx, -ty, 0], [tx, ty, -1, -tx, -ty, -1]])


def largest(matrix):
    return np.abs(matrix).max()


@given(pairs(), FORM)
@pytest.mark.slow
def test_translations_are_null_modes_on_both_sides(packing, form):
    here = block(packing, form)
    for q in ([1, 0, 0, 1, 0, 0], [0, 1, 0, 0, 1, 0]):
        # the columns of i and of j are the same numbers with opposite signs
        assert not (here @ q).any()
        assert not (q @ here).any()


@given(pairs(), FORM)
@pytest.mark.slow
def test_rolling_gears_are_a_null_mode(packing, form):
    """Disks that turn against each other with one surface velocity do not slip."""
    here = block(packing, form)
    assert not (here @ [0, 0, 1, 0, 0, -1]).any()


@given(pairs())
def test_rigid_rotation_turns_the_forces(packing):
    here = block(packing)
    (x, y), (radius, other) = packing.position.T, packing.radius
    rotation = np.array([-y[0], x[0], radius, -y[1], x[1], other])
    big_n, big_p, big_t = vectors(packing)
    overlap, slip = packing.geometry.overlap, packing.contacts.slip
    a = packing.law.tangential_slip_derivative(overlap, slip)[0]
    expected = packing.normal_force * big_p - packing.tangential_force * big_n - a * overlap * big_t
    # products of K with coordinates of up to 7; at Coulomb's bound terms of the size of k_t delta^(p - 1) cancel in a
    size = largest(here) + packing.law.kt * overlap[0] ** (packing.law.exponent - 1)
    np.testing.assert_allclose(-here @ rotation, expected, rtol=0, atol=2e-14 * size)


@given(pairs(), FORM)
@pytest.mark.slow
def test_partners_are_interchangeable(packing, form):
    swapped = Packing(
        position=packing.position[::-1],
        radius=packing.radius[::-1],
        law=packing.law,
        contacts=packing.contacts,
    )
    order = [3, 4, 5, 0, 1, 2]
    here = block(packing, form)
    np.testing.assert_array_equal(block(swapped, form)[np.ix_(order, order)], here)
    np.testing.assert_array_equal(swapped.net_force.reshape(3, 2)[:, ::-1], packing.net_force.reshape(3, 2))


@given(pairs(), FORM)
@pytest.mark.slow
def test_mirror_images(packing, form):
    """x -> -x turns slips, angles and forces along x round, to the bit."""
    mirrored = replace(
        packing, position=packing.position * [-1, 1], contacts=Contacts([0], [1], -packing.contacts.slip)
    )
    sign = np.array([-1, 1, -1, -1, 1, -1])
    here = block(packing, form)
    np.testing.assert_array_equal(block(mirrored, form), sign[:, None] * here * sign)


@given(pairs(), FORM, st.integers(-8, 8))
@pytest.mark.slow
def test_scaling_with_stiffness_and_length(packing, form, power):
    """K ~ k, and K ~ length^(p - 1) of all lengths at once: powers of four are exact."""
    law, here = packing.law, block(packing, form)
    factor = 4.0**power
    stiffer = replace(packing, law=replace(law, kn=factor * law.kn, kt=factor * law.kt))
    np.testing.assert_array_equal(block(stiffer, form), factor * here)
    larger = Packing(
        position=factor * packing.position,
        radius=factor * packing.radius,
        law=law,
        contacts=Contacts([0], [1], factor * packing.contacts.slip),
    )
    np.testing.assert_array_equal(block(larger, form), factor ** (law.exponent - 1) * here)


@given(pairs(), FORM)
@pytest.mark.slow
def test_symmetric_where_nothing_is_tangential(packing, form):
    smooth = replace(packing, contacts=Contacts([0], [1], [0.0]))
    here = block(smooth, form)
    # c N N^T is rounded as N_i (c N_j)
    assert largest(here - here.T) <= 4e-16 * largest(here)


@given(pairs())
@pytest.mark.slow
def test_turning_the_frame_turns_the_block(packing):
    """A quarter turn is exact: (x, y) -> (-y, x)."""
    turned = replace(packing, position=packing.position[:, ::-1] * [-1, 1])
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    both = np.kron(np.eye(2), quarter)
    here = block(packing)
    np.testing.assert_array_equal(block(turned), both @ here @ both.T)


@given(LAW, EXPONENT, SHARE, st.integers(-8, 8))
def test_law_scales_with_length(law, exponent, share, power):
    """Forces ~ length^p, to the bit for powers of four; stiffnesses ~ length^(p - 1)."""
    overlap, factor = 10**exponent, 4.0**power
    slip = share * float(law.slip_limit(overlap))
    for name, expected in (
        ("normal_force", factor**law.exponent),
        ("normal_stiffness", factor ** (law.exponent - 1)),
    ):
        assert getattr(law, name)(factor * overlap) == expected * getattr(law, name)(overlap)
    for name, expected in (
        ("tangential_force", factor**law.exponent),
        ("tangential_slip_derivative", factor ** (law.exponent - 1)),
        ("tangential_overlap_derivative", factor ** (law.exponent - 1)),
    ):
        assert getattr(law, name)(factor * overlap, factor * slip) == expected * getattr(law, name)(overlap, slip)


@given(LAW, EXPONENT, SHARE.filter(lambda share: abs(share) <= 1))
def test_forces_are_homogeneous(law, exponent, share):
    """Euler: f_t is of degree p in (overlap, slip), so that delta b + s a = p f_t."""
    overlap = 10**exponent
    slip = share * float(law.slip_limit(overlap))
    a, b = law.tangential_slip_derivative(overlap, slip), law.tangential_overlap_derivative(overlap, slip)
    force = float(law.tangential_force(overlap, slip))
    bound = law.mu * float(law.normal_force(overlap))
    assert float(overlap * b + slip * a) == pytest.approx(law.exponent * force, rel=1e-13, abs=1e-14 * bound)
